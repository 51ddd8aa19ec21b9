"""A shape whose bare modes meet the lines no more than by chance is kept: a mass or a grain may move them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from benchmarks.suite import plans
from benchmarks.suite.cases import make_case
from sonic_bullet.lab.diagnosis import diagnose
from sonic_bullet.lab.diagnosis.evidence.baseline import Baseline, _has_shape_model
from tests.lab.diagnosis.test_shapeless import FLAT, evidence
from tests.made.body import recorded

DRAW = 6203


@pytest.mark.parametrize("chance", [True, False])
def test_chance_takes_a_shape_away_only_where_lines_are_asked_for(chance: bool) -> None:
    found, g = cast(Any, SimpleNamespace(gain_sd=0.1, plays_modes=lambda _: not chance)), evidence()
    g = replace(g, family=cast(Any, object()))
    assert _has_shape_model(found, g, by_lines=False)
    assert _has_shape_model(found, g, by_lines=True) != chance
    nowhere = replace(g, recordings=tuple(replace(r, position_m=None) for r in g.recordings))
    assert not _has_shape_model(found, nowhere, by_lines=False)
    assert not _has_shape_model(
        cast(Any, SimpleNamespace(gain_sd=np.nan, plays_modes=lambda _: True)), g, by_lines=False
    )


@pytest.mark.parametrize("chance", [True, False])
def test_a_baseline_is_doubtful_where_a_shape_may_be_anothers(chance: bool) -> None:
    found = cast(Any, SimpleNamespace(plays_modes=lambda _: not chance))
    assert Baseline(found, (recorded(),), FLAT, ()).doubtful == chance
    assert not Baseline(found, (replace(recorded(), family=None),), FLAT, ()).doubtful


@pytest.mark.slow
def test_a_mass_that_moves_most_modes_is_named(tmp_path: Path) -> None:
    """37 g on a slab of porcelain leave 8 of 21 lines near modes of the bare body, as many as by chance."""
    (plan,) = (p for p in plans.singles(DRAW) if p.name == "single-added-mass-strong-1")
    truth = make_case(tmp_path / "cases", plan, tmp_path / "modes")
    found = diagnose(tmp_path / "cases" / plan.name)
    assert [c.id for c in found.closed.added] == ["added-mass"]
    assert found.closed.added[0].effect.parameters()["mass_kg"] == pytest.approx(truth["effects"][0]["mass"], rel=0.2)
    assert found.errors["after"]["transfer"] < found.errors["before"]["transfer"] - 6
