"""The sound path's tables: moves by hand, histories that grow, parts of rows, and the equations in plain numpy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from sonic_bullet import _engine
from sonic_bullet._engine import MEMORY_SHORT, NOT_FINITE, PATH_DONE, PLACES_SHORT, TAPS, TOO_FAR, hear
from sonic_bullet.engine.path.propagation import AT_REST, Path, PathState, append_bodies, empty_path, grow
from sonic_bullet.records import Air, Array
from sonic_bullet.records.errors import AudioError
from tests.made.paths import ALL_ALIKE, Arrivals, Course, Emission, propagate

KAISER_BETA = 9.5
AHEAD = TAPS // 2

SR = 48_000
AIR = Air()
C = AIR.sound_speed_m_s
MICROPHONES = np.array([[0.0, -1.0, 0.5], [2.0, 3.0, 1.0]])


def path_of(bodies: int, radius: float = 0.01) -> tuple[Path, PathState]:
    path, state = empty_path(SR, AIR, MICROPHONES)
    return append_bodies(path, state, np.full(bodies, radius))


def called(
    path: Path,
    state: PathState,
    source: Array,
    begin_m: Array,
    end_m: Array,
    moved: bool = False,
    dipole: Array | None = None,
    step: int = 0,
) -> tuple[int, Array]:
    """One call for one body, as the run time makes it: nothing grows by itself."""
    n = source.shape[1]
    out = np.zeros((2, n))
    dipole = np.zeros((1, 3, n)) if dipole is None else dipole
    course = Course(begin_m, end_m, np.array([moved]), np.arange(n) / n, AT_REST, ALL_ALIKE)
    arrivals = Arrivals(out, 0, 0)
    status = hear(
        state.at,
        step,
        n,
        Emission(source[None], dipole, 0, np.zeros(2, np.int64)),
        course,
        (path, state),
        arrivals,
    )
    return status, out


def test_a_body_at_rest_is_a_windowed_sinc_of_its_delay() -> None:
    """The equations in plain numpy, one sample at a time; the taps' polynomials are fitted to 1e-8."""
    rng = np.random.default_rng(0)
    source, dipole, place = rng.normal(size=(1, 500)), rng.normal(size=(1, 3, 500)), np.array([[0.3, 0.4, -0.2]])
    path, state = path_of(1)
    sound = propagate(path, state, 0, source, dipole, place, place, np.zeros(1, bool), np.zeros(500))
    for c, microphone in enumerate(MICROPHONES):
        away = microphone - place[0]
        r = np.linalg.norm(away)
        emitted = np.concatenate([np.zeros(TAPS), (source[0] + away / r @ dipole[0]) / r])
        late = r / C * SR
        whole, fraction = int(np.ceil(late)), np.ceil(late) - late
        distance = np.arange(TAPS) - (AHEAD - 1) - fraction
        taps = np.sinc(distance) * np.i0(KAISER_BETA * np.sqrt(1 - (distance / AHEAD) ** 2))
        taps /= taps.sum()
        first = TAPS - whole - (AHEAD - 1) + np.arange(whole, 500)
        wanted = [emitted[k : k + TAPS] @ taps for k in first]
        assert np.abs(sound[c, whole:] - wanted).max() < 1e-7 * np.abs(wanted).max()


def test_a_body_moved_in_every_step_is_heard_from_all_its_places() -> None:
    """As many bodies that stay, each fading in over one step and out over the next."""
    rng = np.random.default_rng(1)
    steps, n = 9, 90
    source, places, x = rng.normal(size=(steps, n)), rng.uniform(-4, 4, (steps + 1, 3)), np.arange(n) / n
    path, state = path_of(1)
    parts = []
    for k in range(30):
        here, there = places[[min(k, steps)]], places[[min(k + 1, steps)]]
        now = source[[k]] if k < steps else np.zeros((1, n))
        parts.append(propagate(path, state, k, now, np.zeros((1, 3, n)), here, there, np.array([k < steps]), x))
    assert len(state.places) > 2
    path, state = path_of(steps + 1)
    wanted = []
    for k in range(30):
        now = np.zeros((steps + 1, n))
        if k < steps:
            now[k], now[k + 1] = source[k] * (1 - x), source[k] * x
        still = np.zeros(steps + 1, bool)
        wanted.append(propagate(path, state, k, now, np.zeros((steps + 1, 3, n)), places, places, still, x))
    moved, apart = np.concatenate(parts, axis=1), np.concatenate(wanted, axis=1)
    assert np.abs(moved[:, -n:]).max() == 0.0
    assert np.abs(moved - apart).max() < 1e-12 * np.abs(apart).max()


