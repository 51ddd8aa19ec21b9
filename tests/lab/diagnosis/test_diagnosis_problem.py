"""What stays the same during a diagnosis is one record; a score is where there is something to compare, and says what
is open.
"""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import pytest

from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.score import (
    Comparable,
    ComparableTakes,
    Incomparable,
    Score,
    comparable,
    least_db,
    mean_db,
)
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import recorded


def test_a_score_is_what_its_strikes_say() -> None:
    body = recorded()
    h = fitted(body)
    made = {body: predict(h, body)}
    found = comparable(takes_of((body,)), made)
    assert isinstance(found, ComparableTakes)
    problem = DiagnosisProblem((body,), found.takes, BAND, (DampingLaw,), seed=4)
    score = problem.score(h)
    assert score == problem.score_predictions(made) == Score(mean_db(found.takes, made), least_db(found.takes, made))
    assert score.gap_db == score.distance_db - score.floor_db
    assert problem.distance_db(h) == score.distance_db
    assert problem.has_audio and problem.has_meshes
    assert not replace(problem, bodies=(replace(body, family=None),)).has_meshes


def test_candidates_change_and_nothing_else_does() -> None:
    body = recorded()
    found = comparable(takes_of((body,)), {body: predict(fitted(body), body)})
    assert isinstance(found, ComparableTakes)
    problem = DiagnosisProblem((body,), found.takes, BAND, (DampingLaw,), seed=4)
    other = problem.only(ContactTime)
    assert other.effects == (ContactTime,)
    assert (other.bodies, other.takes, other.band_hz, other.seed) == (problem.bodies, problem.takes, problem.band_hz, 4)
    with pytest.raises(FrozenInstanceError):
        problem.seed = 5  # type: ignore[misc]


def test_without_anything_to_compare_there_is_no_problem() -> None:
    body = recorded()
    assert isinstance(comparable((), {}), Incomparable)
    with pytest.raises(ValueError, match="something to compare"):
        DiagnosisProblem((body,), Comparable(()), BAND)
    found = comparable(takes_of((body,)), {body: predict(fitted(body), body)})
    assert isinstance(found, ComparableTakes)
    with pytest.raises(ValueError, match="lower to a higher"):
        DiagnosisProblem((body,), found.takes, (500.0, 500.0))


def test_a_gap_may_be_negative() -> None:
    """Noise drawn again may be farther from itself than what is played."""
    assert Score(1.0, 1.25).gap_db == -0.25
