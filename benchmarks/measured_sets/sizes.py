"""One material in several sizes: two sizes fitted, a third predicted, each size in its turn.

A law of the material must carry over; what hangs on the size must not.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.laws import Validation, draw, validated
from benchmarks.measured_sets.observed import lines
from benchmarks.measured_sets.values import Lines, Outcome, Row, clear

BAND = {
    "glockenspiel-fluidr3": (0.75, (200.0, 16000.0), 4e-3),
    "xylophone-vcsl": (1.2, (150.0, 12000.0), 0.03),
}  # seconds, band, most loss factor of a line that rings


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    """Sizes by their lowest strong line. Raises ValueError where fewer than three sizes can be read."""
    seconds, band, loss = BAND.get(case["set"], (1.0, (150.0, 14000.0), 0.03))
    bodies, skipped = {}, []
    for entry in case["files"]:
        try:
            found = clear(
                lines(folder / entry["file"], start_s=entry["t_hit_s"], seconds=seconds, onset_s=0.0, band_hz=band),
                loss=loss,
            )
            bodies[str(entry.get("bar", entry["file"]))] = found
        except Exception as error:  # one file less: the others are judged
            skipped.append(f"{entry['file']}: {error}")
    return over_sizes(bodies, skipped)


def over_sizes(bodies: dict[str, Lines], skipped: list[str], label: str = "") -> Outcome:
    """Each size predicted from its two neighbours in pitch."""
    bodies = {k: b for k, b in bodies.items() if len(b.freq_hz)}
    if len(bodies) < 3:
        raise ValueError(f"{len(bodies)} sizes with a clear line: two are needed to fit, a third to predict")
    pitch = {}
    for name, b in bodies.items():  # the lowest line within 20 dB of the strongest
        energy = b.amplitude**2 / b.decay_per_s
        pitch[name] = float(b.freq_hz[energy > 0.01 * energy.max()].min())
    order = sorted(bodies, key=pitch.__getitem__)
    made: list[tuple[Validation, list[Lines], list[Lines]]] = []
    for i, name in enumerate(order):
        others = sorted((j for j in range(len(order)) if j != i), key=lambda j: abs(j - i))[:2]
        fit = [bodies[order[j]] for j in others]
        made.append(
            (
                validated(f"{label}{name} from {order[others[0]]} and {order[others[1]]}", fit, [bodies[name]], seed=i),
                fit,
                [bodies[name]],
            )
        )
    rows = [m[0].row for m in made]
    rows.append(total(f"{label}all sizes, median", rows))
    laws = [m[0].said for m in made if m[0].law is not None]
    text = (
        f"Decays of {', '.join(f'{n} ({len(bodies[n].freq_hz)} lines)' for n in order)}. Each size is "
        "predicted from the two nearest to it in pitch. "
        f"Laws proposed: {'; '.join(laws) or 'none: Rayleigh`s law stands'}."
    )
    one = max(made, key=lambda m: len(m[2][0].freq_hz))
    left = min(rows[-1].before, rows[-1].after)
    return Outcome(
        tuple(rows),
        text,
        f"a line of the size left out is wrong by {left:.1f} dB (a factor {10 ** (left / 20):.1f}) at the "
        "median at best, with a law or without. Decays differ line by line "
        "(hanging, radiation, tubes, close pairs), which frequency alone does not tell",
        lambda figure: draw(figure.subplots(), [one[0]], one[1], one[2], one[0].row.what),
        tuple(skipped),
    )


def total(what: str, rows: list[Row]) -> Row:
    """Median over rows; chance: the median one's."""
    named = [r.effect for r in rows if r.effect]
    effect = max(set(named), key=named.count) if len(named) * 2 > len(rows) else ""
    before, after, null, chance = (
        float(np.median([getattr(r, n) for r in rows])) for n in ("before", "after", "null", "chance")
    )
    return Row(what, sum(r.count for r in rows), rows[0].unit, before, after, null, chance, effect)
