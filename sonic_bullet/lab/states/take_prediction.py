"""How well the named effects, applied to the first state as it was recorded, predict takes of the second held out.

    P'_b(t) = (P_b ⊛ tail)(t) · 10^(g_b/10) ((1 − r_b) e^(−2 Δd_b t) + r_b) + ρ_b Σ_b P_b(t)
        P of the take with its lines moved; r: what damping does not reach
    Δd, g, r: by third of an octave, least squares of the other takes' levels over time; with less damping A rings on
    as it fell where it ends or its noise hides it, or from its loudest on
    of no effect, the effects and their ways the one nearest to the other takes is held against the one held out
    gap closed = (D(A, B) − D(A', B))/(D(A, B) − D(B', B)),   D of band_time.py, B' another take of B

Each take of the second state is held out in turn; the effects' numbers are fitted to the others. The interval is of the
ratio over the held-out takes, drawn again.                                                       [Efron 1979]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.states.chance import CERTAIN
from sonic_bullet.lab.states.changes import Changes
from sonic_bullet.lab.states.state_causes import Cause
from sonic_bullet.records import Array
from sonic_bullet.signal.band_time import (
    ABOVE_NOISE_DB,
    BLOCK_S,
    EDGES_S,
    THIRDS_HZ,
    BandTime,
    band_time,
    cell_levels,
    level_distance_db,
)
from sonic_bullet.signal.short_time import raised_cosine

LEAST_GAP_DB = 0.1
"""Less is no gap to close."""
MOST_GROWTH = 60.0
"""Of ln of power, by less damping of what falls by as much."""
MOST_TAKES = 8
"""Of each state that are predicted: distances cost their product."""


@dataclass(frozen=True, slots=True)
class TakePrediction:
    """Distances in dB of takes of B held out from: A as it was, A with the effects, other takes of B; of A's takes.

    gap_closed, its low and high: of the way from A to another take of B; NaN where there is none to close.
    """

    before_db: float
    after_db: float
    floor_db: float
    baseline_db: float
    gap_closed: float
    gap_low: float
    gap_high: float
    held_out: int


@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """Numbers of the effects by third of an octave (b,).

    Gain, decay added, share of noise, and share of the sound that damping does not reach (wires, a room); tail: level
    and T60.
    """

    gain_db: Array
    decay_per_s: Array
    noise_share: Array
    spared: Array
    tail: tuple[float, float] = (0.0, 1.0)


def predict(found: Changes, causes: tuple[Cause, ...]) -> TakePrediction | None:
    """Predict held-out takes of the second state; None where one of the states has a single take."""
    a_takes, b_takes = found.before.state.takes[:MOST_TAKES], found.after.state.takes[:MOST_TAKES]
    if len(a_takes) < 1 or len(b_takes) < 2:
        return None
    sr = found.before.state.sr
    recorded = [band_time(take.signal, sr) for take in b_takes]
    plain = [band_time(take.signal, sr) for take in a_takes]
    moved = plain
    names = {one.name for one in causes}
    if found.shift is not None and found.shift.moved(CERTAIN) and names & {"stiffness", "material"}:
        factor = float(np.exp(found.shift.log_factor))
        moved = [band_time(_played_faster(take.signal, factor), sr) for take in a_takes]
    elif found.of("moved line") and names & {AddedMass.id, "added-stiffness", "stiffness"}:
        moved = [band_time(_with_lines_moved(take.signal, sr, found), sr) for take in a_takes]
    if "material" in names:
        names |= {"damping", "less-damping"}
    # late sound may be the thing's or a room's: the other takes tell whether damping moves it
    ways = [moved]
    if "less-damping" in names:
        ways += [[_ringing_on(one, alone=alone) for one in moved] for alone in (False, True)]
    before, after, floor = [], [], []
    for k, held in enumerate(recorded):
        others = [one for j, one in enumerate(recorded) if j != k]
        before.append(_mean([level_distance_db(one, held) for one in plain]))
        floor.append(_mean([level_distance_db(one, held) for one in others]))
        if causes:
            models = [_fit(way, others, names, found) for way in ways]
            made = [[_apply_effects(one, model) for one in way] for way, model in zip(ways, models, strict=True)]
            # the other takes tell, too, whether an effect is better than none
            nearest = min([plain, *made], key=lambda way: _few_apart_db(way, others))
            after.append(_mean([level_distance_db(one, held) for one in nearest]))
        else:
            after.append(before[-1])
    baseline = _mean([level_distance_db(x, y) for i, x in enumerate(plain) for j, y in enumerate(plain) if i != j])
    b, a, f = np.array(before), np.array(after), np.array(floor)
    gap, low, high = _gap(b, a, f)
    return TakePrediction(float(b.mean()), float(a.mean()), float(f.mean()), baseline, gap, low, high, len(recorded))


def _played_faster(signal: Array, factor: float) -> Array:
    """Return a take with all frequencies times a factor and all times through it, as size and stiffness make it."""
    from scipy.signal import resample_poly

    steps = Fraction(factor).limit_denominator(100)  # within 1e-4, far less than a third of an octave
    return np.asarray(resample_poly(signal, steps.denominator, steps.numerator))


def _few_apart_db(made: list[BandTime], others: list[BandTime]) -> float:
    """Mean distance of a few takes as made from a few others."""
    few = 3
    return _mean([level_distance_db(x, y) for x in made[:few] for y in others[:few]])


def _mean(values: list[float]) -> float:
    good = [x for x in values if np.isfinite(x)]
    return float(np.mean(good)) if good else float("nan")


def _gap(before: Array, after: Array, floor: Array) -> tuple[float, float, float]:
    if not np.isfinite(before - floor).all() or before.mean() - floor.mean() < LEAST_GAP_DB:
        return float("nan"), float("nan"), float("nan")
    gap = float((before - after).mean() / (before - floor).mean())
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(before), (400, len(before)))
    wide = (before - floor)[drawn].mean(axis=1)
    ratio = (before - after)[drawn].mean(axis=1) / np.maximum(wide, LEAST_GAP_DB / 2)
    return gap, float(np.quantile(ratio, 0.025)), float(np.quantile(ratio, 0.975))


def _fit(plain: list[BandTime], recorded: list[BandTime], names: set[str], found: Changes) -> _Model:
    """Fit the effects' numbers to takes."""
    bands = THIRDS_HZ[: len(plain[0].power)]
    none = np.zeros(len(bands))
    model = _Model(none, none, none, none)
    if names & {Room.id}:
        model = _Model(none, none, none, none, _fit_tail(plain, recorded))
        plain = [_apply_effects(one, model) for one in plain]
    gain, decay, spared = _fit_octaves(plain, recorded, _decays_tried(names), bands)
    share = np.zeros(len(bands))
    if "rattle" in names:
        loud = {row.freq_hz for row in found.of("octave level") if row.change > 6}
        for j, f in enumerate(bands):
            if min((abs(np.log2(f / g)) for g in loud), default=9.0) <= 0.5:
                share[j] = np.median([_share(one, j) for one in recorded])
    return _Model(gain, decay, share, spared, model.tail)


