"""Which candidates of a round are compared, once one of them is accepted."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, evidence
from sonic_bullet.lab.diagnosis.selection.simplest import examine_candidates, simplest
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.lab.effects.searches import propose
from tests.made.body import recorded, truth
from tests.made.problems import posed

BAND = (50.0, 7_500.0)
ALIKE = np.array([5.0, 5.2, 4.8, 5.1, 4.9])  # gains in dB, the same at every strike
WITH_STRIKE = np.array([0.2, 2.0, 6.0, 9.0, 12.0])


@cache
def heard() -> tuple[StruckBody, Hypothesis, Evidence]:
    """A body struck by pulses, what fits it without an effect, and what the takes then say."""
    body = recorded(ContactTime(9e-4, 0.02, -0.2))
    plain = refit_material(truth(), (body,))
    return body, plain, evidence_of(plain, (body,), BAND)


@cache
def with_effect(kind: type[Effect]) -> tuple[Effect, Hypothesis]:
    """An effect as it is looked for, and what fits with it."""
    body, plain, told = heard()
    effect = propose(kind, told)
    assert effect is not None
    return effect, refit_material(replace(plain, effects=(effect,)), (body,))


@pytest.mark.parametrize("accepts_one", [True, False])
def test_a_nearer_candidate_is_compared_with_an_accepted_one(accepts_one: bool) -> None:
    """A pulse gains more the louder the strike, a filter alike; alone the pulse's gains say too little."""
    body, plain, told = heard()
    assert evidence(WITH_STRIKE) < RULES.strong_evidence < evidence(ALIKE)
    gains = {ContactTime: WITH_STRIKE, MeasurementChain: ALIKE if accepts_one else 0.001 * ALIKE}
    found = []
    for kind, drop_db in gains.items():
        effect, h = with_effect(kind)
        found.append(Candidate(effect.id, effect, h, drop_db, float(drop_db.mean()), 0.0, {}))
    problem = posed((body,), takes_of((body,)))
    now = problem.score(plain)
    able = [c for c in examine_candidates(found, problem, now, now, now.gap_db) if not c.why_not]
    assert [c.id for c in able] == (["contact-time", "measurement-chain"] if accepts_one else [])
    if able:
        assert simplest(able, (body,), told).id == "contact-time"


def test_a_name_closes_a_tenth_of_the_whole_gap() -> None:
    body, plain, _ = heard()
    effect, h = with_effect(ContactTime)
    one = Candidate(effect.id, effect, h, ALIKE, float(ALIKE.mean()), 0.0, {})
    problem = posed((body,), takes_of((body,)))
    now = problem.score(plain)
    for whole_db, accepted in ((40.0, True), (60.0, False)):
        (made,) = examine_candidates([one], problem, now, now, whole_db)
        assert (not made.why_not) == accepted
