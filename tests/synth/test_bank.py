"""The bank against closed forms: the oscillator's own solution, exact strikes, forces, and what it does with what it
cannot play.
"""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.synth import bank as bank_module
from sonic_bullet.synth.bank import Force, ModeSet, Strike, advance, append, audible, empty_bank, silence

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
    for j, impulse in enumerate(strike.impulse_n_s):
        late = sample - (strike.start + j * strike.spacing)
        response = np.exp(np.multiply.outer(pole(modes), np.maximum(late, 0.0))) * (late >= 0)
        out += (
            (modes.weight * ((1 + 1j * modes.decay_per_s / modes.omega_rad_s) * strike.gain * impulse)) @ response
        ).real
    return out


def test_free_ringing_keeps_pitch_and_decay_to_1e9_of_the_envelope_over_ten_seconds() -> None:
    freq, t60 = (grid.ravel() for grid in np.meshgrid(np.geomspace(20, 20_000, 9), np.geomspace(0.05, 20, 6)))
    omega, decay = 2 * np.pi * freq, np.log(1000.0) / t60
    bank, state = empty_bank(SR)
    bank, state = append(
        bank, state, [ModeSet(omega[i : i + 1], decay[i : i + 1], np.ones((1, 1), complex)) for i in range(len(freq))]
    )
    strikes = [Strike(i, 0.0, 1.0, np.ones(1), np.ones(1)) for i in range(len(freq))]
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


@pytest.mark.parametrize(
    ("start", "spacing", "nodes"),
    [
        (100.0, 1.0, 1),
        (100.3, 0.04, 24),
        (137.71, 0.37, 200),
        (100.5, 0.5, 100),
        (355.2, 1.7, 61),
        (255.9, 0.5, 900),
        (100.1, 7.3, 9),
    ],
)
def test_strikes_are_the_sampled_continuous_response_wherever_their_nodes_fall(
    start: float, spacing: float, nodes: int
) -> None:
    rng = np.random.default_rng(nodes)
    modes = random_modes(rng, 21, sets=2)
    bank, state = empty_bank(SR, 2, at=100)
    bank, state = append(bank, state, [random_modes(rng, 5, sets=2), modes])
    strike = Strike(1, start + 1e-4 / 3, spacing, rng.uniform(size=nodes) / nodes, rng.normal(size=21))
    sound = advance(bank, state, 4000, [strike])
    wanted = struck(modes, strike, np.arange(100, 4100, 11))
    assert np.abs(sound[:, 1, ::11] - wanted).max() < 1e-11 * np.abs(wanted).max()
    assert not sound[:, 0].any()


def test_no_strike_sounds_before_its_time() -> None:
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [random_modes(np.random.default_rng(0), 9)])
    sound = advance(bank, state, 600, [Strike(0, 511.25, 0.1, np.ones(3), np.ones(9))])[0, 0]
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
    assert advance(bank, state.copy(), 1, [Strike(0, 0.0, 1.0, np.array([0.02]), np.array([3.0]))])[
        0, 0, 0
    ] == pytest.approx(0.06, rel=1e-14)
    n = SR // 2
    drive = np.cos(2 * np.pi * 1000 * np.arange(n) / SR)
    sound = advance(bank, state, n, forces=[Force(0, drive, np.ones(1), np.ones(1))])[0, 0]
    assert np.abs(sound[-48:]).max() == pytest.approx(0.5 * n / SR, rel=1e-3)


def test_bodies_appended_while_ringing_change_nothing_for_the_others() -> None:
    rng = np.random.default_rng(5)
    old = [random_modes(rng, m, 2) for m in (7, 0, 40)]
    strikes = [Strike(0, 3.2, 0.2, np.ones(5), np.ones(7)), Strike(2, 90.0, 0.5, np.ones(700), np.ones(40))]
    bank, state = empty_bank(SR, 2)
    bank, state = append(bank, state, old)
    alone = advance(bank, state.copy(), 900, strikes)
    first = advance(bank, state, 333, strikes)
    kept = state.copy()
    bank2, state2 = append(bank, state, [random_modes(rng, 11, 2)])
    second = advance(bank2, state2, 567, [Strike(3, 400.0, 1.0, np.ones(1), np.ones(11))])
    assert np.array_equal(np.concatenate([first, second[:, :3]], axis=2), alone)
    assert second[:, 3].any()
    assert np.array_equal(advance(bank, kept, 567), alone[:, :, 333:])
    assert bank2.mode_count == bank.mode_count + 11


