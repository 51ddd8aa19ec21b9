"""The bank against closed forms: the oscillator's own solution, exact strikes, forces, and what it does with what it
cannot play.
"""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.engine import bank as bank_module
from sonic_bullet.engine.bank import ModeSet, Translation, append, audible, empty_bank, silence
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError
from tests.made.banks import Force, Strike, advance
from tests.made.pulses import pulse_cells, pulse_nodes

SR = 48_000


def random_modes(
    rng: np.random.Generator, count: int, sets: int = 1, decay: tuple[float, float] = (0.5, 300.0)
) -> ModeSet:
    omega = 2 * np.pi * np.sort(np.exp(rng.uniform(np.log(40.0), np.log(20_000.0), count)))
    return ModeSet(
        omega, rng.uniform(*decay, count), rng.normal(size=(sets, count)) + 1j * rng.normal(size=(sets, count))
    )


def pole(modes: ModeSet) -> Array:
    return np.asarray((-modes.decay_per_s + 1j * modes.omega_rad_s) / SR)


def struck(modes: ModeSet, strike: Strike, sample: Array) -> Array:
    """The definition: (W, n) Σ over modes and nodes of Re w (1 + i d/ω) g J e^{s (n - u)} for n ≥ u."""
    out = np.zeros((len(modes.weight), len(sample)))
    first, spacing, weight = pulse_nodes(strike.start, strike.length_s, SR, flat=strike.flat)
    for j, impulse in enumerate(weight):
        late = sample - (first + j * spacing)
        response = np.exp(np.multiply.outer(pole(modes), np.maximum(late, 0.0))) * (late >= 0)
        out += (
            (modes.weight * ((1 + 1j * modes.decay_per_s / modes.omega_rad_s) * strike.gain * impulse)) @ response
        ).real
    return out


SHORT = 1e-12
"""Samples: a pulse so short is an impulse."""


def at_once(body: int, sample: float, gain: Array) -> Strike:
    """An impulse at a sample."""
    return Strike(body, sample - SHORT, SHORT / SR, gain)


