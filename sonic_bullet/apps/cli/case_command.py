"""Command `case`: make a case.json, which `fit` and `diagnose` read, of a folder of recordings; and check one.

new     FOLDER, mesh, recordings, guess -> FOLDER/case.json     files from elsewhere are copied to it; recordings
        of several strikes are cut into takes where asked for; responses of UFF files become recordings
check   FOLDER -> what the case holds, and what of it is not read; or one line with its fault
schema  JSON Schema of case.json
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from sonic_bullet.apps.cli.hammer import StrikeFiles, part_force
from sonic_bullet.apps.cli.output import places, table, warn
from sonic_bullet.apps.cli.responses import UFF, ResponseTakes, with_responses, write_takes
from sonic_bullet.apps.cli.takes import cut_takes
from sonic_bullet.files import case_fields, read_channel, replace_file
from sonic_bullet.files.case_fields import CASE_FORMAT, LARGEST_NUMBER
from sonic_bullet.files.cases import LENGTH_UNITS, Case, read_case
from sonic_bullet.files.presets import load_material
from sonic_bullet.files.storage.json_records import record_schema
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.lab.fit.observation import check_strikes
from sonic_bullet.lab.fit.takes.usable_take import refuse_clipped, refuse_short
from sonic_bullet.lab.lines.onset import clipped_samples, span
from sonic_bullet.machine.leftovers import temporary_folder
from sonic_bullet.modal import read_mesh
from sonic_bullet.options.case import CaseOptions
from sonic_bullet.options.render import Point
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

RESPONSES = {"sum": "sum of modes", "pressure": "pressure", "velocity": "velocity"}
"""What case.json calls what was recorded."""


def run_case_new(folder: str, recordings: Sequence[str], options: CaseOptions) -> None:
    """Run `case new`: write case.json and copy files from elsewhere, whole or not at all, without overwriting.

    Raises SonicBulletError.
    """
    split, hold_out, mesh, units = options.split, options.hold_out, options.mesh, options.units
    force_channel, force_newton = options.force_channel, options.force_newton
    sensor, sensor_at, sensor_direction = options.sensor, options.sensor_at, options.sensor_direction
    _check_options(options)
    drawing = _find_picture_path(options.picture, split)
    place = _new_place(folder)
    sounds = [Path(name) for name in recordings] or _inside(place)
    universal = bool(sounds) and all(sound.suffix.lower() in UFF for sound in sounds)
    _check_recordings(folder, sounds, "--split" if split else "" if force_channel is None else "--force-channel")
    if sensor != "velocity" and (sensor_at or sensor_direction) and not universal:
        raise FileError(
            f"--sensor-at or --sensor-direction is given, but --sensor is {sensor}",
            "give --sensor velocity, or leave it out",
        )
    if mesh is not None:
        read_mesh(mesh, LENGTH_UNITS[units])
    thing = _object(mesh, units, options.material)
    with temporary_folder() as takes:
        if split:
            sounds, rows = cut_takes(sounds, takes, force_channel, drawing)
            print(table(("take", "at", "length", "peak", ""), rows))
        struck: list[StrikeFiles] = []
        made: ResponseTakes | None = None
        if force_channel is not None:
            struck, rows = part_force(sounds, force_channel, force_newton, takes)
            sounds = [take.sound for take in struck]
            print(table(("force", "impulse", "peak", "contact", ""), rows))
        elif universal:
            made = write_takes(sounds, takes)
            sounds = list(made.sounds)
            warn(made.warnings)
            print(table(("take", "struck at", "measured at", "of", ""), made.rows))
        elif not split:
            for sound in sounds:
                warn(_doubts(sound))
        forces = [take.force for take in struck]
        name_of = _names(place, [*sounds, *forces, *([Path(mesh)] if mesh is not None else [])])
        if mesh is not None:
            thing["mesh"] = name_of[Path(mesh)]
        case = _case_json(
            place, [name_of[s] for s in sounds], thing, RESPONSES[sensor], sensor_at, sensor_direction, options.medium
        )
        if made is not None:
            case = with_responses(case, made, sensor_at, sensor_direction)
        for recording, take in zip(case["recordings"], struck, strict=False):
            force = {"file": name_of[take.force], "channel": 0, "newton_per_unit": force_newton}
            recording["strike"] = recording["strike"] | {"impulse": take.impulse_n_s, "force": force}
        for recording in case["recordings"][hold_out - 1 :: hold_out] if hold_out is not None else []:
            recording["split"] = "holdout"
        _write_case(place, name_of, case)
    of = "" if mesh is None else f" of {thing['mesh']}"
    print(f"{place / 'case.json'}: {format_count(len(sounds), 'recording')}{of}")
    _say_missing(case, force_newton)
    if mesh is None and made is None:
        print(
            "without a mesh 'fit' gives lines that a preset plays, but no E/ρ, no Poisson's ratio and no other shape: "
            "name it with --mesh and --material"
        )


def _find_picture_path(picture: str | None, split: bool) -> Path | None:
    """Return the picture's path; raises FileError."""
    if picture is not None and not (split and picture.endswith((".png", ".pdf", ".svg"))):
        wrong = "pictures are .png, .pdf or .svg" if split else "there is nothing to draw without --split"
        raise FileError(f"cannot write {picture}: {wrong}", "end the name with .png, and give --split too")
    (drawing,) = places(picture)
    return Path(drawing) if drawing else None


