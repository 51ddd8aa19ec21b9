"""The law of a number, as litres filled in, from states that have one each.

    lines of each state -> tracked from state to state by the pairing of line_pairs.py -> f_k(q), d_k(q)
    mass:   (f_0/f)² − 1 = m(q)      stiffness: (f/f_0)² − 1 = m(q)      damping: d − d_0 = m(q)
    m(q):   c q, c q^p, or c (1 − e^{−(q/q₀)^p}), as what is added counts by the square of the motion there: what
        fills a thing from its moving end counts less the nearer it comes to a node
    a state left out: its value by the law fitted to the others

Whether a line goes with the number is told by exchange: the numbers given to the states in every other order.

A state of one take is predicted by the others: the first state's take, its lines moved to where their law without that
state puts them, with T60 and level as they go from state to state beside it. How far two takes of one state lie apart
is not recorded then: the two states between which the law says least stand for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations
from math import factorial

import numpy as np

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.lab.states.chance import CERTAIN, MOST_LABELLINGS
from sonic_bullet.lab.states.changes import StateValues
from sonic_bullet.lab.states.line_pairs import NEAR, pair_lines
from sonic_bullet.lab.states.take_prediction import LEAST_GAP_DB, TakePrediction, with_lines_moved
from sonic_bullet.records import Array
from sonic_bullet.signal.band_time import band_time, level_distance_db

LIKELY = 0.5
"""Expected lines as near by chance, at most, from one state to the next."""
ONE_LINE = 5 * NEAR
"""Of ln f, over all states: a track that goes with nothing and goes farther is of two lines."""
FEWEST_STATES = 5
"""With five states there are 120 orders, 60 of them apart from their reverse: one is one in sixty."""


@dataclass(frozen=True, slots=True)
class LineLaw:
    """A line that goes with the number: its law, and each state's shift beside what the others predict of it.

    shift_percent, predicted_percent: by state, of the frequency at the least number. level_db_by_state: over that at
    the least number, less what lines that stay are louder by. error_share: of the state with the largest number,
    |predicted − measured| over |measured|.
    """

    freq_hz: float
    law: str
    effect: str
    numbers: tuple[float, ...]
    freq_hz_by_state: tuple[float, ...]
    shift_percent: tuple[float, ...]
    predicted_percent: tuple[float, ...]
    t60_s_by_state: tuple[float, ...]
    level_db_by_state: tuple[float, ...]
    error_share: float
    chance: float


@dataclass(frozen=True, slots=True)
class StateSeries:
    """Lines that go with the number, those that stay, and what the number does in a word."""

    numbers: tuple[float, ...]
    states: tuple[str, ...]
    moving: tuple[LineLaw, ...]
    still: tuple[tuple[float, float], ...]
    verdict: str
    tracked: int


def find_series(values: tuple[StateValues, ...]) -> StateSeries | None:
    """Find which lines go with the states' numbers; None where too many states have one number."""
    order = sorted(range(len(values)), key=lambda k: values[k].state.rank)
    values = tuple(values[k] for k in order)
    number = np.array([one.state.number for one in values], float)
    names = tuple(one.state.name for one in values)
    if len(np.unique(number)) < len(number) or len(number) < FEWEST_STATES:
        return StateSeries(tuple(number), names, (), (), "too few states", 0)
    tracks = [track for track in _tracks(values) if np.isfinite(track.freq_hz).sum() >= len(values) - 1]
    if not tracks:
        return StateSeries(tuple(number), names, (), (), "none", 0)
    chance = _chance_of_trend(np.array([track.freq_hz for track in tracks]), number)
    louder = _louder([track for track, by_chance in zip(tracks, chance, strict=True) if by_chance > CERTAIN])
    moving, still = [], []
    for track, by_chance in zip(tracks, chance.tolist(), strict=True):
        law = _law_of(track, louder, number, by_chance) if by_chance <= CERTAIN else None
        if law is not None:
            moving.append(law)
        elif np.ptp(np.log(last := track.freq_hz[np.isfinite(track.freq_hz)])) < ONE_LINE:
            still.append((float(last[0]), float(100 * (last[-1] / last[0] - 1))))
    moving.sort(key=lambda one: -abs(one.shift_percent[-1]))
    down = sum(one.effect == AddedMass.id for one in moving)
    verdict = "none"
    if moving:
        verdict = AddedMass.id if down > len(moving) / 2 else "added-stiffness"
    return StateSeries(tuple(number.tolist()), names, tuple(moving), tuple(sorted(still)), verdict, len(tracks))


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """A line over the states: frequency, T60 and level (states,); NaN where it was not found."""

    freq_hz: Array
    t60_s: Array
    level_db: Array


