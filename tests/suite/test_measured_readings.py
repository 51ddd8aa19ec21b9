"""What is said of a measured set must stand in every reading of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import measured
from benchmarks.measured_sets.observed import JITTER, READINGS, jittered, reading
from benchmarks.measured_sets.page import section, verdict
from benchmarks.measured_sets.values import Outcome, Row

ROW = Row("every second line", 12, "dB of d", 5.0, 2.0, 4.8, 0.01, "damping-law")


def test_the_first_reading_is_the_recording_and_the_others_lie_beside_it() -> None:
    x = np.random.default_rng(0).standard_normal(4000)
    assert jittered(x) is x
    with reading(1):
        one = jittered(x)
        assert (jittered(x) == one).all(), "the same bytes every time"
    with reading(2):
        assert (jittered(x) != one).any()
    assert 0 < np.abs(one / x - 1).max() < 6 * JITTER
    assert jittered(x) is x


@pytest.mark.parametrize(
    ("second", "accepted", "said"),
    [
        (ROW, True, "| 2 | 4.8 | 1% | damping-law **accepted** |"),
        (replace(ROW, after=2.5), True, "| 2 (2 to 2.5) | 4.8 | 1% | damping-law **accepted** |"),
        (replace(ROW, after=5.5), False, "| 2 (2 to 5.5) | 4.8 | 1% | damping-law (accepted in 2 of 3 readings) |"),
        (replace(ROW, effect=""), False, "| 2 (none in 1) | 4.8 | 1% | damping-law (accepted in 2 of 3 readings) |"),
    ],
    ids=["alike", "as good", "worse", "gone"],
)
def test_what_is_named_is_named_in_every_reading(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, second: Row, accepted: bool, said: str
) -> None:
    turn: list[int] = []

    def judge(folder: Path, case: dict[str, object]) -> Outcome:
        number = 0 if jittered(np.ones(1))[0] == 1 else 1 + len([t for t in turn if t])
        turn.append(number)
        return Outcome((second if number == 1 else ROW,), "", "nothing", lambda _: None)

    monkeypatch.setitem(measured.JUDGES, tmp_path.name, judge)
    monkeypatch.setattr("sonic_bullet.parallel._can_fork", lambda: False)
    page = measured.judged(tmp_path)
    assert not isinstance(page, str)
    assert turn == [0, *range(1, READINGS), 0]
    assert page.found.rows[0].accepted == accepted
    assert verdict(page.found.rows).startswith("named" if accepted else "unexplained")
    assert said in section(page, "")


def test_a_reading_that_fails_leaves_nothing_standing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def judge(folder: Path, case: dict[str, object]) -> Outcome:
        if jittered(np.ones(1))[0] != 1:
            raise ValueError("no line that most taps have")
        return Outcome((ROW,), "", "nothing", lambda _: None)

    monkeypatch.setitem(measured.JUDGES, tmp_path.name, judge)
    page = measured.judged(tmp_path)
    assert not isinstance(page, str)
    assert not page.found.rows[0].accepted
