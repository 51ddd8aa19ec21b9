"""Hum of a session: a comb of the mains that stands before every onset, and in the tails as before.

    x_i(t) = Σ_k a_ik cos(2πk f₀t + φ_ik) + noise,  f₀ about 50 or 60 Hz, one for all takes i

f₀ and which multiples k there are, by what precedes the onsets of all takes together, where no mode rings; a_ik and
φ_ik by least squares over it, or over the last third of a take that has too little before its onset. Carried on to the
last thirds, by whose phases f₀ is told to a part of a period there, the comb has to take what its frequencies hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.units import MAINS_HZ
from sonic_bullet.signal.exponential_law import mean_by_median
from sonic_bullet.signal.robust import weighted_median
from sonic_bullet.signal.short_time import power_spectrum, raised_cosine

LEAST_QUIET_S = 0.1
"""Before an onset: five periods, so that Hann's main lobes lie apart."""
MOST_MULTIPLES = 20
MAINS_DRIFT = 5e-3
"""Of the mains' frequency: interconnected grids are within 0.2 Hz of it while they work."""
ABOVE = 30.0
"""Times the power between the multiples that one take's must have: noise has it once in 10^13 [exponential law]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Quiet:
    """What precedes the onset of one take: at its rate (n,), and at a low rate (m,), for the search."""

    sound: Array
    slow: Array
    slow_sr: float


def find_standing_hum(signal: Array, sr: int, start: int, known_hz: float = 0.0) -> tuple[Array, float]:
    """Find the hum in one recording (n,) whose onset is at sample ``start``, as `find_session_hum` does."""
    hums, hz = find_session_hum([signal], sr, [start], known_hz)
    return hums[0], hz


def find_session_hum(
    signals: Sequence[Array], sr: int, starts: Sequence[int], known_hz: float = 0.0
) -> tuple[list[Array], float]:
    """Find the hum that takes of one session share.

    Parameters
    ----------
    signals : sequence of (n,) arrays
        Samples of each take.
    sr : int
        Their rate in Hz.
    starts : sequence of int
        Sample of each onset.
    known_hz : float
        Its fundamental by other takes of the session; 0 where it is not known.

    Returns
    -------
    list of (n,) arrays
        The hum in each; zeros where there is none, or less than `LEAST_QUIET_S` to tell it from.
    float
        Its fundamental in Hz; 0 where there is none.
    """
    refined = 3  # times that the tails' phases mend the frequency
    stays = 0.25  # of the comb's power in the tails, at most, once it is taken off
    none = [np.zeros(len(signal)) for signal in signals]
    quiet = [_quiet(signal, sr, start) for signal, start in zip(signals, starts, strict=True)]
    heard = [one for one in quiet if one is not None]
    f, found = _fundamental(heard, sr, known_hz) if heard else (0.0, np.zeros(0, int))
    if not f:
        return none, 0.0
    tails = [slice(len(signal) - len(signal) // 3, None) for signal in signals]
    for turn in range(refined + 1):
        hums = [_hum(signal, one, f, found, sr) for signal, one in zip(signals, quiet, strict=True)]
        if turn < refined:
            f += _correct_fundamental(signals, hums, quiet, tails, f, found, sr)
    held, rest = (
        np.array([(np.abs(_tones(x[tail], f, found, sr)) ** 2).sum() for x, tail in zip(sounds, tails, strict=True)])
        for sounds in (signals, [x - hum for x, hum in zip(signals, hums, strict=True)])
    )
    told = np.array([one is not None for one in quiet])
    if float(np.median(rest[told] / np.maximum(held[told], 1e-300))) > stays:
        return none, 0.0
    # a take whose modes ring at multiples is not made worse than it was
    return [hum if r < max(h, 1e-300) else zero for hum, zero, r, h in zip(hums, none, rest, held, strict=True)], f


def describe_hum(hz: float) -> str:
    """Say that it hums; nothing of 0 Hz."""
    return f"hum at {round(hz)} Hz and its multiples stands before the onset, and is taken off" if hz else ""


def _quiet(signal: Array, sr: int, start: int) -> _Quiet | None:
    """Return what precedes an onset, None of less than `LEAST_QUIET_S`."""
    guard_s = 0.005  # before the onset, whose first sample is not known that well
    over = 4.0  # the rate in which the frequency is sought, over that of the highest multiple
    sound = signal[: max(0, start - round(guard_s * sr))]
    if len(sound) < LEAST_QUIET_S * sr:
        return None
    sound = sound - sound.mean()
    highest = MOST_MULTIPLES * MAINS_HZ[-1]
    down = max(1, int(sr / (over * highest)))
    if down == 1:
        return _Quiet(sound, sound, sr)
    slow_sr, count = sr / down, -(-len(sound) // down)
    freq = np.arange(count // 2 + 1) * slow_sr / count
    spectrum = np.fft.rfft(sound, count * down)[: len(freq)]
    spectrum *= 1 - raised_cosine((freq - highest) / (slow_sr / 2 - highest))  # no alias on a multiple
    return _Quiet(sound, np.fft.irfft(spectrum, count) / down, slow_sr)


def _fundamental(heard: Sequence[_Quiet], sr: int, known_hz: float) -> tuple[float, Array]:
    """Return the comb's fundamental and multiples (k,) that take most of what precedes the onsets; 0 where none do."""
    near_known_hz = 0.02  # as far as the mains drift in a session
    power = [float((one.slow**2).sum()) for one in heard]

    def left(f: float) -> float:
        total = 0.0
        for one, whole in zip(heard, power, strict=True):
            rest = one.slow - _comb(f, found, len(one.slow), one.slow_sr) @ _weights(one.slow, f, found, one.slow_sr)
            total += float(((rest - rest.mean()) ** 2).sum()) / max(whole, 1e-300)
        return total

    longest = max(len(one.sound) for one in heard)
    best, least = (0.0, np.zeros(0, int)), float(len(heard))
    for mains in [known_hz] if known_hz else MAINS_HZ:
        found = _multiples(heard, sr, mains)
        if not known_hz and 1 not in found and len(found) < 2:  # half of a rectifier's hum is even multiples alone
            continue
        if not len(found):
            continue
        from scipy.optimize import minimize_scalar  # half a second to load, and most takes do not hum

        reach = near_known_hz if known_hz else min(MAINS_DRIFT * mains, 0.5 * sr / longest / found[-1] + 0.002 * mains)
        f = float(
            minimize_scalar(left, bounds=(mains - reach, mains + reach), method="bounded", options={"xatol": 1e-5}).x
        )
        if left(f) < least:
            least, best = left(f), (f, found)
    return best


