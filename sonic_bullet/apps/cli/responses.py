"""Convert responses of UFF files to takes of a case: a recording each, with place and direction of its strike.

responses -> those of one sensor, as a case has one -> recordings (impulse_response.py), one common factor
    -> NAME-01.wav and so on, strike {place, direction, impulse}, sensor, onset, band

Responses per force are written as struck with J N·s, J such that the loudest take peaks at half of full scale: then
files are in m/s or Pa. For responses at many points to one exciter, both ends are exchanged: H_ij = H_ji of motion.
[Maxwell-Betti]
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files import write_audio
from sonic_bullet.files.case_fields import LARGEST_NUMBER
from sonic_bullet.files.uff.impulse_response import as_period, measured_band
from sonic_bullet.files.uff.reader import Freedom, Point, Response, read_uff
from sonic_bullet.records.errors import FileError

UFF = frozenset({".uff", ".unv"})


@dataclass(frozen=True, slots=True)
class ResponseTakes:
    """Takes made of UFF files: sounds and strikes (JSON) in order, a row a take, and the case's fields.

    warnings: one line each.
    """

    sounds: tuple[Path, ...]
    strikes: tuple[dict[str, Any], ...]
    rows: tuple[tuple[str, ...], ...]
    response: str
    sensor: Freedom
    onset: str | None
    band_hz: tuple[float, float]
    response_hz: tuple[float, float] | None
    warnings: tuple[str, ...]


def write_takes(files: Sequence[Path], to: Path) -> ResponseTakes:
    """Write the takes of UFF files to a folder.

    Parameters
    ----------
    files : sequence of Path
        Of one object and one kind of response.
    to : Path
        Folder for the takes.

    Returns
    -------
    ResponseTakes
        The files written, and fields for a case.

    Raises
    ------
    FileError
        A file cannot be read or holds nothing that is understood.
    """
    read = {file: read_uff(file) for file in files}
    warnings = [f"{file}: {note}" for file, one in read.items() for note in one.notes]
    every = [(file, response) for file, one in read.items() for response in one.responses]
    kept, turned = _of_one_sensor([response for _, response in every])
    if len(kept) < len(every):
        warnings.append(
            f"{len(every) - len(kept)} of {len(every)} responses are left out: a case has one sensor, and they have "
            "another, or are of another kind"
        )
    chosen = [(file, response) for file, response in every if any(response is one for one in kept)]
    recordings = [as_period(response) for _, response in chosen]
    loudest = max(float(np.abs(sound).max()) for sound, _, _ in recordings)
    if not loudest > 0:
        raise FileError(f"{files[0]} holds zeros alone", "export what was measured")
    first = kept[0]
    response_peak = 0.5
    impulse = min(float(f"{response_peak / loudest:.5g}"), LARGEST_NUMBER) if first.per_force else None
    low, high = max(low for _, _, (low, _) in recordings), min(high for _, _, (_, high) in recordings)
    sounds, strikes, rows = [], [], []
    number: dict[Path, int] = defaultdict(int)
    for (file, response), (sound, sr, _) in zip(chosen, recordings, strict=True):
        number[file] += 1
        path = to / f"{file.stem}-{number[file]:02d}.wav"
        write_audio(path, sound * (impulse or 1.0), sr, full_scale_pa=None, subtype="FLOAT")
        strike, sensor = (response.sensor, response.strike) if turned else (response.strike, response.sensor)
        sounds.append(path)
        strikes.append({"position": strike.position_m, "direction": strike.direction, "impulse": impulse})
        rows.append(
            (path.name, _place(strike), _place(sensor), response.quantity, _describe_conversion(response, turned))
        )
    return ResponseTakes(
        tuple(sounds),
        tuple(strikes),
        tuple(rows),
        "pressure" if first.quantity == "pressure" else "velocity",
        first.strike if turned else first.sensor,
        "sample 0: responses to an impulse" if first.per_force else None,
        measured_band((low, high)) if first.spectral else (low, high),
        (low, high) if first.spectral else None,
        tuple(warnings),
    )


def with_responses(
    case: dict[str, Any], made: ResponseTakes, sensor_at: Point | None, sensor_direction: Point | None
) -> dict[str, Any]:
    """Return the case with the fields of its UFF files; options of the sensor take precedence."""
    surface = made.response == "velocity"
    sensor = {
        "response": made.response,
        "position": sensor_at or (made.sensor.position_m if surface else None),
        "direction": sensor_direction or (made.sensor.direction if surface else None),
    }
    recordings = [
        recording | {"strike": strike} for recording, strike in zip(case["recordings"], made.strikes, strict=True)
    ]
    said = {"sensor": sensor, "onset": made.onset, "band_hz": list(made.band_hz)}
    measured = {"response_hz": list(made.response_hz)} if made.response_hz is not None else {}
    return case | said | measured | {"recordings": recordings}


def _of_one_sensor(responses: list[Response]) -> tuple[list[Response], bool]:
    """Find the largest group of responses that one sensor can have recorded, and whether its ends are exchanged."""
    groups: dict[tuple[Any, ...], list[Response]] = defaultdict(list)
    for response in responses:
        pressure = response.quantity == "pressure"
        kind = pressure, response.per_force, response.spectral
        groups[(False, *kind, response.sensor)].append(response)
        if response.per_force and not pressure and response.strike.node:
            groups[(True, *kind, response.strike)].append(response)
    best = max(groups, key=lambda key: (len(groups[key]), not key[0]))
    return groups[best], bool(best[0])


def _place(freedom: Freedom) -> str:
    """Format a node with its direction and position."""
    if not freedom.node:
        return "not said"
    axis = f" {'+-'[freedom.axis < 0]}{'XYZ'[abs(freedom.axis) - 1]}" if freedom.axis else ""
    place = "" if freedom.position_m is None else " (" + ", ".join(f"{x:.4g}" for x in freedom.position_m) + ") m"
    return f"node {freedom.node}{axis}{place}"


def _describe_conversion(response: Response, turned: bool) -> str:
    """Describe the conversion of a response."""
    change = {"acceleration": "integrated to velocity", "displacement": "derived to velocity"}
    parts = [change.get(response.quantity, ""), "exciter and sensor change places" * turned]
    return "; ".join(filter(None, parts))
