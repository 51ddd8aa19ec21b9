"""Materials from and to typed preset files: density, elasticity, damping, surface, each number with its source.

    NAME.json -> Preset (typed, every field checked) -> Material

A file is UTF-8 JSON, format "sonic-bullet-preset/1": name, density_kg_m3, elasticity (youngs_pa and poisson, or
stiffness_pa 6×6), damping, surface, impact, each group with the `source` of its numbers, an optional `note`, and how
far they differ between objects of that material: `range`, `range_source`, `spread`. `provenance` states what a fitted
preset was fitted from, and how certain it is; it changes no sound. `residual` is the sound beside the modes
(docs/explanation/residual.md), played with every contact. `effects` are what a diagnosis found to belong to material or
object (sonic_bullet.effects.presets_of_effects): they sound in every scene.
What `damping` may say is in effects/damping_law/damping_form.py.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from sonic_bullet.effects.damping_law.damping_form import (
    Damping,
    NotNegative,
    Positive,
    PresetPart,
    Thermal,
    law_of,
    rayleigh_pair,
    thermoelastic_of,
)
from sonic_bullet.effects.presets_of_effects import effect_of
from sonic_bullet.effects.protocol import Effect
from sonic_bullet.files.residual_code import ResidualForm, residual_of
from sonic_bullet.files.storage.json_records import read_record, write_record
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records import Material
from sonic_bullet.records.coerce import as_path, nearest, quote
from sonic_bullet.records.errors import MaterialError, MaterialWarning, RecordError
from sonic_bullet.records.touching.surface_form import waves_of

PRESET_FORMAT = "sonic-bullet-preset/1"


_MATERIALS = Path(__file__).parent / "materials"

TABLES_FOLDER = _MATERIALS
RECORDED_FOLDER = _MATERIALS / "recorded"
MADE_FOLDER = _MATERIALS / "made"

_REMEDY = "give a material's name, or the path of a preset file"
DAMPING_TAKEN = "damping (from '"
"""First words of a provenance's line on the damping that was taken from a table, without radiation, where recordings
identified none.
"""

Fraction = Annotated[float, msgspec.Meta(ge=0, le=1)]
Row = tuple[float, float, float, float, float, float]


class Elasticity(PresetPart, frozen=True):
    """Isotropic (youngs_pa, poisson) or any (stiffness_pa, Voigt order xx yy zz yz xz xy, body axes)."""

    youngs_pa: Positive | None = None
    poisson: Annotated[float, msgspec.Meta(gt=-1, lt=0.5)] | None = None
    stiffness_pa: tuple[Row, Row, Row, Row, Row, Row] | None = None


class Surface(PresetPart, frozen=True):
    """Roughness: roughness_m, the rms height of the profile; hurst, the exponent of its spectrum.

    waviness_m, waviness_length_m: rms height and length of the waves that its making leaves [ISO 4287]; 0: none.
    """

    roughness_m: NotNegative
    hurst: Annotated[float, msgspec.Meta(gt=0, lt=1)]
    waviness_m: NotNegative | None = None
    waviness_length_m: Positive | None = None


class Restitution(PresetPart, frozen=True):
    """Restitution of an impact against a rigid wall: the file's group `impact`."""

    restitution: Fraction