def _multiples(heard: Sequence[_Quiet], sr: int, f: float) -> Array:
    """Return which multiples of f stand above what lies between them, in all takes together.

    The mean over takes of what each has over its own background, each counted up to what one alone would need.
    """
    from scipy.special import chdtri

    multiple = np.arange(1, min(MOST_MULTIPLES, int(0.45 * sr / MAINS_HZ[-1])) + 1)
    over = np.zeros(len(multiple))
    for one in heard:
        n = len(one.sound)
        power, step = power_spectrum(one.sound, np.hanning(n), 4 * n), sr / (4 * n)
        at = np.round(multiple * f / step).astype(int)
        between = np.array(
            [mean_by_median(power[int((k + 0.35) * f / step) : int((k + 0.65) * f / step) + 1]) for k in multiple]
        )
        least = np.maximum(np.minimum(between, np.concatenate([between[:1], between[:-1]])), 1e-300)
        over += np.minimum(power[at] / least, ABOVE * (1 + 1e-9))
    takes = len(heard)
    needed = float(chdtri(2 * takes, np.exp(-ABOVE)) / (2 * takes))
    return np.asarray(multiple[over / takes > min(needed, ABOVE)])


def _hum(signal: Array, quiet: _Quiet | None, f: float, found: Array, sr: int) -> Array:
    """Return the comb in a take, by what precedes its onset and by its last third, each wave by what it is sure of."""
    agree = 9.0  # of the variances: three standard errors; what is farther apart in the tail is a mode there
    comb = _comb(f, found, len(signal), sr)
    late = slice(len(signal) - len(signal) // 3, None)
    tail, tail_variance = _part(signal[late], comb[late], f, found, sr)
    if quiet is None:
        return np.asarray(comb @ tail)
    start, variance = _part(quiet.sound, comb[: len(quiet.sound)], f, found, sr)
    off = ((start - tail) ** 2).reshape(2, -1).sum(axis=0)
    sure = np.where(off < agree * (variance + tail_variance), variance / (variance + tail_variance), 0.0)
    return np.asarray(comb @ (start + np.tile(sure, 2) * (tail - start)))


def _part(sound: Array, comb: Array, f: float, found: Array, sr: int) -> tuple[Array, Array]:
    """Fit waves (2k,) to a stretch beside an offset; variance (k,) of each multiple by the power between multiples."""
    n = len(sound)
    wave = np.linalg.lstsq(np.column_stack([comb, np.ones(n)]), sound, rcond=None)[0][:-1]
    power, step = power_spectrum(sound, np.hanning(n), 4 * n), sr / (4 * n)
    beside = np.array([_power_beside(power, k, f / step) for k in found])
    return wave, np.maximum(beside, 1e-300) * 4 / (n * (np.hanning(n) ** 2).sum())


def _power_beside(power: Array, k: int, bins: float) -> float:
    """Compute the power that lies apart from a multiple, so many bins each, and from its neighbours."""
    bin_number = np.arange(max(int((k - 0.65) * bins), 1), int((k + 0.65) * bins) + 1)
    off = np.abs(bin_number / bins - k)
    return float(mean_by_median(power[bin_number[(off > 0.35) & (off < 0.65)]]))


def _correct_fundamental(
    signals: Sequence[Array],
    hums: Sequence[Array],
    quiet: Sequence[_Quiet | None],
    tails: Sequence[slice],
    f: float,
    found: Array,
    sr: int,
) -> float:
    """Return by what the fundamental is off, by the phases of all tails: a median, as modes may ring at multiples."""
    off, weight = [np.zeros(0)], [np.zeros(0)]
    for signal, hum, one, tail in zip(signals, hums, quiet, tails, strict=True):
        if one is None:
            continue
        held, carried = (_tones(x[tail], f, found, sr) for x in (signal, hum))
        lever = np.pi * found * (tail.start + len(signal) - len(one.sound)) / sr
        off.append(np.angle(held * carried.conj()) / lever)
        weight.append((lever * np.abs(carried)) ** 2)
    shift, weights = np.concatenate(off), np.concatenate(weight)
    return weighted_median(shift, weights) if len(shift) and weights.any() else 0.0


def _comb(f: float, multiple: Array, n: int, sr: float) -> Array:
    turn = 2 * np.pi * f / sr * np.outer(np.arange(n), multiple)
    return np.concatenate([np.cos(turn), np.sin(turn)], axis=1)


def _weights(signal: Array, f: float, multiple: Array, sr: float) -> Array:
    """Of the comb's waves, beside an offset: taken off first, it would hold a part of a period."""
    waves = np.column_stack([_comb(f, multiple, len(signal), sr), np.ones(len(signal))])
    return np.asarray(np.linalg.lstsq(waves, signal, rcond=None)[0][:-1])


def _tones(signal: Array, f: float, multiple: Array, sr: int) -> Array:
    """Return what a recording (n,) holds at the comb, by a window that keeps modes beside it out."""
    turn = 2 * np.pi * f / sr * np.outer(multiple, np.arange(len(signal)))
    return np.asarray(np.exp(-1j * turn) @ (np.hanning(len(signal)) * signal))