def test_free_ringing_keeps_pitch_and_decay_to_1e9_of_the_envelope_over_ten_seconds() -> None:
    freq, t60 = (grid.ravel() for grid in np.meshgrid(np.geomspace(20, 20_000, 9), np.geomspace(0.05, 20, 6)))
    omega, decay = 2 * np.pi * freq, np.log(1000.0) / t60
    bank, state = empty_bank(SR)
    bank, state = append(
        bank, state, [ModeSet(omega[i : i + 1], decay[i : i + 1], np.ones((1, 1), complex)) for i in range(len(freq))]
    )
    strikes = [at_once(i, 0.0, np.ones(1)) for i in range(len(freq))]
    worst, compared = 0.0, 0
    for second in range(10):
        sound = advance(bank, state, SR, strikes if second == 0 else ())[0]
        place = np.arange(0, SR, 37)
        time = (second * SR + place).astype(np.longdouble) / SR
        phase = np.multiply.outer(omega.astype(np.longdouble), time)
        envelope = np.exp(-np.multiply.outer(decay, time.astype(float)))
        wanted = envelope * (np.cos(phase) - (decay / omega)[:, None] * np.sin(phase)).astype(float)
        size = envelope * np.hypot(1.0, decay / omega)[:, None]
        alive = envelope > 10 * bank_module.FLOOR
        error = np.abs(sound[:, place] - wanted)[alive] / size[alive]
        worst, compared = max(worst, float(error.max())), compared + int(alive.sum())
        assert np.abs(sound[:, place][~alive]).max(initial=0.0) < 20 * bank_module.FLOOR
    assert compared > 300_000
    assert worst < 1e-9


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize(
    ("start", "length"),
    [(100.0, SHORT), (100.3, 0.96), (137.71, 7.3), (100.5, 12.0), (355.2, 61.0), (255.9, 900.5), (100.1, 0.01)],
)
def test_strikes_are_the_sampled_continuous_response_wherever_their_nodes_fall(
    start: float, length: float, flat: bool
) -> None:
    rng = np.random.default_rng(int(length))
    modes = random_modes(rng, 21, sets=2)
    bank, state = empty_bank(SR, 2, at=100)
    bank, state = append(bank, state, [random_modes(rng, 5, sets=2), modes])
    strike = Strike(1, start + 1e-4 / 3, length / SR, rng.normal(size=21), flat)
    sound = advance(bank, state, 4000, [strike])
    wanted = struck(modes, strike, np.arange(100, 4100, 11))
    assert np.abs(sound[:, 1, ::11] - wanted).max() < 1e-11 * np.abs(wanted).max()
    assert not sound[:, 0].any()
    assert state.free[0] == len(state.strikes)


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize(("start", "length"), [(100.0, 0.96), (137.71, 7.3), (355.2, 361.0), (100.9, 0.01)])
def test_translations_hear_a_pulse_as_forces_even_over_its_cells(start: float, length: float, flat: bool) -> None:
    """y = w Re Σ_cells j (1 + i d/ω) (1/c) ∫ over the cell of e^{s (n - u)} du, at all samples that end one."""
    rate, rigid_impulse = 9000.0, np.array([1.0, -2.0, 0.0])
    s = rate * (-1 + 1j) / SR
    bank, state = empty_bank(SR, at=100)
    bank, state = append(bank, state, [translating(rate, 3.0)])
    dipole = np.zeros((1, 3, 600))
    advance(bank, state, 600, [Strike(0, start, length / SR, np.zeros(0), flat, rigid_impulse)], dipole=dipole)
    first, spacing, impulse = pulse_cells(start, length / SR, SR, int(np.ceil(4 * rate / SR)), flat=flat)
    sample, wanted = np.arange(100, 700), np.zeros(600)
    for j, part in enumerate(impulse):
        late = sample - (first + (j + 0.5) * spacing)
        even = np.exp(s * np.maximum(late, 0.0)) * np.expm1(s * spacing) / (s * spacing)
        wanted += part * ((1 + 1j) * even).real * (late > -1e-6)
    assert np.abs(dipole[0] - 3.0 * rigid_impulse[:, None] * wanted).max() < 1e-12 * np.abs(wanted).max()
    assert np.abs(wanted).max() > 0
    advance(bank, state, 600)
    assert state.free[0] == len(state.strikes)
    assert not state.ringing["motion"].any()


def test_translations_follow_forces_that_are_even_over_a_sample_and_lie_along_directions_that_turn() -> None:
    rng = np.random.default_rng(8)
    rate, n = 5000.0, 400
    s = rate * (-1 + 1j) / SR
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [translating(rate, 2.0), translating(rate, 1.0)])
    signal, direction, progress = rng.normal(size=(2, n)), rng.normal(size=(2, 2, 3)), np.linspace(0.1, 0.9, n)
    none = np.zeros(0)
    forces = [Force(0, signal[i], none, none, direction[i, 0], direction[i, 1]) for i in range(2)]
    dipole = np.zeros((2, 3, n))
    advance(bank, state, n, (), forces, progress, dipole)
    total = sum(
        signal[i] * (direction[i, 0][:, None] * (1 - progress) + direction[i, 1][:, None] * progress) for i in range(2)
    )
    z, onset, wanted = np.zeros(3, complex), (1 + 1j) * np.expm1(s) / s, np.zeros((3, n))
    for k in range(n):
        z = z * np.exp(s) + onset * total[:, k] / SR
        wanted[:, k] = 2.0 * z.real
    assert np.abs(dipole[0] - wanted).max() < 1e-12 * np.abs(wanted).max()
    assert not dipole[1].any()


def translating(rate: float, weight: float) -> ModeSet:
    """A body without modes whose translations sound."""
    none = np.zeros(0)
    return ModeSet(none, none, np.zeros((1, 0), complex), translation=Translation(rate, rate, weight))


def test_no_strike_sounds_before_its_time() -> None:
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [random_modes(np.random.default_rng(0), 9)])
    sound = advance(bank, state, 600, [Strike(0, 511.25, 1e-5, np.ones(9))])[0, 0]
    assert not sound[:512].any()
    assert sound[512:].all()