def _share(sound: BandTime, band: int) -> float:
    first = round(0.3 / BLOCK_S)
    return float(sound.power[band, :first].sum() / max(float(sound.power[:, :first].sum()), 1e-30))


def _decays_tried(names: set[str]) -> Array:
    """Return the decays (d,) in 1/s that the effects may add: damping adds, less of it takes away, others do neither.

    From growth in which a T60 of 0.1 s becomes one of many, to what is over within one cell.
    """
    less = -np.geomspace(60, 0.3, 24) if "less-damping" in names else np.zeros(0)
    more = np.geomspace(0.3, 120, 36) if "damping" in names else np.zeros(0)
    return np.concatenate([less, [0.0], more])


def _fit_octaves(
    plain: list[BandTime], recorded: list[BandTime], decay: Array, bands: Array
) -> tuple[Array, Array, Array]:
    """Gain, decay added and share that no damping reaches (b,), each of its third of an octave.

    Least squares of levels over the noise: what fell below it counts as no more than that.
    """
    noise = np.max([one.noise for one in recorded], axis=0)
    level_b = _mean_level(recorded, noise)
    floor = 10 * np.log10(np.maximum(noise, 1e-30))[:, None] + ABOVE_NOISE_DB
    gain = np.arange(-24.0, 24.5, 1.0)
    share = np.array([0.0, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3]) if len(decay) > 1 else np.zeros(1)
    still = int(np.abs(decay).argmin())
    made = _decayed_levels(plain, noise, decay, share)  # (b, d, r, c)
    found = []
    for band in range(len(bands)):
        low = floor[band, 0]
        seen = np.isfinite(made[band, still, 0]) & np.isfinite(level_b[band])
        seen &= np.maximum(made[band, still, 0], level_b[band]) > low
        if seen.sum() < 3:
            found.append((0.0, 0.0, 0.0))
            continue
        target = np.maximum(level_b[band, seen], low)
        shown = made[band][:, :, seen]
        miss = np.array([((np.maximum(shown + g, low) - target) ** 2).sum(axis=-1) for g in gain])  # (g, d, r)
        plain_at = (int(miss[:, still, 0].argmin()), still, 0)
        at = tuple(int(k) for k in np.unravel_index(int(miss.argmin()), miss.shape))
        if not _worth(float(miss[plain_at]), float(miss[at]), int(seen.sum())):
            at = plain_at
        found.append((float(gain[at[0]]), float(decay[at[1]]), float(share[at[2]])))
    gains, decays, shares = np.array(found).T
    return gains, decays, shares


