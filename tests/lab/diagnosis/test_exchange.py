"""Several effects at once: what one took up alone is given back once the other is there, names included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.score import mean_db, predict_takes
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate
from sonic_bullet.lab.diagnosis.selection.exchange import decays_for, exchange_effects, together
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.contact_time import propose_contact_time
from sonic_bullet.lab.effects.measurement_chain import propose_measurement_chain
from tests.made.body import recorded, truth
from tests.made.problems import posed

BAND = (50.0, 7_500.0)
PULSE = ContactTime(9e-4, 0.02, 0.0)
SOUNDING = Radiation(0.05, 3.0, 0.5)


def problem_of(body: StruckBody) -> DiagnosisProblem:
    return posed((body,), takes_of((body,)))


@pytest.mark.slow
def test_a_filter_that_came_first_goes_for_the_pulse_that_a_tilt_of_level_had_hidden() -> None:
    """√σ and the pulse together look like a gentler low-pass, until both are fitted at once."""
    body = recorded(PULSE, SOUNDING)
    assert body.recorded is not None and body.recorded.signals is not None
    takes = takes_of((body,))
    plain = refit_material(truth(), (body,))
    told = evidence_of(plain, (body,), BAND)
    low, pulse = propose_measurement_chain(told), propose_contact_time(told)
    assert low is not None and pulse is not None
    wrong = replace(plain, effects=(low, Radiation(0.05, 3.0, 0.0)))
    drop = np.full(len(takes), 2.0)
    chosen, passed = (Candidate(e.id, e, plain, drop, float(drop.mean()), 0.0, {}) for e in (low, pulse))
    other = Candidate("radiation", wrong.effects[1], plain, drop, float(drop.mean()), 0.0, {})
    h, added = exchange_effects(wrong, [chosen, other], [(passed,), ()], posed((body,), takes))
    assert [c.id for c in added] == ["contact-time", "radiation"]
    found = {e.id: e for e in h.effects}
    assert found["contact-time"].parameters()["tau_s"] == pytest.approx(9e-4, rel=0.03)
    assert found["radiation"].parameters()["tilt"] == 0.5
    before = mean_db(takes, predict_takes(refit_material(wrong, (body,)), takes))
    after = mean_db(takes, predict_takes(h, takes))
    assert before is not None and after is not None and after < 0.6 * before


def test_effects_that_are_right_stay() -> None:
    body = recorded(PULSE, SOUNDING)
    h = together(truth(PULSE, SOUNDING), problem_of(body))
    found = {e.id: e.parameters() for e in h.effects}
    assert found["contact-time"]["tau_s"] == pytest.approx(9e-4, rel=0.02)
    assert found["radiation"]["radius_m"] == pytest.approx(0.05, rel=0.2)
    assert found["radiation"]["tilt"] == 0.5


def test_a_part_of_the_evidence_fits_the_same_pulse_again() -> None:
    """Eight lines of a few strikes may like another pulse somewhere else; it was not asked for."""
    body = recorded(PULSE, SOUNDING)
    told = evidence_of(truth(SOUNDING), (body,), BAND)
    for seed in range(6):
        less = replace(
            thin_evidence(told, (told.observed[0].source, seed % 5), 0.4, np.random.default_rng(seed)), known=PULSE
        )
        again = propose_contact_time(less)
        assert again is not None and again.pulse == PULSE.pulse
        assert again.duration_s(0.02) == pytest.approx(9e-4, rel=0.3)


def test_strikes_alone_do_not_put_one_decay_for_another() -> None:
    """A law and a radiation fitted in its place: the decays of lines know which, and are not asked of what says more
    than decays.
    """
    law = DampingLaw("relaxation", 5e-3, strength=0.03, tau_s=8e-5)
    body = recorded(law)
    right, wrong = truth(law), refit_material(truth(Radiation(0.05, 3.0)), (body,))
    assert decays_for(right, wrong, 0, problem_of(body)) > RULES.strong_evidence
    assert decays_for(wrong, right, 0, problem_of(body)) < -RULES.strong_evidence
    assert decays_for(truth(PULSE), right, 0, problem_of(body)) == 0
