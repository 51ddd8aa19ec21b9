"""Records of a baked body, checked when built: modes at points of its surface, mass, contact constants.

    velocity of a mode q̇ = Re z,   strike j at p:  z += (1 + i d/ω) φ(p)·j,   ż = (-d + iω) z
    pressure at 1 m = Re Σ pressure·z
        [as the bank has it]

The draft glTF extension KHR_audio_rigid_bodies holds frequency, decay and shape; the pressure is the transfer that it
leaves to the engine.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from sonic_bullet.records import Array, Residual, frozen_array
from sonic_bullet.records.arrays import require, store
from sonic_bullet.records.coerce import as_number, as_text, quote
from sonic_bullet.records.roughness import OCTAVES

Row = tuple[float, float, float, float, float, float]


class BakedMaterial(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """The solid, and its contact properties. What is not known is absent."""

    name: Annotated[str, Meta(description="the preset's")] = ""
    density_kg_m3: Annotated[float | None, Meta(description="kg/m³")] = None
    youngs_pa: Annotated[float | None, Meta(description="Young's modulus, Pa")] = None
    poisson: Annotated[float | None, Meta(description="Poisson's ratio")] = None
    alpha_per_s: Annotated[float | None, Meta(description="Rayleigh's α, 1/s, of the material alone")] = None
    beta_s: Annotated[float | None, Meta(description="Rayleigh's β, s, of the material alone")] = None
    contact_modulus_pa: Annotated[  # of its softest axis [Johnson 1985, eq. 4.24]
        float | None,
        Meta(description="E/(1−ν²) where it is touched, Pa; two bodies meet with 1/E* = Σ 1/contact_modulus"),
    ] = None
    restitution: Annotated[float | None, Meta(description="of an impact against a rigid wall")] = None
    roughness_m: Annotated[float | None, Meta(description="rms height of the surface, m")] = None
    hurst: Annotated[float | None, Meta(description="Hurst exponent of its profile")] = None
    octave_rms_m: Annotated[
        tuple[float, ...] | None,
        Meta(description="rms heights by wavelength, 100 mm and its halves, in place of both, m"),
    ] = None
    waviness_m: Annotated[
        float | None, Meta(description="rms height of the waves of manufacture above the finish, m")
    ] = None
    waviness_length_m: Annotated[float | None, Meta(description="their wavelength, m")] = None
    stiffness_pa: Annotated[
        tuple[Row, Row, Row, Row, Row, Row] | None,
        Meta(description="Voigt stiffness xx yy zz yz xz xy, Pa, of a material with a grain"),
    ] = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        where = f"material {quote(as_text(self.name, 'the name of a material', 'give a text'))}"
        bounds: dict[str, dict[str, Any]] = {
            "density_kg_m3": {"above": 0},
            "youngs_pa": {"above": 0},
            "poisson": {"above": -1, "below": 0.5},
            "alpha_per_s": {"least": 0},
            "beta_s": {"least": 0},
            "contact_modulus_pa": {"above": 0},
            "restitution": {"least": 0, "most": 1},
            "roughness_m": {"least": 0},
            "hurst": {"above": 0, "below": 1},
            "waviness_m": {"least": 0},
            "waviness_length_m": {"above": 0},
        }
        for name, bound in bounds.items():
            value = getattr(self, name)
            if value is not None:
                number = as_number(value, f"{where}: {name}", f"give a number {_words(bound)}", **bound)
                msgspec.structs.force_setattr(self, name, number)
        for name, size in (("octave_rms_m", (OCTAVES,)), ("stiffness_pa", (6, 6))):
            if getattr(self, name) is not None:
                frozen_array(getattr(self, name), float, size, f"{where}: {name}")


def _words(bound: dict[str, Any]) -> str:
    """Describe a range for a remedy."""
    names = {"above": "above", "below": "below", "least": "of at least", "most": "of at most"}
    return " and ".join(f"{names[key]} {value:g}" for key, value in bound.items())


@dataclass(frozen=True, slots=True, eq=False)
class MassProperties:
    """Mass in kg, centre of mass (3,) in m and inertia (3, 3) in kg·m² about it, in the mesh's frame."""

    mass_kg: float
    centre_m: Array
    inertia_kg_m2: Array

    def __post_init__(self) -> None:
        """Check the numbers."""
        store(
            self,
            mass_kg=as_number(self.mass_kg, "mass_kg", "give a mass above zero", above=0),
            centre_m=frozen_array(self.centre_m, float, (3,), "centre_m"),
            inertia_kg_m2=frozen_array(self.inertia_kg_m2, float, (3, 3), "inertia_kg_m2"),
        )


