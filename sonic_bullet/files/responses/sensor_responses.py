"""Frequency response of a sensor from a file: a table of frequencies and magnitudes, or a FIR filter as audio.

.csv, .txt: rows of Hz and factor        .wav, .flac, …: taps of one channel -> |FFT|        -> SensorResponse
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from sonic_bullet.files.recordings import read_audio
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records import Array, SensorResponse
from sonic_bullet.records.coerce import as_path
from sonic_bullet.records.errors import FileError

RESPONSE_REMEDY = "give rows of a frequency in Hz and a factor, or a FIR filter as a sound file"


def read_response(path: str | os.PathLike[str]) -> SensorResponse:
    """Read the magnitude response of a sensor; its phase is the least that this magnitude can have.

    Raises
    ------
    FileError
        The file cannot be read, or holds no response.
    """
    tables = (".csv", ".txt", ".tsv")
    name = as_path(path, "path", "name a table (.csv) or a sound file (.wav)")
    if Path(name).suffix.lower() in tables:
        with reading_file(name, "sensor response", FileError, RESPONSE_REMEDY):
            table = _table(Path(name).read_text(encoding="utf-8"), name)
        return _response(table[:, 0], table[:, 1], name)
    taps, sr = read_audio(name)
    if len(taps) != 1:
        raise FileError(f"{name} has {len(taps)} channels, and a filter has one", RESPONSE_REMEDY)
    least_taps = 1024  # a short filter's spectrum is taken at as many points as of one so long
    size = max(least_taps, taps.shape[1])
    return _response(np.fft.rfftfreq(size, 1 / sr)[1:], np.abs(np.fft.rfft(taps[0], size))[1:], name)


def _table(text: str, name: str) -> Array:
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.replace(";", " ").replace(",", " ").replace("\t", " ").split()
        try:
            row = [float(word) for word in words[:2]]
        except ValueError:
            if rows:
                raise FileError(f"{name}:{number}: no row of numbers", RESPONSE_REMEDY) from None
            continue  # a heading
        if words and len(row) < 2:
            raise FileError(f"{name}:{number}: one number", RESPONSE_REMEDY)
        if words:
            rows.append(row)
    if not rows:
        raise FileError(f"{name} holds no row of numbers", RESPONSE_REMEDY)
    return np.array(rows)


def _response(freq_hz: Array, magnitude: Array, name: str) -> SensorResponse:
    with reading_file(name, "sensor response", FileError, RESPONSE_REMEDY):
        return SensorResponse(freq_hz, magnitude)
