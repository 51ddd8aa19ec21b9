"""Files of a set -> their damped sinusoids, found once and kept: the extraction is what costs.

channel c of seconds s after t -> jittered, in all readings but the first -> sonic_bullet.estimator.features.extract ->
Features, in CACHE/<digest of samples, arguments and code>.npz

The code that finds them is part of the name: lines that an older version found were once taken for today's. Where a
recording is not a sum of a few decays, a search for them may end elsewhere for an error in the last bit, on another
processor say: what is said of a set must stand in all READINGS.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet import estimator
from sonic_bullet.estimator.lines.extraction import extract
from sonic_bullet.estimator.lines.line_values import Features
from sonic_bullet.modal.keys import code_digest, key

Array = np.ndarray[Any, Any]
READINGS = 3
# of each sample: a hundredth of the last bit of 24 at full scale, and millions of times what rounding does
JITTER = 1e-9
ARRAYS = tuple(f.name for f in fields(Features) if f.name not in ("onset_s", "noise_dbfs", "sr", "note"))


_reading: ContextVar[int] = ContextVar("reading", default=0)


@contextmanager
def reading(number: int) -> Iterator[None]:
    """Everything read while this lasts is read for the number-th time; 0: as it was recorded."""
    before = _reading.set(number)
    try:
        yield
    finally:
        _reading.reset(before)


def jittered(signal: Array) -> Array:
    """Samples as this reading has them, each off by JITTER of itself."""
    number = _reading.get()
    return signal * (1 + JITTER * np.random.default_rng(number).standard_normal(signal.shape)) if number else signal


def cache() -> Path:
    """Where features are kept: SONIC_BULLET_MEASURED_CACHE, or a folder among the temporary ones."""
    return Path(os.environ.get("SONIC_BULLET_MEASURED_CACHE", Path(tempfile.gettempdir()) / "sonic-bullet-measured"))


@lru_cache(maxsize=4)
def audio(path: Path) -> tuple[Array, int]:
    """Samples (n, channels) and rate. Raises OSError (soundfile's own errors are RuntimeError)."""
    import soundfile

    found, sr = soundfile.read(path, always_2d=True)
    return found, int(sr)


def cut(path: Path, channel: int = 0, start_s: float = 0.0, seconds: float | None = None) -> tuple[Array, int]:
    """Samples (n,) of one channel from start_s on, and the rate."""
    whole, sr = audio(path)
    first = max(round(start_s * sr), 0)
    last = len(whole) if seconds is None else first + round(seconds * sr)
    return jittered(np.ascontiguousarray(whole[first:last, channel])), sr


def _code() -> bytes:
    return code_digest(tuple(sorted(Path(estimator.__file__).parent.glob("*.py"))), ("numpy", "scipy", "numba"))


def features(
    signal: Array, sr: int, *, onset_s: float | None = None, band_hz: tuple[float, float] | None = None
) -> Features:
    """`extract`, once. Raises AudioError."""
    text = key("lines", np.ascontiguousarray(signal), sr, onset_s, repr(band_hz), code=_code())
    place = cache() / f"{text}.npz"
    if place.is_file():
        with np.load(place, allow_pickle=False) as kept:
            return Features(
                **{n: kept[n] for n in ARRAYS},
                onset_s=float(kept["onset_s"]),
                noise_dbfs=float(kept["noise_dbfs"]),
                sr=sr,
                note=str(kept["note"]),
            )
    found = extract(signal, sr, onset_s=onset_s, band_hz=band_hz)
    place.parent.mkdir(parents=True, exist_ok=True)
    part = place.with_name(f"{text}-{os.getpid()}.npz")
    np.savez(
        part,
        **{n: getattr(found, n) for n in ARRAYS},
        onset_s=found.onset_s,
        noise_dbfs=found.noise_dbfs,
        note=np.array(found.note),
    )
    part.replace(place)
    return found


def lines(
    path: Path,
    *,
    channel: int = 0,
    start_s: float = 0.0,
    seconds: float | None = None,
    onset_s: float | None = None,
    band_hz: tuple[float, float] | None = None,
) -> Features:
    """Features of a part of a file. Raises AudioError, OSError."""
    signal, sr = cut(path, channel, start_s, seconds)
    return features(signal, sr, onset_s=onset_s, band_hz=band_hz)
