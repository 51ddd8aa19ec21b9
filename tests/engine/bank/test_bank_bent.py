"""Modes that bend with their level: the bank beside the closed form, blocks beside each other, and a linear body
untouched.
"""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.effects.common.ringing import synthesize_ring
from sonic_bullet.effects.protocol import Impact, Ring
from sonic_bullet.engine.bank import ModeSet, append, empty_bank, silence
from sonic_bullet.records import Array
from tests.made.banks import Strike, advance

SR = 48_000
HZ, DECAY, GAIN = np.array([440.0, 1234.5, 3000.0]), np.array([3.0, 8.0, 20.0]), np.array([1.0, 0.6, 0.8])


def modes(bend: float, damping_growth: float, power: float = 1.0) -> ModeSet:
    return ModeSet(
        2 * np.pi * HZ,
        DECAY,
        np.ones((1, 3), complex),
        bend=np.full(3, bend),
        damping_growth=np.full(3, damping_growth),
        damping_growth_power=power,
    )


def played(bend: float, damping_growth: float, cuts: list[int], start: float = 0.0, power: float = 1.0) -> Array:
    bank, state = append(*empty_bank(SR), [modes(bend, damping_growth, power)])
    strike = [at_once(start, GAIN)]
    parts = [advance(bank, state, n, strike if i == 0 else ())[0, 0] for i, n in enumerate(cuts)]
    return np.concatenate(parts)


SHORT = 1e-12


def at_once(sample: float, gain: Array) -> Strike:
    """An impulse at a sample."""
    return Strike(0, sample - SHORT, SHORT / SR, gain)


def wanted(bend: float, damping_growth: float, n: int, power: float = 1.0) -> Array:
    """The closed form with every mode from its start; |z| is GAIN there."""
    amplitude = (1 + 1j * DECAY / (2 * np.pi * HZ)) * GAIN
    ring = Ring(
        HZ,
        DECAY,
        amplitude,
        np.abs(amplitude),
        np.full(3, bend),
        np.full(3, damping_growth),
        damping_growth_power=power,
    )
    return synthesize_ring(ring, Impact(1.0, np.zeros(1), np.ones(1)), n, SR)


@pytest.mark.parametrize(
    ("bend", "damping_growth", "power"),
    [(0.004, 0.0, 1.0), (-0.004, 0.0, 1.0), (0.0, 0.8, 1.0), (0.003, 0.8, 1.0), (0.0, 0.9, 2.0), (0.003, 0.9, 2.0)],
)
def test_bent_modes_follow_the_closed_form(bend: float, damping_growth: float, power: float) -> None:
    """32 samples late at most: 2π f b a² · 0.67 ms of phase, c a d · 0.67 ms of level, and no drift after that."""
    made, right = played(bend, damping_growth, [SR], power=power), wanted(bend, damping_growth, SR, power)
    linear = played(0.0, 0.0, [SR])
    late = 2 * 32 / SR  # the first are unbent, and a mean over the next stands for their course
    allowed = float((GAIN * (2 * np.pi * HZ * abs(bend) * GAIN**2 + damping_growth * GAIN * DECAY) * late).sum())
    error = np.abs(made - right).max()
    assert error < allowed * 1.05
    assert error < 0.1 * np.abs(linear - right).max()


def test_zero_bend_is_the_linear_bank_and_poles_come_back() -> None:
    bank, state = append(*empty_bank(SR), [ModeSet(2 * np.pi * HZ, DECAY, np.ones((1, 3), complex))])
    plain = advance(bank, state, SR, [at_once(0.0, GAIN)])[0, 0]
    assert np.array_equal(plain, played(0.0, 0.0, [SR]))


def test_any_cut_gives_the_same_bits() -> None:
    rng = np.random.default_rng(3)
    whole = played(0.004, 0.5, [20_000], start=17.3)
    for _ in range(4):
        cuts: list[int] = []
        while sum(cuts) < 20_000:
            cuts.append(int(min(rng.integers(1, 3000), 20_000 - sum(cuts))))
        assert np.array_equal(whole, played(0.004, 0.5, cuts, start=17.3))


def test_decaying_from_any_level_never_grows() -> None:
    """A bent mode is a passive one: without forces its block energies fall."""
    sound = played(0.01, 3.0, [SR])
    energy = (sound[: SR - SR % 2400].reshape(-1, 2400) ** 2).sum(axis=1)
    assert (np.diff(energy) <= 0).all()


def test_a_quenched_body_begins_anew_with_its_own_poles() -> None:
    """Struck hard, quenched while its poles are bent, struck softly: the soft strike is as from rest."""
    bank, state = append(*empty_bank(SR), [modes(0.02, 2.0)])
    advance(bank, state, 2000, [at_once(0.0, GAIN)])
    state = silence(state)
    again = advance(bank, state, 4000, [at_once(2010.0, 0.05 * GAIN)])[0, 0]
    bank, fresh = append(*empty_bank(SR, at=2000), [modes(0.02, 2.0)])
    assert np.array_equal(again, advance(bank, fresh, 4000, [at_once(2010.0, 0.05 * GAIN)])[0, 0])