@pytest.mark.parametrize("moved", [False, True])
def test_what_is_refused_has_changed_nothing_and_goes_on_in_longer_tables(moved: bool) -> None:
    rng = np.random.default_rng(2)
    near, far = np.array([[1.0, 0.0, 0.0]]), np.array([[40.0, 0.0, 0.0]])
    path, state = path_of(1)
    status, _ = called(path, state, rng.normal(size=(1, 300)), near, near)
    assert status == PATH_DONE
    state.at += 300
    before = state.copy()
    source = rng.normal(size=(1, 300))
    refused = []
    while (status := called(path, state, source, near, far, moved)[0]) != PATH_DONE:
        refused.append(status)
        assert np.array_equal(state.lines[:2], before.lines)
        if status != MEMORY_SHORT or len(refused) == 1:
            assert np.array_equal(state.memory[: len(before.memory)], before.memory)
        grow(path, state, status)
    assert refused == ([PLACES_SHORT, MEMORY_SHORT] if moved else [MEMORY_SHORT])
    roomy, other = path_of(1)  # the same with enough room from the start
    other.places["need"] = 16_384
    grow(roomy, other, PLACES_SHORT)
    other.places["need"] = 16_384
    grow(roomy, other, MEMORY_SHORT)
    rng = np.random.default_rng(2)
    assert called(roomy, other, rng.normal(size=(1, 300)), near, near)[0] == PATH_DONE
    state.at, other.at = 600, 300
    assert called(roomy, other, rng.normal(size=(1, 300)), near, far, moved)[0] == PATH_DONE
    other.at = 600
    rest = np.zeros((1, 9000))
    later = [called(roomy, one, rest, far, far, step=1) for one in (state, other)]
    assert [status for status, _ in later] == [PATH_DONE, PATH_DONE]
    assert later[0][1].any()
    assert later[0][1].tobytes() == later[1][1].tobytes()


@pytest.mark.parametrize("n", [1, 7, 8, 9, 17])
def test_each_number_is_looked_at(n: int) -> None:
    here = np.zeros((1, 3))
    for wrong in (np.nan, np.inf, -np.inf):
        for place in range(4 * n):
            values = np.zeros(4 * n)
            values[place] = wrong
            path, state = path_of(1)
            source, dipole = values[None, :n].copy(), values[n:].reshape(1, 3, n).copy()
            assert called(path, state, source, here, here, dipole=dipole)[0] == NOT_FINITE
            assert not state.lines["awake"].any()
    for place in range(n):  # and a single one of them wakes
        source = np.zeros((1, n))
        source[0, place] = 1e-20
        path, state = path_of(1)
        assert called(path, state, source, here, here)[0] == PATH_DONE
        assert state.lines["awake"].all()


def test_a_distance_is_refused_once_and_named() -> None:
    path, state = path_of(1)
    far = np.array([[0.0, 0.0, 2000.0]])
    assert called(path, state, np.ones((1, 9)), far, far)[0] == TOO_FAR
    with pytest.raises(AudioError, match="body 0 sounds 2000 m"):
        grow(path, state, TOO_FAR)
    assert called(path, state, np.ones((1, 9)), far, np.full((1, 3), np.nan))[0] == NOT_FINITE
    with pytest.raises(AudioError, match="not finite"):
        grow(path, state, NOT_FINITE)


def test_parts_of_longer_rows_give_the_same_bits() -> None:
    """A chunk of steps lies in one array: each call takes its columns and writes its own."""
    rng = np.random.default_rng(4)
    bodies, steps, n = 3, 5, 203
    source, dipole = rng.normal(size=(bodies, steps * n)), rng.normal(size=(bodies, 3, steps * n))
    place = rng.uniform(-2, 2, (steps + 1, bodies, 3)) * 0.01 + np.arange(bodies)[:, None]
    x, still = np.arange(n) / n, np.zeros(bodies, bool)
    path, state = path_of(bodies)
    parts = [
        propagate(
            path, state, k, source[:, k * n :][:, :n], dipole[:, :, k * n :][:, :, :n], place[k], place[k + 1], still, x
        )
        for k in range(steps)
    ]
    path, state = path_of(bodies)
    out, along = np.full((2, steps * n + 3), np.nan), np.tile(x, steps)
    for k in range(steps):
        course = Course(place[k], place[k + 1], still, along, AT_REST, ALL_ALIKE)
        arrivals = Arrivals(out, k * n + 3, 0)
        status = hear(
            k * n,
            k,
            n,
            Emission(source[None], dipole, k * n, np.zeros(len(path.microphone_m), np.int64)),
            course,
            (path, state),
            arrivals,
        )
        assert status == PATH_DONE
    assert np.isnan(out[:, :3]).all()
    assert np.ascontiguousarray(out[:, 3:]).tobytes() == np.concatenate(parts, axis=1).tobytes()


