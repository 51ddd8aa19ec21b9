"""Materials, shapes and modal models as values, checked when built.

    shapes (listener) + Material (presets) -> ModalModel (modal) -> Body -> Step, ContactLog -> sound

Every record is frozen, its arrays are read-only copies, units are in the names and shapes in the comments: b bodies,
m modes, v vertices, f faces. A record that exists is valid: inner code does not check again. Body frame always means
the frame PyBullet calls inertial: origin at the centre of mass, axes as `getBasePositionAndOrientation` gives them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store
from sonic_bullet.records.coerce import (
    as_flag,
    as_items,
    as_kind,
    as_number,
    as_text,
    as_whole,
    check_options,
    nearest,
    quote,
)
from sonic_bullet.records.errors import RecordError
from sonic_bullet.records.residual import Residual
from sonic_bullet.records.roughness import OCTAVES
from sonic_bullet.records.touching.surface_form import SurfaceForm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = [
    "Array",
    "Material",
    "ModalModel",
    "Residual",
    "Shape",
    "ShapeKind",
    "frozen_array",
    "isotropic_stiffness_pa",
]


def isotropic_stiffness_pa(youngs_pa: float, poisson: float) -> Array:
    """Return the Voigt stiffness (6, 6) in Pa, order xx yy zz yz xz xy with engineering shear strains.

    References
    ----------
    Lamé constants, e.g. Slaughter, The Linearized Theory of Elasticity (2002), ch. 5.
    """
    lame = youngs_pa * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = youngs_pa / (2 * (1 + poisson))
    stiffness = np.zeros((6, 6))
    stiffness[:3, :3] = lame
    stiffness[range(3), range(3)] += 2 * shear
    stiffness[range(3, 6), range(3, 6)] = shear
    return stiffness


ORTHOTROPIC = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1), (3, 3), (4, 4), (5, 5))
"""Indices in the Voigt tensor of C11 C22 C33 C23 C13 C12 C44 C55 C66, which symmetry planes along the axes leave."""


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """Material of a body.

    Parameters
    ----------
    stiffness_pa : Array, shape (6, 6)
        Voigt tensor, positive definite.
    alpha_per_s, beta_s
        Rayleigh damping d = (alpha + beta·lambda)/2 [Ren, Yeh, Lin 2013, eq. 6], None where unknown.
    roughness_m, hurst
        rms height of the surface profile, and its Hurst exponent (spectrum ∝ k^-(1+2·hurst)).
    octave_rms_m : Array, shape (octaves,)
        rms heights by wavelength in place of both (`records.roughness`).
    restitution
        Of an impact at 1 m/s against a rigid wall.
    residual, form
        Non-modal part of the sound; waviness and measured track of the surface. None: none.
    effects
        Further effects (sonic_bullet.effects), in the order in which they act.
    includes_radiation
        Whether its damping, and that of its effects, is a body's total damping as recorded, to which the run time adds
        no radiation; else it is the material's own.
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
    includes_radiation: bool = False
    octave_rms_m: Array | None = None
    form: SurfaceForm | None = None

    def __post_init__(self) -> None:
        """Check the fields."""
        as_text(self.name, "the name of a material", "give a text")
        where = f"material {quote(self.name)}"
        stiffness = frozen_array(self.stiffness_pa, float, (6, 6), f"{where}: stiffness_pa")
        store(
            self,
            stiffness_pa=stiffness,
            density_kg_m3=as_number(
                self.density_kg_m3, f"{where}: density_kg_m3", "give a density above zero", above=0
            ),
        )
        require(
            bool(np.allclose(stiffness, stiffness.T, rtol=1e-9)),
            f"{where}: stiffness_pa is not symmetric",
            "give a symmetric tensor",
        )
        require(
            bool(np.linalg.eigvalsh(stiffness)[0] > 0),
            f"{where}: stiffness_pa is not positive definite",
            "Young's modulus must be above 0 and Poisson's ratio within -1 … 0.5",
        )
        for name in ("alpha_per_s", "beta_s"):
            if getattr(self, name) is not None:
                damping = as_number(getattr(self, name), f"{where}: {name}", "damping must be zero or above", least=0)
                store(self, **{name: damping})
        require(
            (self.alpha_per_s is None) == (self.beta_s is None),
            f"{where}: only one of alpha_per_s, beta_s is given",
            "give both or neither",
        )
        store(
            self,
            roughness_m=as_number(
                self.roughness_m, f"{where}: roughness_m", "rms height must be zero or above", least=0
            ),
            hurst=as_number(self.hurst, f"{where}: hurst", "the Hurst exponent lies between 0 and 1", above=0, below=1),
            restitution=as_number(
                self.restitution, f"{where}: restitution", "restitution lies between 0 and 1", least=0, most=1
            ),
            effects=as_items(self.effects, f"{where}: effects", "give effects of sonic_bullet.effects"),
            includes_radiation=as_flag(self.includes_radiation, f"{where}: includes_radiation"),
        )
        if self.octave_rms_m is not None:
            heights = frozen_array(self.octave_rms_m, float, (OCTAVES,), f"{where}: octave_rms_m")
            require(bool((heights >= 0).all()), f"{where}: octave_rms_m is below 0", "give rms heights in m")
            store(self, octave_rms_m=heights)
        as_text(self.source, f"{where}: source", "give a text")
        for name, kind in (("residual", Residual), ("form", SurfaceForm)):
            if getattr(self, name) is not None:
                as_kind(getattr(self, name), kind, f"{where}: {name}", f"give a {kind.__name__}, or none")

    @classmethod
    def isotropic(cls, name: str, *, youngs_pa: float, poisson: float, density_kg_m3: float, **rest: Any) -> Material:
        """Build a material with the same stiffness in every direction.

        Raises
        ------
        RecordError
            The constants are unphysical.
        """
        where = f"material {quote(name)}"
        modulus = as_number(youngs_pa, f"{where}: youngs_pa", "give a Young's modulus above zero", above=0)
        ratio = as_number(poisson, f"{where}: poisson", "Poisson's ratio lies between -1 and 0.5", above=-1, below=0.5)
        check_options(
            rest,
            [f.name for f in fields(cls) if f.name not in ("name", "density_kg_m3", "stiffness_pa")],
            "Material.isotropic",
        )
        return cls(name=name, density_kg_m3=density_kg_m3, stiffness_pa=isotropic_stiffness_pa(modulus, ratio), **rest)

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
        """Young's modulus of the averaged moduli."""
        return 9 * self.bulk_pa * self.shear_pa / (3 * self.bulk_pa + self.shear_pa)

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the averaged moduli."""
        return (3 * self.bulk_pa - 2 * self.shear_pa) / (2 * (3 * self.bulk_pa + self.shear_pa))

    @property
    def plane_strain_pa(self) -> float:
        """Plane strain modulus E/(1-ν²) of Hertz' law."""
        return self.youngs_pa / (1 - self.poisson**2)


