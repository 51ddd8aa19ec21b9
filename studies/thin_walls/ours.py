"""This project's modes of a body's surface, each in a process of its own: frequencies, processor time, peak memory."""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.records import Array, Shape
from studies.thin_walls.bodies import BODIES, SOLID
from studies.thin_walls.reference import Truth, pairs

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
NEAR = 0.02  # where the two of a pair are looked for
LIMIT_S = 900.0
DENT = 3e-3
HUNDRED, TOP_HZ = 100, 10_000.0


@dataclass(frozen=True, slots=True, eq=False)
class Ours:
    """frequency_hz (m,), processor_s of the analysis, peak_bytes of its process and its children; note: the model's;
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
    truth's, None where it has none; told: the error that the note tells, of elements and facets, None where it tells
    none; bounded: how many of the fifteen are no farther off than that and the truth's own change.
    """

    worst: float
    split: float | None
    told: float | None
    bounded: int


def compared(found: Ours, truth: Truth, *, paired: bool) -> Compared:
    """Modes in ascending order against the truth's; fewer than it has: infinite error."""
    told = re.search(r"error up to \d+ Hz (?:about|under) ([\d.e-]+) %", found.note)
    facets = re.search(r"facets change frequencies by up to ([\d.e-]+) %", found.note)
    bound = (float(told[1]) + (float(facets[1]) if facets else 0.0)) / 100 if told else None
    if len(found.frequency_hz) < len(truth.frequency_hz):
        return Compared(np.inf, None, bound, 0)
    ours = found.frequency_hz[: len(truth.frequency_hz)]
    split = [_apart(ours, float(truth.frequency_hz[k])) for k in pairs(truth.frequency_hz)] if paired else []
    off = np.abs(ours / truth.frequency_hz - 1)
    bounded = int((off <= bound + truth.change).sum()) if bound is not None else 0
    return Compared(float(off.max()), max(split) if split else None, bound, bounded)


def _apart(ours: Array, pair_hz: float) -> float:
    """How far the two of ours that are a pair near pair_hz lie apart: another mode may have changed places with it."""
    near = np.flatnonzero(np.abs(ours[:-1] / pair_hz - 1) < NEAR)
    return float((ours[near + 1] / ours[near] - 1).min()) if len(near) else np.inf


def measured(name: str, **options: float | bool) -> Ours:
    """A body's modes by `sonic_bullet.modal.analyse`, called with these options, without its cache, one process, one
    thread. ``dented``: one corner moved by `DENT` of its distance from the middle, so that it is round no more.
    """
    command = [sys.executable, "-m", "studies.thin_walls.ours", name, json.dumps(options)]
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


def hundred(name: str) -> Ours:
    """The first 100 modes or those up to 10 kHz, whichever are fewer."""
    up_to = measured(name, to_hz=TOP_HZ)
    return measured(name, count=HUNDRED) if len(up_to.frequency_hz) > HUNDRED else up_to


def _used() -> tuple[float, int]:
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in usage), max(u.ru_maxrss for u in usage) * 1024


def dented(shape: Shape) -> Shape:
    """Return a mesh with the corner that is farthest from its middle moved outward."""
    vertex_m = shape.vertex_m.copy()
    from_middle = vertex_m - vertex_m.mean(axis=0)
    farthest = np.linalg.norm(from_middle, axis=1).argmax()
    vertex_m[farthest] += DENT * from_middle[farthest]
    return replace(shape, vertex_m=vertex_m)


def child(name: str, options: dict[str, Any]) -> None:
    """Print one body's answer as JSON."""
    from sonic_bullet.modal import analyse
    from sonic_bullet.records.errors import SonicBulletError

    body = {**BODIES, SOLID.name: SOLID}[name]
    shape = dented(body.shape()) if options.pop("dented", False) else body.shape()
    before, _ = _used()
    frequency: list[float] = []
    note = error = ""
    try:
        model = analyse((shape,), body.material, cache=None, **options)
        frequency, note = model.freq_hz.tolist(), model.note
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
    child(sys.argv[1], json.loads(sys.argv[2]))