def _louder(still: list[_Track]) -> Array:
    """Return by how many dB lines that stay are louder in each state than in the first (states,); 0 of none."""
    if not still:
        return np.zeros(1)
    level = np.array([track.level_db - track.level_db[0] for track in still])
    level = level[np.isfinite(level[:, 0])]
    if not len(level):
        return np.zeros(1)
    middle = [np.median(x[np.isfinite(x)]) if np.isfinite(x).any() else 0.0 for x in level.T]
    return np.asarray(middle, np.float64)


def _tracks(values: tuple[StateValues, ...]) -> list[_Track]:
    """Track lines from each state to the next."""
    tracks = [{0: i} for i in range(len(values[0].lines.freq_hz))]
    for k in range(1, len(values)):
        pairs = pair_lines(values[k - 1].lines, values[k].lines)
        step = {
            i: j
            for i, j, c in zip(pairs.before.tolist(), pairs.after.tolist(), pairs.chance, strict=True)
            if c <= LIKELY
        }
        for track in tracks:
            if k - 1 in track and track[k - 1] in step:
                track[k] = step[track[k - 1]]
        lost = [track for track in tracks if k - 1 not in track and k - 2 in track]
        if lost and k >= 2:
            pairs = pair_lines(values[k - 2].lines, values[k].lines)
            taken = {track.get(k) for track in tracks}
            for i, j, c in zip(pairs.before.tolist(), pairs.after.tolist(), pairs.chance, strict=True):
                for track in lost:
                    if track[k - 2] == i and j not in taken and c <= LIKELY:
                        track[k] = j
    found = []
    for track in tracks:
        f, t, level = np.full((3, len(values)), np.nan)
        for k, i in track.items():
            f[k] = values[k].lines.freq_hz[i]
            t[k] = np.log(1e3) / values[k].lines.decay_per_s[i]
            level[k] = values[k].lines.level_db[i]
        found.append(_Track(f, t, level))
    return found


def _chance_of_trend(freq: Array, number: Array) -> Array:
    """Probability (k,) that the numbers in any order go as well with any line as they do with each."""
    moved = np.log(freq)
    orders = _orders(len(number))
    x = np.argsort(np.argsort(number)).astype(float)
    largest = np.zeros(len(orders))
    own = np.zeros(len(freq))
    for k, y in enumerate(moved):
        good = np.isfinite(y)
        shuffled = x[orders]
        a = shuffled[:, good] - shuffled[:, good].mean(axis=1, keepdims=True)
        b = y[good] - y[good].mean()
        # how far the line goes counts as well as how steadily: one that scatters within 0.1 % goes nowhere
        scatter = 1e-3
        r = np.abs(a @ b) / np.sqrt((a**2).sum(axis=1) * ((b**2).sum() + good.sum() * scatter**2))
        own[k] = r[0]
        largest = np.maximum(largest, r)
    return np.asarray((largest[None] * (1 + 1e-9) >= own[:, None]).mean(axis=1))


def _orders(count: int) -> Array:
    """Orders (p, count), as they are first: all of them, or many."""
    if factorial(count) <= 2 * MOST_LABELLINGS:
        return np.array(list(permutations(range(count))))
    rng = np.random.default_rng(0)
    return np.array([np.arange(count), *(rng.permutation(count) for _ in range(MOST_LABELLINGS - 1))])


def _law_of(track: _Track, louder: Array, number: Array, chance: float) -> LineLaw | None:
    freq = track.freq_hz
    good = np.isfinite(freq)
    f, q = freq[good], number[good]
    if len(f) < 4:
        return None
    down = f[-1] < f[0]
    q = q - q[0]
    y = (f[0] / f) ** 2 - 1 if down else (f / f[0]) ** 2 - 1
    laws = {"c q^p": _power_law, "c q": _proportional, "c (1 − e^{−(q/q₀)^p})": _saturating_law}

    def predicted(law: Callable[[Array, Array], Callable[[Array], Array]], out: int, among: Array) -> float:
        kept = among[among != out]
        return float(law(q[kept], y[kept])(q[out : out + 1])[0])

    every = np.arange(len(q))
    made = np.full(len(q), np.nan)
    chosen = ""
    for out in every[1:]:
        kept = every[every != out]
        # the law itself is chosen without the state that is left out
        misses = {
            name: sum(abs(predicted(law, int(one), kept) - y[one]) for one in kept[2:]) for name, law in laws.items()
        }
        chosen = min(misses, key=lambda name: misses[name])
        made[out] = predicted(laws[chosen], int(out), every)
    shift = np.full(len(freq), np.nan)
    shift[good] = 100 * (f / f[0] - 1)
    expected = np.full(len(freq), np.nan)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(np.maximum(1 + made, 1e-3))
    expected[good] = 100 * ((1 / root if down else root) - 1)
    last = float(abs(expected[good][-1] - shift[good][-1]) / max(abs(shift[good][-1]), 1e-9))
    return LineLaw(
        float(f[0]),
        chosen,
        AddedMass.id if down else "added-stiffness",
        tuple(number.tolist()),
        tuple(freq.tolist()),
        tuple(shift.tolist()),
        tuple(expected.tolist()),
        tuple(track.t60_s.tolist()),
        tuple((track.level_db - track.level_db[good][0] - louder).tolist()),
        last,
        chance,
    )