class Origin(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """Origin of a preset that ships with the package and was made of recordings.

    What was struck, the command that made the file, whose recordings they are, and how near the file alone comes to
    takes. Distances are means in dB over the takes held out, or where none is over those fitted; other_take_db: the
    nearest other take, None where there is none. distance: what was played and compared with which takes, in words.
    """

    struck: Annotated[str, msgspec.Meta(min_length=1)]
    command: Annotated[str, msgspec.Meta(min_length=1)]
    source: Annotated[str, msgspec.Meta(min_length=1)]
    licence: Annotated[str, msgspec.Meta(min_length=1)]
    takes_fitted: Annotated[int, msgspec.Meta(ge=1)]
    takes_held_out: Annotated[int, msgspec.Meta(ge=0)] = 0
    distance: str = ""
    predicted_db: NotNegative
    silence_db: NotNegative
    other_take_db: NotNegative | None = None


class Provenance(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """Origin of a fitted preset.

    parameters: α 1/s, β s, γ m²/s², σ, ν by name; spreads: standard errors in the same units, where known; assumed:
    what was taken from the guess; verdict: the fit's own, or the diagnosis' where one wrote it; correction: relative,
    of each mode's frequency against the mesh's; origin: of a preset that ships with the package.
    """

    method: str
    recordings: tuple[str, ...] = ()
    parameters: dict[str, float] = {}
    spreads: dict[str, float | None] = {}
    assumed: tuple[str, ...] = ()
    verdict: str = ""
    correction: dict[str, tuple[float, ...]] = {}
    origin: Origin | None = None


class Preset(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """One preset file; see the module's head."""

    format: str
    name: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
    density_kg_m3: Positive
    elasticity: Elasticity
    damping: Damping
    surface: Surface
    impact: Restitution
    thermal: Thermal | None = None
    note: str = ""
    effects: tuple[dict[str, Any], ...] = ()
    residual: ResidualForm | None = None
    provenance: Provenance | None = None


def load_material(name: str | os.PathLike[str]) -> Material:
    """Load the material of that name (`list_materials`), or of a preset file where ``name`` is a path or ends in .json.

    Warns (`errors.MaterialWarning`) of numbers that no solid has.

    Raises
    ------
    MaterialError
        Unknown name (listing the near ones), unreadable file, a wrong field (named), unphysical numbers.
    """
    text = as_path(name, "name", _REMEDY, error=MaterialError)
    filed = text.endswith(".json") or os.sep in text
    preset = named_preset(text)
    with (
        reading_file(text, "preset", MaterialError, "mend that field; docs/reference/preset.md describes the file")
        if filed
        else nullcontext()
    ):
        made = material_of(preset, text if filed else "")
    warn_of_units(made)
    return made


def warn_of_units(material: Material) -> None:
    """Warn of a modulus or density that no solid has, naming the unit that was likely meant (`MaterialWarning`)."""
    for line in _wrong_units(material.youngs_pa, material.density_kg_m3):
        warnings.warn(f"material {quote(material.name)}: {line}", MaterialWarning, stacklevel=3)


def _wrong_units(youngs_pa: float, density_kg_m3: float) -> Iterator[str]:
    """Yield a line for each number that no solid has.

    Sound runs in no solid faster than 36 km/s [Trachenko et al. 2020, eq. 1]. What is denser than foams, woods,
    plastics and rubbers is a metal, a ceramic or a glass, and stiff [Ashby, Materials Selection in Mechanical Design,
    4th ed. 2011, fig. 4.3].
    """
    light_kg_m3 = 2500.0  # the densest of those, filled plastics left out
    solid_pa = (1e5 if density_kg_m3 <= light_kg_m3 else 1e9, 1.3e12)  # soft foam, softer than lead; diamond
    solid_kg_m3 = (1.0, 23_000.0)  # aerogel, osmium
    fastest_m_s = 36_100.0
    factors = {"GPa": 9, "MPa": 6}
    meant = youngs_pa
    if not solid_pa[0] <= youngs_pa <= solid_pa[1]:
        fits = [unit for unit, power in factors.items() if solid_pa[0] <= youngs_pa * 10**power <= solid_pa[1]]
        remedy = (
            f"is that {fits[0]}? give {youngs_pa:g}e{factors[fits[0]]}" if fits else "give it in Pa: steel has 2e11"
        )
        meant = youngs_pa * 10 ** factors[fits[0]] if fits else 0.0
        yield f"E = {youngs_pa:g} Pa: {remedy}"
    dense = solid_kg_m3[0] <= density_kg_m3 <= solid_kg_m3[1]
    if not dense or meant > fastest_m_s**2 * density_kg_m3:
        gram = density_kg_m3 <= solid_kg_m3[1] / 1000
        remedy = f"is that g/cm³? give {1000 * density_kg_m3:g}" if gram else "give it in kg/m³: steel has 7850"
        yield f"density = {density_kg_m3:g} kg/m³: {remedy}"


def named_preset(name: str | os.PathLike[str]) -> Preset:
    """Read the preset of that name, or of a file where ``name`` is a path or ends in .json.

    Raises MaterialError as `load_material` does.
    """
    text = as_path(name, "name", _REMEDY, error=MaterialError)
    if text.endswith(".json") or os.sep in text:
        return read_preset(text)
    known = material_names()
    if text.lower() in known:
        return read_preset(_folder_of(text.lower()) / f"{text.lower()}.json")
    remedy = nearest(text, known, ", or the path of a preset file")
    raise MaterialError(f"there is no material {quote(text)}", f"{remedy}; 'sonic-bullet materials' lists all")


def list_materials() -> tuple[Material, ...]:
    """List all materials that come with the package, by name: of tables, as things are made of them, and recorded."""
    return tuple(load_material(name) for name in material_names())


@cache
def material_names() -> tuple[str, ...]:
    """List the names that `load_material` knows, sorted."""
    return tuple(sorted((*table_names(), *made_names(), *recorded_names())))


@cache
def table_names() -> tuple[str, ...]:
    """List the names of materials whose numbers come from tables, sorted."""
    return tuple(sorted(path.stem for path in TABLES_FOLDER.glob("*.json")))


@cache
def made_names() -> tuple[str, ...]:
    """List the names of materials as things are made of them: loss of measured bodies, all else from tables, sorted."""
    return tuple(sorted(path.stem for path in MADE_FOLDER.glob("*.json")))


@cache
def recorded_names() -> tuple[str, ...]:
    """List the names of objects that were struck and recorded, whose presets come with the package, sorted."""
    return tuple(sorted(path.stem for path in RECORDED_FOLDER.glob("*.json")))


def _folder_of(name: str) -> Path:
    return RECORDED_FOLDER if name in recorded_names() else MADE_FOLDER if name in made_names() else TABLES_FOLDER


def read_preset(path: str | os.PathLike[str]) -> Preset:
    """Read the typed content of a preset file. Raises MaterialError naming file and field."""
    remedy = "mend that field; docs/reference/preset.md describes the file"
    return read_record(path, Preset, "preset", MaterialError, remedy, version=PRESET_FORMAT)


def write_preset(path: str | os.PathLike[str], preset: Preset) -> None:
    """Write a preset file, whole or not at all. Raises FileError."""
    write_record(path, preset, indent=2)


def material_of(preset: Preset, where: str = "") -> Material:
    """Build the material that a preset describes.

    Raises MaterialError naming preset and field where its numbers contradict each other.
    """
    label = where or preset.name
    alpha, beta = rayleigh_pair(preset.damping, label)
    elastic = preset.elasticity
    rest: dict[str, Any] = {
        "alpha_per_s": alpha,
        "beta_s": beta,
        "roughness_m": preset.surface.roughness_m,
        "hurst": preset.surface.hurst,
        "restitution": preset.impact.restitution,
        "effects": _effects(preset, label),
        "includes_radiation": total_damping(preset),
        "residual": residual_of(preset.residual, f"preset {label}") if preset.residual is not None else None,
        "source": f"elasticity: {elastic.source} | damping: {preset.damping.source} | surface: {preset.surface.source} "
        f"| impact: {preset.impact.source}",
    }
    try:
        height_m = 0.0 if preset.surface.waviness_m is None else preset.surface.waviness_m
        rest["form"] = waves_of(height_m, preset.surface.waviness_length_m or 2e-3)
        if elastic.stiffness_pa is not None and elastic.youngs_pa is None and elastic.poisson is None:
            return Material(preset.name, preset.density_kg_m3, np.array(elastic.stiffness_pa), **rest)
        if elastic.stiffness_pa is None and elastic.youngs_pa is not None and elastic.poisson is not None:
            return Material.isotropic(
                preset.name,
                youngs_pa=elastic.youngs_pa,
                poisson=elastic.poisson,
                density_kg_m3=preset.density_kg_m3,
                **rest,
            )
    except RecordError as error:
        raise MaterialError(f"preset {label}: {error.what}", error.remedy) from error
    raise MaterialError(
        f"preset {label}: elasticity is neither isotropic nor a tensor",
        "give youngs_pa and poisson, or stiffness_pa alone",
    )


def total_damping(preset: Preset) -> bool:
    """Return whether a preset's damping includes radiation.

    As it states, else where it was fitted, as `fit` read total decays before it stated so.
    """
    if preset.damping.includes_radiation is not None:
        return preset.damping.includes_radiation
    fitted = preset.provenance
    return fitted is not None and not any(line.startswith(DAMPING_TAKEN) for line in fitted.assumed)


def _effects(preset: Preset, label: str) -> tuple[Effect, ...]:
    """Return the law of a preset's damping, its loss by heat where no recording holds that, and its own effects."""
    elastic = (preset.elasticity.youngs_pa, preset.elasticity.poisson, preset.density_kg_m3)
    try:
        heat = () if total_damping(preset) else thermoelastic_of(preset.thermal, elastic)
        return (*law_of(preset.damping), *(effect_of(data) for data in preset.effects), *heat)
    except RecordError as error:
        raise MaterialError(f"preset {label}: {error.what}", error.remedy) from error
