"""Modes whose decay goes with their level: their numbers are the envelopes', twins and all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.score import mean_db, predict_takes
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.amplitude_damping import propose_amplitude_damping
from sonic_bullet.lab.effects.amplitude_damping.damped_lines import fit_decays, fitted_decay, lines_under
from sonic_bullet.lab.effects.common.axes import ANGLES
from sonic_bullet.lab.effects.common.envelope import envelopes
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.records import ModalModel
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import ALPHA, BETA, GAIN, SR, plate, recorded

PAIR = (3, 4)


def with_twins() -> ModalModel:
    """The plate, two neighbours of it at one frequency."""
    model = plate()
    freq = model.freq_hz.copy()
    freq[list(PAIR)] = freq[list(PAIR)].mean()
    return replace(model, freq_hz=freq)


def assert_nearer_than_the_meshs(
    found: AmplitudeDamping | AmplitudePitch, base: Hypothesis, body: StruckBody, evidence: Evidence
) -> None:
    """The axes that were found play nearer to the recordings than the mesh's."""
    takes = takes_of((body,))
    own, mesh = (
        mean_db(takes, predict_takes(refit_material(replace(base, effects=(e,)), (body,), evidence.observed), takes))
        for e in (found, replace(found, freq_hz=(), turn_rad=()))
    )
    assert own is not None and mesh is not None and own < mesh


@parametrize_few(("damping_growth", "power"), [(2.0, 1.0), (5.0, 1.0), (4.0, 2.0)], (1,))
def test_choke_and_decays_are_told_to_a_few_percent(damping_growth: float, power: float) -> None:
    """However weak, as decays are no longer picked from a grid; and with what power of the level."""
    body = recorded(AmplitudeDamping(damping_growth, "velocity", power=power))
    base = refit_material(fitted(body), (body,))
    found = propose_amplitude_damping(evidence_of(base, (body,), BAND))
    assert found is not None and (found.measure, found.power, found.freq_hz) == ("velocity", power, ())
    assert found.damping_growth == pytest.approx(damping_growth, rel=0.1)
    assert found.alpha_per_s == pytest.approx(ALPHA, rel=0.03)
    assert found.beta_s == pytest.approx(BETA, rel=0.03)
    assert base.gain * found.louder == pytest.approx(GAIN, rel=0.03)


@pytest.mark.slow
def test_twins_have_the_axes_that_their_envelopes_tell() -> None:
    model = with_twins()
    middle = float(model.freq_hz[PAIR[0]])
    body = recorded(AmplitudeDamping(5.0, "velocity", freq_hz=(middle,), turn_rad=(0.6,)), model=model)
    base = refit_material(fitted(body), (body,))
    evidence = evidence_of(base, (body,), BAND)
    found = propose_amplitude_damping(evidence)
    assert found is not None
    assert found.damping_growth == pytest.approx(5.0, rel=0.1)
    assert found.freq_hz == pytest.approx((middle,), rel=1e-3)
    assert found.turn_rad[0] == pytest.approx(0.6, abs=0.1)
    assert_nearer_than_the_meshs(found, base, body, evidence)
    less = thin_evidence(evidence, (evidence.observed[0].source, 2), 1.0, np.random.default_rng(0))
    other = replace(found, turn_rad=(1.2,))
    held, learnt = (propose_amplitude_damping(replace(less, known=other, held_out=trial)) for trial in (True, False))
    assert held is not None and learnt is not None
    assert held.turn_rad == (1.2,) and learnt.turn_rad[0] == pytest.approx(0.6, abs=0.1)
    assert abs(held.alpha_per_s / learnt.alpha_per_s - 1) > 1e-3, (
        "decays are told under the axes that they are played with"
    )


