"""One case through the command, in a copy that holds no truth."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

LIMIT_CPU_S = 600
"""Of processor time a process: four times the most that a case may take, so that other work beside it ends none."""


def diagnose(case: Path, command: str) -> dict[str, Any]:
    """Row: case, true ids, verdict, found ids, errors, cpu_s, wall_s; verdict "failed" and the last line of what it
    said where it broke.
    """
    truth = json.loads((case / "truth.json").read_text())
    row: dict[str, Any] = {
        "case": case.name,
        "true": sorted(e["id"] for e in truth["effects"]),
        "distance_db": truth["distance_db"],
    }
    with tempfile.TemporaryDirectory() as folder:
        blind = Path(folder) / case.name
        shutil.copytree(case, blind, ignore=shutil.ignore_patterns("truth.json"))
        start = time.monotonic()
        limited = ["sh", "-c", f'ulimit -S -t {LIMIT_CPU_S}; exec "$@"', "sh"]
        with open(Path(folder) / "out", "w+") as out, open(Path(folder) / "err", "w+") as err:
            what = shlex.split(command.format(case=shlex.quote(str(blind))))
            child = subprocess.Popen([*limited, *what], stdout=out, stderr=err)
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            err.seek(0)
            said, told = out.read(), err.read()
    row |= {
        "wall_s": round(time.monotonic() - start, 2),
        "cpu_s": round(usage.ru_utime + usage.ru_stime, 2),
        "found": [],
        "verdict": "failed",
    }
    try:
        answer = json.loads(said[said.index("{") :])
        found = sorted(e["id"] for e in answer["effects"])
        verdict = str(answer["verdict"])
    except (ValueError, KeyError, TypeError) as error:
        last = (told.strip() or said.strip() or repr(error)).splitlines()[-1]
        if child.returncode == -signal.SIGXCPU:
            last = f"more than {LIMIT_CPU_S} s of processor time"
        return row | {"why": f"exit {child.returncode}: {last[:300]}"}
    kept = {key: answer.get(key) for key in ("errors", "effects", "candidates", "unexplained")}
    return row | {"verdict": verdict, "found": found, **kept}


def rows(file: Path) -> list[dict[str, Any]]:
    """Rows so far; of a case done twice, the last. A line cut short by an interruption is left out."""
    kept: dict[str, dict[str, Any]] = {}
    if file.exists():
        for line in file.read_text().splitlines():
            try:
                row = json.loads(line)
            except ValueError:
                continue
            kept[row["case"]] = row
    return list(kept.values())


def write_row(file: Path, row: dict[str, Any]) -> None:
    """Appends a row."""
    with open(file, "a") as stream:
        stream.write(json.dumps(row, default=float) + "\n")
