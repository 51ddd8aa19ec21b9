"""Beside a room, whose response says what a law does to every line as well, lines left out speak for the law, or do
not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, reidentify_room
from sonic_bullet.lab.diagnosis.prediction.prediction import predict_each
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, Score
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate
from sonic_bullet.lab.diagnosis.selection.cross_validation import cross_validated
from sonic_bullet.lab.diagnosis.selection.decay_test import likelier, tells
from sonic_bullet.lab.diagnosis.selection.simplest import by_lines, helps
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.signal.log_spectral import floor_between
from tests.made.body import SR, plate, recorded, truth
from tests.made.problems import posed

BAND = (50.0, 7_500.0)
ROOM = Room(0.5, 0.3, seed=3)
LAW = DampingLaw("power", 0.03, exponent=0.9)


def tried(*effects: DampingLaw) -> tuple[list[Candidate], bool]:
    """A law's cross-validation beside a room that is known, and whether it is accepted by lines alone."""
    body = recorded(*effects, ROOM)
    assert body.recorded is not None and body.recorded.signals is not None
    floor = floor_between(list(body.recorded.signals))
    takes = [AudioObservation(body, i, x, SR, floor) for i, x in zip(body.fitted, body.recorded.signals, strict=True)]
    h = reidentify_room(refit_material(truth(ROOM), (body,)), (body,))
    found = cross_validated(h, posed((body,), takes, DampingLaw), evidence_of(h, (body,), BAND))
    problem, shapeless = posed((body,), takes), posed((replace(body, family=None),), takes)
    now = problem.score(h)
    far = Score(100.0, now.floor_db)
    for c in found:
        assert helps(c, problem, far, far), "much nearer than nothing, whatever it is"
        assert not (helps(c, shapeless, far, far) or by_lines(c, shapeless, now)), (
            "without a mesh, of a room's lines none is known to be a mode"
        )
    return found, any(by_lines(c, problem, now) for c in found)


@pytest.mark.slow
def test_a_law_in_a_room_is_told_by_lines() -> None:
    found, named = tried(LAW)
    assert found[0].lines > RULES.strong_evidence
    assert named


@pytest.mark.slow
def test_rayleighs_own_damping_in_a_room_is_no_law() -> None:
    found, named = tried()
    assert all(c.lines < RULES.strong_evidence for c in found)
    assert not named


def test_only_what_changes_decays_and_moves_nothing_is_asked_of_lines() -> None:
    beside, alone = truth(ROOM), truth()
    assert tells(beside, LAW)
    assert not tells(alone, LAW)  # without a room strikes speak for themselves
    assert not tells(beside, ContactTime(2e-4, 0.02, 0.0))
    assert not tells(beside, AddedMass((0.0, 0.0, 0.0), 0.01))


def test_lines_that_were_fitted_to_say_nothing() -> None:
    """And those that were not count by Cauchy's loss: with the decays' own law each gains what the other law has it
    miss.
    """
    body = recorded(LAW)
    assert body.recorded is not None
    fitted_to = refit_material(truth(), (body,))
    wrong, right = (predict_each(h, (body,)) for h in (fitted_to, truth(LAW)))
    every = evidence_of(fitted_to, (body,), BAND)
    assert likelier(wrong, right, every, every) == 0.0
    told = thin_evidence(every, (body.recorded, 0), 0.75, np.random.default_rng(1))
    gain = likelier(wrong, right, every, told)
    assert gain > 0
    assert likelier(right, wrong, every, told) == pytest.approx(-gain)
    one, x = every.observed[0], plate()
    out = ~np.isin(one.freq_hz, told.observed[0].freq_hz)
    law = LAW.decay_per_s(2 * np.pi * x.freq_hz[[m[0] for m in one.mode]])
    rayleigh = 0.5 * (fitted_to.alpha_per_s + fitted_to.beta_s * (2 * np.pi * x.freq_hz[[m[0] for m in one.mode]]) ** 2)
    sd = np.hypot(one.decay_sd_per_s / one.decay_per_s, 0.02)
    by_hand = [4 * np.log1p((np.log(one.decay_per_s / d) / sd / 2) ** 2)[out].sum() for d in (rayleigh, law)]
    assert gain == pytest.approx(by_hand[0] - by_hand[1], rel=0.05)