def test_forces_push_with_gains_that_move_over_the_call_and_pairs_add_up() -> None:
    rng = np.random.default_rng(3)
    modes = random_modes(rng, 13)
    n, progress = 700, np.linspace(0.2, 0.9, 700)
    forces = [Force(0, rng.normal(size=n), rng.normal(size=13), rng.normal(size=13)) for _ in range(3)]
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [modes])
    sound = advance(bank, state, n, forces=forces, progress=progress)[0, 0]
    z, turn, wanted = np.zeros(13, complex), np.exp(pole(modes)), np.zeros(n)
    for i in range(n):
        push = sum((f.gain0 + (f.gain1 - f.gain0) * progress[i]) * f.force_n[i] for f in forces) / SR
        z = z * turn + (1 + 1j * modes.decay_per_s / modes.omega_rad_s) * push
        wanted[i] = (modes.weight[0] * z).real.sum()
    assert np.abs(sound - wanted).max() < 1e-12 * np.abs(wanted).max()


def test_the_energy_an_impulse_leaves_is_that_of_a_struck_mass() -> None:
    """A mode of participation g struck by J at rest has kinetic energy (gJ)²/2 at once; a lasting sine at resonance
    grows as F/2·t.
    """
    modes = ModeSet(np.array([2 * np.pi * 1000.0]), np.array([0.0]), np.ones((1, 1), complex))
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [modes])
    assert advance(bank, state.copy(), 1, [at_once(0, 0.0, 0.02 * np.array([3.0]))])[0, 0, 0] == pytest.approx(
        0.06, rel=1e-14
    )
    n = SR // 2
    drive = np.cos(2 * np.pi * 1000 * np.arange(n) / SR)
    sound = advance(bank, state, n, forces=[Force(0, drive, np.ones(1), np.ones(1))])[0, 0]
    assert np.abs(sound[-48:]).max() == pytest.approx(0.5 * n / SR, rel=1e-3)


def test_bodies_appended_while_ringing_change_nothing_for_the_others() -> None:
    rng = np.random.default_rng(5)
    old = [random_modes(rng, m, 2) for m in (7, 0, 40)]
    strikes = [Strike(0, 3.2, 2e-5, np.ones(7)), Strike(2, 90.0, 7e-3, np.ones(40))]
    bank, state = empty_bank(SR, 2)
    bank, state = append(bank, state, old)
    alone = advance(bank, state.copy(), 900, strikes)
    first = advance(bank, state, 333, strikes)
    kept = state.copy()
    bank2, state2 = append(bank, state, [random_modes(rng, 11, 2)])
    second = advance(bank2, state2, 567, [at_once(3, 400.0, np.ones(11))])
    assert np.array_equal(np.concatenate([first, second[:, :3]], axis=2), alone)
    assert second[:, 3].any()
    assert np.array_equal(advance(bank, kept, 567), alone[:, :, 333:])
    assert bank2.mode_count == bank.mode_count + 11


def test_silence_takes_all_that_rings_and_all_that_is_under_way() -> None:
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [random_modes(np.random.default_rng(1), 9)])
    advance(bank, state, 300, [Strike(0, 290.0, 2e-3, np.ones(9))])
    quenched = silence(state)
    assert not advance(bank, quenched, 1000).any()
    assert advance(bank, state, 1000).all()


def test_a_state_copied_plays_the_same_future_twice() -> None:
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [random_modes(np.random.default_rng(1), 9)])
    advance(bank, state, 100, [Strike(0, 90.0, 2e-3, np.ones(9))])
    ahead = state.copy()
    assert np.array_equal(advance(bank, ahead, 700), advance(bank, state, 700))


