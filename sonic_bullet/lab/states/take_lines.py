"""Lines of the takes of two states, each measured in every take about a common pole.

    takes of each state -> poles they share (after_attack.py) -> one list: nearer than a line's width is one line
    -> in every take, about a pole p:  x ≈ Σ_k (a_k + b_k t) e^{p_k t},   δp_k = b_k/a_k                  (first order)

Least squares on the spectrum under a window w(t), by the bins about a line, with its neighbours; the basis has the same
window.  [Golub & Pereyra 1973: b_k is the step of Gauss and Newton]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.lines.after_attack import ringing_lines
from sonic_bullet.lab.states.recorded_states import Take
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import raised_cosine

LISTENED_S = 2.0
MOST_PAIRED_LINES = 60
"""Of a state, the strongest."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedLines:
    """Lines of one state's takes, strongest first: frequency in Hz, decay in 1/s, energy, level in dB (k,)."""

    freq_hz: Array
    decay_per_s: Array
    energy: Array
    level_db: Array

    @property
    def pole(self) -> Array:
        """−d + iω in 1/s."""
        return np.asarray(-self.decay_per_s + 2j * np.pi * self.freq_hz)


@dataclass(frozen=True, slots=True, eq=False)
class TakeLines:
    """Lines measured in takes (t, k): level in dB of full scale, frequency in Hz, T60 in s, and their spreads.

    Frequency and T60 are NaN where a take does not hold the line well enough.
    """

    level_db: Array
    freq_hz: Array
    t60_s: Array
    freq_sd_hz: Array
    t60_sd_s: Array


@one_thread()
def shared_lines(takes: tuple[Take, ...], sr: int) -> SharedLines:
    """Find the lines that takes of one state share."""
    below_db = 70.0  # the strongest line
    longest_s, shortest_s = 30.0, 0.03
    signals = signals_of(takes, sr)
    found = ringing_lines(signals, sr, (30.0, min(16_000.0, 0.45 * sr)), signed=False)
    if not len(found.freq_hz):
        none = np.zeros(0)
        return SharedLines(none, none, none, none)
    t60 = np.log(1e3) / np.maximum(found.decay_per_s, 1e-6)
    level = 20 * np.log10(np.maximum(np.sqrt((np.abs(found.amplitude) ** 2).mean(axis=0)), 1e-12))
    loud = found.energy > found.energy.max() * 10 ** (-below_db / 10)
    good = np.flatnonzero(loud & (t60 < longest_s) & (t60 > shortest_s))
    good = good[np.argsort(-found.energy[good], kind="stable")][:MOST_PAIRED_LINES]
    return SharedLines(found.freq_hz[good], found.decay_per_s[good], found.energy[good], level[good])


def signals_of(takes: tuple[Take, ...], sr: int) -> Array:
    """Return the takes' beginnings (t, n), of one length; those that would cost the others too much are left out."""
    lengths, kept = _lengths_of(takes, sr)
    n = int(lengths[kept].min())
    return np.array([take.signal[:n] for take, keep in zip(takes, kept, strict=True) if keep])


def _lengths_of(takes: tuple[Take, ...], sr: int) -> tuple[Array, Array]:
    """Return how many samples of each take (t,) are listened to, and which of them (t,) the others are cut to.

    A take that is much shorter is not, nor one that a second hit ends, where that would cost the others a tenth.
    """
    short, short_by_a_hit = 0.5, 0.9  # of the median
    lengths = np.array([min(len(take.signal), round(LISTENED_S * sr)) for take in takes])
    least = np.array([short_by_a_hit if take.hit_again else short for take in takes])
    return lengths, lengths >= least * np.median(lengths)


def measured_in_takes(takes: tuple[Take, ...], sr: int, pole: Array) -> TakeLines:
    """Measure lines at poles (k,) in every take."""
    values = np.full((5, len(takes), len(pole)), np.nan)
    lengths, kept = _lengths_of(takes, sr)
    common = int(lengths[kept].min())  # one length where the takes allow it: a basis costs more than a take
    by_length: dict[int, list[int]] = {}
    for k, length in enumerate(lengths):
        by_length.setdefault(min(int(length), common), []).append(k)
    for length, members in by_length.items():
        values[:, members] = _measure_lines(np.array([takes[k].signal[:length] for k in members]), sr, pole)
    return TakeLines(*values)


