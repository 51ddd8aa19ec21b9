"""Features of made recordings: exact modes come back, noisy ones within their spreads, and what is no impact
says so.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from sonic_bullet.lab.lines import exact_modes, sinusoids
from sonic_bullet.lab.lines.extraction import extract
from sonic_bullet.lab.lines.projection import normal_equations
from tests.few_cases import parametrize_few

SR = 44_100


def sound(
    freq_hz: np.ndarray, decay_per_s: np.ndarray, amplitude: np.ndarray, phase: np.ndarray, count: int = SR
) -> np.ndarray:
    """Σ a e^{−dt} cos(2πft + φ), written out."""
    time = np.arange(count) / SR
    return sum(
        a * np.exp(-d * time) * np.cos(2 * np.pi * f * time + p)
        for f, d, a, p in zip(freq_hz, decay_per_s, amplitude, phase, strict=True)
    )


def mixture(seed: int, db: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, np.ndarray]:
    """Twenty pairs of modes 0.3 to 5 % apart in white noise db below the sound: frequencies, decays, amplitudes,
    noise rms, recording.
    """
    rng = np.random.default_rng(seed)
    # each pair has its own twentieth of 100 Hz to 12 kHz
    lower = 100 * 120 ** ((np.arange(20) + rng.uniform(0, 0.7, 20)) / 20)
    freq = np.concatenate([lower, lower * (1 + np.exp(rng.uniform(np.log(0.003), np.log(0.05), 20)))])
    decay, amplitude = np.exp(rng.uniform(np.log(1), np.log(100), 40)), 0.05 * np.exp(rng.normal(0, 0.7, 40))
    clean = sound(freq, decay, amplitude, rng.uniform(0, 2 * np.pi, 40))
    sigma = float(np.sqrt((clean**2).mean()) * 10 ** (-db / 20))
    return freq, decay, amplitude, sigma, clean + sigma * rng.standard_normal(len(clean))


def test_the_equations_of_poles_agree_with_differences() -> None:
    """JᵀJ of the poles beside the amplitudes, from geometric sums, is that of differences of the sound itself."""
    modes = sinusoids.Sinusoids(
        np.array([-30 + 4000j, -55 + 4100j, -3 + 9000j]), np.array([0.3 + 0.1j, -0.2 + 0.5j, 0.1j])
    )
    none = np.zeros(3000)

    def observed(change: np.ndarray) -> np.ndarray:
        turned = sinusoids.Sinusoids(
            modes.pole + 1j * change[0:3] - change[3:6], modes.amplitude + change[6:9] + 1j * change[9:12]
        )
        return -sinusoids.residual(none, turned, SR)

    step = np.r_[np.full(6, 1e-3), np.full(6, 1e-4)]
    jacobian = np.stack(
        [(observed(step * unit) - observed(-step * unit)) / (2 * step[k]) for k, unit in enumerate(np.eye(12))], axis=1
    )
    beside = np.linalg.qr(jacobian[:, 6:])[0]
    wanted = jacobian[:, :6] - beside @ (beside.T @ jacobian[:, :6])
    scale = np.linalg.norm(wanted, axis=0)
    x = observed(np.zeros(12))
    found = normal_equations(x[None], np.ones(1), modes.pole, SR)
    assert np.abs((found.matrix - wanted.T @ wanted) / scale / scale[:, None]).max() < 1e-6
    assert np.abs(found.gradient / scale).max() < 1e-6
    assert found.cost < 1e-9 * (x @ x)  # a Gram matrix is lifted by 1e-10


@parametrize_few("law", ["uniform", "logarithmic"], 1)
@pytest.mark.parametrize("phase", ["any", "sine"])
def test_a_hundred_sinusoids_without_noise_come_back_exactly(law: str, phase: str) -> None:
    """The paper's own test (its errors: 4e-4 and 5.3e-3 on average): worst error of f and d, each mode found once."""
    rng = np.random.default_rng(7)
    freq = rng.uniform(20, 21_500, 100)
    decay = rng.uniform(0.1, 1000, 100) if law == "uniform" else np.exp(rng.uniform(np.log(0.1), np.log(1000), 100))
    turn = rng.uniform(0, 6, 100) if phase == "any" else np.full(100, -np.pi / 2)
    found = extract(np.concatenate([np.zeros(333), sound(freq, decay, rng.uniform(0.1, 1, 100), turn)]), SR)
    assert round(found.onset_s * SR) == 333
    assert len(found.freq_hz) == 100
    nearest = np.abs(found.freq_hz[:, None] - freq).argmin(axis=0)
    assert np.abs(found.freq_hz[nearest] / freq - 1).max() < 1e-6
    assert np.abs(found.decay_per_s[nearest] / decay - 1).max() < 1e-6


