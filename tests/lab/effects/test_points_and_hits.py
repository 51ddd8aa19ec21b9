"""A mass on what its point yields, and hits that strikes agree on: against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.added_mass.mass_loaded_modes import FAR, attach_modes, load_modes
from sonic_bullet.lab.effects.common.points import places_alike
from sonic_bullet.lab.effects.rebound import _find_agreed_value
from sonic_bullet.lab.effects.rebound.later_hits import _delay_signal, _search_delay
from tests.made.body import SIDE_M, plate


def test_a_mass_where_no_mode_moves_hangs_on_what_the_point_yields() -> None:
    """φ = 0: the modes stay, and the mass swings at 1/√(m R), two of three directions held."""
    x = plate()
    mass, freq = 0.05, 2_000.0
    give = 1 / (mass * (2 * np.pi * freq) ** 2)
    found = load_modes(x, attach_modes(np.zeros((3, x.mode_count)), np.array([0.0, 0, 1]), (give, 0.0), x), mass)
    far = FAR * x.omega0_squared_per_s2.max()
    swings = freq / np.sqrt(1 + (2 * np.pi * freq) ** 2 / far)  # λ = λ_r/(1 + m R λ_r)
    assert np.abs(found.freq_hz / swings - 1).min() < 1e-6
    others = np.delete(found.freq_hz, np.argmin(np.abs(found.freq_hz - swings)))
    assert np.allclose(others, x.freq_hz[: len(others)], rtol=1e-9)


def test_a_yielding_point_carries_a_mass_as_if_it_were_heavier() -> None:
    """m/(1 − ω² m R): modes below the swing go down further than with the mass held fast, all of them."""
    x = plate()
    spot = (0.0477, 0.0371, 0.0)
    held, soft = AddedMass(spot, 0.01).apply(x), AddedMass(spot, 0.01, (2e-8, 0.0)).apply(x)
    low = x.freq_hz < 3_000
    assert np.all(soft.freq_hz[low] <= held.freq_hz[low] * (1 + 1e-9))
    assert soft.freq_hz[low].sum() < held.freq_hz[low].sum()


def test_a_rectangles_images_move_alike() -> None:
    """sin² mπx sin² nπy is the same at x and 1 − x, at y and 1 − y, in every mode; the middle has no image."""
    x = plate()
    a, b = SIDE_M
    u, v = 5 * a / 22, 4 * b / 14
    found = {tuple(np.round(p[:2], 6)) for p in places_alike(x, (u, v, 0.0))}
    assert found == {tuple(np.round(p, 6)) for p in ((a - u, v), (u, b - v), (a - u, b - v))}
    assert len(places_alike(x, (a / 2, b / 2, 0.0))) == 0
    assert len(places_alike(x, (0.0, 0.0, 0.0))) == 0, "what never moves tells of no place"


def test_a_later_hit_is_found_between_samples() -> None:
    sr, n = 48_000, 12_000
    t = np.arange(n) / sr
    x = sum(np.exp(-40 * t) * np.sin(2 * np.pi * f * t) for f in (800.0, 2_310.0, 5_130.0))
    lag, strength = _search_delay(np.asarray(x), 0.37 * _delay_signal(np.asarray(x), 0.0123456, sr), sr, 6_000)
    assert lag == pytest.approx(0.0123456, abs=0.6 / 16 / sr)
    assert strength == pytest.approx(0.37, rel=0.02)


def test_the_gap_is_what_the_largest_shares_of_the_strikes_agree_on() -> None:
    """Three of four strikes have it, none first, among delays that are nobody's."""
    value = [np.array([0.1, 1.0]), np.array([0.5, 1.01, 1.4]), np.array([0.99, 2.0]), np.array([0.3])]
    share = [np.array([0.2, 0.4]), np.array([0.3, 0.4, 0.1]), np.array([0.5, 0.2]), np.array([0.6])]
    total, middle, which = _find_agreed_value(value, share)
    assert which == [1, 1, 0, -1]
    assert middle == pytest.approx(1.0)
    assert total == pytest.approx(1.3)
    assert _find_agreed_value([np.zeros(0)], [np.zeros(0)])[2] == [-1]
