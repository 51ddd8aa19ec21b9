"""Which candidate effect is accepted, by what it gained on each strike left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.diagnosis.selection.acceptance import Candidate, accepted, needed, refusal
from sonic_bullet.diagnosis.selection.thresholds import RULES
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.radiation import Radiation


def candidate(*drop_db: float, control_db: float = 0.0) -> Candidate:
    return Candidate("radiation", Radiation(0.1, 1.0), None, np.array(drop_db), float(np.mean(drop_db)), control_db, {})  # type: ignore[arg-type]


def test_less_will_do_where_it_is_most_of_what_is_open() -> None:
    told = [needed(gap, first=True) for gap in (10.0, 2.0, 0.5, 0.1)]
    assert told == pytest.approx([0.8, RULES.least_drop_db, 0.25, 0.2])
    assert [needed(gap, first=False) for gap in (10.0, 2.0, 0.5, 0.1)] == pytest.approx(
        [0.8, RULES.least_drop_db, RULES.least_drop_db, RULES.least_drop_db]
    )
    assert accepted(candidate(0.3, 0.31, 0.29, 0.3, 0.3), 0.5, first=True)
    assert not accepted(candidate(0.3, 0.31, 0.29, 0.3, 0.3), 0.5, first=False), (
        "what a name leaves may be its own fit's"
    )
    assert not accepted(candidate(0.3, 0.31, 0.29, 0.3, 0.3), 2.0, first=True), "a drop of a seventh is a mesh's"
    assert not accepted(candidate(0.15, 0.15, 0.14, 0.16, 0.15), 0.2, first=True), "as little as chance gains"


def test_loud_strikes_may_speak_alone_but_not_a_single_one() -> None:
    assert accepted(candidate(0.0, -0.02, 0.05, 1.1, 0.4), 0.5, first=True)
    assert not accepted(candidate(0.0, 0.0, 0.0, 0.0, 2.0), 0.5, first=True)
    assert not accepted(candidate(0.0, -0.5, 0.05, 1.1, 0.9), 0.5, first=True), "one strike speaks against it"
    assert not accepted(candidate(0.0, -0.02, 0.05, 1.1, 0.4, control_db=0.3), 0.5, first=True), "as good as chance"


def test_of_what_lines_are_sure_of_one_loud_strike_will_do() -> None:
    """What goes with level squared is plain at the loudest; a loud one that is not the one to gain is no such thing."""
    drop, level = (0.0, 0.01, 0.02, 0.06, 0.8), np.array([1.0, 2.0, 3.0, 4.0, 9.0])
    sure = replace(candidate(*drop), effect=AmplitudePitch(0.1), impulse_n_s=level)
    assert sure.certain and sure.loud
    assert accepted(sure, 0.4, first=True)
    assert not accepted(replace(sure, effect=Radiation(0.1, 1.0)), 0.4, first=True), "its lines were not asked"
    assert not accepted(replace(sure, impulse_n_s=level[::-1]), 0.4, first=True), "the softest gains"
    assert not accepted(sure, 0.4, first=False)
    assert not accepted(sure, 1.2, first=True), "a seventh of the gap"
    assert not accepted(replace(sure, drop_db=np.array([-0.9, 0.4, 0.4, 0.4, 0.41])), 1.0, first=True), (
        "one speaks against it"
    )


def test_beside_another_name_the_loudest_may_speak_for_what_goes_with_level() -> None:
    """It was left out, and the bend found from the softer ones plays it; these hardly sound otherwise, and may lose a
    little by it.
    """
    level = np.array([1.0, 2.0, 3.0, 4.0, 9.0])
    sure = replace(candidate(-0.01, -0.13, -0.07, -0.11, 2.9), effect=AmplitudePitch(0.1), impulse_n_s=level)
    assert accepted(sure, 0.9, first=False)
    assert not accepted(replace(sure, effect=Radiation(0.1, 1.0)), 0.9, first=False), "its lines were not asked"
    assert not accepted(replace(sure, impulse_n_s=level[::-1]), 0.9, first=False), "the softest gains"
    assert not accepted(replace(sure, drop_db=np.array([-0.2, -0.13, -0.07, -0.11, 2.9])), 0.9, first=False), (
        "the others lose too much"
    )
    assert not accepted(replace(sure, control_db=2.0), 0.9, first=False), "as good as chance"


def test_one_odd_strike_does_not_outvote_four_that_gain_much() -> None:
    assert accepted(candidate(-0.02, 3.9, -3.5, 5.1, 3.7), 4.0, first=True)
    assert not accepted(candidate(-2.0, 3.9, -3.5, 5.1, 3.7), 4.0, first=True), "nor two"
    assert not accepted(candidate(0.1, 0.9, -0.9, 1.2, 0.8), 4.0, first=True), "what little they gain may be chance"
    assert not accepted(candidate(-0.02, 3.9, -9.0, 5.1, 0.7), 4.0, first=True), "what it loses counts in the mean"


def test_a_refusal_says_its_rule() -> None:
    """Each rule in words with its number; none of what is accepted."""
    assert refusal(candidate(1.0, 1.1, 0.9, 1.0), 2.0, first=True) == ""
    assert "must come 0.40 dB nearer" in refusal(candidate(0.1, 0.1, 0.1, 0.1), 2.0, first=True)
    assert "standard errors" in refusal(candidate(4.0, -1.0, 0.2, -0.4), 2.0, first=True)
    assert "chance" in refusal(candidate(1.0, 1.1, 0.9, 1.0, control_db=0.95), 2.0, first=True)