def test_no_rank_is_claimed_where_there_is_noise_or_no_mode() -> None:
    rng = np.random.default_rng(2)
    hit = sound(np.array([900.0, 2300.0]), np.array([20.0, 350.0]), np.array([0.3, 0.2]), np.zeros(2), 4000)
    assert exact_modes.modes(hit, SR) is not None
    assert exact_modes.modes(hit + 1e-5 * rng.standard_normal(4000), SR) is None
    assert exact_modes.modes(hit / (1 + np.arange(4000)), SR) is None
    assert exact_modes.modes(np.sin(1e-4 * np.arange(4000.0) ** 2), SR) is None


@parametrize_few(
    ("noise", "phase"),
    [(noise, phase) for noise in (0.0, 1e-5, 1e-3) for phase in (-np.pi / 2, 0.0, None)],
    (1, 3, 8),  # each noise and each phase once
)
def test_onset_to_the_sample(noise: float, phase: float | None) -> None:
    """Silence of any length before, sines that begin with a zero included."""
    rng = np.random.default_rng(4)
    for before in (0, 1, 17, 4801):
        turn = rng.uniform(0, 6, 4) if phase is None else np.full(4, phase)
        hit = sound(
            np.array([450.0, 1270.0, 3300.0, 9100.0]),
            np.array([12.0, 25.0, 90.0, 400.0]),
            rng.uniform(0.2, 0.5, 4),
            turn,
            SR // 4,
        )
        x = np.concatenate([np.zeros(before), hit])
        assert round(extract(x + noise * rng.standard_normal(len(x)), SR).onset_s * SR) == before


@pytest.mark.slow
@parametrize_few(("db", "least"), [(20.0, 0.90), (40.0, 0.98), (60.0, 0.99)], (1,))
def test_mixtures_in_noise_near_the_bound(db: float, least: float) -> None:
    """Found, false and error against the single mode's Cramér-Rao bound √(8d³/(fs·a²/2σ²)); pairs closer than their
    width are in it.
    """
    observed, found_count, wrong, features, error, normalised = 0, 0, 0, 0, [], []
    for seed in (11, 12):
        freq, decay, amplitude, sigma, x = mixture(seed, db)
        found = extract(x, SR, onset_s=0.0)
        bound = np.sqrt(8 * decay**3 / (SR * amplitude**2 / (2 * sigma**2)))
        width = np.maximum(10 * bound, 0.3 * decay) / (2 * np.pi)
        cost = np.minimum(np.abs(found.freq_hz[:, None] - freq) / width, 10)
        i, j = linear_sum_assignment(cost)
        i, j = i[cost[i, j] < 1], j[cost[i, j] < 1]
        audible = amplitude**2 * SR / (4 * decay * sigma**2) >= 16
        observed, found_count = observed + audible.sum(), found_count + audible[j].sum()
        wrong, features = wrong + len(found.freq_hz) - len(i), features + len(found.freq_hz)
        error += list(np.abs(found.freq_hz[i] - freq[j]) * 2 * np.pi / bound[j])
        normalised += list((found.freq_hz[i] - freq[j]) / found.freq_sd_hz[i])
    assert found_count >= least * observed
    assert wrong <= 0.01 * features + 1
    assert np.median(error) < 1.3
    assert np.quantile(error, 0.9) < 3.5
    assert 0.7 < np.std(np.clip(normalised, -6, 6)) < 1.3


def test_hum_is_no_mode_and_a_second_hit_ends_the_first() -> None:
    rng = np.random.default_rng(3)
    hit = sound(np.array([900.0, 2300.0]), np.array([20.0, 35.0]), np.array([0.3, 0.2]), np.zeros(2))
    time = np.arange(2 * SR) / SR
    x = 0.01 * np.sin(2 * np.pi * 50 * time) + 3e-5 * rng.standard_normal(2 * SR)
    x[SR // 4 : SR // 4 + SR] += hit
    found = extract(x, SR)
    assert found.onset_s == pytest.approx(0.25, abs=1e-3)
    assert "hum at 50 Hz" in found.note and found.freq_hz.min() > 50.0
    x[SR : 2 * SR] += 2 * hit
    twice = extract(x, SR)
    assert "2 hits" in twice.note
    assert twice.freq_hz[:2] == pytest.approx([900, 2300], rel=1e-3)