def test_levels_from_strike_to_strike_tell_the_axes_too() -> None:
    """Strikes an octave apart: the louder, the sooner choked; and where nobody hears the line, no angle is likely under
    which it would be loud.
    """
    model = with_twins()
    body = recorded(
        AmplitudeDamping(5.0, "velocity", freq_hz=(float(model.freq_hz[PAIR[0]]),), turn_rad=(0.6,)), model=model
    )
    observed = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND).observed[0]
    e = envelopes(observed)
    assert e is not None
    line = next(one for one in lines_under(e, observed, "velocity") if len(one.amplitude) > 1)
    found = fitted_decay(line, 5.0)
    assert ANGLES[int(found.between.argmin())] == pytest.approx(0.6, abs=0.1)
    assert np.ptp(found.between) > 1.0
    for one, growth in zip(fit_decays(line, np.array([1.0, 5.0])), (1.0, 5.0), strict=True):
        alone = fitted_decay(line, growth)
        assert np.allclose(one.spread, alone.spread, atol=1e-6) and np.allclose(one.between, alone.between, atol=1e-6)
        assert np.allclose(one.decay_per_s, alone.decay_per_s, rtol=1e-5)
    loud = np.abs(line.amplitude.sum(axis=2)[0] * line.level.max(axis=2)[0]).argmax()
    silent = replace(
        line,
        weight=np.where(np.arange(5)[:, None] == loud, 0.0, line.weight),
        log=np.where(np.arange(5)[:, None] == loud, -30.0, line.log),
    )
    assert (fitted_decay(silent, 5.0).between > found.between.min() + 1.0).all()


@pytest.mark.slow
def test_what_is_known_to_ring_beside_the_body_is_taken_out_of_its_lines() -> None:
    """A stand that rings just beside every mode hides how these fall; once it is named, its sound is no part
    of theirs.
    """
    freq = plate().freq_hz
    apart = np.array([np.abs(np.delete(freq, k) - f).min() for k, f in enumerate(freq)])
    beside = tuple(float(f) - 45.0 for f in freq[apart > 150])
    stand = ForeignMode(beside, (35.0,) * len(beside), (0.6,) * len(beside), (0.3,) * len(beside))
    body = recorded(AmplitudeDamping(4.0, "velocity", power=2.0), stand)
    told = evidence_of(refit_material(replace(fitted(body), effects=(stand,)), (body,)), (body,), BAND)
    one = told.observed[0]
    assert len(beside) > 4
    assert one.signal is not None and one.own is not None
    t = np.arange(one.signal.shape[1]) / SR
    rings = sum(0.6 * one.impulse_n_s[0] * np.exp(-35.0 * t) * np.cos(2 * np.pi * f * t + 0.3) for f in beside)
    assert one.signal[0] - one.own[0] == pytest.approx(rings, abs=1e-9)
    found = propose_amplitude_damping(told)
    assert found is not None and (found.measure, found.power) == ("velocity", 2.0)
    assert found.damping_growth == pytest.approx(4.0, rel=0.1)
    hidden = propose_amplitude_damping(replace(told, observed=(replace(one, own=None),)))
    assert hidden is None or abs(hidden.damping_growth / 4.0 - 1) > abs(found.damping_growth / 4.0 - 1)


def test_turned_twins_sound_as_before_where_nothing_is_choked() -> None:
    model = with_twins()
    other = AmplitudeDamping(1.0, freq_hz=(float(model.freq_hz[PAIR[0]]),), turn_rad=(0.6,)).turn_pairs(model)
    one, two = (
        np.einsum("vxj,wyj->vwxy", m.shape[-6:, :, list(PAIR)], m.shape[-6:, :, list(PAIR)]) for m in (model, other)
    )
    assert np.abs(model.shape - other.shape).max() > 0.1
    assert np.allclose(one, two, atol=1e-5)
    assert AmplitudeDamping(1.0, freq_hz=(123.0,), turn_rad=(0.6,)).turn_pairs(model).shape == pytest.approx(
        model.shape
    )


@pytest.mark.slow
def test_a_linear_body_proposes_no_choke() -> None:
    body = recorded(model=with_twins())
    assert propose_amplitude_damping(evidence_of(refit_material(fitted(body), (body,)), (body,), BAND)) is None
