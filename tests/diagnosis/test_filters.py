"""`measurement-chain`: the corner that is read off is the one of the filter that is played; a rumbling room is no hum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_body import SR, recorded
from scipy.signal import butter, sosfreqz
from test_found_again import BAND, fitted

from sonic_bullet.diagnosis.evidence import evidence_of
from sonic_bullet.diagnosis.refit import refitted
from sonic_bullet.effects.measurement_chain import MeasurementChain, _hum, butterworth
from sonic_bullet.effects.values import Heard


@pytest.mark.parametrize("kind", ["highpass", "lowpass"])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_response_is_the_digital_filters(kind: str, order: int) -> None:
    freq = np.geomspace(50, 0.49 * SR, 60)
    for corner in (300.0, 3_000.0, 0.45 * SR):
        _, told = sosfreqz(butter(order, corner, kind, fs=SR, output="sos"), freq, fs=SR)
        assert butterworth(freq, corner, order, kind == "highpass", SR) == pytest.approx(np.abs(told), rel=1e-6)


@pytest.mark.parametrize("planted", [MeasurementChain(high_pass_hz=4_200.0, high_order=2), MeasurementChain(low_pass_hz=3_500.0, low_order=2)])
def test_a_corner_near_nyquist_is_found_where_it_is(planted: MeasurementChain) -> None:
    body = recorded(planted)
    found = MeasurementChain.propose(evidence_of(refitted(fitted(body), (body,)), (body,), BAND))
    assert found is not None
    assert (found.high_order, found.low_order) == (planted.high_order, planted.low_order)
    assert found.high_pass_hz + found.low_pass_hz == pytest.approx(planted.high_pass_hz + planted.low_pass_hz, rel=0.03)


@pytest.fixture(scope="module")
def told() -> Heard:
    body = recorded(seconds=1.5)
    return evidence_of(fitted(body), (body,), BAND).heard[0]


@pytest.mark.parametrize("mains", [0.0, 50.0])
def test_hum_stands_out_of_the_noise_beside_it(told: Heard, mains: float) -> None:
    """Pink noise is strongest where mains hum."""
    assert told.signal is not None
    rng, n = np.random.default_rng(3), told.signal.shape[1]
    hz = np.fft.rfftfreq(n, 1 / SR)
    pink = np.fft.irfft(np.fft.rfft(rng.standard_normal(told.signal.shape)) / np.sqrt(np.maximum(hz, 5)), n)
    noisy = 2e-4 * pink / pink.std() + (3e-3 * np.cos(2 * np.pi * mains * np.arange(n) / SR) if mains else 0.0)
    found = _hum([replace(told, signal=noisy)])
    assert (found.get("hum_hz", 0.0) > 0) == (mains > 0)
    if mains:
        assert found["hum_hz"] == pytest.approx(mains, abs=0.5)
        assert found["hum_amplitude"][0] == pytest.approx(3e-3, rel=0.1)
