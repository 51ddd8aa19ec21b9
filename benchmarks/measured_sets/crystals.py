"""Small crystals by resonant ultrasound: lists of frequencies of blocks of known size.

Every second one fitted, the others predicted, by the package's own diagnosis.

f₁ f₃ f₅ … -> case.json with `features`, split fit; f₂ f₄ … split holdout -> diagnose -> rms ln f of the holdout list,
isotropic -> with orthotropy
null
    as many modes drawn anywhere between the lowest and the highest line: rms of the distance to the nearest, one line a
    mode
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.values import DRAWS, Array, Outcome, Row
from sonic_bullet.diagnosis.diagnose import Diagnosis, diagnose
from sonic_bullet.diagnosis.prediction.line_score import CAP, off_by
from sonic_bullet.diagnosis.prediction.prediction import predict

# of any hard solid: E/ρ is sought over a factor of two to each side
GUESS = {"youngs_modulus": 1.7e11, "poisson_ratio": 0.25}


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    rows, texts, left, found, skipped = [], [], [], [], []
    for entry in case["cases"]:
        try:
            d = diagnosed(folder, entry)
        except Exception as error:  # one crystal less: the others are judged
            skipped.append(f"{entry.get('id')}: {error}")
            continue
        found.append((entry, d))
        name, told = entry.get("object", entry["id"]), d.errors_lines
        effects = ", ".join(f"{c.id} ({c.effect.parameters().get('symmetry', '')})" for c in d.closed.added)
        before, after = (100 * told[when]["holdout"]["frequency_rms"] for when in ("before", "after"))
        null = 100 * _nulls(d)
        rows.append(
            Row(
                f"{name}: every second frequency",
                told["after"]["holdout"]["lines"],
                "% of f",
                before,
                after,
                float(np.median(null)),
                float((null <= after).mean()),
                effects,
            )
        )
        texts.append(f"{name}: verdict {d.verdict}. " + _constants(d))
        if d.verdict == "unexplained":
            left.append(f"{name}: no symmetry that is known here accounts for the lines")
    if not rows:
        raise ValueError("; ".join(skipped) or "it lists no crystal")
    rest = (
        "; ".join(left)
        or "what is left is some parts in a thousand, as edges a few micrometres off and the transducers' touch "
        "would make it"
    )
    return Outcome(tuple(rows), " ".join(texts), rest, lambda figure: _paint(figure, found), tuple(skipped))


def diagnosed(folder: Path, entry: dict[str, Any]) -> Diagnosis:
    """The diagnosis of a crystal of which every second line is known."""
    lines = sorted(float(f) for f in entry["f_hz"])
    with tempfile.TemporaryDirectory() as place:
        made = Path(place) / "case.json"
        (Path(place) / "block.obj").write_bytes((folder / entry["mesh"]).read_bytes())
        thing = {
            "mesh": "block.obj",
            "units": "m",
            "material": "crystal",
            "elastic_guess": GUESS | {"density": entry["density_kg_m3"]},
        }
        takes = [
            {"object": "block", "split": split, "features": [{"freq_hz": f} for f in lines[first::2]]}
            for first, split in ((0, "fit"), (1, "holdout"))
        ]
        told = {
            "format": "sonic-bullet-case/1",
            "case": entry["id"],
            "objects": {"block": thing},
            "support": "free",
            "band_hz": [0.3 * lines[0], 1.05 * lines[-1]],
            "recordings": takes,
        }
        made.write_text(json.dumps(told))
        return diagnose(place)


def _held(d: Diagnosis) -> Array:
    return np.array(
        [line.freq_hz for r in d.bodies[0].recordings if r.split == "holdout" and r.lines for line in r.lines]
    )


def _nulls(d: Diagnosis) -> Array:
    """Rms ln f (draws,) of the held-out lines and modes drawn at random."""
    from scipy.optimize import linear_sum_assignment

    held, rng, found = _held(d), np.random.default_rng(0), []
    for _ in range(DRAWS):
        drawn = rng.uniform(0.98 * held[0], 1.02 * held[-1], 2 * len(held))
        gap = np.minimum(np.abs(np.log(held[:, None] / drawn[None, :])), CAP)
        found.append(np.sqrt((gap[linear_sum_assignment(gap)] ** 2).mean()))
    return np.array(found)


def _constants(d: Diagnosis) -> str:
    for c in d.closed.added:
        told = c.effect.parameters()
        names = [n for n in told if n.startswith("c") and n.endswith("_pa")]
        spread = {n: c.spread.get(n, float("nan")) for n in names}
        return (
            ", ".join(f"{n[:-3]} {told[n] / 1e9:.1f} ± {spread[n] / 1e9:.1f} GPa" for n in names)
            + f" ({told['symmetry']}), from {len(_held(d))} lines or so."
        )
    return "No effect was added."


def _paint(figure: Any, found: list[tuple[dict[str, Any], Diagnosis]]) -> None:
    axes = figure.subplots(1, len(found), squeeze=False)[0]
    for axis, (entry, d) in zip(axes, found, strict=True):
        held = _held(d)
        for label, h in (("isotropic", d.closed.before), ("after", d.closed.after)):
            off, _ = off_by(predict(h, d.bodies[0]), held, np.full(len(held), np.nan))
            axis.plot(held / 1e6, 100 * off, "o-", ms=3, lw=0.6, label=label)
        axis.set_xlabel("MHz")
        axis.set_ylabel("|Δf|/f in % (at most 3), lines that were not fitted")
        axis.set_title(entry.get("object", entry["id"]), fontsize=8)
        axis.legend(fontsize=6)
