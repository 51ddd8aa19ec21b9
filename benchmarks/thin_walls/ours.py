"""This project's modes of a body's surface, each in a process of its own: frequencies, processor time, peak memory."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from dataclasses import dataclass

import numpy as np

from benchmarks.thin_walls.bodies import BODIES
from benchmarks.thin_walls.reference import COUNT, Truth, pairs
from sonic_bullet.records import Array

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
LIMIT_S = 900.0
HUNDRED, TOP_HZ = 100, 10_000.0


@dataclass(frozen=True, slots=True, eq=False)
class Ours:
    """frequency_hz (m,), processor_s and peak_bytes of the process less those of its imports; note: the model's;
    error: why there are none.
    """

    frequency_hz: Array
    processor_s: float
    peak_bytes: int
    note: str
    error: str = ""


@dataclass(frozen=True, slots=True)
class Compared:
    """worst: largest relative error of the first fifteen; split: largest relative distance within a pair of the
    truth's, None where it has none.
    """

    worst: float
    split: float | None


def compared(frequency_hz: Array, truth: Truth, *, paired: bool) -> Compared:
    """Modes in ascending order against the truth's; fewer than it has: infinite error."""
    if len(frequency_hz) < len(truth.frequency_hz):
        return Compared(np.inf, None)
    ours = frequency_hz[: len(truth.frequency_hz)]
    split = [float(ours[k + 1] / ours[k] - 1) for k in pairs(truth.frequency_hz)] if paired else []
    return Compared(float(np.abs(ours / truth.frequency_hz - 1).max()), max(split) if split else None)


def measured(name: str, *, hundred: bool = False) -> Ours:
    """A body's modes by `sonic_bullet.modal.analyse`, without its cache, one process, one thread."""
    command = [sys.executable, "-m", "benchmarks.thin_walls.ours", name, *(["hundred"] if hundred else [])]
    ended = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
        env={**os.environ, **dict.fromkeys(THREADS, "1")},
    )
    if ended.returncode:
        return Ours(np.zeros(0), 0.0, 0, "", ended.stderr.strip()[-300:])
    said = json.loads(ended.stdout.splitlines()[-1])
    return Ours(np.array(said.pop("frequency_hz")), **said)


def _used() -> tuple[float, int]:
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in usage), max(u.ru_maxrss for u in usage) * 1024


def child(name: str, hundred: bool) -> None:
    """Print one body's answer as JSON."""
    from sonic_bullet.modal import analyse
    from sonic_bullet.records.errors import SonicBulletError

    body = BODIES[name]
    shape = body.shape()
    before, _ = _used()
    frequency: list[float] = []
    note = error = ""
    try:
        if hundred:
            model = analyse((shape,), body.material, to_hz=TOP_HZ, cache=None)
        else:
            model = analyse((shape,), body.material, count=COUNT, cache=None)
        frequency, note = model.freq_hz[:HUNDRED].tolist(), model.note
    except SonicBulletError as raised:
        error = f"{type(raised).__name__}: {raised}"
    after, peak = _used()
    print(
        json.dumps(
            {
                "frequency_hz": frequency,
                "processor_s": after - before,
                "peak_bytes": peak,
                "note": note,
                "error": error,
            }
        )
    )


if __name__ == "__main__":
    child(sys.argv[1], "hundred" in sys.argv[2:])
