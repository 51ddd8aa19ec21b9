"""What moved between two states: each value with its spread, and whether takes of one state differ as much.

    takes -> octave_values (level, T60, flatness, attack), take_lines about shared poles (frequency, T60, level) -> rows
    -> judge (chance.py) -> StateChange, a row each; moved lines: one went, one came, and line_pairs pairs them

Levels are of a take's spectrum: a take's own gain, the median over octaves of its level less what all takes have there,
is taken off, as strength and distance are not declared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.lab.states.chance import Verdicts, judge
from sonic_bullet.lab.states.line_pairs import LinePairs, pair_lines
from sonic_bullet.lab.states.octave_values import OctaveValues, octave_values
from sonic_bullet.lab.states.recorded_states import RecordedState, Take
from sonic_bullet.lab.states.spectrum_shift import SpectrumShift, find_shift
from sonic_bullet.lab.states.take_lines import SharedLines, TakeLines, measured_in_takes, shared_lines
from sonic_bullet.records import Array

GONE_DB = 15.0
"""A line that fell by so much went: a strike at another place leaves that of one mode in six that it had
(|sin| below 10^(−15/20) = 0.18 over a random place has a probability of 0.11, in a product of two 0.2)."""

UNITS = {
    "octave level": "dB",
    "octave T60": "ratio",
    "octave late T60": "ratio",
    "octave flatness": "dB",
    "octave attack": "dB",
    "line frequency": "%",
    "line T60": "ratio",
    "line level": "dB",
    "moved line": "%",
}
# spread of a measurement alone where takes do not tell it: rounding of the method, in the units compared
OWN_SD = {
    "octave level": 0.2,
    "octave T60": 0.03,
    "octave late T60": 0.05,
    "octave flatness": 0.3,
    "octave attack": 0.1,
}


@dataclass(frozen=True, slots=True)
class StateChange:
    """One value of two states.

    change is in the kind's unit: % of frequency, ratio of T60, dB; low and high bound it by two spreads. chance:
    probability that takes of one state make any value differ so; None where takes were too few to say.
    """

    kind: str
    freq_hz: float
    before: float
    after: float
    change: float
    low: float
    high: float
    t: float
    chance: float | None
    certain: bool


@dataclass(frozen=True, slots=True, eq=False)
class StateValues:
    """What is measured of one state by itself."""

    state: RecordedState
    octaves: OctaveValues
    lines: SharedLines


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """All that was compared of two states. pole (k,): about which lines were measured, pair (k, 2) their states'.

    shift: of the spectrum as a whole; None where nothing changed beyond takes.
    """

    before: StateValues
    after: StateValues
    rows: tuple[StateChange, ...]
    method: str
    pairs: LinePairs
    pole: Array
    before_lines: TakeLines
    after_lines: TakeLines
    gain_db: tuple[Array, Array]
    shift: SpectrumShift | None = None
    notes: tuple[str, ...] = field(default=())

    def of(self, kind: str, *, certain: bool = True) -> list[StateChange]:
        """Return the rows of a kind, those that are certain or all."""
        return [row for row in self.rows if row.kind == kind and (row.certain or not certain)]

    @property
    def anything(self) -> bool:
        """Whether anything changed beyond takes."""
        return any(row.certain for row in self.rows)


def values_of(state: RecordedState) -> StateValues:
    """Measure one state."""
    return StateValues(state, octave_values(state.takes, state.sr), shared_lines(state.takes, state.sr))


def compare_states(
    before: StateValues,
    after: StateValues,
    others: tuple[StateValues, ...] = (),
    measure: Callable[[tuple[Take, ...], int, Array], TakeLines] = measured_in_takes,
    *,
    same_strikes: bool = False,
) -> Changes:
    """Compare two states.

    others: more states of the same thing, whose takes tell how takes scatter. measure: of lines at poles, in takes.
    same_strikes: take by take, in their order, the states are recordings of the same strikes.
    """
    pairs = pair_lines(before.lines, after.lines)
    pole, source = _poles(before.lines, after.lines, pairs)
    lines = tuple(measure(one.state.takes, one.state.sr, pole) for one in (before, after))
    gain = _gains(before.octaves, after.octaves)
    table = _octave_rows(before.octaves, after.octaves, gain, others) + _line_rows(lines[0], lines[1], pole, gain)
    label = np.repeat([False, True], [len(before.state.takes), len(after.state.takes)])
    names, freq = [row[0] for row in table], np.array([row[1] for row in table])
    verdicts = judge(
        np.array([row[2] for row in table]),
        label,
        np.array(names),
        np.array([row[3] for row in table]),
        (np.array([row[4] for row in table]), np.array([row[5] for row in table])),
        paired=same_strikes and len(before.state.takes) == len(after.state.takes),
    )
    rows = _changes(names, freq, np.array([row[2] for row in table]), label, verdicts)
    rows += _moved_lines(before.lines, after.lines, pairs, pole, source, rows, lines)
    changed = any(row.certain for row in rows)
    shift = find_shift(before.state, after.state) if changed and not same_strikes else None
    return Changes(before, after, tuple(rows), verdicts.method, pairs, pole, lines[0], lines[1], gain, shift)


Row = tuple[str, float, Array, float, float, float]  # kind, frequency, values of takes, own spread, squares elsewhere


def _gains(a: OctaveValues, b: OctaveValues) -> tuple[Array, Array]:
    """Return what each take is louder by than all together, as the median of its octaves."""
    both = np.concatenate([a.level_db, b.level_db])
    seen = np.isfinite(both).all(axis=0)
    if not seen.any():
        return np.zeros(len(a.level_db)), np.zeros(len(b.level_db))
    off = both[:, seen] - both[:, seen].mean(axis=0)
    gain = np.median(off, axis=1)
    return gain[: len(a.level_db)], gain[len(a.level_db) :]


def _octave_rows(
    a: OctaveValues, b: OctaveValues, gain: tuple[Array, Array], others: tuple[StateValues, ...]
) -> list[Row]:
    rows: list[Row] = []
    count = min(len(a.octave_hz), len(b.octave_hz))
    for kind, one, other, elsewhere in (
        ("octave level", a.level_db - gain[0][:, None], b.level_db - gain[1][:, None], _own_levels),
        ("octave T60", np.log(a.t60_s), np.log(b.t60_s), lambda o: np.log(o.t60_s)),
        ("octave late T60", np.log(a.late_t60_s), np.log(b.late_t60_s), lambda o: np.log(o.late_t60_s)),
        ("octave flatness", a.flatness_db, b.flatness_db, lambda o: o.flatness_db),
        ("octave attack", a.attack_db, b.attack_db, lambda o: o.attack_db),
    ):
        for j in range(count):
            squares = degrees = 0.0
            for state in others:
                column = elsewhere(state.octaves)[:, j] if j < len(state.octaves.octave_hz) else np.zeros(0)
                column = column[np.isfinite(column)]
                if len(column) > 1:
                    squares += float(((column - column.mean()) ** 2).sum())
                    degrees += len(column) - 1
            value = np.concatenate([one[:, j], other[:, j]])
            rows.append((kind, float(a.octave_hz[j]), value, OWN_SD[kind], squares, degrees))
    return rows


def _own_levels(octaves: OctaveValues) -> Array:
    """Levels of a state's takes without their gains."""
    level = octaves.level_db
    seen = np.isfinite(level).all(axis=0)
    gain = np.median(level[:, seen] - level[:, seen].mean(axis=0), axis=1) if seen.any() else np.zeros(len(level))
    return np.asarray(level - gain[:, None])