def _proportional(q: Array, y: Array) -> Callable[[Array], Array]:
    c = float((q * y).sum() / max(float((q * q).sum()), 1e-30))
    return lambda at: c * at


def _power_law(q: Array, y: Array) -> Callable[[Array], Array]:
    good = (q > 0) & (y > 0)
    if good.sum() < 2:
        return _proportional(q, y)
    # least squares of y itself, by its exponent: small shifts say little of large ones
    best, found = np.inf, (1.0, 0.0)
    for p in np.linspace(0.3, 3.0, 55):
        basis = q**p
        c = float((basis * y).sum() / max(float((basis * basis).sum()), 1e-30))
        miss = float(((y - c * basis) ** 2).sum())
        if miss < best:
            best, found = miss, (p, c)
    return lambda at: found[1] * np.maximum(at, 0.0) ** found[0]


def _saturating_law(q: Array, y: Array) -> Callable[[Array], Array]:
    if (q > 0).sum() < 3:
        return _proportional(q, y)
    best, found = np.inf, (1.0, 1.0, 0.0)
    for q0 in np.geomspace(0.1, 3.0, 40) * q.max():
        for p in np.linspace(0.5, 3.0, 26):
            basis = 1 - np.exp(-((q / q0) ** p))
            c = float((basis * y).sum() / max(float((basis * basis).sum()), 1e-30))
            miss = float(((y - c * basis) ** 2).sum())
            if miss < best:
                best, found = miss, (float(q0), float(p), c)
    return lambda at: np.asarray(found[2] * (1 - np.exp(-((np.maximum(at, 0.0) / found[0]) ** found[1]))))


def predict_by_law(values: tuple[StateValues, ...], series: StateSeries) -> dict[str, TakePrediction]:
    """Predict the takes of each state but the first from the first one's, by the laws without that state.

    By state's name; empty where no line goes with the number.
    """
    if not series.moving:
        return {}
    by_name = {one.state.name: one.state for one in values}
    states = [by_name[name] for name in series.states]
    sr = states[0].sr
    plain = [band_time(state.takes[0].signal, sr) for state in states]
    distance = np.array([[level_distance_db(one, other) for other in plain] for one in plain])
    floor_db = float(distance[_most_alike(series)])
    found = {}
    for k, state in enumerate(states[1:], 1):
        moves = [move for law in series.moving if (move := _move_of(law, k)) is not None]
        made = band_time(with_lines_moved(states[0].takes[0].signal, sr, moves), sr)
        before_db, after_db = float(distance[0, k]), level_distance_db(made, plain[k])
        open_db = before_db - floor_db
        gap = (before_db - after_db) / open_db if open_db > LEAST_GAP_DB else float("nan")
        none = float("nan")
        found[state.name] = TakePrediction(before_db, after_db, floor_db, floor_db, gap, none, none, len(state.takes))
    return found


def _most_alike(series: StateSeries) -> tuple[int, int]:
    """Return the two states between which the lines that go with the number go least."""
    shift = np.array([law.shift_percent for law in series.moving])
    pairs = [(i, j) for j in range(len(series.states)) for i in range(j)]
    return min(pairs, key=lambda pair: float(np.nanmax(np.abs(shift[:, pair[0]] - shift[:, pair[1]]), initial=0.0)))


def _move_of(law: LineLaw, k: int) -> tuple[complex, complex, float] | None:
    """Return a line's pole in the first state, that which the others tell of state k, and by how many dB it is louder.

    None where it is not told.
    """
    number, others = np.array(law.numbers), np.arange(len(law.numbers)) != k
    t60, level, shift = np.array(law.t60_s_by_state), np.array(law.level_db_by_state), law.predicted_percent[k]
    known = others & np.isfinite(t60) & np.isfinite(level)
    if not np.isfinite(shift) or not known[0]:
        return None
    place = np.searchsorted(number, number)  # states in their order: numbers may lie decades apart
    own = float(np.exp(np.interp(place[k], place[known], np.log(t60[known]))))
    louder = float(np.interp(place[k], place[known], level[known]))
    old = complex(-np.log(1e3) / t60[0], 2 * np.pi * law.freq_hz)
    return old, complex(-np.log(1e3) / own, 2 * np.pi * law.freq_hz * (1 + shift / 100)), louder
