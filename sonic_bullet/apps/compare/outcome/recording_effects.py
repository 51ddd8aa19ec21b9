"""Changes of a recording, from the samples alone, without causes, as a recording has no inputs.

    order of channels -> delay, polarity, gain by cross-correlation -> transfer function H = S_ab/S_aa -> the residual:
    noise, tones, clipping, gaps; two that correlate no more than chance have nothing in common

Chance: c(k) = Σ a(t) b(t + k) of two unrelated sounds has the variance Σ a²b² · Σ ρ_a ρ_b [Bartlett, J. R. Stat. Soc.
Suppl. 8 (1946) 27], a² and b² their envelopes; of M lags the largest is below √(2 ln(2M/α)) of its root but for α.
H and its coherence: Bendat and Piersol, Random Data (2010), eq. 6.37 and 6.39. A coherence near 1 means one linear
filter; the rest is the residual.
"""

from __future__ import annotations

import itertools

import numpy as np

from sonic_bullet.apps.compare.comparison_record import Consequence
from sonic_bullet.apps.compare.outcome.sound_effects import level_words
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.signal.octave_bands import in_octave
from sonic_bullet.signal.short_time import power_spectrum

COMMON_BY_CHANCE = 0.01  # α
LEAST_COMMON_SHARE = 0.25  # of B's power that A explains in any case: a tone correlates with any other


def recording_effects(a: Array, b: Array, sr: int) -> list[Consequence]:
    """Find the changes between two recordings (channels, n) at one rate."""
    group_delay = 16  # largest group delay of a filter in samples
    if a.shape[0] != b.shape[0] or not a.size or not b.size:
        return []
    if not a.any() or not b.any():
        return [Consequence("silence", f"{'A' if not a.any() else 'B'} is silent")]
    found: list[Consequence] = []
    order = _order(a, b)
    if order != tuple(range(len(a))):
        found.append(Consequence("channels", f"channels in another order: {' '.join(str(i + 1) for i in order)} of A"))
        a = a[list(order)]
    delay, sign, share, chance = _delay(a, b, sr)
    if share < min(chance, LEAST_COMMON_SHARE):
        words = f"nothing in common: A explains {share:.1e} of B's power, no more than chance does ({chance:.1e})"
        return [Consequence("unrelated", words, None, {"share": share, "chance": chance})]
    if 0 < abs(delay) <= group_delay and not _only_delayed(a, b, delay):
        delay = 0
    found += _offset(a * sign, b)
    if delay:
        words = f"delayed by {delay} samples ({delay / sr * 1e3:+.3g} ms)"
        found.append(Consequence("delay", words, None, {"delay_s": delay / sr}))
    if sign < 0:
        found.append(Consequence("polarity", "polarity is inverted"))
    x, y = _overlap(a, b, delay)
    found += _find_clipping(a, b) + _gaps(x, y, sr)
    clean = not found or all(one.kind in ("channels", "delay", "polarity") for one in found)
    return found + _transfer(x * sign, y, sr, clean)


def _only_delayed(a: Array, b: Array, delay: int) -> bool:
    """Tell whether little but a gain is left at that delay; else it is the delay of a filter."""
    x, y = _overlap(a, b, delay)
    return _db(y - float((x * y).sum() / np.square(x).sum()) * x, y) < -40


def _order(a: Array, b: Array) -> tuple[int, ...]:
    """Find the permutation of channels whose spectra agree best."""
    if not 1 < len(a) <= 4:
        return tuple(range(len(a)))
    n = max(a.shape[1], b.shape[1])
    one, other = (np.fft.rfft(x, n, axis=1) for x in (a, b))

    def agree(i: int, j: int) -> float:
        cross = np.fft.irfft(np.conj(one[i]) * other[j])
        return float(np.abs(cross).max() / (np.linalg.norm(a[i]) * np.linalg.norm(b[j]) + 1e-300))

    table = [[agree(i, j) for j in range(len(b))] for i in range(len(a))]
    best = max(itertools.permutations(range(len(a))), key=lambda p: sum(table[i][j] for j, i in enumerate(p)))
    usual = sum(table[i][i] for i in range(len(a)))
    return best if sum(table[i][j] for j, i in enumerate(best)) > usual + 1e-6 else tuple(range(len(a)))


