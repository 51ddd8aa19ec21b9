"""Changes in scenes that comparing was not developed with: is each found, and named first?"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.planted.held_out_scenes import CHANGES, HELPER, SCENES
from sonic_bullet.apps.compare.compared_sides import compare_sides
from sonic_bullet.apps.compare.sides import SceneSide, Side, run


def held_out(folder: Path, line: Callable[..., None]) -> None:
    """A table of what is said."""
    kept: dict[str, Side] = {}
    found_count = right = 0
    for number, (scene, old, new, who, what) in enumerate(CHANGES):
        began = time.perf_counter()
        if scene not in kept:
            kept[scene] = run(SceneSide(_written(folder / f"{scene}-a", scene, "", "")), "a")
        b = run(SceneSide(_written(folder / f"{scene}-{number}", scene, old, new)), "b")
        found = compare_sides(kept[scene], b)
        first = found.differences[0] if found.differences else None
        good = (
            not found.same and first is not None and bool(first.cause) and what in first.what
            and who in (first.who or "") and len(found.causes) == 1
        )  # fmt: skip
        found_count, right = found_count + (not found.same), right + good
        line(number, scene, what, "" if good else "WRONG", found.verdict[:160], f"{time.perf_counter() - began:.1f} s")
        if not good:
            line(*[f"{x.cause} {x.words[:90]}" for x in found.differences[:5]], *found.notes)
    line("held out", f"{found_count} of {len(CHANGES)} found", f"{right} exactly that first")


def _written(folder: Path, scene: str, old: str, new: str) -> Path:
    """The scene with one text instead of another, and its helper."""
    folder.mkdir(parents=True, exist_ok=True)
    name, helper = HELPER
    assert old in SCENES[scene] or old in helper
    (folder / name).write_text(helper.replace(old, new, 1) if old else helper)
    place = folder / f"{scene}.py"
    place.write_text(SCENES[scene].replace(old, new, 1) if old else SCENES[scene])
    return place
