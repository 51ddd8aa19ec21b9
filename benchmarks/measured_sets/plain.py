"""A set of unknown kind: every second line of each file is fitted, the others predicted, and the files among
themselves.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.laws import draw, joined, validated
from benchmarks.measured_sets.observed import lines
from benchmarks.measured_sets.values import Lines, Outcome, clear

MOST_FILES = 6
SECONDS = 1.5


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    """Decays alone. Raises ValueError where no file can be read or there are too few lines."""
    bodies, skipped = {}, []
    for entry in case.get("files", [])[:MOST_FILES]:
        try:
            begin = float(entry.get("t_hit_s", 0.0))
            bodies[entry["file"]] = clear(lines(folder / entry["file"], start_s=begin, seconds=SECONDS, onset_s=0.0))
        except Exception as error:  # one file less: the others are judged
            skipped.append(f"{entry.get('file', 'a file without a name')}: {error}")
    if not bodies:
        raise ValueError(f"no file of its case.json can be read: {'; '.join(skipped) or 'it lists none'}")
    return alternate(bodies, skipped)


def alternate(bodies: dict[str, Lines], skipped: list[str]) -> Outcome:
    """Every second line of every body fitted, the others predicted."""
    kept = [b for b in bodies.values() if len(b.freq_hz) >= 2]
    if not kept:
        raise ValueError("no body with two lines that stand clear")
    fit = [b.part(np.arange(len(b.freq_hz)) % 2 == 0) for b in kept]
    held = [b.part(np.arange(len(b.freq_hz)) % 2 == 1) for b in kept]
    found = validated("every second line", fit, held)
    text = (
        f"{len(joined(kept).freq_hz)} lines of {len(kept)} files; every second one fitted, the others predicted. "
        f"{found.said}."
    )
    left = (
        f"{found.row.after:.1f} dB of decay at the median line are left"
        if not found.row.accepted
        else "what is left is the scatter of single lines"
    )
    return Outcome((found.row,), text, left, lambda figure: draw(figure.subplots(), [found], fit, held), tuple(skipped))
