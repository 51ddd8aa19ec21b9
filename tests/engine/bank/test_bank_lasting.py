"""What a force that lasts sends: nothing, for pressure follows what moves. And what a slow one sends: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.engine.bank import ModeSet, append, empty_bank
from sonic_bullet.records import Array
from tests.made.banks import Force, Strike, advance

SR = 48_000
PRESSURE = np.array([True])


def played(
    modes: ModeSet, count: int, strikes: list[Strike], force_n: Array | None = None, gain: Array | None = None
) -> Array:
    """Pressure (n,) of one body."""
    bank, state = append(*empty_bank(SR, radiates=PRESSURE), [modes])
    forces = [] if force_n is None or gain is None else [Force(0, force_n, gain, gain)]
    return advance(bank, state, count, strikes, forces)[0, 0]


def some_modes(count: int) -> tuple[ModeSet, Array]:
    rng = np.random.default_rng(count)
    omega = 2 * np.pi * np.sort(rng.uniform(300, 20_000, count))
    weight = rng.normal(size=(1, count)) + 1j * rng.normal(size=(1, count))
    return ModeSet(omega, rng.uniform(100, 300, count), weight), rng.normal(size=count)


def test_a_body_that_is_pressed_is_silent() -> None:
    modes, gain = some_modes(20)
    sound = played(modes, SR, [], np.ones(SR), gain)
    assert np.abs(sound[-100:]).max() < 1e-12 * np.abs(sound).max()


@pytest.mark.parametrize("start", [100.0, 100.3, 100.49, 100.51, 100.96])
@pytest.mark.parametrize("samples", [0.0, 0.2, 0.9, 1.0, 1.7, 11.0, 11.9, 300.5])
def test_a_strike_has_no_mean(start: float, samples: float) -> None:
    """Σ p = 0: at frequency 0 a body is pressed and let go."""
    modes, gain = some_modes(20)
    sound = played(modes, SR, [Strike(0, start, samples / SR, gain)])
    assert abs(sound.sum()) < 1e-9 * np.abs(sound).max()
    assert not sound[: int(np.ceil(start - 0.5))].any()


@pytest.mark.parametrize("force_hz", [40.0, 80.0, 1600.0])
def test_the_imaginary_part_of_a_weight_sends_acceleration(force_hz: float) -> None:
    """p = Re(w) q̇ + Im(w) (q̈ + d q̇)/ω: 6 and 12 dB an octave below the mode."""
    omega, decay, weight, gain = 2 * np.pi * 800.0, 60.0, 0.3 + 0.8j, 1.7
    modes = ModeSet(np.array([omega]), np.array([decay]), np.array([[weight]]))
    n, i = np.arange(SR), 2j * np.pi * force_hz
    sound = played(modes, SR, [], np.cos(2 * np.pi * force_hz / SR * n), np.array([gain]))
    late = n >= SR // 2
    found = 2 * (sound * np.exp(-i * n / SR))[late].mean()
    closed = (weight.real * i + weight.imag * i * (i + decay) / omega) * gain / ((i + decay) ** 2 + omega**2)
    assert abs(found - closed) < 0.02 * abs(closed)


@pytest.mark.parametrize("count", [4, 20])
def test_a_string_pressed_slowly_sends_its_static_volume(count: int) -> None:
    """p = a d²/dt² ∫u dx of a compact string: of a slow force a x (L - x)/2T · F̈, whatever the number of modes.

    φ_n = √(2/ρL) sin nπx/L,  ω_n = nπ√(T/ρ)/L,  w_n = i a ω_n ∫φ_n;   u of a static force: a triangle, F x (L - x)/TL.
    """
    length_m, tension_n, kg_m, a, place_m = 0.6, 1500.0, 1e-3, 0.1, 0.22
    number = np.arange(1, count + 1)
    omega = number * np.pi / length_m * np.sqrt(tension_n / kg_m)
    height = np.sqrt(2 / (kg_m * length_m))
    volume = height * length_m / (number * np.pi) * (1 - np.cos(number * np.pi))
    gain = height * np.sin(number * np.pi * place_m / length_m)
    modes = ModeSet(omega, np.full(count, 2.0), (1j * a * omega * volume)[None])
    hz, n = 20.0, np.arange(SR)
    rising = np.minimum(n / (0.3 * SR), 1)  # its corners have rung out before the last fifth of a second
    sound = played(modes, SR, [], (rising**2 * (3 - 2 * rising)) * np.cos(2 * np.pi * hz / SR * n), gain)
    late = n >= SR - SR // 5
    static = a * place_m * (length_m - place_m) / (2 * tension_n)
    found = 2 * (sound * np.exp(-2j * np.pi * hz / SR * n))[late].mean()
    assert abs(found + static * (2 * np.pi * hz) ** 2) < 0.03 * static * (2 * np.pi * hz) ** 2
