"""Hum that one recording tells by itself: a comb of the mains that stands before the onset, and in the tail as before.

    Σ_k a_k cos(2πk f₀t + φ_k),  f₀ about 50 or 60 Hz

f₀, a and φ by least squares over what precedes the onset, where no mode rings. Carried on to the last third, by whose
phases f₀ is told to a part of a period there, the comb has to take what its frequencies hold.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.units import MAINS_HZ
from sonic_bullet.signal.exponential_law import mean_by_median
from sonic_bullet.signal.robust import weighted_median
from sonic_bullet.signal.short_time import power_spectrum


def find_standing_hum(signal: Array, sr: int, start: int) -> tuple[Array, float]:
    """Find the hum in a recording.

    Parameters
    ----------
    signal : (n,) array
        Samples.
    sr : int
        Their rate in Hz.
    start : int
        Sample of the onset.

    Returns
    -------
    (n,) array
        The hum; zeros where there is none, or less than `least_s` to tell it from.
    float
        Its fundamental in Hz; 0 where there is none.
    """
    least_s = 0.1  # before the onset: five periods, so that Hann's main lobes lie apart
    guard_s = 0.005  # before the onset, whose first sample is not known that well
    most = 20  # multiples
    above = 30.0  # times the power between them
    refined = 3  # times that the tail's phases mend the frequency
    stays = 0.25  # of the comb's power in the tail, at most, once it is taken off
    from scipy.optimize import minimize_scalar

    quiet = signal[: max(0, start - round(guard_s * sr))]
    n = len(quiet)
    if n < least_s * sr:
        return np.zeros(len(signal)), 0.0
    power = power_spectrum(quiet - quiet.mean(), np.hanning(n), 4 * n)
    step = sr / (4 * n)
    multiple = np.arange(1, min(most, int(0.45 * sr / MAINS_HZ[-1])) + 1)

    def stands(f: float) -> Array:
        """Which multiples of f stand above what lies between them."""
        at = np.round(multiple * f / step).astype(int)
        between = np.array(
            [mean_by_median(power[int((k + 0.35) * f / step) : int((k + 0.65) * f / step) + 1]) for k in multiple]
        )
        between_least = np.minimum(between, np.concatenate([between[:1], between[:-1]]))
        return np.asarray(multiple[(power[at] > above * between_least) & (power[at] > 0)])

    def left(f: float) -> float:
        rest = quiet - _comb(f, found, n, sr) @ _weights(quiet, f, found, sr)
        return float(((rest - rest.mean()) ** 2).sum())

    best, least = (0.0, np.zeros(0, int)), float(((quiet - quiet.mean()) ** 2).sum())
    for mains in MAINS_HZ:
        found = stands(mains)
        if 1 not in found and len(found) < 2:  # half of a rectifier's hum is even multiples alone
            continue
        reach = min(0.02 * mains, 0.5 * sr / n / found[-1] + 0.002 * mains)
        f = float(
            minimize_scalar(left, bounds=(mains - reach, mains + reach), method="bounded", options={"xatol": 1e-7}).x
        )
        if left(f) < least:
            least, best = left(f), (f, found)
    f, found = best
    if not f:
        return np.zeros(len(signal)), 0.0
    tail = slice(len(signal) - len(signal) // 3, None)
    for _ in range(refined):
        hum = _comb(f, found, len(signal), sr) @ _weights(quiet, f, found, sr)
        held, carried = (_tones(x[tail], f, found, sr) for x in (signal, hum))
        # the median, as a mode may ring at one of them
        turn, weight = np.angle(held * carried.conj()) / found, (found * np.abs(carried)) ** 2
        f += weighted_median(turn, weight) * sr / (np.pi * (tail.start + len(signal) - n))
    held, rest = (_tones(x[tail], f, found, sr) for x in (signal, signal - hum))
    if (np.abs(rest) ** 2).sum() > stays * (np.abs(held) ** 2).sum():
        return np.zeros(len(signal)), 0.0
    return hum, f


def describe_hum(hz: float) -> str:
    """Say that it hums; nothing of 0 Hz."""
    return f"hum at {round(hz)} Hz and its multiples stands before the onset, and is taken off" if hz else ""


def _comb(f: float, multiple: Array, n: int, sr: int) -> Array:
    turn = 2 * np.pi * f / sr * np.outer(np.arange(n), multiple)
    return np.concatenate([np.cos(turn), np.sin(turn)], axis=1)


def _weights(signal: Array, f: float, multiple: Array, sr: int) -> Array:
    """Of the comb's waves, beside an offset: taken off first, it would hold a part of a period."""
    waves = np.column_stack([_comb(f, multiple, len(signal), sr), np.ones(len(signal))])
    return np.asarray(np.linalg.lstsq(waves, signal, rcond=None)[0][:-1])


def _tones(signal: Array, f: float, multiple: Array, sr: int) -> Array:
    """Return what a recording (n,) holds at the comb, by a window that keeps modes beside it out."""
    turn = 2 * np.pi * f / sr * np.outer(multiple, np.arange(len(signal)))
    return np.asarray(np.exp(-1j * turn) @ (np.hanning(len(signal)) * signal))