def test_silence_takes_all_that_rings_and_all_that_is_under_way() -> None:
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [random_modes(np.random.default_rng(1), 9)])
    advance(bank, state, 300, [Strike(0, 290.0, 0.5, np.ones(200), np.ones(9))])
    quenched = silence(state)
    assert not advance(bank, quenched, 1000).any()
    assert advance(bank, state, 1000).all()


def test_a_state_copied_plays_the_same_future_twice() -> None:
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [random_modes(np.random.default_rng(1), 9)])
    advance(bank, state, 100, [Strike(0, 90.0, 0.5, np.ones(200), np.ones(9))])
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
            [Strike(0, second * SR + 11.3, 0.1, 10.0 ** rng.uniform(-320, -3, 30), np.ones(int(keep.sum())))]
            if second < 2
            else ()
        )
        sounds.append(advance(bank, state, SR, strikes))
        live = np.abs(np.concatenate([state.z, state.driven]))
        assert not ((live > 0) & (live < np.finfo(float).tiny)).any()
    size = np.abs(np.concatenate(sounds, axis=2))
    assert np.isfinite(size).all()
    assert not ((size > 0) & (size < np.finfo(np.float32).tiny)).any()
    assert sounds[0].any()
    assert not sounds[-1].any()
    assert not state.ringing.any()


def test_audible_drops_what_cannot_be_played_and_append_refuses_it() -> None:
    omega = 2 * np.pi * np.array([100.0, 23_999.0, 24_000.0, 0.0, 1000.0, 500.0, np.nan])
    decay = np.array([1.0, 1.0, 1.0, 1.0, 3e5, 0.0, 1.0])
    assert audible(omega, decay, SR).tolist() == [True, True, False, False, False, True, False]
    bank, state = empty_bank(SR)
    with pytest.raises(AudioError, match="audible"):
        append(bank, state, [ModeSet(omega[2:3], decay[2:3], np.ones((1, 1), complex))])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start": -5.0}, "have sounded"),
        ({"start": float("nan")}, "nodes"),
        ({"spacing": 0.0}, "nodes"),
        ({"spacing": 20.0}, "nodes"),
        ({"impulse_n_s": np.array([1.0, np.inf])}, "nodes"),
        ({"gain": np.ones(8)}, "gain of shape"),
        ({"gain": np.full(9, np.nan)}, "not finite"),
        ({"body": 7}, "body 7 of 1"),
    ],
)
def test_bad_strikes_are_named(change: dict[str, object], message: str) -> None:
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [random_modes(np.random.default_rng(1), 9)])
    good: dict[str, object] = {"body": 0, "start": 3.0, "spacing": 0.5, "impulse_n_s": np.ones(4), "gain": np.ones(9)}
    with pytest.raises(AudioError, match=message):
        advance(bank, state, 10, [Strike(**(good | change))])  # type: ignore[arg-type]


def test_bad_forces_rates_and_states_are_named() -> None:
    bank, state = empty_bank(SR)
    grown, _ = append(bank, state, [random_modes(np.random.default_rng(1), 9)])
    with pytest.raises(AudioError, match="bank of 1"):
        advance(grown, state, 10)
    grown, state = append(bank, state, [random_modes(np.random.default_rng(1), 9)])
    with pytest.raises(AudioError, match="force that is not finite"):
        advance(grown, state, 10, forces=[Force(0, np.full(10, np.nan), np.ones(9), np.ones(9))])
    with pytest.raises(AudioError, match="shape"):
        advance(grown, state, 10, forces=[Force(0, np.ones(9), np.ones(9), np.ones(9))])
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
        [Strike(0, 20.0, 1.0, np.ones(3), np.zeros(0))],
        [Force(0, np.ones(10), np.zeros(0), np.zeros(0))],
    ).any()
    assert state.at == 20
