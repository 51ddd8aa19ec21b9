"""A baked model as JSON: records of a .json file, the same in a glTF's `extras`, and what each field means.

BakedModel -> BodyForm -> JSON;   of it, ExtrasForm is what glTF's own accessors do not hold
"""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from sonic_bullet.apps.bake.baked_model import BakedMaterial, BakedModel, MassProperties
from sonic_bullet.files.residual_code import ResidualForm, form_of, residual_of
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

BAKED_FORMAT = "sonic-bullet-baked/1"

Triple = tuple[float, float, float]
Corners = tuple[int, int, int]


class _Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    pass


class ModesForm(_Part, frozen=True):
    """Frequencies, decays and radiation of the modes, the most important first."""

    freq_hz: Annotated[list[Annotated[float, Meta(gt=0)]], Meta(description="of the damped modes, Hz")]
    decay_per_s: Annotated[
        list[Annotated[float, Meta(ge=0)]],
        Meta(description="d in e^(−dt), 1/s, with all that the body loses to the air"),
    ]
    pressure_real_pa_m: Annotated[
        list[float] | None,
        Meta(description="real part of the pressure at 1 m for a modal velocity of 1 m/s·√kg, mean of directions"),
    ] = None
    pressure_imag_pa_m: Annotated[list[float] | None, Meta(description="imaginary part")] = None
    bend_s2_m2: Annotated[
        list[float] | None,
        Meta(description="relative rise of a frequency per square of the mode's peak velocity at the surface"),
    ] = None
    damping_growth_s_m: Annotated[
        list[float] | None,
        Meta(description="a decay rises by (this · that velocity) to the next field's power, relative"),
    ] = None
    damping_growth_power: Annotated[float, Meta(description="1 or 2")] = 1.0


class MassForm(_Part, frozen=True):
    """Mass properties of the solid, in the mesh's frame."""

    mass_kg: Annotated[float, Meta(description="kg, of the solid by which shapes are normalised")]
    centre_m: Annotated[Triple, Meta(description="centre of mass, m")]
    inertia_kg_m2: Annotated[tuple[Triple, Triple, Triple], Meta(description="about the centre of mass, kg·m²")]


class ExtrasForm(_Part, frozen=True):
    """What a glTF's own accessors do not hold of a model: doubles, radiation, contact, residual."""

    format: str
    modes: ModesForm
    material: BakedMaterial = BakedMaterial()
    mass: MassForm | None = None
    residual: ResidualForm | None = None
    notes: list[str] = []


class BodyForm(_Part, frozen=True):
    """One body: its modes at points of its surface."""

    name: Annotated[str, Meta(description="the mesh's or the body's")]
    modes: Annotated[ModesForm, Meta(description="m of them")]
    point_m: Annotated[
        list[Triple],
        Meta(
            description="p points on the surface, m, in the mesh's frame: its own vertices in its file's order, where "
            "nothing else was asked for"
        ),
    ]
    face: Annotated[
        list[Corners],
        Meta(
            description="triangles of points, outward, between which shapes are interpolated; none: the nearest point "
            "counts"
        ),
    ]
    shape_per_sqrt_kg: Annotated[
        list[list[Triple]], Meta(description="of each mode at each point: displacement, mass-normalised, 1/√kg")
    ]
    material: Annotated[BakedMaterial, Meta(description="what it is made of")] = BakedMaterial()
    mass: Annotated[MassForm | None, Meta(description="what it weighs")] = None
    residual: Annotated[
        ResidualForm | None, Meta(description="what its preset sounds beside its modes, as in a preset file")
    ] = None
    notes: Annotated[list[str], Meta(description="what to know of it")] = []


class BakedFile(_Part, frozen=True):
    """Baked models of one or several bodies."""

    format: Annotated[str, Meta(description=f"`{BAKED_FORMAT}`")]
    bodies: Annotated[list[BodyForm], Meta(description="at least one")]


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
        "material": model.material,
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
        material=form.material,
        mass=None
        if mass is None
        else MassProperties(mass.mass_kg, np.array(mass.centre_m), np.array(mass.inertia_kg_m2)),
        bend_s2_m2=None if modes.bend_s2_m2 is None else np.array(modes.bend_s2_m2),
        damping_growth_s_m=None if modes.damping_growth_s_m is None else np.array(modes.damping_growth_s_m),
        damping_growth_power=modes.damping_growth_power,
        residual=None if form.residual is None else residual_of(form.residual, name),
        notes=tuple(form.notes),
    )
