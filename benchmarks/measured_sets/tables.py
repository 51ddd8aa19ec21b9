"""Sets that are numbers alone: resonances per material and size, plates, bowls, a blade; and hammer hits with
acceleration in frf.py.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.laws import draw, validated
from benchmarks.measured_sets.sizes import total
from benchmarks.measured_sets.values import DRAWS, Array, Lines, Outcome, Row, told

LONGEST_S = 5.0  # of a T60: the set's README clips there
MOST_LINES = 60  # of a table: its strongest
T60 = 3 * np.log(10)
FIRST = ("metal", "glass", "wood", "ceramic", "plastic", "stone", "rubber")


def materials(folder: Path, case: dict[str, Any]) -> Outcome:
    """T60(f) per material: one size class left out and predicted from the others; where there is one class, every
    second line.
    """
    tables, skipped = {}, []
    for entry in case["index"]:
        if "same_as" in entry:
            continue
        try:
            data = json.loads((folder / "data" / entry["file"]).read_text())
            tables[entry["file"].removesuffix("_mm.json").lower().replace("plastc", "plastic")] = _table(data)
        except Exception as error:  # one table less: the others are judged
            skipped.append(f"{entry['file']}: {error}")
    kinds = sorted({name.split("_")[0] for name in tables})
    rows, pictured = [], None
    for kind in [k for k in FIRST if k in kinds]:
        mine = {n: t for n, t in tables.items() if n.split("_")[0] == kind and len(t.freq_hz) >= 4}
        if not mine:
            continue
        made = []
        if len(mine) >= 3:
            for i, name in enumerate(sorted(mine)):
                rest = [t for n, t in mine.items() if n != name]
                made.append((validated(name, rest, [mine[name]], seed=i), rest, [mine[name]]))
            rows.append(total(f"{kind}: each of {len(made)} classes from the others", [m[0].row for m in made]))
        else:
            fit = [t.part(np.arange(len(t.freq_hz)) % 2 == 0) for t in mine.values()]
            held = [t.part(np.arange(len(t.freq_hz)) % 2 == 1) for t in mine.values()]
            made.append((validated(f"{kind}: every second line", fit, held), fit, held))
            rows.append(made[0][0].row)
        pictured = pictured or (kind, made[0])
    if pictured is None:
        raise ValueError("no material with four lines")
    text = (
        f"{len(tables)} distinct tables, the {MOST_LINES} strongest lines of each, T60 over {LONGEST_S:.0f} s "
        "left out. A size class of a material is predicted from its others."
    )
    left = (
        "T60 against frequency scatters within a class by as much as between laws; which recording stands behind "
        "a table is not known, so a law here is a range, not a material's"
    )
    kind, one = pictured
    return Outcome(
        tuple(rows), text, left, lambda figure: draw(figure.subplots(), [one[0]], one[1], one[2], kind), tuple(skipped)
    )


def _table(data: dict[str, Any]) -> Lines:
    f, level, t60 = (np.asarray(data[n], float) for n in ("cf", "op", "rt"))
    keep = (t60 > 0.005) & (t60 < LONGEST_S) & (f > 30)
    keep[np.argsort(-level)[MOST_LINES:]] = False
    return told(f[keep], T60 / t60[keep], 0.1 * T60 / t60[keep], 10 ** (level[keep] / 20))


def derived(folder: Path, case: dict[str, Any]) -> Outcome:
    """Spruce plates: two predict the third's damping; the fan blade: a clamp that gives; bowls: nothing that can be
    judged.
    """
    rows, texts, skipped, pictured = [], [], [], None
    try:
        plates = json.loads((folder / "dev" / "spruce_plates_1-3.json").read_text())["plates"]
        bodies = {p["plate"]: _plate(p["modes"]) for p in plates}
        made = [
            (
                validated(
                    f"spruce {n}, from the other plates", [b for m, b in bodies.items() if m != n], [bodies[n]], seed=i
                ),
                n,
            )
            for i, n in enumerate(bodies)
        ]
        rows.append(total(f"spruce: damping of each of {len(bodies)} plates from the others", [m[0].row for m in made]))
        one, name = made[0]
        pictured = (one, [b for m, b in bodies.items() if m != name], [bodies[name]])
        texts.append(
            f"Spruce: {sum(len(b.freq_hz) for b in bodies.values())} modes of {len(bodies)} plates; laws: "
            f"{', '.join(sorted({m[0].law.law if m[0].law else 'Rayleigh' for m in made}))}."
        )
    except Exception as error:
        skipped.append(f"spruce_plates_1-3.json: {type(error).__name__}: {error}")
    try:
        tables = json.loads((folder / "dev" / "published.json").read_text())["tables"]
        blade = next(t for t in tables if t["id"] == "olson_lindberg_fan_blade")
        rows.append(clamp(np.array(blade["f_hz"]), np.array(blade["fe_elmer_hz"])))
        texts.append(
            "Fan blade: frequencies against those of a rigid clamp. A clamp that gives is no member of the "
            "family without the blade's shape: one factor of all modes stands for it."
        )
        texts.append(
            "Flax laminate: two frequencies and three stiffnesses, nothing is left to judge by. Bowls: no "
            "shape and no decays. RealImpact: see the JSON; one strike each."
        )
    except Exception as error:
        skipped.append(f"published.json: {type(error).__name__}: {error}")
    if not rows:
        raise ValueError("; ".join(skipped))
    left = (
        "damping of single plate modes scatters about any law of frequency (bending along and across the grain "
        "lose differently); the blade's clamp acts on some modes and not on others"
    )
    return Outcome(
        tuple(rows),
        " ".join(texts),
        left,
        lambda figure: draw(figure.subplots(), [pictured[0]], *pictured[1:]) if pictured else None,
        tuple(skipped),
    )


def _plate(modes: list[dict[str, Any]]) -> Lines:
    good = [m for m in modes if m.get("zeta")]
    f, zeta = (np.array([m[n] for m in good], float) for n in ("f_hz", "zeta"))
    return told(f, 2 * np.pi * f * zeta, 0.1 * 2 * np.pi * f * zeta)


def clamp(observed: Array, rigid: Array) -> Row:
    """Odd modes fitted, even ones predicted: all lowered by one factor."""
    y, fit = np.log(observed / rigid), np.arange(len(observed)) % 2 == 0
    factor, held = float(np.median(y[fit])), y[~fit]
    rng = np.random.default_rng(0)
    nulls = np.array([np.median(np.abs(100 * (held - f))) for f in rng.choice([-1, 1], DRAWS) * abs(factor)])
    after = float(np.median(np.abs(100 * (held - factor))))
    return Row(
        "fan blade: every second frequency",
        len(held),
        "% of f",
        float(np.median(np.abs(100 * held))),
        after,
        float(np.median(nulls)),
        float((nulls <= after).mean()),
        "a clamp that gives (one factor)",
    )
