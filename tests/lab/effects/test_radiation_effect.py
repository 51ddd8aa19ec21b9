"""`radiation`: the law of its spheres, how steeply it grows, and how loud a body is whose modes are tilted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import spherical_jn, spherical_yn

from sonic_bullet.effects.radiation import SOUND_M_S, Radiation
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.score import least_db, mean_db, predict_takes
from sonic_bullet.lab.effects.radiation import propose_radiation
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import GAIN, recorded


@pytest.mark.parametrize(("degree", "order"), [(0, 2), (1, 4)])
def test_efficiency_is_the_pulsating_and_the_oscillating_spheres(degree: int, order: int) -> None:
    """σ_n = 1/(x² |h_n'(x)|²), x = ka   [Fahy & Gardonio 2007, ch. 3; Morse & Ingard 1968, eq. 7.2.8]."""
    x = np.geomspace(0.02, 30, 40)
    slope = spherical_jn(degree, x, derivative=True) + 1j * spherical_yn(degree, x, derivative=True)
    told = Radiation(0.03, 1.0, order=order).efficiency(x * SOUND_M_S / (2 * np.pi * 0.03))
    assert told == pytest.approx(1 / (x**2 * np.abs(slope) ** 2), rel=1e-9)


@parametrize_few(
    "planted",
    [
        Radiation(0.04, 4.0, 0.0, 2),
        Radiation(0.04, 4.0, 0.0, 4),
        Radiation(0.05, 3.0, 0.5, 4),
        Radiation(0.04, 6.0, 0.5, 2),
    ],
    (0, 2),
)
def test_how_steeply_a_body_radiates_is_read_off_its_decays(planted: Radiation) -> None:
    body = recorded(planted)
    h = refit_material(fitted(body), (body,))
    told = evidence_of(h, (body,), BAND)
    found = propose_radiation(told)
    assert found is not None
    assert (found.order, found.tilt) == (planted.order, planted.tilt)
    assert found.radius_m == pytest.approx(planted.radius_m, rel=0.15)
    after = refit_material(replace(h, effects=(found,)), (body,), told.observed)
    assert after.gain == pytest.approx(GAIN, rel=0.06), "modes that are tilted are as loud as they sound"
    takes = takes_of((body,))
    made = predict_takes(after, takes)
    before_db, after_db, floor_db = mean_db(takes, predict_takes(h, takes)), mean_db(takes, made), least_db(takes, made)
    assert before_db is not None and after_db is not None and floor_db is not None
    assert after_db - floor_db < 0.2 * (before_db - floor_db)
