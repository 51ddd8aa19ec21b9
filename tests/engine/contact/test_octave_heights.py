"""Heights of octaves and tracks against closed forms: waves, traces, closed profiles, smooth patches, rough layers."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet._engine import (
    UNIT_RMS,
    add_waves,
    close_round,
    reach_of_ball,
    rough_stretch,
    sweep_profile,
    sweep_track,
)
from sonic_bullet.records.roughness import OCTAVES, WAVE_M, track_slopes
from tests.made.surfaces import octave_gains
from tests.made.surfaces import octave_heights as heights_of

SR = 48_000


def test_waves_add_in_power_where_their_length_is() -> None:
    out = np.full(OCTAVES, 3e-6 * UNIT_RMS)
    add_waves(4e-6, WAVE_M[5] * 1.3, out)
    assert out[5] == pytest.approx(5e-6 * UNIT_RMS)
    assert (np.delete(out, 5) == 3e-6 * UNIT_RMS).all()
    for length in (1e3, 1e-9):
        add_waves(4e-6, length, out)  # beyond the octaves: left out
    assert out[5] == pytest.approx(5e-6 * UNIT_RMS)


def test_a_ball_rolls_over_cusps() -> None:
    """The centre of a ball over crests λ apart falls by R - √(R² - λ²/4), and by its Hertz depth more."""
    radius, patch = 0.03, 1e-4
    for wave in WAVE_M[5:]:
        fall = 2 * np.sqrt(2) * reach_of_ball(wave, 0.0, radius) / UNIT_RMS
        assert fall == pytest.approx(radius - np.sqrt(radius**2 - wave**2 / 4), rel=1e-2)
        more = reach_of_ball(wave, patch, radius) / UNIT_RMS * np.sqrt(2) - fall / 2
        assert more == pytest.approx(patch**2 / radius)


@pytest.mark.parametrize("round_m", [0.0942, 0.011, 2.0])
def test_a_round_body_s_profile_closes_on_itself(round_m: float) -> None:
    """What passes in the second turn is what passed in the first, and no sooner."""
    height, x, speed = heights_of(1e-6, 0.7), np.zeros(0), 0.5
    around, stretch = close_round(round_m, height)
    assert abs(stretch) <= 0.125 and (around * 2.0 ** np.flatnonzero(height)[0]) % 1 == 0
    n = 4000
    x = np.zeros(n)
    rate = np.zeros((4, n))
    for k, start in enumerate((0.0, round_m, 7 * round_m, round_m / 2)):
        ends, per_sample_s = np.array([height, height]), 0.4 * round_m / speed / n
        sweep_profile(start, (speed, speed), x, 12345, around, stretch, ends, per_sample_s, rate[k])
    assert rate[0].std() > 0
    for again in rate[1:3]:
        assert np.abs(again - rate[0]).max() < 1e-6 * np.abs(rate[0]).max()
    assert np.abs(rate[3] - rate[0]).max() > 0.5 * rate[0].std()


def test_a_patch_in_full_contact_averages_as_remington_s() -> None:
    patch = 6e-3
    smooth, spots = octave_gains(20.0, patch, SR, 1.0), octave_gains(20.0, patch, SR)
    free = octave_gains(20.0, 0.0, SR)
    heard = free > 0
    filtered = 1 / np.sqrt(1 + np.pi / 4 * (2 * np.pi * patch / WAVE_M) ** 3)
    assert smooth[heard] / free[heard] == pytest.approx(filtered[heard])
    half = octave_gains(20.0, patch, SR, 0.5)
    assert half == pytest.approx((smooth + spots) / 2)


def test_a_track_is_played_height_by_height() -> None:
    """A sum of two waves, swept: dh/dt is their derivative times the speed, in the second turn as in the first."""
    length, n, speed = 0.05, 40_000, 0.2
    place = np.arange(n) * length / n
    waves = [(1e-6, 25, 0.3), (2e-7, 400, 1.0)]  # m, waves a turn, phase
    track = sum(a * np.sin(2 * np.pi * k * place / length + p) for a, k, p in waves)
    slopes, spacing = track_slopes(np.asarray(track), length / n)
    x = np.zeros(3000)
    rate = np.zeros(len(x))
    swept = sweep_track(length * 5, (speed, speed), x, slopes, spacing, np.ones((2, OCTAVES)), 1 / SR, rate)
    at = speed * np.arange(1, len(x) + 1) / SR
    exact = sum(a * 2 * np.pi * k / length * np.cos(2 * np.pi * k * at / length + p) for a, k, p in waves)
    assert swept == pytest.approx(5 * length + at[-1])
    assert np.abs(rate - speed * np.asarray(exact)).max() < 2e-3 * np.abs(rate).max()


@pytest.mark.parametrize("layer_m", [0.0, 1e-7, 1e-5, 1e-3])
def test_a_rough_layer_keeps_the_energy(layer_m: float) -> None:
    """2/5 k^(-2/3) f^(5/3) + u₀ f is the energy; without a layer it is Hertz', with a thick one f = m v²/2u₀."""
    mass, modulus, curvature, speed = 0.5, 5.6e10, 28.0, 0.3
    k, energy = 4 / 3 * modulus / np.sqrt(curvature), 0.5 * mass * speed**2
    hertz = (2.5 * energy * k ** (2 / 3)) ** 0.6
    longer = rough_stretch(mass, modulus, curvature, speed, layer_m)
    peak = hertz / longer
    assert 0.4 * k ** (-2 / 3) * peak ** (5 / 3) + layer_m * peak == pytest.approx(energy)
    assert longer >= 1 and (longer == pytest.approx(1) or layer_m > 0)
    if layer_m == 1e-3:
        assert peak == pytest.approx(energy / layer_m, rel=0.01)
