"""Cases: recorded strikes of known objects, with the declarations of whoever recorded them.

    FOLDER/case.json ("sonic-bullet-case/1") -> typed, every path inside the folder -> Case

A case may lack a mesh, positions, impulses, a sensor, or give measured `features` in place of a file. What it does not
declare is None: the fit finds it, or it stays unknown. Fields that this version does not know are ignored and named in
a warning (`unread.py`). Nothing in a case is ever executed.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

from sonic_bullet.files import case_fields
from sonic_bullet.files.case_fields import CASE_FORMAT, Line, Split, Vector
from sonic_bullet.files.storage.json_records import decode_record, read_text
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.files.storage.unread import shorten, unread_fields
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError, excerpt

__all__ = [
    "CASE_FORMAT",
    "DIMENSION_TOLERANCE",
    "LENGTH_UNITS",
    "MEDIA",
    "SPLITS",
    "Case",
    "CaseObject",
    "CaseRecording",
    "Line",
    "dimension_tolerance",
    "inside",
    "medium_of",
    "read_case",
]

LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
SPLITS: tuple[str, ...] = get_args(Split)
MEDIA = ("air", "none", "unknown")
DIMENSION_TOLERANCE = 0.005
"""Relative standard error of a mesh's dimensions by default: ± 0.1 mm, any error in it as likely, has
0.058 mm, 0.5 % of 12 mm. [ISO 2768-1, class f, 6 to 30 mm]
"""


@dataclass(frozen=True, slots=True)
class CaseObject:
    """One object: its mesh file, metres per unit of it, the estimated material, and estimated constants.

    fixed: clamps, each x, y, z and radius in m. dimension_tolerance: relative standard error of the mesh's dimensions.
    """

    name: str
    mesh: Path | None
    scale: float
    material: str | None
    youngs_pa: float | None = None
    density_kg_m3: float | None = None
    poisson: float | None = None
    fixed: tuple[tuple[float, float, float, float], ...] = ()
    dimension_tolerance: float = DIMENSION_TOLERANCE


@dataclass(frozen=True, slots=True)
class CaseRecording:
    """One strike: an audio file or measured lines, its object, its use, and the strike; None where not declared.

    channel: counted from 0; None: the first that is not dead. force: file, channel and newtons per unit of the force.
    """

    file: Path | None
    lines: tuple[Line, ...] | None
    object: str
    split: str
    position_m: Vector | None = None
    direction: Vector | None = None
    impulse_n_s: float | None = None
    channel: int | None = None
    force: tuple[Path, int, float | None] | None = None
    state: str | None = None


@dataclass(frozen=True, slots=True)
class Case:
    """A case as declared.

    Parameters
    ----------
    sensor
        "velocity" (of the surface at sensor_m along sensor_direction, by object), "pressure" (a microphone), "sum" (of
        modes) or "unknown".
    onset_s
        Arrival of the impulse in every file, or None.
    support
        As declared, in words; clamps are in the objects.
    medium
        What the object radiates into: "air", "none" or "unknown"; by default air for a microphone or a vibrometer.
    response_hz
        Where frequency responses were measured, of which each file is the inverse transform; None: recordings.
    warnings
        One line for each field that is not read.
    states
        Numbers of states by name, in the order of the states.
    """

    name: str
    folder: Path
    objects: dict[str, CaseObject]
    recordings: tuple[CaseRecording, ...]
    sensor: str = "unknown"
    sensor_m: dict[str, Vector] | None = None
    sensor_direction: dict[str, Vector] | None = None
    band_hz: tuple[float, float] = (20.0, 20_000.0)
    onset_s: float | None = None
    support: str = ""
    medium: str = "unknown"
    response_hz: tuple[float, float] | None = None
    warnings: tuple[str, ...] = ()
    states: dict[str, float] = field(default_factory=dict)


def read_case(folder: str | os.PathLike[str]) -> Case:
    """Read the case in a folder (or a case.json); audio may be missing.

    Raises
    ------
    FileError
        Names the file and its fault.
    """
    remedy = "mend that field; docs/reference/case.md describes the file"
    path = Path(folder)
    if path.is_dir():
        path = path / "case.json"
    with reading_file(path, "case", FileError, remedy):
        content = read_text(path, "case", FileError, remedy, 1 << 24)
        raw = decode_record(content, case_fields.CaseFile, f"case {path}", FileError, remedy, CASE_FORMAT)
        unread = unread_fields(content, case_fields.CaseFile, f"case {path}")
        if not raw.recordings:
            raise FileError(f"case {path} has no recordings", "list at least one strike")
        return _case(raw, path, unread)


def _case(raw: case_fields.CaseFile, path: Path, unread: tuple[str, ...]) -> Case:
    folder = path.parent
    clamps = raw.support.fixed if isinstance(raw.support, case_fields.Support) else ()
    for clamp in clamps:
        if clamp.object is not None and clamp.object not in raw.objects:
            raise FileError(f"case {path}: a clamp is on object '{clamp.object}'", "name a listed object")
    common = dimension_tolerance(raw.dimension_tolerance, f"case {path}: dimension_tolerance")
    objects = {name: _object(name, thing, folder, clamps, common) for name, thing in raw.objects.items()}
    only = next(iter(objects)) if len(objects) == 1 else None
    recordings = tuple(_read_recording(entry, i, objects, only, path) for i, entry in enumerate(raw.recordings))
    sensor = raw.sensor or case_fields.Sensor()
    low, high = raw.band_hz or (20.0, 20_000.0)
    if not 0 <= low < high:
        raise FileError(f"case {path}: band_hz is {low:g} to {high:g}", "give a low and a high frequency")
    places, directions = (_by_object(value, objects) for value in (sensor.position, sensor.direction))
    observed = _response(sensor)
    if raw.medium is not None and raw.medium not in MEDIA:
        unread = (
            *unread,
            f"case {path}: medium '{shorten(raw.medium)}' is not known (known: {', '.join(MEDIA)}): damping is "
            "fitted as a whole",
        )
    measured = raw.response_hz
    if measured is not None and not 0 <= measured[0] < measured[1]:
        raise FileError(
            f"case {path}: response_hz is {measured[0]:g} to {measured[1]:g}", "give a low and a high frequency"
        )
    where = _onset(raw.onset), _support_name(raw.support), medium_of(raw.medium, observed), measured
    return Case(
        raw.case or folder.name,
        folder,
        objects,
        recordings,
        observed,
        places,
        directions,
        (low, high),
        *where,
        unread,
        dict(raw.states),
    )


def medium_of(declared: str | None, sensor: str) -> str:
    """Return the medium that the object radiates into: "air", "none" or "unknown"."""
    # sensors of real objects: their recordings are in air where a case does not say otherwise
    in_air = ("velocity", "pressure")
    if declared is None:
        return "air" if sensor in in_air else "unknown"
    return declared if declared in MEDIA else "unknown"


def dimension_tolerance(given: float | None, name: str, default: float = DIMENSION_TOLERANCE) -> float:
    """Return the relative error of dimensions as given, or the default.

    Raises
    ------
    FileError
        It is out of range.
    """
    if given is None:
        return default
    most_tolerance = 0.2  # with a larger one the shape is unknown
    if not 0 <= given <= most_tolerance:
        raise FileError(
            f"{name} is {100 * given:g} %",
            f"give their relative standard error, 0 to {100 * most_tolerance:g} %; in a case.json 0.005 is 0.5 %",
        )
    return float(given)


def _object(
    name: str, thing: case_fields.Object, folder: Path, clamps: tuple[case_fields.Fixed, ...], tolerance: float
) -> CaseObject:
    fixed = tuple((*clamp.position, clamp.radius) for clamp in clamps if clamp.object in (None, name))
    mesh = inside(folder, thing.mesh) if thing.mesh is not None else None
    own = dimension_tolerance(thing.dimension_tolerance, f"object '{name}': dimension_tolerance", tolerance)
    guess = thing.elastic_guess
    constants = guess.youngs_modulus, guess.density, guess.poisson_ratio
    return CaseObject(name, mesh, LENGTH_UNITS[thing.units], thing.material, *constants, fixed, own)


def _read_recording(
    entry: case_fields.Recording, number: int, objects: dict[str, CaseObject], only: str | None, path: Path
) -> CaseRecording:
    where = f"case {path}: recording {number + 1}"
    name = entry.object or only or ("" if not objects else None)
    if name is None or (objects and name not in objects):
        raise FileError(
            f"{where} is of object '{entry.object}', which is not listed", f"use one of {', '.join(objects)}"
        )
    if entry.file is None and entry.features is None:
        raise FileError(f"{where} has neither file nor features", "give one of them")
    strike = entry.strike
    direction = strike.direction
    if direction is not None:
        length = math.sqrt(sum(x * x for x in direction))
        if not length > 0:
            raise FileError(f"{where}: the strike's direction is zero", "give the direction of the impulse")
        direction = (direction[0] / length, direction[1] / length, direction[2] / length)
    force = strike.force
    kept = (inside(path.parent, force.file), force.channel, force.newton_per_unit) if force is not None else None
    file = inside(path.parent, entry.file) if entry.file is not None else None
    struck = strike.position, direction, strike.impulse
    return CaseRecording(file, entry.features, name, entry.split, *struck, entry.channel, kept, entry.state)


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file that a case names.

    Raises
    ------
    FileError
        It is outside the folder, by name or by link.
    """
    name_bytes, path_bytes = 255, 4095  # of POSIX file systems
    if not name or "\0" in name or os.path.isabs(name) or "\\" in name:
        raise FileError(f"case names the file {name!r}", "name files inside the case's folder")
    if (
        max(len(part) for part in os.fsencode(name).split(b"/")) > name_bytes
        or len(os.fsencode(folder / name)) > path_bytes
    ):
        raise FileError(
            f"case names the file '{excerpt(name, 80)}' of {len(name)} characters",
            "give it a name that a disk can hold",
        )
    whole = os.path.realpath(folder / name)
    if not whole.startswith(os.path.join(os.path.realpath(folder), "")):
        raise FileError(
            f"case names the file '{name}', which lies outside its folder", "name files inside the case's folder"
        )
    return folder / name


def _by_object(value: dict[str, Vector] | Vector | None, objects: dict[str, CaseObject]) -> dict[str, Vector] | None:
    if value is None or isinstance(value, dict):
        return value
    return dict.fromkeys(objects or [""], value)


def _response(sensor: case_fields.Sensor) -> str:
    """Return the recorded quantity, by the declared response, else by the sensor's type."""
    for text in (sensor.response.lower(), sensor.type.lower()):
        if "velocity" in text or "vibromet" in text:
            return "velocity"
        if "pressure" in text or "microphone" in text:
            return "pressure"
        if ("sum" in text and "mode" in text) or "modal" in text:
            return "sum"
    return "unknown"


def _onset(value: Any) -> float | None:
    """Return a number of seconds, 0 for "sample 0" in words, else None."""
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, str) and "sample 0" in value.lower():
        return 0.0
    return None


def _support_name(support: case_fields.Support | str | None) -> str:
    if isinstance(support, case_fields.Support):
        return f"clamped at {format_count(len(support.fixed), 'place')}" if support.fixed else "free"
    return support or "not declared"
