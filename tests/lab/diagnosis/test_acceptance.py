"""Which candidate effect is accepted, by what it gained on each strike left out."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.lab.diagnosis.selection.acceptance import (
    Candidate,
    evidence,
    gain_needed_db,
    is_accepted,
    is_open,
    refusal,
)
from sonic_bullet.lab.diagnosis.thresholds import RULES


def candidate(*drop_db: float, gap_db: tuple[float, ...] = (1.0,), control_db: float = 0.0) -> Candidate:
    drop, mean = np.array(drop_db), float(np.mean(drop_db))
    return Candidate("radiation", Radiation(0.1, 1.0), None, drop, mean, control_db, {}, gap_db=np.array(gap_db))  # type: ignore[arg-type]


def test_of_equal_gaps_evidence_is_students() -> None:
    """n ln(1 + t²/(n − 1)), whatever the gaps' size; with the sign of the mean."""
    gain = np.array([1.0, 1.5, 0.5, 2.0, 1.2])
    t = gain.mean() / (gain.std(ddof=1) / np.sqrt(5))
    assert evidence(gain) == pytest.approx(5 * np.log(1 + t**2 / 4))
    assert evidence(gain, 7.0) == pytest.approx(evidence(gain)) == pytest.approx(-evidence(-gain))
    assert evidence(3 * gain, gain[::-1]) == pytest.approx(evidence(gain, gain[::-1]))


def test_what_closes_one_share_of_every_gap_is_evidence_however_loud_strikes_are() -> None:
    gap = np.array([0.05, 0.1, 0.2, 0.9, 4.0])
    told = 0.8 * gap + np.array([0.02, -0.03, 0.0, 0.05, -0.02])
    assert evidence(told, gap) > 20 > evidence(told)
    assert is_accepted(candidate(*told, gap_db=tuple(gap)), 1.0)
    assert not is_accepted(candidate(*told[::-1], gap_db=tuple(gap)), 1.0), "the softest gains"


def test_nothing_is_no_evidence() -> None:
    assert evidence(np.zeros(5)) == evidence(np.array([3.0])) == evidence(np.array([np.inf, 1.0])) == 0
    assert evidence(np.array([1.0, 1.0]), np.zeros(2)) == 0


def test_chance_is_seldom_evidence() -> None:
    """Of normal gains of five strikes about nothing, on one side, P(t > 3.05) = 1.9 %: least_drop_db and the control
    effect are asked beside.
    """
    gain = np.random.default_rng(1).standard_normal((4000, 5))
    assert np.mean([evidence(g) > RULES.strong_evidence for g in gain]) == pytest.approx(0.019, abs=0.006)


def test_a_gain_is_needed_that_is_some_of_what_is_open() -> None:
    assert [gain_needed_db(gap) for gap in (10.0, 2.0, 0.5)] == pytest.approx([1.0, 0.2, 0.2])
    assert is_accepted(candidate(0.3, 0.31, 0.29, 0.3, 0.3), 0.5)
    assert not is_accepted(candidate(0.3, 0.31, 0.29, 0.3, 0.3), 4.0), "a drop of a thirteenth is a mesh's"
    assert not is_accepted(candidate(0.15, 0.15, 0.14, 0.16, 0.15), 0.2)


def test_a_single_strike_does_not_speak_for_all() -> None:
    assert not is_accepted(candidate(0.0, 0.0, 0.0, 0.0, 2.0), 0.5)
    assert not is_accepted(candidate(0.0, -0.5, 0.05, 1.1, 0.9), 0.5)
    assert not is_accepted(candidate(-0.02, 3.9, -9.0, 5.1, 0.7), 4.0)


def test_a_refusal_says_its_rule() -> None:
    """Each rule in words with its number; none of what is accepted."""
    assert refusal(candidate(1.0, 1.1, 0.9, 1.0), 2.0) == ""
    assert "must come 0.20 dB nearer" in refusal(candidate(0.1, 0.1, 0.1, 0.1), 2.0)
    assert "say less than 6" in refusal(candidate(4.0, -1.0, 0.2, -0.4), 2.0)
    assert "chance" in refusal(candidate(1.0, 1.1, 0.9, 1.0, control_db=0.95), 2.0)


def test_a_second_effect_may_close_less_than_a_share_of_all_if_it_closes_nearly_all_that_is_open() -> None:
    assert gain_needed_db(15.0, 1.2) == pytest.approx(0.9)  # 1.5 without what is open now
    assert gain_needed_db(15.0, 8.0) == pytest.approx(1.5)
    assert is_open(1.33, 15.0) and not is_open(0.5, 15.0)
    assert not is_open(0.3, 5.0)
