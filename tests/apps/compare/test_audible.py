"""The rank test alarms as often as it says, and not by who is asked first."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.compare.ensemble import RUNS, Ensemble, ShiftPlan, judge_run
from sonic_bullet.simulators.calls import Call, ObjectId

SIGNIFICANCE = 0.01
SHIFT_M = 1e-4


def known(rng: np.random.Generator) -> Ensemble:
    return Ensemble(rng.normal(size=(RUNS, 11)), rng.normal(size=(RUNS, 96)), 1.0, True)


def test_chance_alarms_in_one_of_a_hundred() -> None:
    rng = np.random.default_rng(35)
    alarms = [judge_run(known(rng), rng.normal(size=11), rng.normal(size=96)).beyond_chance for _ in range(400)]
    assert 0 <= sum(alarms) <= 12  # 4 expected; more than 12 of 400 at 1 % has a chance of 1e-4
    assert (RUNS + 1) * SIGNIFICANCE == 1  # the first of all runs alone


def test_what_stands_out_alarms() -> None:
    rng = np.random.default_rng(36)
    found = judge_run(known(rng), rng.normal(size=11) + 8 * (np.arange(11) == 4), rng.normal(size=96))
    assert found.beyond_chance
    assert found.rank == 1
    assert found.p == pytest.approx(0.01)


def test_starts_are_shifted_along_the_support_by_a_tenth_of_a_millimetre() -> None:
    plan = ShiftPlan(7)
    made = [
        plan.ahead_of(Call("createMultiBody", 0, {"baseMass": mass, "basePosition": (1.0, 2.0, 3.0)}))[1][
            "basePosition"
        ]  # type: ignore[index]
        for mass in (0.0, 1.0, 1.0)
    ]
    moved = np.array(made) - (1.0, 2.0, 3.0)
    assert np.array_equal(moved[0], np.zeros(3))
    assert np.linalg.norm(moved[1:], axis=1) == pytest.approx([SHIFT_M, SHIFT_M])
    assert np.array_equal(moved[:, 2], np.zeros(3))
    assert not np.allclose(moved[1], moved[2])
    place = {"bodyUniqueId": ObjectId("a", 1), "posObj": (0.0, 0.0, 1.0), "ornObj": (0.0, 0.0, 0.0, 1.0)}
    _, later = plan.ahead_of(Call("resetBasePositionAndOrientation", 0, place, ObjectId("a", 1)))
    assert later is not None
    assert np.linalg.norm(np.subtract(later["posObj"], (0.0, 0.0, 1.0))) == pytest.approx(SHIFT_M)
