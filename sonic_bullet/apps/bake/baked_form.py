"""A baked model as JSON: typed, every field checked; the same names in a .json file and in a glTF's `extras`.

BakedModel -> BodyForm -> JSON;   of it, ExtrasForm is what glTF's own accessors do not hold

ABOUT describes each field, for docs/reference/baked.md and the schema.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any

import msgspec
import numpy as np

from sonic_bullet.apps.bake.baked_model import BakedMaterial, BakedModel, MassProperties, Row
from sonic_bullet.files.residual_code import ResidualForm, form_of, residual_of
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

BAKED_FORMAT = "sonic-bullet-baked/1"

Triple = tuple[float, float, float]
Corners = tuple[int, int, int]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    pass


class ModesForm(_Part, frozen=True):
    """Frequencies, decays and radiation of the modes, the most important first."""

    freq_hz: list[Annotated[float, msgspec.Meta(gt=0)]]
    decay_per_s: list[NotNegative]
    pressure_real_pa_m: list[float] | None = None
    pressure_imag_pa_m: list[float] | None = None
    bend_s2_m2: list[float] | None = None
    damping_growth_s_m: list[float] | None = None
    damping_growth_power: float = 1.0


class BakedMaterialForm(_Part, frozen=True):
    """The solid, and its contact properties. What is not known is absent."""

    name: str = ""
    density_kg_m3: float | None = None
    youngs_pa: float | None = None
    poisson: float | None = None
    alpha_per_s: float | None = None
    beta_s: float | None = None
    contact_modulus_pa: float | None = None
    restitution: float | None = None
    roughness_m: float | None = None
    hurst: float | None = None
    octave_rms_m: tuple[float, ...] | None = None
    waviness_m: float | None = None
    waviness_length_m: float | None = None
    stiffness_pa: tuple[Row, Row, Row, Row, Row, Row] | None = None


class MassForm(_Part, frozen=True):
    """Mass properties of the solid, in the mesh's frame."""

    mass_kg: float
    centre_m: Triple
    inertia_kg_m2: tuple[Triple, Triple, Triple]


class ExtrasForm(_Part, frozen=True):
    """What a glTF's own accessors do not hold of a model: doubles, radiation, contact, residual."""

    format: str
    modes: ModesForm
    material: BakedMaterialForm = BakedMaterialForm()
    mass: MassForm | None = None
    residual: ResidualForm | None = None
    notes: list[str] = []


class BodyForm(_Part, frozen=True):
    """One body: its modes at points of its surface."""

    name: str
    modes: ModesForm
    point_m: list[Triple]
    face: list[Corners]
    shape_per_sqrt_kg: list[list[Triple]]
    material: BakedMaterialForm = BakedMaterialForm()
    mass: MassForm | None = None
    residual: ResidualForm | None = None
    notes: list[str] = []


class BakedFile(_Part, frozen=True):
    """Baked models of one or several bodies."""

    format: str
    bodies: list[BodyForm]


ABOUT: dict[str, dict[str, str]] = {
    "BakedFile": {"format": f"`{BAKED_FORMAT}`", "bodies": "at least one"},
    "BodyForm": {
        "name": "the mesh's or the body's",
        "modes": "m of them",
        "point_m": "p points on the surface, m, in the mesh's frame: its own vertices in its file's order, where "
        "nothing else was asked for",
        "face": "triangles of points, outward, between which shapes are interpolated; none: the nearest point counts",
        "shape_per_sqrt_kg": "of each mode at each point: displacement, mass-normalised, 1/√kg",
        "material": "what it is made of",
        "mass": "what it weighs",
        "residual": "what its preset sounds beside its modes, as in a preset file",
        "notes": "what to know of it",
    },
    "ModesForm": {
        "freq_hz": "of the damped modes, Hz",
        "decay_per_s": "d in e^(−dt), 1/s, with all that the body loses to the air",
        "pressure_real_pa_m": "real part of the pressure at 1 m for a modal velocity of 1 m/s·√kg, mean of directions",
        "pressure_imag_pa_m": "imaginary part",
        "bend_s2_m2": "relative rise of a frequency per square of the mode's peak velocity at the surface",
        "damping_growth_s_m": "a decay rises by (this · that velocity) to the next field's power, relative",
        "damping_growth_power": "1 or 2",
    },
    "BakedMaterialForm": {
        "name": "the preset's",
        "density_kg_m3": "kg/m³",
        "youngs_pa": "Young's modulus, Pa",
        "poisson": "Poisson's ratio",
        "alpha_per_s": "Rayleigh's α, 1/s, of the material alone",
        "beta_s": "Rayleigh's β, s, of the material alone",
        "contact_modulus_pa": "E/(1−ν²) where it is touched, Pa; two bodies meet with 1/E* = Σ 1/contact_modulus",
        "restitution": "of an impact against a rigid wall",
        "roughness_m": "rms height of the surface, m",
        "hurst": "Hurst exponent of its profile",
        "octave_rms_m": "rms heights by wavelength, 100 mm and its halves, in place of both, m",
        "waviness_m": "rms height of the waves of manufacture above the finish, m",
        "waviness_length_m": "their wavelength, m",
        "stiffness_pa": "Voigt stiffness xx yy zz yz xz xy, Pa, of a material with a grain",
    },
    "MassForm": {
        "mass_kg": "kg, of the solid by which shapes are normalised",
        "centre_m": "centre of mass, m",
        "inertia_kg_m2": "about the centre of mass, kg·m²",
    },
}