@pytest.mark.parametrize("speed", [0.0, 1.0, 300.0, 700.0])
def test_any_speed_gives_the_same_bits_for_any_cuts(speed: float) -> None:
    rng = np.random.default_rng(5)
    n, steps = 160, 20
    source, x = rng.normal(size=(1, steps * n)), np.arange(n) / n
    source[:, 900:1500] = 0.0
    sounds = []
    for size in (n, 1, 31):
        path, state = path_of(1)
        parts = []
        for k in range(steps):
            begin, end = (np.array([[-10.0 + speed * n / SR * j, 1.0, 0.0]]) for j in (k, k + 1))
            for lo in range(0, n, size):
                now = source[:, k * n + lo : k * n + min(lo + size, n)]
                dipole = np.zeros((1, 3, now.shape[1]))
                parts.append(propagate(path, state, k, now, dipole, begin, end, np.zeros(1, bool), x[lo : lo + size]))
        sounds.append(np.concatenate(parts, axis=1))
    assert sounds[0].any()
    assert sounds[0].tobytes() == sounds[1].tobytes() == sounds[2].tobytes()


def test_taps_are_the_least_squares_fit_of_the_windowed_sinc() -> None:
    """Derived again by LAPACK; the engine's are a sum over Chebyshev's points, the same on each machine."""
    t = 0.5 * np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    distance = np.arange(TAPS) - (AHEAD - 1) - (t[:, None] + 0.5)
    taps = np.sinc(distance) * np.i0(KAISER_BETA * np.sqrt(np.maximum(0, 1 - (distance / AHEAD) ** 2)))
    taps /= taps.sum(axis=1, keepdims=True)
    here, mirrored = taps[:, :AHEAD], taps[:, : AHEAD - 1 : -1]
    powers = np.vander(t**2, _engine.HALF_DEGREE + 1, increasing=True)
    made = np.empty((_engine.HALF_DEGREE + 1, 2, AHEAD))
    _engine.tap_polynomials(made)
    for part, wanted in enumerate([(here + mirrored) / 2, (here - mirrored) / (2 * t[:, None])]):
        fit = np.linalg.lstsq(powers, wanted, rcond=None)[0]
        assert np.abs(powers @ (made[:, part] - fit)).max() < 1e-13
        assert np.abs(powers @ made[:, part] - wanted).max() < 2e-8


@pytest.fixture
def every_level() -> Iterator[list[int]]:
    """Levels of vector instructions that this processor has; the one in use is put back."""
    best = _engine.vector_level()
    yield list(range(best + 1))
    _engine.force_vector_level(best)


def test_each_level_of_vector_instructions_gives_the_same_bits(every_level: list[int]) -> None:
    """Bodies at rest and fast ones, moved by hand, with gains and aims: sound and histories."""
    found = []
    for level in every_level:
        _engine.force_vector_level(level)
        rng = np.random.default_rng(7)
        path, state = path_of(3)
        place = rng.normal(size=(3, 3))
        parts = []
        for step in range(20):
            n = int(rng.integers(1, 500))
            after = place + np.array([0.0, 1.0, 400.0])[:, None] * n / SR * rng.normal(size=(3, 3))
            moved = rng.random(3) < 0.1
            source, dipole = rng.normal(size=(3, n)), rng.normal(size=(3, 3, n))
            source[0, n // 2 :] = 0.0
            parts.append(propagate(path, state, step, source, dipole, place, after, moved, np.arange(n) / n))
            place = after
        found.append((np.concatenate(parts, axis=1).tobytes(), state.memory.tobytes(), state.lines.tobytes()))
    assert any(found[0][0])
    assert all(one == found[0] for one in found)