def _poles(a: SharedLines, b: SharedLines, pairs: LinePairs) -> tuple[Array, list[tuple[int, int]]]:
    """Return the poles (k,) about which takes are measured, and which lines of either state they are (-1: none).

    A pair within half its width is one pole: about the middle, both are first-order.
    """
    pole: list[complex] = []
    source: list[tuple[int, int]] = []
    free_a, free_b = set(range(len(a.freq_hz))), set(range(len(b.freq_hz)))

    def joined(i: int, j: int) -> bool:
        p, q = a.pole[i], b.pole[j]
        return bool(abs(p.imag - q.imag) < 0.5 * max(-p.real - q.real, 2.0) / 2)

    for i, j in zip(pairs.before.tolist(), pairs.after.tolist(), strict=True):
        if joined(i, j):
            pole.append((a.pole[i] + b.pole[j]) / 2)
            source.append((i, j))
            free_a.discard(i)
            free_b.discard(j)
    for i in sorted(free_a):
        pole.append(a.pole[i])
        source.append((i, -1))
    for j in sorted(free_b):
        if not any(abs(b.pole[j].imag - p.imag) < 0.25 * -(b.pole[j] + p).real for p in pole):
            pole.append(b.pole[j])
            source.append((-1, j))
    return np.array(pole, complex), source


