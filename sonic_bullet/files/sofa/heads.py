"""Heads from SOFA files (AES69): responses of two ears by direction.

    FILE.sofa -> sofar (checks conventions) -> SourcePosition, Data.IR, Data.Delay, Data.SamplingRate -> Head

SourcePosition is spherical (azimuth to the left, elevation up, in degrees, m) or cartesian (x ahead, y left, z up, m)
[AES69-2022, 4.5]. Of responses measured at several distances the farthest of each direction counts. Data.Delay goes
into the responses, in whole samples and the rest by a band-limited shift.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.records import Array, Head
from sonic_bullet.records.coerce import as_path
from sonic_bullet.records.errors import FileError
from sonic_bullet.records.regular_files import check_regular
from sonic_bullet.signal.short_time import filter_circular


def read_head(path: str | os.PathLike[str]) -> Head:
    """Read the head of a SOFA file.

    Raises FileError where it cannot be read, holds no responses of two ears by direction, or sofar is missing.
    """
    extra = "pip install 'sonic_bullet[head]'"
    name = as_path(path, "path", "name a head's file (.sofa)")
    check_regular(name, "give a head as a SOFA file (.sofa)")
    try:
        import sofar
    except ImportError:
        raise FileError(f"cannot read {name}: sofar is not installed", extra) from None
    try:
        found = sofar.read_sofa(name, verify=False, verbose=False)
    except Exception as error:  # whatever sofar, netCDF and HDF5 raise
        said = str(error).splitlines() or [type(error).__name__]
        raise FileError(f"cannot read {name}: no SOFA file ({said[0][:120]})", "give a head as a SOFA file") from None
    return _head(found, name)


def _head(found: Any, name: str) -> Head:
    conventions = ("SimpleFreeFieldHRIR", "GeneralFIR", "GeneralFIR-E", "FreeFieldHRIR")
    convention = str(getattr(found, "GLOBAL_SOFAConventions", ""))
    response = getattr(found, "Data_IR", None)
    if convention not in conventions or response is None:
        raise FileError(
            f"{name} holds no head's impulse responses but {convention or 'no convention'}",
            f"give a SOFA file of one of {', '.join(conventions)}",
        )
    response = np.array(response, float)
    if response.ndim != 3 or response.shape[1] != 2:
        ears = response.shape[1] if response.ndim > 1 else 0
        raise FileError(f"{name} has responses of {ears} receivers, not of two ears", "give the file of a head")
    if not np.isfinite(response).all():
        raise FileError(f"{name} has responses with NaN or infinite numbers", "give a whole file")
    away = _cartesian(np.atleast_2d(np.array(found.SourcePosition, float)), str(found.SourcePosition_Type), name)
    away = np.broadcast_to(away, (len(response), 3)) if len(away) == 1 else away
    rate = np.ravel(np.array(found.Data_SamplingRate, float))
    if len(away) != len(response) or not rate.size or not np.isfinite(rate[0]) or not 1000 <= rate[0] <= 1e6:
        raise FileError(f"{name} lacks the direction or the rate of its responses", "give a whole file")
    delay = np.array(getattr(found, "Data_Delay", np.zeros((1, 2))), float)
    delay = np.broadcast_to(np.atleast_2d(delay), (len(response), 2))
    keep = _farthest(away)
    return Head(away[keep], _delay_responses(response[keep], delay[keep]), round(float(rate[0])), Path(name).name)


def _cartesian(position: Array, kind: str, name: str) -> Array:
    if position.shape[-1] != 3 or not np.isfinite(position).all():
        raise FileError(f"{name} has no positions of its sources", "give a whole file")
    if kind.lower() == "cartesian":
        return position
    azimuth, elevation = np.radians(position[:, 0]), np.radians(position[:, 1])
    radius = np.where(position[:, 2] > 0, position[:, 2], 1.0)
    unit = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    return np.asarray(radius[:, None] * unit)


def _farthest(away: Array) -> Array:
    """Pick of each direction (d, 3) the one farthest away, in the order of the file."""
    length = np.linalg.norm(away, axis=1)
    if not (length > 0).all():
        return np.flatnonzero(length > 0)
    key = np.round(away / length[:, None], 6) + 0.0
    best: dict[tuple[float, ...], int] = {}
    for i, one in enumerate(map(tuple, key.tolist())):
        if one not in best or length[i] > length[best[one]]:
            best[one] = i
    return np.array(sorted(best.values()))


def _delay_responses(response: Array, delay: Array) -> Array:
    """Delay responses (d, 2, n) by delays (d, 2) in samples."""
    if not delay.any():
        return response
    size = response.shape[2] + int(np.ceil(delay.max())) + 16
    turn = np.exp(-2j * np.pi / size * delay[..., None] * np.arange(size // 2 + 1))
    whole = np.zeros((*response.shape[:2], size))
    exact = delay == np.round(delay)
    shifted = filter_circular(response, turn, size)
    for i, ear in zip(*np.nonzero(exact), strict=True):
        at = int(delay[i, ear])
        whole[i, ear, at : at + response.shape[2]] = response[i, ear]
    whole[~exact] = shifted[~exact]
    return whole
