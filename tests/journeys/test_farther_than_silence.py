"""A strong radiation leaves a baseline farther than silence; its name brings it near."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.suite import plans
from benchmarks.suite.cases import make_case
from tests.cli.test_commands import run


@pytest.mark.slow
def test_an_effect_is_found_from_a_baseline_farther_than_silence(tmp_path: Path) -> None:
    (plan,) = [p for p in plans.singles(7411) if p.name == "single-radiation-strong-1"]
    made = make_case(tmp_path, plan, tmp_path / "modes")
    out = tmp_path / "d.json"
    assert run("diagnose", str(tmp_path / plan.name), "--json", str(out)) == 0, made
    found = json.loads(out.read_text())
    assert (found["verdict"], [e["id"] for e in found["effects"]]) == ("explained", ["radiation"])
    assert found["errors"]["before"]["holdout"] > 25 and found["errors"]["after"]["holdout"] < 3
