"""Poles and transmissions that change while bodies ring: any cutting gives the same bits, and nothing is added."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.engine.bank import (
    MOST_PARTNERS,
    Bank,
    BankState,
    ModeSet,
    append,
    empty_bank,
    silence,
)
from sonic_bullet.engine.bank.layout import BLOCK
from sonic_bullet.records import Array
from tests.made.banks import Force, Strike, advance, set_poles, set_transmissions

SR = 48_000
SIZES = (20, 7, 11)
CHANGES = (0, 700, 1500, 1555, 2400, 3600)
"""Samples before which poles and transmissions change."""
RUBBED = (500, 2500)
ENTER = (90, 1480, 1990)
"""Samples at which strikes become known: a step's are known when it begins, with the poles that are then."""


def bodies(rng: np.random.Generator, bent: bool = False) -> tuple[Bank, BankState, list[ModeSet]]:
    sets = [
        ModeSet(
            2 * np.pi * np.sort(rng.uniform(100, 9000, m)), rng.uniform(5, 60, m), rng.normal(size=(2, m)) + 0j,
            bend=rng.uniform(0, 1e-3, m) if bent else None,
        )
        for m in SIZES
    ]  # fmt: skip
    return *append(*empty_bank(SR, 2, transmissions=MOST_PARTNERS), sets), sets


def played(cuts: Array, bent: bool = False) -> Array:
    """6000 samples of three bodies of which one is struck and rubbed, and passes on to the others; cut at ``cuts``."""
    rng = np.random.default_rng(0)
    bank, state, sets = bodies(rng, bent)
    strikes = [Strike(b, at, 3e-4, rng.normal(size=SIZES[b])) for b, at in ((0, 100.3), (0, 1490.0), (1, 2000.7))]
    known = dict(zip(ENTER, strikes, strict=True))
    gain, signal = rng.normal(size=20), rng.normal(size=6000)
    out, at = [], 0
    for stop in sorted({*cuts.tolist(), *CHANGES, *ENTER, *RUBBED, 6000}):
        forces = [Force(0, signal[at:stop], gain, gain)] if RUBBED[0] <= at < RUBBED[1] else []
        struck = [known[at]] if at in known else []
        out.append(advance(bank, state, stop - at, struck, forces))
        at = stop
        if at in CHANGES:
            change(np.random.default_rng(at), bank, state, sets)
    return np.concatenate(out, axis=2)


def change(rng: np.random.Generator, bank: Bank, state: BankState, sets: list[ModeSet]) -> None:
    for b, one in enumerate(sets):
        turn, more = rng.uniform(0.98, 1.02), rng.uniform(0, 300)
        set_poles(bank, state, b, (1j * one.omega_rad_s * turn - one.decay_per_s - more) / SR)
        others = [c for c in range(3) if c != b and rng.random() < 0.7]
        m = SIZES[b]
        set_transmissions(bank, state, b, {c: rng.normal(size=(2, m)) + 1j * rng.normal(size=(2, m)) for c in others})


@pytest.mark.parametrize("bent", [False, True])
def test_any_cutting_gives_the_same_bits(bent: bool) -> None:
    whole = played(np.array([], int), bent)
    assert np.abs(whole[:, 2]).max() > 0.1, "the third body sounds with the others alone"
    rng = np.random.default_rng(1)
    for count in (3, 40, 900):
        assert np.array_equal(played(rng.integers(1, 6000, count), bent), whole)