def _line_rows(a: TakeLines, b: TakeLines, pole: Array, gain: tuple[Array, Array]) -> list[Row]:
    rows: list[Row] = []
    level = np.concatenate([a.level_db - gain[0][:, None], b.level_db - gain[1][:, None]])
    freq, t60 = np.concatenate([a.freq_hz, b.freq_hz]), np.concatenate([a.t60_s, b.t60_s])
    freq_sd, t60_sd = np.concatenate([a.freq_sd_hz, b.freq_sd_hz]), np.concatenate([a.t60_sd_s, b.t60_sd_s])
    for k, p in enumerate(pole):
        middle = float(p.imag / (2 * np.pi))
        rows.append(("line level", middle, level[:, k], 0.3, 0.0, 0.0))
        held = np.isfinite(freq[:, k])
        if held[: len(a.freq_hz)].mean() < 0.6 or held[len(a.freq_hz) :].mean() < 0.6:
            continue
        own = max(float(np.median(freq_sd[held, k])) / middle, 1e-5)
        rows.append(("line frequency", middle, np.log(freq[:, k]), own, 0.0, 0.0))
        own = max(float(np.median(t60_sd[held, k] / t60[held, k])), 3e-3)
        rows.append(("line T60", middle, np.log(t60[:, k]), own, 0.0, 0.0))
    return rows


def _changes(names: list[str], freq: Array, values: Array, after: Array, found: Verdicts) -> list[StateChange]:
    rows = []
    for r, kind in enumerate(names):
        if not np.isfinite(found.t[r]):
            continue
        one, other = float(np.nanmedian(values[r, ~after])), float(np.nanmedian(values[r, after]))
        change, sd = other - one, float(found.change_sd[r])
        bounds: list[float] = [change, change - 2 * sd, change + 2 * sd]
        if UNITS[kind] == "ratio":
            one, other, bounds = float(np.exp(one)), float(np.exp(other)), [float(np.exp(x)) for x in bounds]
        elif UNITS[kind] == "%":
            one, other = float(np.exp(one)), float(np.exp(other))
            bounds = [float(100 * np.expm1(x)) for x in bounds]
        chance = None if np.isnan(found.chance[r]) else float(found.chance[r])
        rows.append(
            StateChange(
                kind,
                float(freq[r]),
                one,
                other,
                bounds[0],
                bounds[1],
                bounds[2],
                float(found.t[r]),
                chance,
                bool(found.certain[r]),
            )
        )
    return rows


def _moved_lines(
    a: SharedLines,
    b: SharedLines,
    pairs: LinePairs,
    pole: Array,
    source: list[tuple[int, int]],
    rows: list[StateChange],
    lines: tuple[TakeLines, ...],
) -> list[StateChange]:
    """Return pairs of a line that went and one that came."""
    likely = 0.3  # expected lines as near by chance, at most
    level = {row.freq_hz: row for row in rows if row.kind == "line level"}
    at = {one: k for k, one in enumerate(source)}
    found = []
    for i, j, chance in zip(pairs.before.tolist(), pairs.after.tolist(), pairs.chance, strict=True):
        if (i, -1) not in at or (-1, j) not in at or chance > likely:
            continue
        went = level.get(float(pole[at[i, -1]].imag / (2 * np.pi)))
        came = level.get(float(pole[at[-1, j]].imag / (2 * np.pi)))
        if went is None or came is None or went.change > -GONE_DB or came.change < GONE_DB:
            continue
        f, g = (
            _mean_of(lines[0].freq_hz[:, at[i, -1]], a.freq_hz[i]),
            _mean_of(lines[1].freq_hz[:, at[-1, j]], b.freq_hz[j]),
        )
        sd = np.hypot(f[1] / f[0], g[1] / g[0])
        shift = np.log(g[0] / f[0])
        bounds = [float(100 * np.expm1(shift + z * sd)) for z in (0, -2, 2)]
        worst = None if went.chance is None or came.chance is None else max(went.chance, came.chance)
        t = float(np.sign(shift) * min(abs(went.t), abs(came.t)))
        certain = went.certain and came.certain
        found.append(StateChange("moved line", f[0], f[0], g[0], bounds[0], bounds[1], bounds[2], t, worst, certain))
    return found


def _mean_of(values: Array, otherwise: float) -> tuple[float, float]:
    """Mean and its spread of values of takes."""
    good = values[np.isfinite(values)]
    if not len(good):
        return float(otherwise), 0.0
    return float(good.mean()), float(good.std(ddof=1) / np.sqrt(len(good))) if len(good) > 1 else 0.0