def _new_place(folder: str) -> Path:
    """Return the case's folder, which may exist without a case.json; raises FileError."""
    place = Path(folder)
    if place.exists() and not place.is_dir():
        raise FileError(f"{folder} is no folder", "name the case's folder first, then its files")
    if (place / "case.json").exists():
        raise FileError(f"{place / 'case.json'} is there already", "name another folder, or move it away")
    return place


def _check_recordings(folder: str, sounds: Sequence[Path], option: str) -> None:
    """Raise FileError where there are none, or UFF files among audio or with an option that cuts audio."""
    if not sounds:
        raise FileError(f"{folder} holds no recordings", "name them: --recordings a.wav b.wav")
    responses = [sound for sound in sounds if sound.suffix.lower() in UFF]
    if responses and (option or len(responses) < len(sounds)):
        raise FileError(
            f"{responses[0]} beside {option or 'audio'}",
            "responses of a UFF file are cut already, and per force; make a case of them alone",
        )


def _say_missing(case: dict[str, Any], force_newton: float | None) -> None:
    """Print what of the strikes is to be filled in, if anything."""
    strikes = [recording["strike"] for recording in case["recordings"]]
    where = any(strike["position"] is None for strike in strikes)
    hard = force_newton is None and any(strike["impulse"] is None for strike in strikes)
    if missing := " and ".join(["where"] * where + ["how hard"] * hard):
        fields = ", ".join(["strike.position in m"] * where + ["strike.impulse in N·s"] * hard)
        print(f"now say {missing} each strike was: {fields}, or null")


def _check_options(options: CaseOptions) -> None:
    """Raise FileError where an option of `case new` is out of range or lacks another."""
    hold_out, force_channel, force_newton = options.hold_out, options.force_channel, options.force_newton
    if hold_out is not None and hold_out < 2:
        raise FileError(f"--hold-out is {hold_out}", "give 2 or more: some takes are to be fitted")
    if force_newton is not None and (force_channel is None or not 0 < force_newton <= LARGEST_NUMBER):
        raise FileError(
            f"--force-newton is {force_newton:g}" + " without --force-channel" * (force_channel is None),
            f"name the force's channel, counted from 0, and newton at full scale, above 0, at most {LARGEST_NUMBER:g}",
        )
    if options.mesh is not None and options.material is None:
        raise FileError(
            "--material missing", "a shape needs a guess of what it is made of; 'sonic-bullet materials' lists names"
        )


def _inside(place: Path) -> list[Path]:
    """List the recordings in a folder: audio, or UFF files where there is none."""
    files = sorted(place.glob("*"))
    for suffixes in (AUDIO_FORMATS, UFF):
        if found := [file for file in files if file.suffix.lower() in suffixes]:
            return found
    return []


def _doubts(sound: Path) -> list[str]:
    """List what is unusual about a recording; raises FileError, AudioError."""
    signal, sr, which = read_channel(sound)
    clipped, hits = clipped_samples(signal), span(signal, sr).hits
    many = format_count(clipped, "sample is", "samples are")
    doubts = [f"{sound}: {which}"] * bool(which) + [f"{sound}: {many} clipped: 'fit' refuses that"] * bool(clipped)
    return doubts + [f"{sound} holds {hits} hits: --split cuts it into takes"] * (hits > 1)


def _object(mesh: str | None, units: str, material: str | None) -> dict[str, Any]:
    """Describe the case's object, without the mesh's name; empty where it is unknown; raises MaterialError."""
    if material is None:
        return {}

    guess = load_material(material)
    constants = {"youngs_modulus": guess.youngs_pa, "density": guess.density_kg_m3, "poisson_ratio": guess.poisson}
    return {
        "mesh": None,
        "units": units,
        "material": guess.name,
        "elastic_guess": {key: float(f"{value:.6g}") for key, value in constants.items()},
        "dimension_tolerance": None,
    }


