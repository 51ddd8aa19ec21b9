"""`measurement-chain`: the corner that is read off is the one of the filter that is played; a rumbling room
is no hum.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfreqz

from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.lab.diagnosis.evidence.baseline import _drop_clipped
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.effects.common.hum import hum_of, subtract_hum, without_hum
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.lab.effects.measurement_chain import butterworth, limit_of, propose_measurement_chain
from sonic_bullet.lab.lines.joint_lines import joint_lines
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import SR, recorded


@pytest.mark.parametrize("kind", ["highpass", "lowpass"])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_response_is_the_digital_filters(kind: str, order: int) -> None:
    freq = np.geomspace(50, 0.49 * SR, 60)
    for corner in (300.0, 3_000.0, 0.45 * SR):
        _, told = sosfreqz(butter(order, corner, kind, fs=SR, output="sos"), freq, fs=SR)
        assert butterworth(freq, corner, order, kind == "highpass", SR) == pytest.approx(np.abs(told), rel=1e-6)


@parametrize_few(
    "planted",
    [MeasurementChain(high_pass_hz=4_200.0, high_order=2), MeasurementChain(low_pass_hz=3_500.0, low_order=2)],
    1,
)
def test_a_corner_near_nyquist_is_found_where_it_is(planted: MeasurementChain) -> None:
    body = recorded(planted)
    found = propose_measurement_chain(evidence_of(refit_material(fitted(body), (body,)), (body,), BAND))
    assert found is not None
    assert (found.high_order, found.low_order) == (planted.high_order, planted.low_order)
    assert found.high_pass_hz + found.low_pass_hz == pytest.approx(planted.high_pass_hz + planted.low_pass_hz, rel=0.03)


@pytest.fixture(scope="module")
def told() -> ObjectEvidence:
    body = recorded(seconds=1.5)
    return evidence_of(fitted(body), (body,), BAND).observed[0]


@pytest.mark.slow
@pytest.mark.parametrize("mains", [0.0, 50.0])
def test_hum_stands_out_of_the_noise_beside_it(told: ObjectEvidence, mains: float) -> None:
    """Pink noise is strongest where mains hum."""
    assert told.signal is not None
    rng, n = np.random.default_rng(3), told.signal.shape[1]
    hz = np.fft.rfftfreq(n, 1 / SR)
    pink = np.fft.irfft(np.fft.rfft(rng.standard_normal(told.signal.shape)) / np.sqrt(np.maximum(hz, 5)), n)
    noisy = 2e-4 * pink / pink.std() + (3e-3 * np.cos(2 * np.pi * mains * np.arange(n) / SR) if mains else 0.0)
    found = hum_of(noisy, told.noise, SR)
    assert (found is not None) == (mains > 0)
    if found is not None:
        assert found.hz == pytest.approx(mains, abs=0.5)
        assert found.amplitude[0] == pytest.approx(3e-3, rel=0.1)


def ringing(freq_hz: float, decay_per_s: float, strikes: int, seconds: float) -> np.ndarray:
    """Strikes (s, n) as loud as each other."""
    t = np.arange(round(seconds * SR)) / SR
    noise = 1e-5 * np.random.default_rng(5).standard_normal((strikes, len(t)))
    return np.exp(-decay_per_s * t) * np.cos(2 * np.pi * freq_hz * t) + noise


@pytest.mark.parametrize("decay_per_s", [2.0, 4.0, 0.0])
def test_a_mode_near_a_multiple_of_the_mains_is_no_hum(decay_per_s: float) -> None:
    """However long it rings, and as equally loud the strikes are: it fades, even one that would be low enough."""
    assert hum_of(ringing(401.0, decay_per_s, 4, 1.5), np.full(4, 1e-5), SR) is None
    assert (hum_of(ringing(99.0, decay_per_s, 4, 1.5), np.full(4, 1e-5), SR) is None) == (decay_per_s > 0)


@pytest.mark.parametrize(("strength", "decay_per_s"), [((1, 1, 1, 1), 0.5), ((1, 2, 4, 8), 0.5), ((1, 1, 1, 1), 0.0)])
def test_a_lone_tone_that_hardly_fades_is_no_hum_in_strikes_of_one_strength(
    strength: tuple[float, ...], decay_per_s: float
) -> None:
    """A bell's lowest mode may ring for ten seconds, and lie near the eighth multiple as near anything; with strength
    it goes, where there are several.
    """
    sound = np.array(strength)[:, None] * ringing(401.0, decay_per_s, 4, 1.5)
    assert hum_of(sound, np.full(4, 1e-5), SR) is None


def test_a_lone_tone_is_a_hum_in_strikes_of_many_strengths_and_several_in_any() -> None:
    tone, other, quiet = ringing(400.0, 0.0, 4, 1.5), ringing(350.0, 0.0, 4, 1.5), np.full(4, 1e-5)
    click = np.zeros_like(tone)
    click[:, 10] = (5.0, 10.0, 20.0, 40.0)
    for sound, amplitude in ((tone + click, 1), (tone + other, 2)):
        found = hum_of(sound, quiet, SR)
        assert found is not None and found.hz == pytest.approx(50.0, abs=0.05)
        assert np.count_nonzero(found.amplitude) == amplitude


def test_one_recording_fits_a_known_hum_again_and_no_other() -> None:
    sound, quiet = ringing(50.0, 0.0, 1, 1.5), np.full(1, 1e-5)
    assert hum_of(sound, quiet, SR) is None
    found = hum_of(sound, quiet, SR, 50.0)
    assert found is not None and found.hz == pytest.approx(50.0, abs=0.02)
    assert hum_of(sound, quiet, SR, 60.0) is None


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("strikes", "seconds"), [(1, 1.5), (4, 0.3), (4, 300 / SR)])
def test_too_little_tells_no_hum(strikes: int, seconds: float) -> None:
    """One recording alone, or recordings too short to hear whether a tone fades, in silence."""
    sound = ringing(50.0, 0.0, strikes, seconds)
    assert hum_of(sound, np.full(strikes, 1e-5), SR) is None
    assert without_hum(sound, np.full(strikes, 1e-5), SR) is sound


def test_what_hums_is_taken_out_of_every_recording(told: ObjectEvidence) -> None:
    """Between the bins of its spectrum, and with a phase of its own in every recording; what rings stays."""
    assert told.signal is not None
    time = np.arange(told.signal.shape[1]) / SR
    phase = np.array([0.3, 1.9, -2.2, 0.0, 2.8])[:, None]
    hum = 0.02 * np.cos(2 * np.pi * 49.93 * time + phase) + 0.005 * np.cos(2 * np.pi * 3 * 49.93 * time - phase)
    found = hum_of(told.signal + hum, told.noise, SR)
    assert found is not None
    assert found.hz == pytest.approx(49.93, abs=0.01)
    assert found.amplitude[:3] == pytest.approx((0.02, 0.0, 0.005), rel=0.02)
    left = subtract_hum(told.signal + hum, SR, found) - told.signal
    assert np.sqrt((left**2).mean(axis=1) / (hum**2).mean(axis=1)).max() < 0.02
    assert hum_of(told.signal, told.noise, SR) is None


@pytest.mark.slow
def test_loud_hum_hides_no_modes(told: ObjectEvidence) -> None:
    """Louder than the strikes: with the hum in them, recordings tell of tones that never end, and of no plate."""
    assert told.signal is not None
    hum = 0.5 * np.cos(2 * np.pi * 50 * np.arange(told.signal.shape[1]) / SR)
    lines = joint_lines(without_hum(told.signal + hum, told.noise, SR), SR, band_hz=BAND)
    assert np.abs(np.log(lines.freq_hz[:, None] / told.freq_hz)).min(axis=0).max() < 2e-4


@pytest.mark.parametrize(("peak", "limit"), [((0.4, 0.4, 0.1), 0.4), ((0.4, 0.2, 0.1), 0.0), ((0.9, 0.9, 0.95), 0.0)])
def test_a_limit_is_where_two_strikes_stand(peak: tuple[float, ...], limit: float) -> None:
    """One that stands there for long and another that touches it; no recording may go beyond."""
    ring = np.cos(0.3 * np.arange(800)) * np.exp(-0.004 * np.arange(800))
    loud = np.stack([np.clip(3 * ring, -peak[0], peak[0]), peak[1] * ring, peak[2] * ring])
    assert limit_of([loud]) == pytest.approx(limit, abs=1e-9)
    if limit:
        assert limit_of([loud[:1]]) == 0.0  # one alone may ring so
        assert limit_of([loud[:1]], known=limit) == limit


@pytest.mark.slow
def test_clipped_strikes_tell_no_amplitudes() -> None:
    """Modes are the softer strikes' own; what a limit has cut out of the others is as wide as it is large."""
    plain = recorded()
    assert plain.recorded is not None
    assert plain.recorded.signals is not None
    peak = np.sort(np.abs(plain.recorded.signals).max(axis=1))
    body = recorded(MeasurementChain(limit=float(0.5 * (peak[1] + peak[2]))), noise=1e-6)
    assert body.recorded is not None
    lines = _drop_clipped(body.recorded, BAND).lines
    model = body.model.freq_hz
    assert (np.abs(np.log(lines.freq_hz[:, None] / model)).min(axis=1) < 1e-3).mean() > 0.95
    wide = (lines.amplitude_sd >= np.abs(lines.amplitude)).all(axis=1)
    assert wide.sum() == 3
    assert _drop_clipped(plain.recorded, BAND) is plain.recorded