def _decayed_levels(sounds: list[BandTime], noise: Array, decay: Array, share: Array) -> Array:
    """Mean levels of takes with decays (d,) added to all but shares (r,) of them: (b, d, r, c), without noise."""
    made = np.zeros(())
    for one, gain_db in zip(sounds, _take_gains(sounds, noise), strict=True):
        edges = np.minimum(np.round(np.array(EDGES_S) / BLOCK_S).astype(int), one.power.shape[1])
        fade = np.exp(np.clip(-2 * decay[:, None] * one.time_s, -60, MOST_GROWTH))
        cells = np.full((len(one.power), len(decay), len(edges) - 1), np.nan)
        for c, (a, b) in enumerate(pairwise(edges)):
            if b > a:
                cells[:, :, c] = one.power[:, a:b] @ fade[:, a:b].T / (b - a)
        still = cells[:, np.abs(decay).argmin()][:, None, None]
        power = (1 - share[:, None]) * cells[:, :, None] + share[:, None] * still
        made = made + (10 * np.log10(np.maximum(power, 1e-30)) - gain_db) / len(sounds)
    return made


def _ringing_on(sound: BandTime, *, alone: bool) -> BandTime:
    """Return a take that rings on as its early decay fell: what less damping makes audible.

    Where it ends or its noise hides it, and below −25 dB: there a room or a stand rings, which another damping leaves.
    alone: from its loudest on, as what damps it may damp some of it more than the rest, so that it bends.
    """
    least, smoothed = 3, 3  # blocks by which a fall is told, and over which a level is taken
    above, lowest = 4.0, 10**-2.5  # times the noise; of the band's loudest, as octave_values.py has it
    count = round(EDGES_S[-1] / BLOCK_S)
    power = np.zeros((len(sound.power), count))
    power[:, : sound.power.shape[1]] = sound.power[:, :count]
    for row, noise in zip(power, sound.noise, strict=True):
        level = np.convolve(row[: sound.power.shape[1]], np.ones(smoothed) / smoothed, "same")
        first = int(level.argmax())
        quiet = np.flatnonzero(level[first:] <= max(above * noise, lowest * level[first]))
        end = first + int(quiet[0]) if len(quiet) else sound.power.shape[1]
        if end - first < least or (end >= count and not alone):
            continue
        part = np.arange(first, end)
        fall, start = np.polyfit(part, np.log(np.maximum(level[part], 1e-30)), 1)
        begin = first + 1 if alone else end
        row[begin:] = np.exp(start + min(fall, 0.0) * np.arange(begin, count))
    return BandTime(power, sound.noise)


def _worth(plain: float, free: float, cells: int) -> bool:
    """Whether two numbers more than a gain are worth what they take off, by Akaike's criterion [Akaike 1974]."""
    penalty = 2 * 2
    least = 0.05 * cells  # squares of dB: levels are not told better than 0.2 dB
    return cells * float(np.log((plain + least) / (free + least))) > penalty


