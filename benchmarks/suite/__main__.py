"""Does the diagnosis name what a case lacks, and only that?

python -m benchmarks.suite make --out DIR [--quick] [--noises FOLDER]    cases into DIR/cases, modes kept in DIR/modes
python -m benchmarks.suite run --out DIR [--quick] [--only PART] [--workers N] [--rows FILE]
    diagnoses what lacks a row, then reports
python -m benchmarks.suite report --out DIR [--rows FILE]

Plan -> make_case -> DIR/cases/NAME -> `sonic-bullet diagnose` in a copy without its truth -> a row of JSON -> tables
"""

from __future__ import annotations

import argparse
import shlex
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.suite import plans
from benchmarks.suite.cases import make_case
from benchmarks.suite.run import diagnose, rows, write_row
from benchmarks.suite.tables import report


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.suite", description=__doc__.splitlines()[0] if __doc__ else ""
    )
    parser.add_argument("what", choices=["make", "run", "report"])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="20 cases in place of 166")
    parser.add_argument(
        "--draw", type=int, default=0, help="other cases of the same kinds: other numbers and bodies; a folder each"
    )
    parser.add_argument("--only", default="", help="cases whose name holds this, or one of several with commas between")
    parser.add_argument(
        "--noises", type=Path, default=None, help="a folder of recordings whose quiet stretches are rooms' noise"
    )
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--rows", type=Path, default=None, help="results, one JSON a line; DIR/rows.jsonl by default")
    parser.add_argument(
        "--command",
        default=f"{shlex.quote(str(Path(sys.executable).with_name('sonic-bullet')))} diagnose {{case}} --json",
        help="what is run; {case} is the folder",
    )
    args = parser.parse_args()
    every = plans.quick(args.draw) if args.quick else plans.whole(args.draw)
    chosen = [p for p in every if any(part in p.name for part in args.only.split(","))]
    file = args.rows or args.out / "rows.jsonl"
    if args.what in ("make", "run"):
        for k, plan in enumerate(chosen):
            if (args.out / "cases" / plan.name / "case.json").exists():
                continue
            start = time.monotonic()
            made = make_case(args.out / "cases", plan, args.out / "modes", args.noises)
            print(
                f"{k + 1}/{len(chosen)} {plan.name}: {made['distance_db']} dB, {time.monotonic() - start:.1f} s",
                flush=True,
            )
    if args.what == "run":
        done = {row["case"] for row in rows(file)}
        todo = [p.name for p in chosen if p.name not in done]
        with ThreadPoolExecutor(args.workers) as pool:
            for row in pool.map(lambda name: diagnose(args.out / "cases" / name, args.command), todo):
                write_row(file, row)
                print(
                    f"{row['case']}: {row['verdict']} {'+'.join(row['found']) or '-'} (was "
                    f"{'+'.join(row['true']) or '-'}), {row['cpu_s']:.0f} s CPU",
                    flush=True,
                )
    if args.what in ("run", "report"):
        names = {p.name for p in chosen}
        print(report([row for row in rows(file) if row["case"] in names], len(chosen)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
