"""Measured data: each set fitted on one part and judged on another, baseline against baseline + effect, a null
of as many numbers beside it.

    python benchmarks/measured.py --data ../shared/measured [--out docs/measured/recordings-by-others.md] [SET ...]

DATA/SET/case.json, dev/ -> measured_sets/ judge of that set, or plain.py's for a set of unknown kind, READINGS times
(observed.py) -> OUT, and pictures/SET.png beside it What is missing or cannot be read gives one line that names it, and
the count of it is printed. Features are kept in SONIC_BULLET_MEASURED_CACHE.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.measured_sets.observed import READINGS, reading
from benchmarks.measured_sets.page import Page, written
from benchmarks.measured_sets.table import JUDGES, PLAIN
from benchmarks.measured_sets.values import Judge, Row
from sonic_bullet.parallel import one_thread, parallel_map


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=Path("docs/measured/recordings-by-others.md"))
    parser.add_argument("sets", nargs="*", metavar="SET", help="these alone; the page then holds them alone")
    asked = parser.parse_args(arguments)
    if not asked.data.is_dir():
        print(f"{asked.data}: no such folder; give the folder that holds the sets", file=sys.stderr)
        return 2
    known = asked.sets or sorted({p.name for p in asked.data.iterdir() if p.is_dir()} | set(JUDGES))
    pages, skipped = [], []
    for name in known:
        print(f"{name} ...", flush=True)
        page = judged(asked.data / name)
        if isinstance(page, str):
            skipped.append(f"{name}: {page}")
            print(f"  skipped: {page}", flush=True)
            continue
        pages.append(page)
        skipped += [f"{name}: {line}" for line in page.found.skipped]
        for row in page.found.rows:
            print(
                f"  {row.what}: {row.before:.3g} -> {row.after:.3g} {row.unit} (null {row.null:.3g}) "
                f"{row.effect}{' accepted' if row.accepted else ''}",
                flush=True,
            )
    written(asked.out, pages, skipped)
    for line in skipped:
        print(f"skipped: {line}")
    print(f"{len(pages)} sets judged, {len(skipped)} sets or files skipped: {asked.out}")
    return 0


def judged(folder: Path) -> Page | str:
    """A set's page, or one line that says why there is none."""
    if not folder.is_dir():
        return "the folder is absent"
    try:
        text = (folder / "README.md").read_text() if (folder / "README.md").is_file() else ""
        case = json.loads((folder / "case.json").read_text()) if (folder / "case.json").is_file() else {}
        case.setdefault("set", folder.name)
        judge = JUDGES.get(folder.name, PLAIN)
        read = parallel_map(lambda number: _rows(judge, folder, case, number), range(READINGS))
        with one_thread():
            found = judge(folder, case)  # its lines are kept by now
        return Page(folder.name, text, case, replace(found, rows=tuple(r.read_again(read[1:]) for r in found.rows)))
    except Exception as error:  # a set fails alone
        return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _rows(judge: Judge, folder: Path, case: dict[str, Any], number: int) -> tuple[Row, ...]:
    """What one reading says; nothing where another than the first fails, so that nothing stands."""
    with reading(number):
        try:
            return judge(folder, case).rows
        except Exception:
            if not number:
                raise
            return ()


if __name__ == "__main__":
    sys.exit(main())
