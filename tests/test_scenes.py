"""Scenes do and sound as the measurements beside them say; the long ones are measured by `benchmarks/scene_all.py`."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet.scene import render_scene
from tests.few_cases import parametrize_few

REPO = Path(__file__).parents[1]
SCENES = sorted(path.stem for path in (REPO / "scenes").glob("*.py"))
BENCH: dict[str, Any] = runpy.run_path(str(REPO / "benchmarks" / "scene_all.py"))


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_has_measurements_and_says_where_they_come_from(name: str) -> None:
    told = json.loads((REPO / "scenes" / f"{name}.json").read_text(encoding="utf-8"))
    assert len(told["why"]) > 20
    assert len(told) >= 4
    low, high = told["peak_db_spl"]
    assert high - low <= 17, "a band of levels as wide as that says nothing"
    assert "peak" in told["why"] or "dB" in told["why"]


@parametrize_few("name", ["bar", "sliding", "rolling"], 2)
def test_a_scene_keeps_its_measurements(name: str) -> None:
    told = BENCH["expected"](name)
    found = list(BENCH["claims"](render_scene(REPO / "scenes" / f"{name}.py"), told))
    assert len(found) >= 5
    assert [claim for claim in found if not BENCH["holds"](claim)] == []