ShapeKind = Literal["sphere", "box", "capsule", "cylinder", "mesh", "plane"]


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """One piece of a body's geometry, placed in the body frame.

    Parameters
    ----------
    size_m : Array, shape (3,)
        Sphere (r, 0, 0); box full edge lengths; capsule and cylinder (r, length along z without caps, 0); unused of a
        mesh, and of a plane, whose normal is +z.
    position_m, quaternion_xyzw : Array, shapes (3,), (4,)
        Placement.
    vertex_m, face : Array, shapes (v, 3), (f, 3)
        Meshes only, already scaled, counter-clockwise seen from outside.
    """

    kind: ShapeKind
    size_m: Array = field(default_factory=lambda: np.zeros(3))
    position_m: Array = field(default_factory=lambda: np.zeros(3))
    quaternion_xyzw: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))
    vertex_m: Array = field(default_factory=lambda: np.zeros((0, 3)))
    face: Array = field(default_factory=lambda: np.zeros((0, 3), np.int32))

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self,
            kind: ShapeKind,
            size_m: ArrayLike = ...,
            position_m: ArrayLike = ...,
            quaternion_xyzw: ArrayLike = ...,
            vertex_m: ArrayLike = ...,
            face: ArrayLike = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        kinds = get_args(ShapeKind)
        if as_text(self.kind, "kind of a shape", f"one of {', '.join(kinds)}") not in kinds:
            raise RecordError(f"kind of a shape is {quote(self.kind)}", nearest(self.kind, kinds))
        store(
            self,
            size_m=frozen_array(self.size_m, float, (3,), "shape: size_m"),
            position_m=frozen_array(self.position_m, float, (3,), "shape: position_m"),
            quaternion_xyzw=frozen_array(self.quaternion_xyzw, float, (4,), "shape: quaternion_xyzw"),
            vertex_m=frozen_array(self.vertex_m, float, (None, 3), "mesh: vertex_m"),
            face=frozen_array(self.face, np.int32, (None, 3), "mesh: face"),
        )
        positive = bool((self.size_m >= 0).all())
        require(positive, f"{self.kind}: size_m {self.size_m} is negative", "give sizes above zero")
        if self.kind == "mesh":
            require(len(self.face) > 0, "mesh without triangles", "give a triangle mesh")
            require(
                bool((self.face >= 0).all() and (self.face < len(self.vertex_m)).all()),
                "mesh faces point at missing vertices",
                "repair the mesh file",
            )