def _rows(matrix: Array) -> tuple[Triple, Triple, Triple]:
    one, two, three = (tuple(row) for row in matrix.tolist())
    return one, two, three


def modes_form(model: BakedModel) -> ModesForm:
    """Return the modes of a model without their shapes."""
    pressure = model.pressure_pa_m
    bend, growth = model.bend_s2_m2, model.damping_growth_s_m
    return ModesForm(
        freq_hz=model.freq_hz.tolist(),
        decay_per_s=model.decay_per_s.tolist(),
        pressure_real_pa_m=None if pressure is None else pressure.real.tolist(),
        pressure_imag_pa_m=None if pressure is None else pressure.imag.tolist(),
        bend_s2_m2=None if bend is None else bend.tolist(),
        damping_growth_s_m=None if growth is None else growth.tolist(),
        damping_growth_power=float(model.damping_growth_power),
    )


def common_form(model: BakedModel) -> dict[str, Any]:
    """Return the fields that `BodyForm` and `ExtrasForm` share."""
    mass = model.mass
    return {
        "modes": modes_form(model),
        "material": BakedMaterialForm(**{f.name: getattr(model.material, f.name) for f in fields(BakedMaterial)}),
        "mass": None
        if mass is None
        else MassForm(
            mass_kg=mass.mass_kg,
            centre_m=tuple(mass.centre_m.tolist()),
            inertia_kg_m2=_rows(mass.inertia_kg_m2),
        ),
        "residual": None if model.residual is None else form_of(model.residual),
        "notes": list(model.notes),
    }


def model_of(form: BodyForm | ExtrasForm, *, name: str, point_m: Array, face: Array, shape: Array) -> BakedModel:
    """Build the model of a form, with shapes (p, 3, m) at its points. Raises RecordError, FileError, MaterialError."""
    modes, mass = form.modes, form.mass
    real, imag = modes.pressure_real_pa_m, modes.pressure_imag_pa_m
    if (real is None) != (imag is None) or (real is not None and imag is not None and len(real) != len(imag)):
        raise FileError(f"{name}: pressure_real_pa_m and pressure_imag_pa_m do not fit", "give both, a number a mode")
    return BakedModel(
        name=name,
        freq_hz=np.array(modes.freq_hz, float),
        decay_per_s=np.array(modes.decay_per_s, float),
        shape=shape,
        point_m=point_m,
        face=face,
        pressure_pa_m=None if real is None else np.array(real) + 1j * np.array(imag),
        material=BakedMaterial(**msgspec.structs.asdict(form.material)),
        mass=None
        if mass is None
        else MassProperties(mass.mass_kg, np.array(mass.centre_m), np.array(mass.inertia_kg_m2)),
        bend_s2_m2=None if modes.bend_s2_m2 is None else np.array(modes.bend_s2_m2),
        damping_growth_s_m=None if modes.damping_growth_s_m is None else np.array(modes.damping_growth_s_m),
        damping_growth_power=modes.damping_growth_power,
        residual=None if form.residual is None else residual_of(form.residual, name),
        notes=tuple(form.notes),
    )


def baked_schema() -> dict[str, Any]:
    """Build the JSON Schema of a baked .json file. Raises KeyError where a field has no description in `ABOUT`."""
    schema = msgspec.json.schema(BakedFile)
    for name, about in ABOUT.items():
        properties = schema["$defs"][name]["properties"]
        for field, part in properties.items():
            part["description"] = about[field]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": BAKED_FORMAT, **schema}
