"""Heights of octaves and tracks against closed forms: waves, traces, closed profiles, smooth patches, rough layers."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.contact import octave_heights
from sonic_bullet.contact.profile import sweep_profile
from sonic_bullet.contact.pulse_shape import rough_share
from sonic_bullet.contact.track import sweep_track
from sonic_bullet.machine.compiled import njit
from sonic_bullet.machine.vector import At
from sonic_bullet.records.roughness import OCTAVES, WAVE_M, track_slopes
from tests.made.surfaces import octave_gains
from tests.made.surfaces import octave_heights as heights_of

SR = 48_000
UNIT = octave_heights._UNIT_RMS


@njit(nogil=True)
def _swept(swept, speed, x, surface, height, per_sample_s, rate):  # type: ignore[no-untyped-def]
    sweep_profile(swept, (speed, speed), x, surface, (height, height), per_sample_s, np.empty(0), At(rate, 0))


def test_waves_add_in_power_where_their_length_is() -> None:
    out = np.full(OCTAVES, 3e-6 * UNIT)
    octave_heights.add_waves.py_func(4e-6, WAVE_M[5] * 1.3, out)
    assert out[5] == pytest.approx(5e-6 * UNIT)
    assert (np.delete(out, 5) == 3e-6 * UNIT).all()
    for length in (1e3, 1e-9):
        octave_heights.add_waves.py_func(4e-6, length, out)  # beyond the octaves: left out
    assert out[5] == pytest.approx(5e-6 * UNIT)


def test_a_ball_rolls_over_cusps() -> None:
    """The centre of a ball over crests λ apart falls by R - √(R² - λ²/4), and by its Hertz depth more."""
    radius, patch = 0.03, 1e-4
    for wave in WAVE_M[5:]:
        fall = 2 * np.sqrt(2) * octave_heights.reach_of_ball.py_func(wave, 0.0, radius) / UNIT
        assert fall == pytest.approx(radius - np.sqrt(radius**2 - wave**2 / 4), rel=1e-2)
        more = octave_heights.reach_of_ball.py_func(wave, patch, radius) / UNIT * np.sqrt(2) - fall / 2
        assert more == pytest.approx(patch**2 / radius)


@pytest.mark.parametrize("round_m", [0.0942, 0.011, 2.0])
def test_a_round_body_s_profile_closes_on_itself(round_m: float) -> None:
    """What passes in the second turn is what passed in the first, and no sooner."""
    height, x, speed = heights_of(1e-6, 0.7), np.zeros(0), 0.5
    around, stretch = octave_heights.close_round.py_func(round_m, height)
    assert abs(stretch) <= 0.125 and (around * 2.0 ** np.flatnonzero(height)[0]) % 1 == 0
    n = 4000
    x = np.zeros(n)
    rate = np.zeros((4, n))
    for k, start in enumerate((0.0, round_m, 7 * round_m, round_m / 2)):
        _swept(start, speed, x, (12345, around, stretch), height, 0.4 * round_m / speed / n, rate[k])
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
    swept = sweep_track.py_func(
        length * 5, (speed, speed), x, (slopes.ravel(), 0, slopes.shape[1], spacing),
        (np.ones(OCTAVES), np.ones(OCTAVES)), 1 / SR, (rate, 0),
    )  # fmt: skip
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
    longer = rough_share.py_func(mass, modulus, curvature, speed, layer_m)
    peak = hertz / longer
    assert 0.4 * k ** (-2 / 3) * peak ** (5 / 3) + layer_m * peak == pytest.approx(energy)
    assert longer >= 1 and (longer == pytest.approx(1) or layer_m > 0)
    if layer_m == 1e-3:
        assert peak == pytest.approx(energy / layer_m, rel=0.01)