@pytest.mark.parametrize("bend", [None, np.array([1e-15])])
def test_a_mode_whose_pole_changes_goes_on_with_the_other_from_the_next_block(bend: Array | None) -> None:
    """Closed form: e^{s t} up to the block, then e^{s' (t − t0)} times what was there; |z| never rises. A mode that
    depends on its level starts from the new pole too.
    """
    one = ModeSet(np.array([3000.0]), np.array([4.0]), np.ones((1, 1)), bend=bend)
    bank, state = append(*empty_bank(SR, transmissions=MOST_PARTNERS), [one])
    y = advance(bank, state, 1000, [Strike(0, 0.0, 1e-12, np.array([1.0]))])[0, 0]
    set_poles(bank, state, 0, np.array([-90 + 3010j]) / SR)
    y = np.concatenate([y, advance(bank, state, 3000)[0, 0]])
    turn, later = np.exp(np.array([-4 + 3000j, -90 + 3010j]) / SR)
    n = np.arange(4000)
    t0 = -(-1000 // BLOCK) * BLOCK
    z = np.where(n < t0, turn ** np.minimum(n, t0), turn**t0 * later ** np.maximum(n - t0, 0))
    assert y[1:] == pytest.approx(((1 + 1j * 4 / 3000) * z).real[1:], abs=1e-7)


def test_what_passes_on_is_the_ringing_by_its_weights_faded_in_and_out_over_a_block() -> None:
    one = ModeSet(np.array([3000.0, 7000.0]), np.array([4.0, 9.0]), np.array([[1.0, 1.0]]) + 0j)
    bank, state = append(*empty_bank(SR, transmissions=MOST_PARTNERS), [one, one])
    weight = np.array([[0.2 + 0.1j, -0.3j]])
    y = [advance(bank, state, 300, [Strike(0, 0.0, 1e-12, np.array([1.0, 2.0]))])]
    set_transmissions(bank, state, 0, {1: weight})
    y.append(advance(bank, state, 900))
    set_transmissions(bank, state, 0, {})
    y.append(advance(bank, state, 1000))
    n = np.arange(2200)
    z = np.stack([a * (1 + 1j * d / w) * np.exp((-d + 1j * w) / SR * n) for a, w, d in ((1, 3e3, 4.0), (2, 7e3, 9.0))])
    fade = np.interp(n, [0, 512, 768, 1280, 1536, 9999], [0, 0, 1, 1, 0, 0])
    heard = np.concatenate(y, axis=2)[0]
    assert heard[1] == pytest.approx(fade * (weight @ z).real[0], abs=1e-7)
    assert heard[0, 1:] == pytest.approx(z.real.sum(axis=0)[1:], abs=1e-7)


def test_quenched_they_are_silent_and_touch_on() -> None:
    rng = np.random.default_rng(3)
    bank, state, sets = bodies(rng)
    set_transmissions(bank, state, 0, {2: rng.normal(size=(2, 20)) + 0j})
    set_poles(bank, state, 0, (1j * sets[0].omega_rad_s - sets[0].decay_per_s - 100) / SR)
    hit = rng.normal(size=20)
    fresh = state.copy()
    first = advance(bank, fresh, 800, [Strike(0, 0.0, 1e-4, hit)])
    advance(bank, state, 900, [Strike(0, 1.0, 1e-4, hit)])
    state = silence(state)
    assert not advance(bank, state, 600).any()
    state.at = 0
    assert np.array_equal(advance(bank, state, 800, [Strike(0, 0.0, 1e-4, hit)]), first)


def test_a_quench_within_a_fade_leaves_nothing_to_fade() -> None:
    """What was ended before a quench is not heard at the next strike, and what was to come is there."""
    rng = np.random.default_rng(4)
    bank, state, _ = bodies(rng)
    weight, hit = rng.normal(size=(2, 20)) + 0j, rng.normal(size=20)
    set_transmissions(bank, state, 0, {2: weight})
    advance(bank, state, 300, [Strike(0, 0.0, 1e-4, hit)])
    set_transmissions(bank, state, 0, {1: weight})
    advance(bank, state, 100)
    state = silence(state)
    state.at = 0
    heard = advance(bank, state, 1200, [Strike(0, 0.0, 1e-4, hit)])
    assert not heard[:, 2].any() and heard[:, 1, :BLOCK].any()


def test_no_change_adds_energy() -> None:
    """What rings, Σ|z|², through 2000 changes of poles and transmissions at random samples: it never grows."""
    rng = np.random.default_rng(5)
    bank, state, sets = bodies(rng)
    advance(bank, state, 3 * BLOCK, [Strike(b, 0.0, 1e-4, rng.normal(size=m)) for b, m in enumerate(SIZES)])
    begun = before = (state.z**2).sum()
    state.at = 0
    for _ in range(2000):
        for b, one in enumerate(sets):
            slow = rng.uniform(0, 1e-2) * one.decay_per_s
            set_poles(bank, state, b, (1j * one.omega_rad_s * rng.uniform(0.3, 1.5) - slow) / SR)
        set_transmissions(bank, state, 0, {c: rng.normal(size=(2, 20)) + 0j for c in (1, 2) if rng.random() < 0.5})
        advance(bank, state, int(rng.integers(1, 700)))
        assert (state.z**2).sum() <= before + 1e-9 * begun
        before = (state.z**2).sum()
    assert 0 < before < begun
