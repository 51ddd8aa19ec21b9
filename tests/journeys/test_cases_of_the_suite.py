"""Cases of the suite that were missed once are named, by the command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.suite import plans
from benchmarks.suite.cases import make_case
from tests.apps.cli.test_commands import run

MISSED = (
    (7411, "single-radiation-strong-1", "radiation"),  # the baseline is farther than silence
    (2764, "single-rebound-strong-0", "rebound"),  # one strike alone allows many delays
    (2764, "single-contact-time-weak-0", "contact-time"),  # a filter came in beside the pulse, and took its place
)


@pytest.mark.slow
@pytest.mark.parametrize(("draw", "name", "effect"), MISSED)
def test_a_case_that_was_missed_is_named(draw: int, name: str, effect: str, tmp_path: Path) -> None:
    (plan,) = [p for p in plans.singles(draw) if p.name == name]
    make_case(tmp_path, plan, tmp_path / "modes")
    (tmp_path / name / "truth.json").unlink()
    out = tmp_path / "d.json"
    assert run("diagnose", str(tmp_path / name), "--json", str(out)) == 0
    found = json.loads(out.read_text())
    assert (found["verdict"], [e["id"] for e in found["effects"]]) == ("explained", [effect])
    before, after = (found["errors"][when]["holdout"] for when in ("before", "after"))
    assert after < 0.35 * before
