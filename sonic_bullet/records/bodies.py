"""The values that travel between rooms: what a thing is, proven when it is built.

    shapes (listener) + Material (presets) -> ModalModel (modal) -> Body -> Step, ContactLog (contacts.py) -> sound

Every record is frozen, its arrays are read-only copies, units stand in the names and shapes in the comments:
b bodies, m modes, v vertices, f faces. A record that exists is sound: inner code never asks again. Body frame always
means the frame PyBullet calls inertial: origin at the centre of mass, axes as `getBasePositionAndOrientation` gives them.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array
from sonic_bullet.records.arrays import require as _require
from sonic_bullet.records.arrays import store as _store
from sonic_bullet.records.residual import Residual

__all__ = [
    "Air",
    "Array",
    "Body",
    "Material",
    "Microphone",
    "ModalModel",
    "ModalSum",
    "Residual",
    "Sensor",
    "Shape",
    "ShapeKind",
    "Vibrometer",
    "frozen_array",
    "isotropic_stiffness_pa",
]


def isotropic_stiffness_pa(youngs_pa: float, poisson: float) -> Array:
    """Voigt stiffness (6, 6) in Pa, order xx yy zz yz xz xy with engineering shear strains.

    Source: Lamé constants, e.g. Slaughter, The Linearized Theory of Elasticity (2002), ch. 5.
    """
    lame = youngs_pa * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = youngs_pa / (2 * (1 + poisson))
    stiffness = np.zeros((6, 6))
    stiffness[:3, :3] = lame
    stiffness[range(3), range(3)] += 2 * shear
    stiffness[range(3, 6), range(3, 6)] = shear
    return stiffness


ORTHOTROPIC = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1), (3, 3), (4, 4), (5, 5))
"""Places in the Voigt tensor of C11 C22 C33 C23 C13 C12 C44 C55 C66, the constants that symmetry planes along the axes leave."""


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """What a body is made of.

    stiffness_pa (6, 6): Voigt tensor, positive definite. alpha_per_s, beta_s: Rayleigh damping d = (alpha + beta·lambda)/2
    [Ren, Yeh, Lin 2013, eq. 6], None where unknown. roughness_m: rms height of the surface profile; hurst: its Hurst
    exponent (profile spectrum ∝ k^-(1+2·hurst)). restitution: of an impact against a rigid wall, for pulses only.
    residual: what sounds beside the modes, None: nothing. effects: what else belongs to it (sonic_bullet.effects), in the order in which they act.
    """

    name: str
    density_kg_m3: float
    stiffness_pa: Array
    alpha_per_s: float | None = None
    beta_s: float | None = None
    roughness_m: float = 1e-6
    hurst: float = 0.7
    restitution: float = 0.5
    source: str = ""
    residual: Residual | None = None
    effects: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        stiffness = frozen_array(self.stiffness_pa, float, (6, 6), f"material '{self.name}': stiffness_pa")
        _store(self, stiffness_pa=stiffness)
        where = f"material '{self.name}'"
        _require(np.isfinite(self.density_kg_m3) and self.density_kg_m3 > 0, f"{where}: density_kg_m3 is {self.density_kg_m3}", "give a density above zero")
        _require(bool(np.allclose(stiffness, stiffness.T, rtol=1e-9)), f"{where}: stiffness_pa is not symmetric", "give a symmetric tensor")
        _require(
            bool(np.linalg.eigvalsh(stiffness)[0] > 0),
            f"{where}: stiffness is not positive definite",
            "Young's modulus must be above 0 and Poisson's ratio within -1 … 0.5",
        )
        for name in ("alpha_per_s", "beta_s"):
            value = getattr(self, name)
            _require(value is None or (np.isfinite(value) and value >= 0), f"{where}: {name} is {value}", "damping must be zero or above")
        _require((self.alpha_per_s is None) == (self.beta_s is None), f"{where}: only one of alpha_per_s, beta_s is given", "give both or neither")
        _require(np.isfinite(self.roughness_m) and self.roughness_m >= 0, f"{where}: roughness_m is {self.roughness_m}", "rms height must be zero or above")
        _require(0 < self.hurst < 1, f"{where}: hurst is {self.hurst}", "the Hurst exponent lies between 0 and 1")
        _require(0 <= self.restitution <= 1, f"{where}: restitution is {self.restitution}", "restitution lies between 0 and 1")

    @classmethod
    def isotropic(cls, name: str, *, youngs_pa: float, poisson: float, density_kg_m3: float, **rest: Any) -> Material:
        """Material with the same stiffness in every direction. Raises RecordError on unphysical constants."""
        _require(np.isfinite(youngs_pa) and youngs_pa > 0, f"material '{name}': youngs_pa is {youngs_pa}", "give a Young's modulus above zero")
        _require(-1 < poisson < 0.5, f"material '{name}': poisson is {poisson}", "Poisson's ratio lies between -1 and 0.5")
        return cls(name=name, density_kg_m3=density_kg_m3, stiffness_pa=isotropic_stiffness_pa(youngs_pa, poisson), **rest)

    @property
    def bulk_pa(self) -> float:
        """Voigt average of the bulk modulus [Hill 1952, eq. 1]; exact for isotropic materials."""
        return float(self.stiffness_pa[:3, :3].sum() / 9)

    @property
    def shear_pa(self) -> float:
        """Voigt average of the shear modulus [Hill 1952, eq. 2]; exact for isotropic materials."""
        c = self.stiffness_pa
        return float((np.trace(c[:3, :3]) - (c[0, 1] + c[1, 2] + c[0, 2]) + 3 * np.trace(c[3:, 3:])) / 15)

    @property
    def youngs_pa(self) -> float:
        return 9 * self.bulk_pa * self.shear_pa / (3 * self.bulk_pa + self.shear_pa)

    @property
    def poisson(self) -> float:
        return (3 * self.bulk_pa - 2 * self.shear_pa) / (2 * (3 * self.bulk_pa + self.shear_pa))

    @property
    def plane_strain_pa(self) -> float:
        """E/(1-ν²), the modulus that enters Hertz' law."""
        return self.youngs_pa / (1 - self.poisson**2)


