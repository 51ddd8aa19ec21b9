"""The bank has the same bits whichever vector instructions the processor has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from sonic_bullet import _engine
from sonic_bullet.engine.bank import ModeSet, Translation, append, empty_bank
from sonic_bullet.records import Array
from tests.made.banks import Force, Strike, advance, set_poles, set_transmissions

SR = 48_000
SIZES = 40, 9, 150  # two chunks and a part, a part of a group, many


@pytest.fixture
def best() -> Iterator[int]:
    """Return the best level, which is in use again afterwards."""
    level = _engine.vector_level()
    yield level
    _engine.force_vector_level(level)


def sound_at(level: int) -> tuple[Array, Array]:
    """Sound and dipoles of strikes, forces, bent modes and transmissions at a level of instructions."""
    _engine.force_vector_level(level)
    rng = np.random.default_rng(11)
    sets = [
        ModeSet(
            2 * np.pi * rng.uniform(100, 15_000, m),
            rng.uniform(2.0, 300.0, m),
            rng.normal(size=(2, m)) + 1j * rng.normal(size=(2, m)),
            bend=rng.uniform(0, 1e-3, m) if m == SIZES[1] else None,
            translation=Translation(7000.0, 7000.0, 1.0),
        )
        for m in SIZES
    ]
    bank, state = append(*empty_bank(SR, weight_sets=2, transmissions=1, radiates=np.array([True, False])), sets)
    sounds, dipoles = [], []
    for call in range(12):
        n = int(rng.integers(1, 400))
        strikes = [
            Strike(b, state.at + rng.uniform(0, n), 10 ** rng.uniform(-6, -3), rng.normal(size=m), bool(b), np.ones(3))
            for b, m in enumerate(SIZES)
        ]
        forces = [
            Force(b, rng.normal(size=n), *rng.normal(size=(2, m)), *rng.normal(size=(2, 3)))
            for b, m in enumerate(SIZES)
            if (call + b) % 3
        ]
        if call == 4:
            set_poles(bank, state, 0, -rng.uniform(1e-4, 1e-2, SIZES[0]) + 1j * rng.uniform(0.01, 2, SIZES[0]))
            set_transmissions(bank, state, 0, {2: rng.normal(size=(2, SIZES[0])) + 0j})
        dipole = np.zeros((len(SIZES), 3, n))
        sounds.append(advance(bank, state, n, strikes, forces, np.linspace(0, 1, n), dipole))
        dipoles.append(dipole)
    return np.concatenate(sounds, axis=2), np.concatenate(dipoles, axis=2)


def test_each_level_of_vector_instructions_has_the_same_bits(best: int) -> None:
    if best == 0:
        pytest.skip("this processor has one level")
    sound, dipole = sound_at(0)
    assert sound.all(axis=0).any()
    assert dipole.any(axis=(1, 2)).all()
    for level in range(1, best + 1):
        again, dipole_again = sound_at(level)
        assert np.array_equal(sound, again)
        assert np.array_equal(dipole, dipole_again)
