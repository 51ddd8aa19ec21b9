"""Cases with their truth: is the verdict right, and how much of the gap is closed on strikes that were never fitted?

    python benchmarks/practice.py --data ../shared/practice [CASE ...]

Each case is diagnosed in a copy without truth.json. share = (after − floor)/(before − floor) of the log-spectral
distance; what must hold is share <= 0.2 on `holdout` (0.5 where the truth is a room) and <= 0.35 on `transfer`, and
nothing added where nothing lacks.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path

from sonic_bullet.lab.diagnosis import diagnose

LIMIT = {"holdout": 0.2, "transfer": 0.35}
ROOM = 0.5


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("cases", nargs="*", metavar="CASE")
    asked = parser.parse_args()
    folders = sorted(
        p.parent for p in asked.data.glob("*/truth.json") if not asked.cases or p.parent.name in asked.cases
    )
    if not folders:
        print(f"{asked.data}: no cases with a truth.json; give the folder that holds them", file=sys.stderr)
        return 2
    print(
        "| case | truth | verdict | split | before dB | after dB | floor dB | share | | wall s |\n"
        "|---|---|---|---|---|---|---|---|---|---|"
    )
    missed = 0
    for folder in folders:
        truth = sorted(e["id"] for e in json.loads((folder / "truth.json").read_text())["effects"])
        with tempfile.TemporaryDirectory() as place:
            case = Path(shutil.copytree(folder, Path(place) / folder.name, ignore=shutil.ignore_patterns("truth.json")))
            begun = time.monotonic()
            found = diagnose(case)
            spent = time.monotonic() - begun
        named = sorted(c.id for c in found.closed.added)
        right = named == truth and found.verdict == ("explained" if truth else "none")
        missed += not right
        for split, limit in LIMIT.items():
            before, after, floor = found.errors["before"][split], found.errors["after"][split], found.errors["floor"]
            if before is None:
                continue
            share = (after - floor) / (before - floor)
            held = not truth or share <= (ROOM if "room" in truth and split == "holdout" else limit)
            missed += not held
            print(
                f"| {folder.name} | {', '.join(truth) or 'nothing'} | "
                f"{found.verdict}{' ' if named else ''}{', '.join(named)}{'' if right else ' (wrong)'} | "
                f"{split} "
                f"| {before:.2f} | {after:.2f} | {floor:.2f} | {share:.3f} | {'met' if held else 'missed'} | "
                f"{spent:.0f} |",
                flush=True,
            )
    print(f"\n{missed} missed")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
