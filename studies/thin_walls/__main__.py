"""Are the modes of thin walls true?

python -m studies.thin_walls [table] [BODY …] [--json]     first fifteen modes of each body against the kept truth
python -m studies.thin_walls dented [BODY …] [--json]      the same of round bodies with one corner moved: tetrahedra
python -m studies.thin_walls truth [BODY …]                the truth made again by ccx and kept in calculix.json
python -m studies.thin_walls hundred [BODY …] [--json]     the first 100 modes or 10 kHz: processor time and memory
python -m studies.thin_walls race [--json]                 a solid of 60 k unknowns and a plate beside ccx
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from typing import Any

from studies.thin_walls import calculix, reference
from studies.thin_walls.bodies import BODIES
from studies.thin_walls.ours import compared, hundred, measured
from studies.thin_walls.race import RACES, raced

WHATS = ("table", "dented", "truth", "hundred", "race")
WORST, SPLIT = 0.01, 5e-4
"""What must hold: error of the first fifteen modes, distance within pairs."""
ROUND = ("bowl", "dome", "singing-bowl", "bell", "tumbler", "wine-glass", "bottle")
SECONDS, BYTES = 10.0, 1.5e9
"""What must hold of the first 100 modes or 10 kHz: processor time, peak memory."""


def make_truth(names: list[str]) -> int:
    """Solve bodies by ccx, one after the other, and keep them."""
    if not calculix.installed():
        print(f"ccx is not installed (Debian package {calculix.PACKAGE}): {len(names)} bodies not run", file=sys.stderr)
        return 2
    for name in names:
        entry = reference.solved(BODIES[name])
        reference.keep({name: entry})
        fine, change = entry["fine"], reference.truth(name).change
        print(
            f"{name}: coarse to fine {change:.1e}; {fine['unknowns']} unknowns, {fine['processor_s']} s, "
            f"{fine['peak_mb']} MB",
            flush=True,
        )
    return 0


def race(as_json: bool) -> int:
    """Time ours and ccx on each body of `RACES`, one after the other."""
    held = 0
    for one in RACES:
        figures = raced(one)
        held += figures["ratio"] is not None and figures["ratio"] <= one.at_most
        print(json.dumps(figures) if as_json else figures["said"], flush=True)
    return 0 if held == len(RACES) else 1


def row(name: str, what: str) -> dict[str, Any]:
    """A body's figures: those of the table, or of the first hundred modes."""
    dent = {"dented": True} if what == "dented" else {}
    ours = hundred(name) if what == "hundred" else measured(name, count=reference.COUNT, **dent)
    figures = {
        "body": name,
        "modes": len(ours.frequency_hz),
        "processor_s": round(ours.processor_s, 2),
        "peak_mb": round(ours.peak_bytes / 1e6),
        "note": ours.note,
        "error": ours.error,
    }
    if what == "hundred":
        return {**figures, "top_hz": round(float(ours.frequency_hz[-1])) if len(ours.frequency_hz) else None}
    truth = reference.truth(name)
    found = compared(ours, truth, paired=BODIES[name].paired)
    return {**figures, **asdict(found), "truth": truth.change}


def printed(figures: dict[str, Any]) -> str:
    """A row as a line of a Markdown table."""
    if figures["error"]:
        return f"| {figures['body']} | {figures['error']} |"
    cost = f"{figures['processor_s']:.1f} s | {figures['peak_mb']} MB"
    if "worst" not in figures:
        return f"| {figures['body']} | {figures['modes']} to {figures['top_hz']} Hz | {cost} |"
    split = "–" if figures["split"] is None else f"{figures['split']:.3%}"
    told = "–" if figures["told"] is None else f"{figures['told']:.2%}, {figures['bounded']} of {figures['modes']}"
    return f"| {figures['body']} | {figures['worst']:.2%} | {told} | {split} | {cost} | {figures['truth']:.2%} |"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m studies.thin_walls", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="BODY")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    given = parser.parse_args()
    what = given.names.pop(0) if given.names and given.names[0] in WHATS else "table"
    unknown = [name for name in given.names if name not in BODIES]
    if unknown:
        parser.error(f"no body {', '.join(unknown)}; there are {', '.join(BODIES)}")
    names = given.names or [name for name in BODIES if what != "dented" or name in ROUND]
    if what == "truth":
        return make_truth(names)
    if what == "race":
        return race(given.json)
    if not given.json:
        print("| body | modes | time | memory |" if what == "hundred" else HEAD)
        print("|---|---|---|---|" if what == "hundred" else "|---|---|---|---|---|---|---|")
    rows = []
    for name in names:
        rows.append(row(name, what))
        print(json.dumps(rows[-1]) if given.json else printed(rows[-1]), flush=True)
    held = sum(good(figures) for figures in rows)
    print(f"{held} of {len(rows)} bodies hold", file=sys.stderr)
    return 0 if held == len(rows) else 1


HEAD = "| body | worst error | stated error, modes within it | pairs apart | time | memory | truth's coarse to fine |"


def good(figures: dict[str, Any]) -> bool:
    """Whether a row holds what must hold."""
    if figures["error"]:
        return False
    if "worst" in figures:
        return bool(figures["worst"] <= WORST and (figures["split"] or 0.0) <= SPLIT)
    return bool(figures["processor_s"] <= SECONDS and figures["peak_mb"] * 1e6 <= BYTES)


if __name__ == "__main__":
    sys.exit(main())