def _offset(a: Array, b: Array) -> list[Consequence]:
    offset_errors = 4  # Standard errors of a mean that noise exceeds in 6 of 100 000 cases
    change = float(b.mean() - a.mean())
    rms = float(np.sqrt(np.square(b).mean()))
    if abs(change) < max(0.01, offset_errors / b.size**0.5) * rms:
        return []
    return [Consequence("offset", f"a constant of {change:.3g} is added", None, {"offset": change})]


def _delay(a: Array, b: Array, sr: int) -> tuple[int, int, float, float]:
    """Find B's delay in samples and sign by the largest cross-correlation of all channels together.

    Also returns the fraction of B's power that it explains, and that explained by chance.
    """
    envelope_s = 0.02
    delay_most_s = 0.5
    n = 1 << int(np.ceil(np.log2(a.shape[1] + b.shape[1])))
    one, other = np.fft.rfft(a, n, axis=1), np.fft.rfft(b, n, axis=1)
    most = min(round(delay_most_s * sr), a.shape[1] - 1, b.shape[1] - 1)
    lags = np.concatenate([np.arange(most + 1), np.arange(-most, 0)])
    near = np.fft.irfft((np.conj(one) * other).sum(axis=0), n)[lags]
    k = int(np.argmax(np.abs(near)))
    whole = float(np.square(a).sum() * np.square(b).sum())
    spread = sum(
        np.sqrt(
            _correlate_envelopes(x, y, n, round(envelope_s * sr))[lags].max() * np.fft.irfft(p * q, n)[0] / (p_0 * q_0)
        )
        for x, y, p, q in zip(a, b, np.abs(one) ** 2, np.abs(other) ** 2, strict=True)
        if (p_0 := np.square(x).sum()) and (q_0 := np.square(y).sum())
    )
    chance = float(spread) ** 2 * 2 * np.log(2 * len(lags) / COMMON_BY_CHANCE) / whole
    return int(lags[k]), 1 if near[k] >= 0 else -1, float(near[k] ** 2) / whole, chance


def _correlate_envelopes(x: Array, y: Array, n: int, window: int) -> Array:
    """Compute Σ x²(t) y²(t + k) of envelopes, by k."""
    box = np.fft.rfft(np.full(window, 1 / window), n)
    one, other = np.fft.rfft(np.square(x), n), np.fft.rfft(np.square(y), n)
    return np.fft.irfft(np.conj(one) * other * np.abs(box) ** 2, n)


def _overlap(a: Array, b: Array, delay: int) -> tuple[Array, Array]:
    x, y = (a, b[:, delay:]) if delay >= 0 else (a[:, -delay:], b)
    n = min(x.shape[1], y.shape[1])
    return x[:, :n], y[:, :n]


def _find_clipping(a: Array, b: Array) -> list[Consequence]:
    one, other = _flat_tops(a), _flat_tops(b)
    if other[0] <= one[0]:
        return []
    words = f"clipped at ±{other[1]:.4g}: {format_count(other[0], 'sample')}"
    return [Consequence("clipping", words, None, {"samples": other[0], "limit": other[1]})]


def _flat_tops(x: Array) -> tuple[int, float]:
    """Count the samples at an extreme value in runs, and return that value."""
    clipped_run = 4  # Samples in a row at one extreme value: a sine at 1 kHz has two at 48 kHz
    top = float(np.abs(x).max())
    at = np.abs(x) >= top * (1 - 1e-6)
    count = 0
    for channel in at:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], channel.astype(np.int8), [0]])))
        runs = edges[1::2] - edges[::2]
        count += int(runs[runs >= clipped_run].sum())
    return count, top


def _gaps(x: Array, y: Array, sr: int) -> list[Consequence]:
    """Find where B is exactly zero and A is not."""
    gap_s = 0.002
    silent = (y == 0).all(axis=0) & (np.abs(x).max(axis=0) > 1e-6 * np.abs(x).max())
    edges = np.flatnonzero(np.diff(np.concatenate([[0], silent.astype(np.int8), [0]])))
    runs = [(start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True) if stop - start >= gap_s * sr]
    if not runs:
        return []
    start, stop = runs[0]
    words = f"silent from {start / sr:.4g} to {stop / sr:.4g} s" + (f", and {len(runs) - 1} more" if runs[1:] else "")
    return [Consequence("gap", words, float(start / sr))]


