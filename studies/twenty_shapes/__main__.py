"""Is the error that a model states the true one, over twenty shapes?

python -m studies.twenty_shapes [SHAPE …]          ours beside the kept truth: worst error, stated error, time, memory
python -m studies.twenty_shapes modes [SHAPE …]    the error of each mode beside what is told
python -m studies.twenty_shapes truth [SHAPE …]    the truth made again and kept in truth.json: NGSolve, ccx
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from typing import Any

import numpy as np

from studies.thin_walls import calculix, reference
from studies.thin_walls.ours import LIMIT_S, THREADS, _used
from studies.twenty_shapes import axisymmetric, cad_truth, polynomials
from studies.twenty_shapes.catalogue import ENTRIES

HEAD = (
    "| shape | triangles | stated | worst error | modes within | surely within, beyond, open | truth's | s | GB |\n"
    "|---|---|---|---|---|---|---|---|---|"
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
        model = analyse((shape,), entry.material, count=cad_truth.JUDGED, cache=None)
        frequency, note = model.freq_hz.tolist(), model.note
    except SonicBulletError as raised:
        error = f"{type(raised).__name__}: {raised}"
    after, peak = _used()
    made = {"frequency_hz": frequency, "note": note, "error": error, "processor_s": after - before, "peak": peak}
    print(json.dumps({**made, "triangles": len(shape.face)}))


def row(name: str, ours: dict[str, Any], *, each: bool) -> str:
    """A shape's line of the table, or its modes' errors."""
    truth = cad_truth.limit(ENTRIES[name].truth)
    print(json.dumps({"shape": name, **ours}), file=sys.stderr, flush=True)
    if ours["error"]:
        return f"| {name} | {ours['error']} |"
    told = sum(float(found[1]) for found in (re.search(one, ours["note"]) for one in TOLD) if found) / 100
    count = min(cad_truth.JUDGED, len(ours["frequency_hz"]), len(truth.frequency_hz))
    off = np.array(ours["frequency_hz"][:count]) / truth.frequency_hz[:count] - 1
    if each:
        return f"| {name} | {told:.2%} | " + ", ".join(f"{100 * x:+.2f}" for x in off) + " |"
    far, uncertain = np.abs(off), truth.uncertain[:count]
    within, beyond = int((far + uncertain <= told).sum()), int((far - uncertain > told).sum())
    return (
        f"| {name} | {ours['triangles']} | {told:.2%} | {far.max():.2%} | {int((far <= told).sum())} of {count} | "
        f"{within}, {beyond}, {count - within - beyond} | {uncertain.max():.2%} | "
        f"{ours['processor_s']:.1f} | {ours['peak'] / 1e9:.2f} |"
    )


def make_truth(names: list[str]) -> int:
    """Solve shapes by NGSolve, where they are drawn, and by ccx, one after the other, and keep them."""
    if not calculix.installed() or not find_spec(polynomials.PACKAGE):
        print(f"needs ccx (Debian package {calculix.PACKAGE}) and {polynomials.PACKAGE} (PyPI)", file=sys.stderr)
        return 2
    for name in dict.fromkeys(ENTRIES[one].truth for one in names):
        entry = next(one for one in ENTRIES.values() if one.truth == name)
        if entry.edge_mm is not None:
            cad_truth.keep(name, polynomials=cad_truth.by_polynomials(entry))
        elif name in axisymmetric.ROUND:
            cad_truth.keep(name, polynomials=axisymmetric.solve(axisymmetric.ROUND[name], cad_truth.COUNT))
        if "fine" not in {**reference.read()["bodies"].get(name, {}), **cad_truth.read().get(name, {})}:
            cad_truth.keep(name, **cad_truth.by_calculix(entry))
        true, beside = cad_truth.limit(name), cad_truth.calculix_limit(name)
        off = beside.frequency_hz[: cad_truth.JUDGED] / true.frequency_hz[: cad_truth.JUDGED] - 1
        worst = true.uncertain[: cad_truth.JUDGED].max()
        print(f"{name}: uncertain by {worst:.2%}, CalculiX {off.min():+.2%} to {off.max():+.2%}", flush=True)
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
        print(row(name, measured(name), each=what == "modes"), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