def test_tails_end_in_zeros_and_never_in_subnormals() -> None:
    """Fast and slow decays, tiny strikes: every sample is 0 or normal in single precision, state included, and silence
    is reached.
    """
    rng = np.random.default_rng(2)
    omega = 2 * np.pi * np.geomspace(30, 20_000, 12)
    decay = np.geomspace(15, 1.9 * SR, 12)
    keep = audible(omega, decay, SR)
    modes = ModeSet(omega[keep], decay[keep], np.ones((1, int(keep.sum())), complex))
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [modes])
    sounds = []
    for second in range(6):
        strikes = (
            [
                Strike(0, second * SR + 11.3 + i, 2e-5, np.full(int(keep.sum()), size))
                for i, size in enumerate(10.0 ** rng.uniform(-320, -3, 30))
            ]
            if second < 2
            else ()
        )
        sounds.append(advance(bank, state, SR, strikes))
        live = np.abs(np.concatenate([state.z, state.driven, state.ringing["motion"].ravel()]))
        assert not ((live > 0) & (live < np.finfo(float).tiny)).any()
    size = np.abs(np.concatenate(sounds, axis=2))
    assert np.isfinite(size).all()
    assert not ((size > 0) & (size < np.finfo(np.float32).tiny)).any()
    assert sounds[0].any()
    assert not sounds[-1].any()
    assert not state.ringing["ringing"].any()


def test_audible_drops_what_cannot_be_played_and_append_refuses_it() -> None:
    omega = 2 * np.pi * np.array([100.0, 23_999.0, 24_000.0, 0.0, 1000.0, 500.0, np.nan])
    decay = np.array([1.0, 1.0, 1.0, 1.0, 3e5, 0.0, 1.0])
    assert audible(omega, decay, SR).tolist() == [True, True, False, False, False, True, False]
    bank, state = empty_bank(SR)
    with pytest.raises(AudioError, match="audible"):
        append(bank, state, [ModeSet(omega[2:3], decay[2:3], np.ones((1, 1), complex))])


def test_bad_rates_are_named() -> None:
    for rate in (0, -1, 10**9, 44_100.5):
        with pytest.raises(AudioError, match="sample rate"):
            empty_bank(rate)  # type: ignore[arg-type]


def test_nothing_to_play_is_legal() -> None:
    bank, state = empty_bank(SR, 2)
    assert advance(bank, state, 10).shape == (2, 0, 10)
    bank, state = append(bank, state, [])
    bank, state = append(bank, state, [ModeSet(np.zeros(0), np.zeros(0), np.zeros((2, 0), complex))])
    assert advance(bank, state, 0).shape == (2, 1, 0)
    assert not advance(
        bank,
        state,
        10,
        [Strike(0, 20.0, 1e-3, np.zeros(0))],
        [Force(0, np.ones(10), np.zeros(0), np.zeros(0))],
    ).any()
    assert state.at == 20


@pytest.mark.parametrize("start", [100.0, 100.13, 100.37, 100.71])
def test_a_slow_pulse_moves_fast_modes_by_its_slope_alone(start: float) -> None:
    """|P(Ω)| = w g Ω J |F̂|/(ω² - Ω²) of modes of 6 to 18 kHz at 100 to 400 Hz, under a pulse of 1.5 ms, within 0.2 dB.

    Nodes anywhere between the samples leave up to wgF/8 a sample as well, 25 dB more.
    """
    omega = 2 * np.pi * np.linspace(6_000, 18_000, 40)
    modes = ModeSet(omega, np.full(40, 300.0), np.ones((1, 40), complex))
    bank, state = append(*empty_bank(SR), [modes])
    strike = Strike(0, start, 1.5e-3, np.ones(40), flat=True)
    count = SR // 10
    sound = advance(bank, state, count, [strike])[0, 0]
    f = np.linspace(100, 400, 7)
    turn = np.exp(-2j * np.pi * np.outer(f, np.arange(count)) / SR)
    force = np.abs(np.cos(np.pi * f * 1.5e-3) / (1 - (2 * f * 1.5e-3) ** 2))
    big = 2 * np.pi * f
    wanted = force * (big / (omega[:, None] ** 2 - big**2)).sum(axis=0)
    level = 20 * np.log10(np.abs(turn @ sound) / SR / wanted)
    assert np.abs(level).max() < 0.2