def _names(place: Path, files: Sequence[Path]) -> dict[Path, str]:
    """Map each file to its name inside the folder, its own or its copy's; FileError where two would be one."""
    inner = os.path.realpath(place)
    named: dict[Path, str] = {}
    for file in files:
        whole = os.path.realpath(file)
        at_home = whole.startswith(os.path.join(inner, ""))
        name = Path(os.path.relpath(whole, inner)).as_posix() if at_home else file.name
        if name in named.values() and named.get(file) != name:
            raise FileError(f"two files would be called {name} in {place}", "give each a name of its own")
        if not at_home and (place / name).exists():
            raise FileError(
                f"{place / name} is there already, and {file} is another file",
                "name the one inside the folder, or rename one",
            )
        named[file] = name
    return named


def _case_json(
    place: Path,
    sounds: Sequence[str],
    thing: dict[str, Any],
    response: str,
    sensor_at: Point | None,
    sensor_direction: Point | None,
    medium: str | None,
) -> dict[str, Any]:
    """Return the content of case.json: every field that a user may fill in, null where unknown."""
    strike = {"position": None, "direction": None, "impulse": None}
    of = {"object": "object"} if thing else {}
    return {
        "format": CASE_FORMAT,
        "case": Path(os.path.realpath(place)).name,
        "objects": {"object": thing} if thing else {},
        "support": {"fixed": []},
        "sensor": {"response": response, "position": sensor_at, "direction": sensor_direction},
        "medium": medium,
        "band_hz": [20, 20_000],
        "onset": None,
        "recordings": [{"file": name, **of, "split": "fit", "channel": None, "strike": strike} for name in sounds],
    }


def _write_case(place: Path, name_of: dict[Path, str], case: dict[str, Any]) -> None:
    """Copy files from elsewhere, then write case.json; an error removes all of it; raises FileError."""
    made: list[Path] = []
    fresh = not place.exists()
    try:
        try:
            place.mkdir(exist_ok=True)
        except OSError as error:
            raise FileError(f"cannot make the folder {place}: {error.strerror or error}", "choose another") from error
        for file, name in name_of.items():
            if not (place / name).exists():
                made.append(place / name)
                with file.open("rb") as source, replace_file(place / name) as target:
                    shutil.copyfileobj(source, target)
        with replace_file(place / "case.json") as target:
            target.write(json_bytes(case, indent=2))
        read_case(place)
    except BaseException:
        for path in (*made, place / "case.json"):
            with suppress(OSError):
                path.unlink(missing_ok=True)
        if fresh:
            with suppress(OSError):
                place.rmdir()
        raise


def run_case_check(folder: str) -> None:
    """Run `case check`: print what a case holds; raise SonicBulletError where `fit` would stop."""
    case = read_case(folder)
    warn(case.warnings)
    rows = [_object_row(case, name) for name in case.objects]
    missing = 0
    for recording in case.recordings:
        if recording.file is None:
            continue
        if not recording.file.is_file() and recording.split != "fit":
            missing += 1
            continue
        sound, sr, which = read_channel(recording.file, recording.channel)
        if recording.split == "fit":
            refuse_clipped(sound, recording.file.name)
            refuse_short(len(sound), sr, recording.file.name)
        warn([f"{recording.file.name}: {which}"] if which else [])
    splits = [r.split for r in case.recordings]
    listed = ", ".join(f"{splits.count(name)} {name}" for name in dict.fromkeys(splits))
    print(f"{case.name}: {format_count(len(case.recordings), 'strike')} ({listed}), recorded as {case.sensor}")
    if rows:
        print(table(("object", "mesh", "size in mm", "guess", "strikes placed"), rows))
    if missing:
        which = format_count(missing, "recording that is not fitted is", "recordings that are not fitted are")
        print(f"{which} not there: the sound can be predicted, not compared")


def _object_row(case: Case, name: str) -> tuple[str, str, str, str, str]:
    """Return an object's row of the table; raises SonicBulletError."""
    from sonic_bullet.files.presets import load_material, material_names

    thing = case.objects[name]
    size, mine = "-", [r.position_m for r in case.recordings if r.object == name]
    if thing.mesh is not None:
        shape = read_mesh(thing.mesh, thing.scale)
        check_strikes(shape, mine)
        vertex = shape.vertex_m
        size = " × ".join(f"{1000 * side:.4g}" for side in vertex.max(axis=0) - vertex.min(axis=0))
    whole = None not in (thing.youngs_pa, thing.density_kg_m3, thing.poisson)
    if thing.material is not None and not (whole and thing.material.lower() not in material_names()):
        load_material(thing.material)
    elif not whole:
        raise FileError(
            f"object '{name}' has neither a material nor all of elastic_guess",
            "name a guess; 'sonic-bullet materials' lists all",
        )
    placed = f"{len(mine) - mine.count(None)} of {len(mine)}"
    return name, "-" if thing.mesh is None else thing.mesh.name, size, thing.material or "elastic_guess", placed


def run_case_schema() -> None:
    """Run `case schema`."""
    print(json_bytes(record_schema(case_fields.CaseFile, CASE_FORMAT), indent=2).decode(), end="")