def _take_gains(sounds: list[BandTime], noise: Array) -> Array:
    """Return by how many dB each take is louder than all together (t,)."""
    levels = np.array([cell_levels(one, noise) for one in sounds])
    seen = np.isfinite(levels).all(axis=0)
    if not seen.any():
        return np.zeros(len(sounds))
    return np.asarray(np.median(levels[:, seen] - levels[:, seen].mean(axis=0), axis=1))


def _mean_level(sounds: list[BandTime], noise: Array) -> Array:
    """Mean levels (b, c) of takes after their own gains are taken off; NaN of cells that none of them has."""
    levels = np.array([cell_levels(one, noise) for one in sounds]) - _take_gains(sounds, noise)[:, None, None]
    seen = np.isfinite(levels)
    mean = np.where(seen, levels, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return np.asarray(np.where(seen.any(axis=0), mean, np.nan))


def _fit_tail(plain: list[BandTime], recorded: list[BandTime]) -> tuple[float, float]:
    """Level and T60 of a tail with which takes come nearest to those recorded."""
    best, tail = np.inf, (0.0, 1.0)
    few = plain[:3], recorded[:3]
    for t60 in (0.2, 0.35, 0.6, 1.0, 1.8):
        for level in (0.0, 0.2, 0.4, 0.8, 1.6, 3.2):
            made = [_reverberant(one, (level, t60)) for one in few[0]]
            d = _mean([level_distance_db(x, y) for x in made for y in few[1]])
            if d < best:
                best, tail = d, (level, t60)
    return tail


def _reverberant(sound: BandTime, tail: tuple[float, float]) -> BandTime:
    level, t60 = tail
    if not level:
        return sound
    rate = 2 * np.log(1e3) / t60
    time = (np.arange(sound.power.shape[1]) + 0.5) * BLOCK_S
    response = level**2 * rate * np.exp(-rate * time) * BLOCK_S
    size = 2 * len(time)
    echo = np.fft.irfft(np.fft.rfft(sound.power, size) * np.fft.rfft(response, size), size)[:, : len(time)]
    return BandTime(np.maximum(sound.power + echo, 0.0), sound.noise)


def _apply_effects(sound: BandTime, model: _Model) -> BandTime:
    """Return a take with the effects."""
    made = _reverberant(sound, model.tail)
    power = made.power * 10 ** (model.gain_db / 10)[:, None]
    fade = np.exp(np.clip(-2 * model.decay_per_s[:, None] * sound.time_s, -60.0, MOST_GROWTH))
    power = power * ((1 - model.spared[:, None]) * fade + model.spared[:, None])
    return BandTime(power + model.noise_share[:, None] * power.sum(axis=0), sound.noise)


def _with_lines_moved(signal: Array, sr: int, found: Changes) -> Array:
    """Return a take (n,) of the first state with its moved lines where they are in the second, each with its T60."""
    freq = found.pole.imag / (2 * np.pi)
    moves = []
    for row in found.of("moved line"):
        i, j = int(np.abs(freq - row.before).argmin()), int(np.abs(freq - row.after).argmin())
        level = np.mean(found.after_lines.level_db[:, j] - np.mean(found.gain_db[1]))
        level -= np.mean(found.before_lines.level_db[:, i] - np.mean(found.gain_db[0]))
        moves.append((complex(found.pole[i]), complex(found.pole[j]), float(level)))
    return with_lines_moved(signal, sr, moves)


def with_lines_moved(signal: Array, sr: int, moves: Sequence[tuple[complex, complex, float]]) -> Array:
    """Return a take (n,) with lines moved: each from its pole in 1/s to another, by so many dB."""
    rise_s = 0.002
    time = np.arange(len(signal)) / sr
    rise = raised_cosine(time / rise_s)
    made = np.array(signal, float)
    for old, new, level_db in moves:
        ring = rise * np.exp(old * time)
        amplitude = 2 * np.vdot(ring, made) / np.vdot(ring, ring)
        made -= np.real(amplitude * ring)
        made += np.real(amplitude * 10 ** (level_db / 20) * rise * np.exp(new * time))
    return made
