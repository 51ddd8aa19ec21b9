"""Several objects of one material: a strike left out is left out of its own object alone, and what is learnt of the
rest holds for it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.radiation import AIR_IMPEDANCE, Radiation, areas
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import is_accepted
from sonic_bullet.lab.diagnosis.selection.cross_validation import cross_validated
from sonic_bullet.lab.diagnosis.selection.exchange import left_out_db
from sonic_bullet.signal.log_spectral import floor_between
from tests.made.body import SR, recorded, truth
from tests.made.problems import posed

BAND = (50.0, 7_500.0)
LAW = DampingLaw("power", 6e-3, 1.4)


def alone(body: StruckBody, strike: int) -> StruckBody:
    """The body as if but one of its strikes had been recorded."""
    assert body.recorded is not None and body.recorded.signals is not None
    lines = body.recorded.lines
    one = replace(lines, amplitude=lines.amplitude[[strike]], amplitude_sd=lines.amplitude_sd[[strike]])
    mine = replace(
        body.recorded, lines=one, recordings=(body.recordings[strike],), signals=body.recorded.signals[[strike]]
    )
    return replace(body, recorded=mine)


def takes_of(*bodies: StruckBody) -> list[AudioObservation]:
    made = []
    for body in bodies:
        assert body.recorded is not None and body.recorded.signals is not None
        made += [
            AudioObservation(body, i, x, SR, floor_between(list(body.recorded.signals)))
            for i, x in zip(body.fitted, body.recorded.signals, strict=True)
        ]
    return made


@pytest.mark.slow
def test_a_strike_is_left_out_of_its_own_object_alone() -> None:
    bodies = (recorded(LAW), replace(recorded(LAW, seed=6), name="other"))
    told = evidence_of(truth(), bodies, BAND)
    less = thin_evidence(told, (bodies[1].recorded, 2), 1.0, np.random.default_rng(0))
    assert [h.strike for h in less.observed] == [(0, 1, 2, 3, 4), (0, 1, 3, 4)]
    assert less.observed[0].signal is not None and len(less.observed[0].signal) == 5
    assert np.array_equal(less.observed[1].amplitude, told.observed[1].amplitude[[0, 1, 3, 4]])


def test_an_object_of_one_strike_is_left_out_whole() -> None:
    first = recorded(LAW)
    bodies = (first, alone(recorded(LAW, seed=6), 3))
    takes = takes_of(*bodies)
    assert takes[-1].place == (bodies[1].recorded, 0) and takes[2].place == (first.recorded, 2)
    told = evidence_of(truth(), bodies, BAND)
    less = thin_evidence(told, takes[-1].place, 1.0, np.random.default_rng(0))
    assert [h.source for h in less.observed] == [first.recorded]
    by_rest, by_first = refit_material(truth(), bodies, less.observed), refit_material(truth(), (first,))
    assert (by_rest.alpha_per_s, by_rest.beta_s, by_rest.gain) == (by_first.alpha_per_s, by_first.beta_s, by_first.gain)


@pytest.mark.slow
def test_objects_of_one_strike_stand_trial_with_the_others() -> None:
    bodies = (recorded(LAW), alone(recorded(LAW, seed=6), 3))
    takes = takes_of(*bodies)
    plain = refit_material(truth(), bodies)
    found = cross_validated(plain, posed(bodies, takes, DampingLaw), evidence_of(plain, bodies, BAND))
    assert [c.id for c in found] == ["damping-law"] and len(found[0].drop_db) == len(takes)
    assert is_accepted(found[0], 5.0) and found[0].drop_db.min() > 0
    out = left_out_db(found[0].hypothesis, 0, posed(bodies, takes))
    assert len(out) == len(takes) and np.isfinite(out).all()


def test_what_the_medium_takes_is_taken_of_another_object_by_its_own_shape() -> None:
    """Δd = s ½ ρ₀ c σ A of the other's own A; a dashpot under the first object is not under the other one.

    α and β are without what a body radiates once that is named, so another object must radiate, too.
    """
    air, held = Radiation(0.04, 0.3), SupportDamping(((0.0477, 0.0371, 0.0),), (9.0,))
    other = replace(recorded(), recorded=None)
    other = replace(other, model=replace(other.model, shape=np.float32(2) * other.model.shape))  # a quarter of the mass
    plain, model = predict(truth(), other).model, predict(replace(truth(), effects=(air, held)), other).model
    expected = 0.3 * 0.5 * AIR_IMPEDANCE * air.efficiency(plain.freq_hz) * areas(plain)
    assert expected.min() > 0
    assert model.decay_per_s - plain.decay_per_s == pytest.approx(expected, rel=1e-3)