def _transfer(x: Array, y: Array, sr: int, clean: bool) -> list[Consequence]:
    """Find a gain or filter, and the residual of both."""
    filter_db = 0.1  # A flatter response is a gain
    left_db = -90.0  # A residual below this, re the recording, is rounding of 16 bits
    gain_db = 0.005
    gain = float((x * y).sum() / np.square(x).sum())
    left = y - gain * x
    level = _db(left, y)
    found: list[Consequence] = []
    response = None
    if level > left_db and clean:
        freq, response, explained = _response(x, y, sr)
        bend = np.ptp(response) if len(response) else 0.0
        if bend > filter_db and explained > 0.9:
            k, m = int(np.argmin(response)), int(np.argmax(response))
            words = (
                f"a filter: {response[k]:+.2g} dB at {freq[k]:.0f} Hz, {response[m]:+.2g} dB at {freq[m]:.0f} Hz "
                "(octave bands, A to B)"
            )
            values = {"freq_hz": [float(f) for f in freq], "db": [round(float(v), 3) for v in response]}
            return [Consequence("filter", words, None, values)]
    if abs(20 * np.log10(max(abs(gain), 1e-12))) > gain_db and level < -20:
        words = f"B is A, {level_words(float(20 * np.log10(abs(gain))), digits=3)}"
        found.append(Consequence("gain", words, None, {"gain_db": float(20 * np.log10(abs(gain)))}))
    if level > left_db and clean:
        found.append(_classify_residual(left, level, sr))
    elif level > left_db - 60 and not found and clean:
        words = f"samples differ by rounding: the difference is {abs(level):.0f} dB below A"
        found.append(Consequence("rounding", words, None, {"left_db": level}))
    return found


def _response(x: Array, y: Array, sr: int) -> tuple[Array, Array, float]:
    """Compute the response in octave bands where A has power.

    Returns centre frequencies, response in dB, and the fraction of B's power that a least-squares filter of 64 taps
    explains, fitted on all samples: noise has none.
    """
    from scipy.linalg import solve_toeplitz

    taps = 128
    n = 1 << int(np.ceil(np.log2(2 * x.shape[1])))
    spectrum_x, spectrum_y = np.fft.rfft(x, n, axis=1), np.fft.rfft(y, n, axis=1)
    auto = np.fft.irfft((np.abs(spectrum_x) ** 2).sum(axis=0))
    cross = np.fft.irfft((np.conj(spectrum_x) * spectrum_y).sum(axis=0))
    column = auto[:taps].copy()
    column[0] *= 1 + 1e-10
    filter_ = solve_toeplitz(column, np.concatenate([cross[-16:], cross[: taps - 16]]))
    made = np.fft.irfft(spectrum_x * np.fft.rfft(np.roll(np.pad(filter_, (0, n - taps)), -16)), axis=1)[:, : x.shape[1]]
    gain = float((x * y).sum() / np.square(x).sum())
    before, after = np.square(y - gain * x).sum(), np.square(y - made).sum()
    power_x, power_y = ((np.abs(s) ** 2).sum(axis=0) for s in (spectrum_x, spectrum_y))
    freq = np.fft.rfftfreq(n, 1 / sr)
    centres, response = [], []
    for centre in (63.0 * 2**k for k in range(9)):
        band = in_octave(freq, centre)
        if band.any() and power_x[band].sum() > 1e-7 * power_x.sum():
            centres.append(centre)
            response.append(10 * np.log10(power_y[band].sum() / power_x[band].sum()))
    return np.array(centres), np.array(response), float(1 - after / max(before, 1e-300))


def _classify_residual(left: Array, level: float, sr: int) -> Consequence:
    """Classify the residual after a gain: a tone, or noise."""
    spectrum = power_spectrum(left, np.hanning(left.shape[1])).sum(axis=0)
    k = int(np.argmax(spectrum))
    share = spectrum[max(0, k - 3) : k + 4].sum() / spectrum.sum()
    if share > 0.5:
        freq = k * sr / left.shape[1]
        return Consequence("tone", f"a tone at {freq:.1f} Hz is added, {_added_level(level)}", None, {"freq_hz": freq})
    spread = float(np.exp(np.log(spectrum + 1e-300).mean()) / spectrum.mean())
    what = "noise is added" if spread > 0.2 else "something else sounds besides"
    return Consequence("noise", f"{what}, {_added_level(level)}", None, {"left_db": level})


def _added_level(level_db: float) -> str:
    """Describe the level of an addition."""
    return f"{abs(level_db):.1f} dB {'above' if level_db > 0 else 'below'} A as a whole"


def _db(part: Array, whole: Array) -> float:
    return float(10 * np.log10((np.square(part).sum() + 1e-300) / (np.square(whole).sum() + 1e-300)))