@dataclass(frozen=True, slots=True, eq=False)
class TouchedSurface:
    """Surface of a body as it was given: how it is curved where it is touched, whatever elements its modes have.

    Parameters
    ----------
    vertex_m, face : Array, shapes (v, 3), (f, 3)
        Body frame, outward.
    curvature_per_m : Array, shape (f,)
        As of `ModalModel`.
    """

    vertex_m: Array
    face: Array
    curvature_per_m: Array

    def __post_init__(self) -> None:
        """Check the fields."""
        vertex = frozen_array(self.vertex_m, float, (None, 3), "touched surface: vertex_m")
        face = frozen_array(self.face, np.int32, (None, 3), "touched surface: face")
        curvature = frozen_array(self.curvature_per_m, float, (len(face),), "touched surface: curvature_per_m")
        store(self, vertex_m=vertex, face=face, curvature_per_m=curvature)
        require(len(face) > 0, "touched surface without triangles", "leave it out")
        require(
            bool(((face >= 0) & (face < len(vertex))).all()), "faces point at missing vertices", "give a triangle mesh"
        )

    def resize(self, size: float) -> TouchedSurface:
        """Return the surface ``size`` times as large."""
        return TouchedSurface(self.vertex_m * size, self.face, self.curvature_per_m / size)