@dataclass(frozen=True, slots=True, eq=False)
class BakedModel:
    """One body's modal sound, for engines of any kind.

    Attributes
    ----------
    freq_hz, decay_per_s : (m,)
        Of the damped modes, the most important first; decays include all losses, radiation too.
    shape : (p, 3, m) float32
        Displacement at the points, mass-normalised, in 1/√kg.
    point_m : (p, 3)
        On the surface.
    face : (f, 3)
        Triangles of points between which shapes are interpolated; f = 0: the nearest point's shape counts.
    pressure_pa_m : (m,) complex
        Pressure at 1 m, in Pa·m, per modal velocity of 1 m/s·√kg, mean over directions. None where a file does not
        state it.
    bend_s2_m2, damping_growth_s_m, damping_growth_power : (m,), (m,)
        As of `ModalModel`, None for a linear body.
    residual
        The preset's residual.
    notes
        Notes for the user.
    assumed_wall_m
        As of `ModalModel`; files do not hold it.
    """

    name: str
    freq_hz: Array
    decay_per_s: Array
    shape: Array
    point_m: Array
    face: Array
    pressure_pa_m: Array | None = None
    material: BakedMaterial = field(default_factory=BakedMaterial)
    mass: MassProperties | None = None
    bend_s2_m2: Array | None = None
    damping_growth_s_m: Array | None = None
    damping_growth_power: float = 1.0
    residual: Residual | None = None
    notes: tuple[str, ...] = ()
    assumed_wall_m: float = 0.0

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        where = f"baked model {quote(as_text(self.name, 'the name of a baked model', 'give a text'))}"
        again = "bake it again"
        freq = frozen_array(self.freq_hz, float, (None,), f"{where}: freq_hz")
        m = len(freq)
        point = frozen_array(self.point_m, float, (None, 3), f"{where}: point_m")
        face = frozen_array(self.face, np.int32, (None, 3), f"{where}: face")
        store(
            self,
            freq_hz=freq,
            decay_per_s=frozen_array(self.decay_per_s, float, (m,), f"{where}: decay_per_s"),
            shape=frozen_array(self.shape, np.float32, (len(point), 3, m), f"{where}: shape"),
            point_m=point,
            face=face,
        )
        require(m > 0, f"{where} has no mode", "bake what rings below 20 kHz")
        require(len(point) > 0, f"{where} has no point", again)
        require(bool((freq > 0).all()), f"{where}: a frequency is not above zero", again)
        require(bool((self.decay_per_s >= 0).all()), f"{where}: a decay is below zero", again)
        require(
            bool(((face >= 0) & (face < len(point))).all()),
            f"{where}: a triangle names a point that is not there",
            again,
        )
        if self.pressure_pa_m is not None:
            pressure = np.array(self.pressure_pa_m, complex)
            require(pressure.shape == (m,) and bool(np.isfinite(pressure).all()), f"{where}: pressure_pa_m", again)
            pressure.setflags(write=False)
            store(self, pressure_pa_m=pressure)
        for name in ("bend_s2_m2", "damping_growth_s_m"):
            if getattr(self, name) is not None:
                store(self, **{name: frozen_array(getattr(self, name), float, (m,), f"{where}: {name}")})

    @property
    def mode_count(self) -> int:
        """Number of modes."""
        return len(self.freq_hz)
