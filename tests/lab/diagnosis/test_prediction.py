"""A prediction is made once a hypothesis and body; what one strike makes of it is worked out from it alone."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.prediction import prediction
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, predict, predict_each, predict_fitted
from sonic_bullet.records import Array
from tests.made.body import ALPHA, BETA, IMPULSE, SR, recorded, struck, truth
from tests.made.problems import posed

LAW = DampingLaw("power", 6e-3, 1.4)


def test_modes_are_the_damped_ones_of_the_body() -> None:
    """f_d² = f² − d²/4π², d = (α + βω²)/2, in the body's own order."""
    p = predict(truth(), struck())
    omega = 2 * np.pi * p.base.freq_hz
    decay = (ALPHA + BETA * omega**2) / 2
    assert p.model.decay_per_s == pytest.approx(decay)
    assert 2 * np.pi * p.model.freq_hz == pytest.approx(np.sqrt(omega**2 - decay**2))
    assert p.order.tolist() == list(range(p.base.mode_count))
    with pytest.raises(FrozenInstanceError):
        p.order = p.order  # type: ignore[misc]


def test_corrections_are_taken_out_where_there_are_any() -> None:
    body, off = struck(), np.linspace(-3e-3, 3e-3, 18)
    plain, moved = predict(truth(), body), predict(replace(truth(), correction={"plate": off}), body)
    assert plain.without_corrections() is plain
    assert moved.model.freq_hz == pytest.approx(plain.model.freq_hz * (1 + off), rel=1e-5)
    assert (moved.without_corrections().model.freq_hz == plain.model.freq_hz).all()


def test_strikes_are_what_the_effects_make_of_them() -> None:
    p = predict(truth(ContactTime(3e-4, 0.02, 0.0)), struck())
    assert [p.impact(i).impulse_n_s for i in range(5)] == list(IMPULSE)
    assert p.impact(0).tau_s == pytest.approx(3e-4)
    ring = p.ring(2)
    assert (np.abs(ring.amplitude) > 0).any() and (ring.freq_hz == p.model.freq_hz).all()
    assert (p.sounds((2, 4), 800, SR) == np.stack([p.sound(2, 800, SR), p.sound(4, 800, SR)])).all()


def test_a_problem_predicts_once_a_hypothesis_and_body(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five strikes, distance and floor: one set of modes."""
    body, made, original = recorded(), [], prediction.predict

    def counted(h: object, one: object) -> Prediction:
        made.append(one)
        return original(h, one)  # type: ignore[arg-type]

    monkeypatch.setattr(prediction, "predict", counted)
    problem = posed((body,), takes_of((body,)))
    problem.score(truth(LAW))
    assert made == [body]
    problem.distance_db(truth())
    assert made == [body, body]


def test_each_body_is_predicted_once_and_only_fitted_ones_where_those_are_asked() -> None:
    fitted, other = recorded(), struck()
    both = predict_each(truth(), (fitted, other, fitted))
    assert list(both) == [fitted, other]
    assert list(predict_fitted(truth(), (other, fitted))) == [fitted]


def test_a_sound_outside_the_band_is_silent() -> None:
    p = predict(truth(), replace(struck(), band_hz=(0.0, 1000.0)))
    silent: Array = p.ring(0).amplitude == 0
    assert (silent == (p.model.freq_hz > 1000.0)).all()
