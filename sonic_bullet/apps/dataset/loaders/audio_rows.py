"""Sound in rows of 1/60 s, the frames of a robot's camera: a layout whose rows hold a frame of all that was observed.

sound (channels, n) -> (channels, rows, sr/60), the last row filled up with zeros
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files import read_audio
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

ROWS_PER_S = 60


def count_rows(labels: Mapping[str, Any]) -> int:
    """Return how many rows a sample has."""
    sr = int(labels["sr"])
    return -(-int(labels["seconds"] * sr + 0.5) * ROWS_PER_S // sr)


def one_kind(name: str, labels: Iterable[Mapping[str, Any]]) -> tuple[int, int] | None:
    """Return the rate in Hz and the number of channels that all samples share; None: there is no sample.

    Parameters
    ----------
    name
        Of the layout, for the message.

    Raises
    ------
    FileError
        They differ, or a row is no whole number of samples.
    """
    kinds = {(int(one["sr"]), int(one["channels"])) for one in labels}
    if not kinds:
        return None
    if len(kinds) > 1:
        listed = ", ".join(f"{channels} at {sr} Hz" for sr, channels in sorted(kinds))
        raise FileError(f"{name} holds one rate and number of channels; these are {listed}", "choose another format")
    ((sr, channels),) = kinds
    if sr % ROWS_PER_S:
        raise FileError(f"{name} has {ROWS_PER_S} rows a second, which {sr} Hz does not fill", "make it at --sr 48000")
    return sr, channels


def audio_rows(path: Path, sr: int) -> Array:
    """Read a sound file as rows (channels, rows, sr/60), float32 pascals."""
    sound, _ = read_audio(path)
    width = sr // ROWS_PER_S
    count = -(-sound.shape[1] // width)
    padded = np.zeros((len(sound), count * width), np.float32)
    padded[:, : sound.shape[1]] = sound
    return padded.reshape(len(sound), count, width)