ShapeKind = Literal["sphere", "box", "capsule", "cylinder", "mesh", "plane"]


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """One piece of a body's geometry, placed in the body frame.

    size_m (3,): sphere (r, 0, 0); box full edge lengths; capsule and cylinder (r, length along z without caps, 0); plane: normal
    is +z, unused; mesh: unused. position_m (3,), quaternion_xyzw (4,): placement. vertex_m (v, 3), face (f, 3): meshes only,
    already scaled, counter-clockwise seen from outside.
    """

    kind: ShapeKind
    size_m: Array = field(default_factory=lambda: np.zeros(3))
    position_m: Array = field(default_factory=lambda: np.zeros(3))
    quaternion_xyzw: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    vertex_m: Array = field(default_factory=lambda: np.zeros((0, 3)))
    face: Array = field(default_factory=lambda: np.zeros((0, 3), np.int32))

    def __post_init__(self) -> None:
        _store(
            self,
            size_m=frozen_array(self.size_m, float, (3,), "shape size"),
            position_m=frozen_array(self.position_m, float, (3,), "shape position"),
            quaternion_xyzw=frozen_array(self.quaternion_xyzw, float, (4,), "shape quaternion"),
            vertex_m=frozen_array(self.vertex_m, float, (None, 3), "mesh vertices"),
            face=frozen_array(self.face, np.int32, (None, 3), "mesh faces"),
        )
        _require(bool((self.size_m >= 0).all()), f"{self.kind}: size {self.size_m} is negative", "give sizes above zero")
        if self.kind == "mesh":
            _require(len(self.face) > 0, "mesh without triangles", "give a triangle mesh")
            _require(bool((self.face >= 0).all() and (self.face < len(self.vertex_m)).all()), "mesh faces point at missing vertices", "repair the mesh file")


