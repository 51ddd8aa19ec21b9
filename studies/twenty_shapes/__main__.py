"""Is the error that a model tells the true one, over twenty shapes?

python -m studies.twenty_shapes [SHAPE …]          ours beside the kept truth: worst error, told error, time, memory
python -m studies.twenty_shapes modes [SHAPE …]    the error of each mode beside what is told
python -m studies.twenty_shapes truth [SHAPE …]    the truth made again by ccx and kept in truth.json
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from typing import Any

import numpy as np

from studies.thin_walls import calculix
from studies.thin_walls.ours import LIMIT_S, THREADS, _used
from studies.twenty_shapes import cad_truth
from studies.twenty_shapes.catalogue import ENTRIES

HEAD = (
    "| shape | worst error | told | modes within it | with the truth's own | truth's own | processor | memory |\n"
    "|---|---|---|---|---|---|---|---|"
)
TOLD = (r"error up to \d+ Hz (?:about|under) ([\d.e-]+) %", r"facets change frequencies by up to ([\d.e-]+) %")


def measured(name: str) -> dict[str, Any]:
    """Ours of a shape, one process, one thread: frequencies, note or error, processor time, peak memory."""
    command = [sys.executable, "-m", "studies.twenty_shapes", "child", name]
    threads = {**os.environ, **dict.fromkeys(THREADS, "1")}
    ended = subprocess.run(command, capture_output=True, text=True, timeout=4 * LIMIT_S, check=False, env=threads)
    if ended.returncode:
        return {"frequency_hz": [], "note": "", "error": ended.stderr.strip()[-300:], "processor_s": 0, "peak": 0}
    found: dict[str, Any] = json.loads(ended.stdout.splitlines()[-1])
    return found


def child(name: str) -> None:
    """Print one shape's answer as JSON."""
    from sonic_bullet.modal import analyse
    from sonic_bullet.records.errors import SonicBulletError

    entry = ENTRIES[name]
    shape = entry.surface()
    before, _ = _used()
    frequency: list[float] = []
    note = error = ""
    try:
        model = analyse((shape,), entry.material, count=cad_truth.COUNT, cache=None)
        frequency, note = model.freq_hz.tolist(), model.note
    except SonicBulletError as raised:
        error = f"{type(raised).__name__}: {raised}"
    after, peak = _used()
    made = {"frequency_hz": frequency, "note": note, "error": error, "processor_s": after - before, "peak": peak}
    print(json.dumps({**made, "triangles": len(shape.face)}))


def row(name: str, *, each: bool) -> str:
    """A shape's line of the table, or its modes' errors."""
    truth, ours = cad_truth.limit(ENTRIES[name].truth), measured(name)
    print(json.dumps({"shape": name, **ours}), file=sys.stderr, flush=True)
    if ours["error"]:
        return f"| {name} | {ours['error']} |"
    off = np.array(ours["frequency_hz"][: len(truth.frequency_hz)]) / truth.frequency_hz - 1
    told = sum(float(found[1]) for found in (re.search(one, ours["note"]) for one in TOLD) if found) / 100
    if each:
        return f"| {name} | {told:.2%} | " + ", ".join(f"{100 * x:+.2f}" for x in off) + " |"
    far = np.abs(off)
    strict, slack = (int((far <= told + beyond).sum()) for beyond in (0, truth.uncertain))
    return (
        f"| {name} | {far.max():.2%} | {told:.2%} | {strict} of {len(off)} | {slack} of {len(off)} | "
        f"{truth.uncertain.max():.2%} | {ours['processor_s']:.1f} s | {ours['peak'] / 1e6:.0f} MB |"
    )


def make_truth(names: list[str]) -> int:
    """Solve shapes by ccx, one after the other, and keep them."""
    if not calculix.installed():
        print(f"ccx is not installed (Debian package {calculix.PACKAGE})", file=sys.stderr)
        return 2
    for name in dict.fromkeys(ENTRIES[one].truth for one in names):
        entry = next(one for one in ENTRIES.values() if one.truth == name)
        cad_truth.keep(name, cad_truth.solved(entry))
        print(f"{name}: fine to limit {cad_truth.limit(name).uncertain.max():.1e}", flush=True)
    return 0


def main() -> int:
    what, *names = sys.argv[1:] or ["table"]
    if what == "child":
        child(*names)
        return 0
    if what not in ("table", "modes", "truth"):
        what, names = "table", [what, *names]
    names = names or list(ENTRIES)
    if unknown := [name for name in names if name not in ENTRIES]:
        print(f"no shape {', '.join(unknown)}; there are {', '.join(ENTRIES)}", file=sys.stderr)
        return 2
    if what == "truth":
        return make_truth(names)
    print(HEAD if what == "table" else "| shape | told | error of each mode, % |\n|---|---|---|")
    for name in names:
        print(row(name, each=what == "modes"), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