Solution = Literal["full", "draft", "none"]
"""How a body's modes were solved for."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class ModalModel:
    """Vibration modes of a body on its surface, and that surface.

    A body without audible modes has m = 0; a plane also has v = f = 0.

    Parameters
    ----------
    freq_hz, decay_per_s : Array, shape (m,)
        Of the damped modes, ascending; decay NaN where the material states no damping.
    shape : Array of float32, shape (v, 3, m)
        Mass-normalised displacement at the surface vertices, in 1/√kg (UᵀMU = I), body frame.
    vertex_m, face : Array, shapes (v, 3), (f, 3)
        The surface, body frame, outward.
    curvature_per_m : Array, shape (f,)
        Mean of the principal curvatures of the smooth surface (0 flat, 1/r sphere, negative inside a bowl).
    volume_m3, mass_kg, assumed_wall_m
        Of the meshed solid at the material's density; the wall that an open surface got as none was stated, 0: none.
    dropped
        Number of modes left out as overdamped.
    note
        How it was made (element size, order, choices).
    bend_s2_m2 : Array, shape (m,)
        Relative rise of a mode's frequency per square of its peak velocity at the surface; None: a linear body.
    damping_growth_s_m : Array, shape (m,)
        Relative rise of its decay is (damping_growth · that velocity)^damping_growth_power, 1 or 2; None: linear.
    includes_radiation
        Of decay_per_s (see `Material`).
    stands_for : Array, shape (m,)
        How many modes each stands for, whose energy its shape has; None: each for itself.
    solution
        "full"; "draft": few modes of coarse elements, in air as coarse; "none": its modes were not computed, as nothing
        made it sound: a surface alone, m = 0.
    touched
        The surface as given, where faces of the elements lean from it as creases do; None: that of ``face``.
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
    includes_radiation: bool = False
    stands_for: Array | None = None
    assumed_wall_m: float = 0.0
    solution: Solution = "full"
    touched: TouchedSurface | None = None

    def __post_init__(self) -> None:
        """Check the fields."""
        freq = frozen_array(self.freq_hz, float, (None,), "freq_hz")
        m = len(freq)
        vertex = frozen_array(self.vertex_m, float, (None, 3), "vertex_m")
        face = frozen_array(self.face, np.int32, (None, 3), "face")
        decay = frozen_array(self.decay_per_s, float, (m,), "decay_per_s", finite=False)
        store(
            self,
            freq_hz=freq,
            decay_per_s=decay,
            vertex_m=vertex,
            face=face,
            shape=frozen_array(self.shape, np.float32, (len(vertex), 3, m), "mode shape"),
            damping_growth_power=as_number(self.damping_growth_power, "damping_growth_power", "give 1 or 2"),
            volume_m3=as_number(self.volume_m3, "volume_m3", "orient the mesh outward", least=0),
            mass_kg=as_number(self.mass_kg, "mass_kg", "orient the mesh outward", least=0),
            assumed_wall_m=as_number(self.assumed_wall_m, "assumed_wall_m", "give a thickness in m, or 0", least=0),
            dropped=as_whole(self.dropped, "dropped", "give the number of modes left out", least=0),
            curvature_per_m=frozen_array(self.curvature_per_m, float, (len(face),), "curvature_per_m"),
        )
        anew = "build the model with modal.analyse"
        require(
            bool((freq > 0).all() and (np.diff(freq) >= 0).all()),
            "mode frequencies are not ascending and above zero",
            anew,
        )
        require(not np.isinf(decay).any() and not bool((decay < 0).any()), "mode decays are negative or infinite", anew)
        require(bool(((face >= 0) & (face < len(vertex))).all()), "faces point at missing vertices", anew)
        require(
            self.damping_growth_power in (1.0, 2.0),
            f"decays that rise with power {self.damping_growth_power} of the level",
            "give 1 or 2",
        )
        as_text(self.note, "note", "give a text"), as_flag(self.includes_radiation, "includes_radiation")
        known = get_args(Solution)
        as_text(self.solution, "solution", f"one of {', '.join(known)}")
        require(self.solution in known, f"solution {quote(self.solution)}", nearest(self.solution, known))
        require(not (self.unsolved and m), f"solution 'none' of a model with {m} modes", anew)
        if self.touched is not None:
            as_kind(self.touched, TouchedSurface, "touched", "give a TouchedSurface, or leave it out")
        for name in ("bend_s2_m2", "damping_growth_s_m", "stands_for"):
            if getattr(self, name) is not None:
                store(self, **{name: frozen_array(getattr(self, name), float, (m,), name)})

    @property
    def unsolved(self) -> bool:
        """Whether its modes were not computed."""
        return self.solution == "none"

    @property
    def mode_count(self) -> int:
        """Number of modes."""
        return len(self.freq_hz)

    @property
    def omega0_squared_per_s2(self) -> Array:
        """Eigenvalues λ = ω² + d² (m,), of the undamped body [Ren et al. 2013, eq. 7]; NaN decays count as zero."""
        return np.asarray((2 * np.pi * self.freq_hz) ** 2 + np.nan_to_num(self.decay_per_s) ** 2)
