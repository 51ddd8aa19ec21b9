"""However the calls are cut, the bank's bits are the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonic_bullet.engine.bank import Bank, BankState, ModeSet, Translation, append, empty_bank
from sonic_bullet.records import Array
from tests.made.banks import Force, Strike, advance

SR = 48_000
SIZES = (5, 0, 33, 1, 70, 8, 16)
FIRST = 1000
TURNS = np.array([[1.0, -0.3, 0.2], [0.5, 0.5, -1.0]])


def scene(seed: int, length: int) -> tuple[Bank, BankState, list[Strike], dict[int, tuple[Array, Array, Array]], Array]:
    """Bodies of unequal size, strikes short and long, several on one body at once, and forces on two of them for a
    while.
    """
    rng = np.random.default_rng(seed)
    bank, state = empty_bank(SR, 2, at=FIRST, radiates=np.array([True, False]))
    bodies = [
        ModeSet(
            2 * np.pi * np.sort(rng.uniform(30, 23_000, m)),
            10.0 ** rng.uniform(-1, 4.5, m),
            rng.normal(size=(2, m)) + 1j * rng.normal(size=(2, m)),
            translation=Translation(rate, rate, 1.0) if rate < 40_000 else None,
        )
        for m, rate in zip(SIZES, rng.uniform(500, 50_000, len(SIZES)), strict=True)
    ]
    bodies[4] = replace(bodies[4], weight=bodies[4].weight * np.array([[1.0], [0.0]]))
    bodies[6] = replace(bodies[6], bend=rng.normal(size=16), damping_growth=rng.uniform(size=16))
    bank, state = append(bank, state, bodies)
    strikes = []
    for _ in range(int(rng.integers(1, 25))):
        body, lasts = int(rng.integers(len(SIZES))), float(rng.choice([1e-12, 0.1, 1.0, 2.0, 30.0, 111.1, 700.0]))
        start = FIRST + rng.choice([rng.uniform(0, length - 1), float(rng.integers(length)), 0.0])
        strikes.append(
            Strike(
                body,
                start,
                lasts / SR,
                rng.normal(size=SIZES[body]),
                bool(rng.integers(2)),
                rng.normal(size=3),
            )
        )
    strikes.append(strikes[0])
    forces = {}
    for body in (2, 4, 6, 4 if seed % 2 else 3):
        signal = rng.normal(size=length) * (rng.uniform() < 0.7)
        signal[: int(rng.integers(length))] = 0.0
        forces[len(forces)] = (np.array([body]), signal, rng.normal(size=(2, SIZES[body])))
    return bank, state, strikes, forces, rng.uniform(size=length)


def render(seed: int, length: int, cuts: list[int]) -> bytes:
    bank, state, strikes, forces, progress = scene(seed, length)
    parts = []
    for lo, hi in zip([0, *cuts], [*cuts, length], strict=True):
        now = [s for s in strikes if lo <= np.ceil(s.start - 0.5) - FIRST < hi]
        pushes = [
            Force(int(body[0]), signal[lo:hi], gains[0], gains[1], TURNS[0], TURNS[1])
            for body, signal, gains in forces.values()
        ]
        rigid = np.zeros((len(SIZES), 3, hi - lo))
        sound = advance(bank, state, hi - lo, now, pushes, progress[lo:hi], rigid)
        parts.append(np.concatenate([*sound, *rigid]))
    whole = np.concatenate(parts, axis=1)
    assert whole[-3 * len(SIZES) :].any()
    assert np.isfinite(whole).all()
    return whole.tobytes()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.integers(300, 3000), st.data())
def test_any_cuts_give_the_same_bits(seed: int, length: int, data: st.DataObject) -> None:
    cuts = sorted(data.draw(st.lists(st.integers(0, length), max_size=40)))
    assert render(seed, length, cuts) == render(seed, length, [])


@pytest.mark.parametrize("size", [1, 2, 3, 7, 63, 64, 200, 255, 256, 257, 1024, 8192])
def test_every_frame_size_gives_the_same_bits(size: int) -> None:
    length = 9000
    assert render(42, length, list(range(size, length, size))) == render(42, length, [])


def test_strikes_known_early_or_late_give_the_same_bits() -> None:
    bank, state, strikes, _, _ = scene(7, 2000)
    early = advance(bank, state.copy(), 2000, strikes)
    parts = [advance(bank, state, 500, [s for s in strikes if s.start <= FIRST + 900])]
    parts.append(advance(bank, state, 400))
    parts.append(advance(bank, state, 1100, [s for s in strikes if s.start > FIRST + 900]))
    assert np.concatenate(parts, axis=2).tobytes() == early.tobytes()