@one_thread()
def _measure_lines(signals: Array, sr: int, pole: Array) -> Array:  # noqa: PLR0915
    """Level, frequency, T60 and the spreads of the latter two (5, t, k)."""
    attack_s, fade_s = 0.004, 0.006
    around_hz = 40.0  # of bins about a line that are fitted
    held = 4.0  # spreads of the amplitude over which a line is held well enough to say where it lies
    farthest = 0.7  # of a line's decay over the time that it is heard: beyond it the first order no longer holds
    from scipy.fft import next_fast_len

    t, n = signals.shape
    found = np.full((5, t, len(pole)), np.nan)
    if not len(pole):
        return found
    time = np.arange(n) / sr
    window = raised_cosine((time - attack_s) / fade_s) * raised_cosine((time[-1] - time) / (0.1 * time[-1]))
    size = next_fast_len(n)
    spectrum = np.fft.rfft(signals * window, size, axis=1)
    step_hz = sr / size
    freq = pole.imag / (2 * np.pi)
    width = np.maximum(np.maximum(around_hz, 3 * -pole.real / (2 * np.pi)), 20 * step_hz)
    first = np.maximum(1, ((freq - width) / step_hz).astype(int))
    last = np.minimum(spectrum.shape[1], ((freq + width) / step_hz).astype(int) + 2)
    reach = int(2.5 * width.max() / step_hz) + 2
    start = np.maximum(0, (freq / step_hz).astype(int) - reach)
    rings = [_spectrum(p, time, window, size, at, at + 2 * reach) for p, at in zip(pole, start, strict=True)]
    for k in range(len(pole)):
        low, high = int(first[k]), int(last[k])
        near = np.flatnonzero(np.abs(freq - freq[k]) < 1.4 * width[k])
        others = near[near != k]
        others = others[np.argsort(np.abs(freq[others] - freq[k]))][: max(0, (high - low) // 6)]
        step = _spectrum(pole[k], time, window * time, size, low, high)
        basis = [rings[k][low - start[k] : high - start[k]], step]
        basis += [_slice(rings[j], int(start[j]), low, high) for j in others]
        matrix = np.array(basis).T
        scale = np.linalg.norm(matrix, axis=0)
        inverse = np.linalg.pinv(matrix / scale, rcond=1e-6)
        part = spectrum[:, low:high]
        solved = part @ inverse.T
        left = part - solved @ (matrix / scale).T
        degrees = max(1, high - low - matrix.shape[1])
        noise = np.sqrt((np.abs(left) ** 2).sum(axis=1) / degrees)
        spread = np.sqrt((np.abs(inverse[:2]) ** 2).sum(axis=1))
        a, b = solved[:, 0] / scale[0], solved[:, 1] / scale[1]
        # the amplitude alone, without the step: its spread is less, and its level is what is compared
        alone = np.delete(matrix / scale, 1, axis=1)
        solo = part @ np.linalg.pinv(alone, rcond=1e-6)[0] / scale[0]
        floor = noise * spread[0] / scale[0]
        level = np.maximum(np.abs(solo), floor)
        found[0, :, k] = 20 * np.log10(np.maximum(2 * level, 1e-12))
        with np.errstate(divide="ignore", invalid="ignore"):
            off = b / a
            sd = noise * spread[1] / scale[1] / np.abs(a)
        most = farthest * max(-pole[k].real, 1 / time[-1])
        good = (np.abs(a) > held * floor) & (np.abs(off) < most) & (sd < most)
        decay = -pole[k].real - off.real
        good &= decay > 0.1 * -pole[k].real
        found[1, good, k] = freq[k] + off.imag[good] / (2 * np.pi)
        found[2, good, k] = np.log(1e3) / decay[good]
        found[3, good, k] = sd[good] / (2 * np.pi) / 2**0.5
        found[4, good, k] = np.log(1e3) / decay[good] ** 2 * sd[good] / 2**0.5
    return found


def _slice(ring: Array, start: int, low: int, high: int) -> Array:
    """Bins low to high of a spectrum that is known from ``start`` on; zeros beyond."""
    found = np.zeros(high - low, complex)
    a, b = max(low, start), min(high, start + len(ring))
    if b > a:
        found[a - low : b - low] = ring[a - start : b - start]
    return found


def _spectrum(pole: complex, time: Array, window: Array, size: int, low: int, high: int) -> Array:
    """Spectrum of w(t) e^{pt} at bins low to high."""
    from scipy.fft import fft

    return np.asarray(fft(window * np.exp(pole * time), size)[low:high])
