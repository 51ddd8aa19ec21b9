"""Free air: distance, travel time, Doppler shift, direction, moves by hand, the same bits however calls are cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonic_bullet._engine import TAPS
from sonic_bullet.engine.path.propagation import Path, PathState, append_bodies, empty_path
from sonic_bullet.records import Air, Array
from sonic_bullet.records.errors import AudioError
from tests.made.paths import propagate

SR = 48_000
AIR = Air()
C = AIR.sound_speed_m_s


def path_of(
    bodies: int, microphones: object = ((0.0, 0.0, 0.0),), radius: float = 0.01, at: int = 0
) -> tuple[Path, PathState]:
    path, state = empty_path(SR, AIR, np.array(microphones), at)
    return append_bodies(path, state, np.full(bodies, radius))


def still(
    path: Path, state: PathState, source: Array, place: object, dipole: Array | None = None, step: int = 0
) -> Array:
    """One body that stays."""
    n = source.shape[-1]
    here = np.atleast_2d(np.array(place, float))
    count = len(here)
    source = np.broadcast_to(source, (count, n))
    return propagate(
        path,
        state,
        step,
        source,
        np.zeros((count, 3, n)) if dipole is None else dipole,
        here,
        here,
        np.zeros(count, bool),
        np.zeros(n),
    )


def moving(path: Path, state: PathState, source: Array, place: Array, velocity: Array, dt_s: float = 1 / 240) -> Array:
    """One body on a straight line, step by step."""
    per, parts = round(SR * dt_s), []
    progress = np.arange(per) / per
    for step in range(source.shape[-1] // per):
        start = place + velocity * dt_s * step
        some = source[None, step * per : (step + 1) * per]
        parts.append(
            propagate(
                path,
                state,
                step,
                some,
                np.zeros((1, 3, per)),
                start[None],
                (start + velocity * dt_s)[None],
                np.zeros(1, bool),
                progress,
            )
        )
    return np.asarray(np.concatenate(parts, axis=1)[0])


def tone(freq_hz: float, n: int) -> Array:
    return np.asarray(np.sin(2 * np.pi * freq_hz * np.arange(n) / SR))


def fitted(sound: Array, freq_hz: float, first: int) -> complex:
    """Complex amplitude of e^{iωt} in the samples from ``first`` on, by least squares."""
    phase = 2 * np.pi * freq_hz * np.arange(first, len(sound)) / SR
    basis = np.stack([np.cos(phase), -np.sin(phase)], axis=1)
    real, imag = np.linalg.lstsq(basis, sound[first:], rcond=None)[0]
    return complex(real, imag)


@pytest.mark.slow
@pytest.mark.parametrize("distance", [0.2, 1.0, 3.4567, 51.3, 999.0])
@pytest.mark.parametrize("freq", [200.0, 5000.0])
def test_level_falls_as_one_over_r_and_arrives_within_a_hundredth_of_a_sample(distance: float, freq: float) -> None:
    path, state = path_of(1)
    late = distance / C
    n = int(late * SR) + 4800
    sound = still(path, state, tone(freq, n), [distance, 0, 0])[0]
    assert not sound[: int(late * SR) - TAPS // 2].any()  # half the interpolation rings before
    got = fitted(sound, freq, int(late * SR) + 100) / (-1j)  # of sin
    wanted = np.exp(-2j * np.pi * freq * late) / distance
    assert abs(got) == pytest.approx(abs(wanted), rel=1e-3)
    assert abs(np.angle(got / wanted)) / (2 * np.pi * freq) * SR < 0.01


def test_the_passband_is_flat_within_a_tenth_of_a_db_to_18_khz() -> None:
    for freq in (50.0, 1000.0, 8000.0, 15_000.0, 18_000.0):
        for fraction in (0.0, 0.13, 0.5, 0.77):
            path, state = path_of(1)
            distance = (100 + fraction) / SR * C
            level = 20 * np.log10(
                abs(fitted(still(path, state, tone(freq, 3000), [distance, 0, 0])[0], freq, 400)) * distance
            )
            assert abs(level) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("speed", [-30.0, -3.0, 3.0, 30.0, 100.0])
def test_doppler_shift_is_exact(speed: float) -> None:
    """Receding at v along the line of sight: f/(1 + v/c) [Pierce 1989, sec. 9-1 for a moving source]."""
    freq, n = 1000.0, 14_400
    path, state = path_of(1)
    start = 60.0
    sound = moving(path, state, tone(freq, n), np.array([start, 0, 0.0]), np.array([speed, 0, 0.0]))
    observed = sound[-4000:] * 1.0
    crossing = np.flatnonzero((observed[:-1] < 0) & (observed[1:] >= 0))
    exact = crossing - observed[crossing] / (observed[crossing + 1] - observed[crossing])
    got = SR * (len(exact) - 1) / (exact[-1] - exact[0])
    assert got == pytest.approx(freq / (1 + speed / C), rel=2e-5)


def test_the_clamp_of_radius_and_of_the_shortest_delay() -> None:
    path, state = path_of(1, radius=0.25)
    sound = still(path, state, tone(1000, 2000), [0.01, 0, 0])[0]
    got = fitted(sound, 1000, 200) / (-1j)
    assert abs(got) == pytest.approx(4.0, rel=1e-3)
    assert -np.angle(got) / (2 * np.pi * 1000) * SR == pytest.approx(TAPS / 2, abs=0.01)


def test_a_push_radiates_as_a_dipole() -> None:
    rng = np.random.default_rng(0)
    away = rng.normal(size=(5, 3))
    away *= 2.0 / np.linalg.norm(away, axis=1)[:, None]
    direction = np.array([0.6, 0.0, 0.8])
    path, state = path_of(1, away)
    sound = still(path, state, np.zeros((1, 2000)), [0, 0, 0], dipole=0.3 * direction[None, :, None] * tone(500, 2000))
    for c in range(5):
        got = fitted(sound[c], 500, 600) / (-1j) * np.exp(2j * np.pi * 500 * 2.0 / C)
        assert got == pytest.approx(0.3 * (away[c] / 2.0) @ direction / 2.0, abs=2e-4)


def random_steps(seed: int, bodies: int, steps: int, n: int) -> list[tuple[Array, Array, Array, Array, Array]]:
    """Bodies that move, fall silent, start again, are moved by hand several steps in a row."""
    rng = np.random.default_rng(seed)
    place, out = rng.uniform(-4, 4, (bodies, 3)), []
    on = rng.uniform(size=bodies) < 0.5
    for _ in range(steps):
        by_hand = rng.uniform(size=bodies) < 0.2
        after = place + rng.normal(size=(bodies, 3)) * np.where(by_hand, 3.0, 0.02)[:, None]
        on ^= rng.uniform(size=bodies) < 0.3
        source, dipole = rng.normal(size=(bodies, n)) * on[:, None], rng.normal(size=(bodies, 3, n)) * on[:, None, None]
        gate = int(rng.integers(n))
        source[:, :gate] *= rng.uniform(size=bodies)[:, None] < 0.6
        dipole[:, :, :gate] = 0.0
        out.append((source, dipole, place, after, by_hand))
        place = after
    return out


def play(
    steps: list[tuple[Array, Array, Array, Array, Array]],
    cuts: list[list[int]],
    microphones: Array,
    turn: Array | None = None,
) -> Array:
    path, state = path_of(len(steps[0][0]), microphones, radius=0.05)
    n = steps[0][0].shape[1]
    progress = (np.arange(n) + 0.3) / n
    parts = []
    turn = np.eye(3) if turn is None else turn
    for number, ((source, dipole, before, after, by_hand), cut) in enumerate(zip(steps, cuts, strict=True)):
        for lo, hi in zip([0, *cut], [*cut, n], strict=True):
            turned = 0.2 * np.einsum("ij,bjn->bin", turn, dipole[:, :, lo:hi])
            parts.append(
                propagate(
                    path,
                    state,
                    number,
                    source[:, lo:hi],
                    turned,
                    before @ turn.T,
                    after @ turn.T,
                    by_hand,
                    progress[lo:hi],
                )
            )
    return np.concatenate(parts, axis=1)


MICROPHONES = np.array([[0.0, -1.0, 0.5], [2.0, 3.0, 1.0], [-7.0, 0.1, 0.0]])


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.data())
def test_any_cuts_give_the_same_bits(seed: int, data: st.DataObject) -> None:
    steps = random_steps(seed, 4, 12, 97)
    cuts = [sorted(data.draw(st.lists(st.integers(0, 97), max_size=4))) for _ in steps]
    assert play(steps, cuts, MICROPHONES).tobytes() == play(steps, [[] for _ in steps], MICROPHONES).tobytes()


def test_single_samples_give_the_same_bits() -> None:
    steps = random_steps(3, 5, 20, 97)
    assert (
        play(steps, [list(range(1, 97))] * 20, MICROPHONES).tobytes() == play(steps, [[]] * 20, MICROPHONES).tobytes()
    )


def test_a_microphone_hears_its_own_weight_set_whatever_the_first_one_is() -> None:
    """And what is no number is found in any set that is heard."""
    rng, n = np.random.default_rng(9), 2000
    heard, silent, place = rng.normal(size=(1, n)), np.zeros((1, n)), np.array([[0.3, 0.0, 0.0]])
    at_rest = np.zeros((1, 3, n)), place, place, np.zeros(1, bool), np.zeros(n)
    alone = propagate(*path_of(1), 0, heard, *at_rest)
    assert np.abs(alone).max() > 1.0
    both = propagate(*path_of(1, np.zeros((2, 3))), 0, np.stack([silent, heard]), *at_rest, sets=(0, 1))
    assert not both[0].any() and both[1].tobytes() == alone[0].tobytes()
    with pytest.raises(AudioError):
        propagate(*path_of(1), 0, np.stack([heard, heard * np.nan]), *at_rest, sets=(1,))


def test_a_call_of_no_samples_at_a_steps_end_changes_nothing() -> None:
    steps = random_steps(2, 3, 6, 97)
    assert play(steps, [[0, 97, 97]] * 6, MICROPHONES).tobytes() == play(steps, [[]] * 6, MICROPHONES).tobytes()


def test_several_microphones_are_separate_runs() -> None:
    steps = random_steps(5, 4, 15, 97)
    together = play(steps, [[]] * 15, MICROPHONES)
    for c in range(3):
        assert np.array_equal(play(steps, [[]] * 15, MICROPHONES[c : c + 1])[0], together[c])


def test_turning_the_whole_scene_changes_nothing() -> None:
    steps = random_steps(6, 4, 15, 97)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    straight = play(steps, [[]] * 15, MICROPHONES)
    turned = play(steps, [[]] * 15, MICROPHONES @ turn.T, turn)
    assert np.abs(turned - straight).max() < 1e-9 * np.abs(straight).max()


def test_a_body_moved_by_hand_fades_without_click_or_chirp() -> None:
    """A low tone moved 20 m: nothing of it above the tone's own band, during and after the move, and both ends at their
    own level.
    """
    freq, n = 200.0, 480
    path, state = path_of(1)
    source = tone(freq, 40 * n).reshape(40, 1, n)
    near, far = np.array([[2.0, 0, 0]]), np.array([[0, 22.0, 0]])
    progress, parts = np.arange(n) / n, []
    for step in range(40):
        moved = step == 15
        before, after = (near, far) if moved else ((near, near) if step < 15 else (far, far))
        parts.append(
            propagate(path, state, step, source[step], np.zeros((1, 3, n)), before, after, np.array([moved]), progress)
        )
    sound = np.concatenate(parts, axis=1)[0]
    assert abs(fitted(sound[10 * n : 15 * n], freq, 0)) == pytest.approx(1 / 2, rel=1e-3)
    assert abs(fitted(sound[30 * n :], freq, 0)) == pytest.approx(1 / 22, rel=1e-3)
    body = sound[1000:]  # behind the onset, which is a corner of its own
    second = np.abs(np.diff(body, 2)).max()
    # curvature of the tone, and the fade's corners
    assert second < 1.1 * (2 * np.pi * freq / SR) ** 2 / 2 + 2 * (2 * np.pi * freq / SR) / n
    assert len(state.places) == 2


def test_moving_a_silent_body_costs_no_place() -> None:
    path, state = path_of(1)
    here = np.zeros((1, 3))
    for step in range(50):
        propagate(
            path,
            state,
            step,
            np.zeros((1, 100)),
            np.zeros((1, 3, 100)),
            here + step,
            here + step + 1,
            np.ones(1, bool),
            np.zeros(100),
        )
    assert len(state.places) == 1
    for step in range(50, 400):
        propagate(
            path, state, step, np.ones((1, 100)), np.zeros((1, 3, 100)), here, here + 1, np.ones(1, bool), np.zeros(100)
        )
    assert len(state.places) < 12


def test_bodies_are_appended_while_sound_is_under_way() -> None:
    rng = np.random.default_rng(2)
    source = rng.normal(size=(1, 4000))
    path, state = path_of(1)
    alone = still(path, state.copy(), source, [5.0, 0, 0])
    first = still(path, state, source[:, :900], [5.0, 0, 0])
    path, state = append_bodies(path, state, np.array([0.1]))
    silent_second = np.concatenate([source[:, 900:], np.zeros((1, 3100))])
    second = still(path, state, silent_second, [[5.0, 0, 0], [1.0, 0, 0]], step=1)
    assert np.array_equal(np.concatenate([first, second], axis=1), alone)


def test_sound_drains_to_zeros_and_lines_fall_asleep() -> None:
    path, state = path_of(1, MICROPHONES)
    still(path, state, tone(1000, 500), [3.0, 0, 0])
    tail = still(path, state, np.zeros(6000), [3.0, 0, 0])
    assert tail.any()
    assert not tail[:, -3000:].any()
    assert not state.lines["awake"].any()
    tiny = still(path, state, 1e-29 * tone(1000, 3000), [3.0, 0, 0])
    assert not ((np.abs(tiny) > 0) & (np.abs(tiny) < 1e-30)).any()


def test_a_source_faster_than_sound_stays_finite() -> None:
    path, state = path_of(1)
    sound = moving(path, state, tone(300, 9600), np.array([-100.0, 1.0, 0.0]), np.array([1000.0, 0, 0]))
    assert np.isfinite(sound).all()
    assert np.abs(sound).max() < 2.0


def test_what_cannot_be_is_named() -> None:
    path, state = path_of(1)
    with pytest.raises(AudioError, match="1000 m"):
        still(path, state, np.ones(10), [1001.0, 0, 0])
    still(path, state, np.zeros(10), [1001.0, 0, 0])  # silent: nobody asks
    with pytest.raises(AudioError, match="not finite"):
        still(path, state, np.full(10, np.nan), [1.0, 0, 0])
    with pytest.raises(AudioError, match="not finite"):
        still(path, state, np.ones(10), [np.nan, 0, 0])
    with pytest.raises(AudioError, match="sample rate"):
        empty_path(0, AIR, np.zeros((1, 3)))
    with pytest.raises(AudioError, match="finite"):
        append_bodies(path, state, np.array([np.nan]))


def test_nobody_and_no_microphone_are_legal() -> None:
    path, state = empty_path(SR, AIR, np.zeros((1, 3)))
    none = np.zeros((0, 3))
    assert not propagate(
        path, state, 0, np.zeros((0, 7)), np.zeros((0, 3, 7)), none, none, np.zeros(0, bool), np.zeros(7)
    ).any()
    path, state = path_of(2, np.zeros((0, 3)))
    assert still(path, state, np.ones(7), np.zeros((2, 3))).shape == (0, 7)