@dataclass(frozen=True, slots=True, eq=False)
class ModalModel:
    """A body's vibration modes on its surface, and the surface they live on.

    freq_hz, decay_per_s (m,): of the damped modes, ascending; decay NaN where the material states no damping.
    shape (v, 3, m) float32: mass-normalised displacement at the surface vertices, in 1/√kg (UᵀMU = I), body frame.
    vertex_m (v, 3), face (f, 3): the surface, body frame, outward. curvature_per_m (f,): mean of the principal curvatures
    of the smooth surface (0 flat, 1/r sphere, negative inside a bowl). volume_m3, mass_kg: of the meshed solid at the
    material's density. dropped: modes left out as overdamped. note: how it was made (element size, order, choices).
    bend_s2_m2, damping_growth_s_m (m,): relative rise of a mode's frequency per square of its peak velocity at the surface, of its decay
    (damping_growth · that velocity)^damping_growth_power, 1 or 2; None: a linear body.
    A body without audible modes has m = 0; a plane has v = f = 0 besides.
    """

    freq_hz: Array
    decay_per_s: Array
    shape: Array
    vertex_m: Array
    face: Array
    curvature_per_m: Array
    volume_m3: float
    mass_kg: float
    dropped: int = 0
    note: str = ""
    bend_s2_m2: Array | None = None
    damping_growth_s_m: Array | None = None
    damping_growth_power: float = 1.0

    def __post_init__(self) -> None:
        freq = frozen_array(self.freq_hz, float, (None,), "freq_hz")
        m = len(freq)
        vertex = frozen_array(self.vertex_m, float, (None, 3), "vertex_m")
        face = frozen_array(self.face, np.int32, (None, 3), "face")
        decay = frozen_array(self.decay_per_s, float, (m,), "decay_per_s", finite=False)
        _store(
            self,
            freq_hz=freq,
            decay_per_s=decay,
            vertex_m=vertex,
            face=face,
            shape=frozen_array(self.shape, np.float32, (len(vertex), 3, m), "mode shape"),
            curvature_per_m=frozen_array(self.curvature_per_m, float, (len(face),), "curvature_per_m"),
        )
        _require(
            bool((freq > 0).all() and (np.diff(freq) >= 0).all()), "mode frequencies are not ascending and above zero", "build the model with modal.analyse"
        )
        _require(not np.isinf(decay).any() and not bool((decay < 0).any()), "mode decays are negative or infinite", "build the model with modal.analyse")
        _require(
            len(face) == 0 or bool((face >= 0).all() and (face < len(vertex)).all()), "faces point at missing vertices", "build the model with modal.analyse"
        )
        _require(self.damping_growth_power in (1.0, 2.0), f"decays that rise with power {self.damping_growth_power} of the level", "give 1 or 2")
        _require(self.volume_m3 >= 0 and self.mass_kg >= 0, "negative volume or mass", "orient the mesh outward")
        for name in ("bend_s2_m2", "damping_growth_s_m"):
            if getattr(self, name) is not None:
                _store(self, **{name: frozen_array(getattr(self, name), float, (m,), name)})

    @property
    def mode_count(self) -> int:
        return len(self.freq_hz)

    @property
    def omega0_squared_per_s2(self) -> Array:
        """Eigenvalues λ = ω² + d² (m,), of the undamped body [Ren et al. 2013, eq. 7]; NaN decays count as zero."""
        return np.asarray((2 * np.pi * self.freq_hz) ** 2 + np.nan_to_num(self.decay_per_s) ** 2)

    @property
    def choke_s_m(self) -> Array | None:
        """Former name of `damping_growth_s_m`."""
        warnings.warn("ModalModel.choke_s_m is now damping_growth_s_m", DeprecationWarning, stacklevel=2)
        return self.damping_growth_s_m


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One link of one PyBullet body as the sound needs it, by value, so that a log renders without PyBullet.

    body_id, link: as the user knows them (base is link -1). epoch: grows whenever ids may have been given anew.
    name: for people. mass_kg: the simulator's, 0 for what does not move. inertia_kg_m2 (3, 3): body frame, centre of mass.
    volume_m3: of the displaced air. curvature_per_m: of a shape that has one everywhere (sphere 1/r), else NaN: then the model's
    surface tells. material None: a silent, smooth and rigid partner. model None: nothing of it vibrates.
    since_step: the first step in which it exists for the sound; until_step: the first in which it does not any more, or -1.
    """

    body_id: int
    link: int
    epoch: int
    name: str
    mass_kg: float
    inertia_kg_m2: Array
    volume_m3: float = 0.0
    curvature_per_m: float = float("nan")
    material: Material | None = None
    model: ModalModel | None = None
    since_step: int = 0
    until_step: int = -1

    def __post_init__(self) -> None:
        _store(self, inertia_kg_m2=frozen_array(self.inertia_kg_m2, float, (3, 3), f"body {self.body_id}: inertia"))
        _require(
            np.isfinite(self.mass_kg) and 0 <= self.mass_kg < 1e12,
            f"body {self.body_id} link {self.link} has mass {self.mass_kg} kg",
            "give it a finite mass with changeDynamics",
        )
        _require(np.isfinite(self.volume_m3) and self.volume_m3 >= 0, f"body {self.body_id}: volume {self.volume_m3} m³", "orient its mesh outward")


@dataclass(frozen=True, slots=True, eq=False)
class Microphone:
    """A point that hears pressure in Pa. position_m (3,): world frame, fixed."""

    position_m: Array

    def __post_init__(self) -> None:
        _store(self, position_m=frozen_array(self.position_m, float, (3,), "microphone position"))


@dataclass(frozen=True, slots=True, eq=False)
class Vibrometer:
    """Velocity in m/s of a body's surface at point_m (3,) along direction (3,), both in the body frame."""

    body_id: int
    point_m: Array
    direction: Array
    link: int = -1

    def __post_init__(self) -> None:
        direction = np.array(self.direction, float)
        length = float(np.linalg.norm(direction))
        _require(length > 0, "vibrometer direction is zero", "give the direction in which it looks")
        _store(
            self,
            point_m=frozen_array(self.point_m, float, (3,), "vibrometer point"),
            direction=frozen_array(direction / length, float, (3,), "vibrometer direction"),
        )


@dataclass(frozen=True, slots=True, eq=False)
class ModalSum:
    """The seed's observation: the plain sum Σ a·e^{-dt}·sin(2πft), a = scale·Uᵀj for an impulse j in N·s [Ren et al. 2013, eq. 11, 13]."""

    scale: float = 1.0


Sensor = Microphone | Vibrometer | ModalSum


@dataclass(frozen=True, slots=True)
class Air:
    """The medium: density and speed of sound."""

    density_kg_m3: float = 1.2
    sound_speed_m_s: float = 343.0

    def __post_init__(self) -> None:
        _require(
            0 < self.density_kg_m3 < 1e4 and 0 < self.sound_speed_m_s < 1e5,
            f"air of {self.density_kg_m3} kg/m³ and {self.sound_speed_m_s} m/s",
            "give both above zero",
        )
