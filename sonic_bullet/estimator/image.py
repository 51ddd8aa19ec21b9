"""Multi-level loudness images of a recording and of damped sinusoids, the latter without making a sample.

    s[n] = Σ_j Im A_j z_j^n,  z = e^{(−d + iω)/f_s},  n from the onset                      [Ren, Yeh, Lin 2013, eq. 13]
    P[m, k] = |Σ_n w[n] s[n + mH] e^{−iω_k n}|²                                             [eq. 9]
    Σ_n w[n] z^n e^{−iω_k n} = a₀D_k − ½a₁(D_{k−1} + D_{k+1}) + ½a₂(D_{k−2} + D_{k+2}) − ½a₃(D_{k−3} + D_{k+3}),
    D_k = (1 − z^N)/(1 − z e^{−iω_k})                  (a geometric sum; frame m is frame 0 times z^{mH})

w is Nuttall's window of four cosines with a continuous first derivative [Nuttall 1981, table II], side lobes below −93 dB, so a mode lives in
few bins; modes that share a bin add as waves do, beats and all. Powers of bins go to triangles every `bark_step` on the Bark axis and each
triangle to sone at its middle. A mode's image at −f, bins where its skirt is below about 1e-5 of its peak, and what has sunk under −20 dB SPL
are neglected.
Every level doubles the window; a level weighs its hop, so that all levels count alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from sonic_bullet.errors import RecordError
from sonic_bullet.estimator.loudness import bark, bark_to_hz, loudness
from sonic_bullet.records import Array

WINDOW = (0.355768, 0.487396, 0.144232, 0.012604)
BARK_LAST = 24.0
FLOOR_DB_SPL = -20.0
NODES = 8  # of the loudness table, an octave of power
OUTSIDE = -2  # in Level.band: a bin that feeds no triangle
TABLE_FROM, TABLE_TO = -13, 54  # its powers of two: −39 to 162 dB SPL


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """One resolution: window and hop in samples, and where its bins go. k bins, b bands, m frames."""

    window: int
    hop: int
    band: Array  # (k,) int64: the lower of the two triangles a bin feeds (−1: only the first), or OUTSIDE
    share: Array  # (k,) part that goes to the upper one
    scale: float  # |bin|² times this is mean square
    loud: Array  # (m, b) sone of the recording


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """A recording's loudness in time, Bark and resolution, from its onset on. late_s: from the onset to the first sample."""

    levels: tuple[Level, ...]
    sr: int
    late_s: float
    middle_hz: Array  # (b,)
    table: Array  # (b, t, 2) sone and its slope a cell at powers 2^TABLE_FROM … of 20 µPa
    full_scale_db_spl: float
    norm: float  # Σ hop · loud²


def window(length: int) -> Array:
    """(length,) Nuttall's window, periodic."""
    phase = 2 * np.pi * np.arange(length) / length
    a0, a1, a2, a3 = WINDOW
    return np.asarray(a0 - a1 * np.cos(phase) + a2 * np.cos(2 * phase) - a3 * np.cos(3 * phase))


def _bins(length: int, sr: int, bark_step: float, bands: int) -> tuple[Array, Array]:
    place = bark(np.arange(length // 2 + 1) * sr / length) / bark_step - 1
    below = np.floor(place).astype(np.int64)
    inside = (below >= -1) & (below < bands)
    return np.where(inside, below, OUTSIDE), np.where(inside, place - below, 0.0)


def _pool(power: Array, band: Array, share: Array, bands: int) -> Array:
    """(m, k) powers of bins -> (m, bands). Bins of one triangle lie side by side."""
    inside = np.flatnonzero(band != OUTSIDE)
    power, place, share = power[:, inside], band[inside], share[inside]
    first = np.flatnonzero(np.diff(place, prepend=OUTSIDE))
    pooled = np.zeros((len(power), bands + 2))
    pooled[:, place[first] + 1] += np.add.reduceat(power * (1 - share), first, axis=1)
    pooled[:, place[first] + 2] += np.add.reduceat(power * share, first, axis=1)
    return pooled[:, 1:-1]


def spectra(signal: Array, length: int, hop: int) -> Array:
    """(m, length/2 + 1) complex spectra of frames that lie wholly inside ``signal``."""
    frames = np.lib.stride_tricks.sliding_window_view(signal, length)[::hop]
    return np.asarray(np.fft.rfft(frames * window(length), axis=1))


def image(
    signal: Array,
    sr: int,
    onset_s: float,
    full_scale_db_spl: float,
    *,
    bark_step: float = 0.5,
    levels: int = 5,
    shortest_s: float = 0.0107,
    seconds: float = 1.0,
) -> Image:
    """Image of ``seconds`` of a recording (n,) from its onset; windows double from about ``shortest_s``, as many as fit.

    Raises RecordError where less than one window follows the onset, or nothing there is loud enough to be heard.
    """
    first = int(np.ceil(onset_s * sr - 1e-9))
    heard = np.ascontiguousarray(signal[first : first + int(seconds * sr)])
    bands = int(BARK_LAST / bark_step)
    middle_hz = bark_to_hz(bark_step * np.arange(1, bands + 1))
    shortest = 2 ** round(np.log2(shortest_s * sr))
    if len(heard) < shortest:
        raise RecordError(f"{len(heard)} samples follow the onset at {onset_s:.4f} s", f"an image needs {shortest}")
    made = []
    for step in range(levels):
        length = shortest * 2**step
        if length > len(heard):
            break
        band, share = _bins(length, sr, bark_step, bands)
        scale = 2 / (length * float((window(length) ** 2).sum()))
        power = _pool(np.abs(spectra(heard, length, length // 2)) ** 2 * scale, band, share, bands)
        made.append(Level(length, length // 2, band, share, scale, loudness(power, middle_hz, full_scale_db_spl)))
    norm = float(sum(level.hop * (level.loud**2).sum() for level in made))
    if norm <= 0:
        raise RecordError(f"nothing is heard at {full_scale_db_spl:g} dB SPL full scale", "raise the level that full scale stands for")
    return Image(tuple(made), sr, first / sr - onset_s, middle_hz, _table(middle_hz), full_scale_db_spl, norm)


def _table(middle_hz: Array) -> Array:
    """Sone, and its slope, at powers 2^e(1 + i/8) of the reference's: what a float's own leading bits point at, no logarithm needed."""
    node = (2.0 ** np.arange(TABLE_FROM, TABLE_TO)[:, None] * (1 + np.arange(NODES) / NODES)).ravel()
    cell = np.repeat(2.0 ** np.arange(TABLE_FROM, TABLE_TO), NODES) / NODES

    def value(shift: float) -> Array:
        return loudness(node + shift * cell, middle_hz[:, None], 0.0)

    step = 1e-4
    return np.ascontiguousarray(np.stack([value(0.0), (value(step) - value(-step)) / (2 * step)], axis=-1))


def plain_distance(target: Image, freq_hz: Array, decay_per_s: Array, amplitude: Array) -> float:
    """Π_psycho [eq. 19] over its value for silence, by synthesis and Fourier transforms: what `distance` must equal. (m,) each."""
    time = np.arange(max(level.window + level.hop * (len(level.loud) - 1) for level in target.levels)) / target.sr + target.late_s
    signal = np.zeros(len(time))
    for freq, decay, size in zip(freq_hz, decay_per_s, amplitude, strict=True):
        signal += size * np.exp(-decay * time) * np.sin(2 * np.pi * freq * time)
    total = 0.0
    for level in target.levels:
        power = np.abs(spectra(signal, level.window, level.hop)) ** 2 * level.scale
        loud = loudness(_pool(power, level.band, level.share, len(target.middle_hz)), target.middle_hz, target.full_scale_db_spl)
        total += level.hop * float(((loud[: len(level.loud)] - level.loud) ** 2).sum())
    return total / target.norm


def distance(target: Image, freq_hz: Array, decay_per_s: Array, amplitude: Array, differences: Array | None = None) -> float:
    """Π_psycho [eq. 19] over its value for silence: 0 the same image, 1 as far as silence. (m,) each, modes at 0 Hz are mute.

    differences, where given, takes every √hop·ΔT, level after level, frame after frame, so that their squares sum to the answer.
    """
    total, at = 0.0, 0
    unit = 10 ** (target.full_scale_db_spl / 20)
    floor = 10 ** ((FLOOR_DB_SPL - target.full_scale_db_spl) / 20)
    for level in target.levels:
        cells = level.loud.size if differences is not None else 0
        reach = _reach(freq_hz, decay_per_s, amplitude, float(target.sr), level.window, floor)
        slot, used = _slots(reach, level.band)
        shapes, state, turn = _frame(freq_hz, decay_per_s, amplitude * unit, reach, float(target.sr), target.late_s, level.window, level.hop)
        out = np.empty(0) if differences is None else differences[at : at + cells]
        total += _compare(
            reach, slot, used, shapes, state, turn, floor * unit, level.band, level.share, level.scale, level.loud, target.table, out, level.hop / target.norm
        )
        at += cells
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _reach(freq_hz, decay_per_s, amplitude, sr, length, floor):  # type: ignore[no-untyped-def]
    """(m, 3) first bin, bin after the last, place of the first among all.

    The main lobe is 8 bins wide, the skirt falls as (decay/offset)³. What decays within x⁻¹ of a window is over where the window, ∝ n² at its
    edges, has hardly begun: its peak is below 3/x³ of an undamped mode's.
    """
    reach = np.zeros((len(freq_hz), 3), np.int64)
    room = 0
    for j in range(len(freq_hz)):
        reach[j, 2] = room
        short = decay_per_s[j] * length / sr
        if 0 < freq_hz[j] < sr / 2 and abs(amplitude[j]) * min(1.0, 3 / short**3) > floor:
            centre = int(freq_hz[j] / sr * length)
            radius = 5 + int(3 * decay_per_s[j] * length / (2 * np.pi * sr))
            reach[j, 0], reach[j, 1] = max(1, centre - radius), min(length // 2 + 1, centre + 2 + radius)
            room += max(reach[j, 1] - reach[j, 0], 0)
    return reach


@njit(cache=True, nogil=True)
def _slots(reach, band):  # type: ignore[no-untyped-def]
    """Bins that some mode reaches, and each bin's place among them."""
    bins = len(band)
    edge = np.zeros(bins + 1, np.int64)
    for j in range(len(reach)):
        if reach[j, 1] > reach[j, 0]:
            edge[reach[j, 0]] += 1
            edge[reach[j, 1]] -= 1
    slot, used = np.zeros(bins, np.int64), np.zeros(bins, np.int64)
    count, depth = 0, 0
    for k in range(bins):
        depth += edge[k]
        slot[k] = count
        if depth > 0:
            used[count] = k
            count += 1
    return slot, used[:count]


@njit(cache=True, nogil=True, error_model="numpy")
def _frame(freq_hz, decay_per_s, amplitude, reach, sr, late_s, length, hop):  # type: ignore[no-untyped-def]
    """Frame 0 of every mode in closed form: shapes (2, room) real and imaginary, state and turn (m,): its factor, and what a hop makes of it."""
    modes = len(freq_hz)
    shapes = np.empty((2, reach[-1, 2] + max(reach[-1, 1] - reach[-1, 0], 0)))
    state, turn = np.zeros(modes, np.complex128), np.zeros(modes, np.complex128)
    geometric = np.empty(length // 2 + 7, np.complex128)
    step = np.exp(complex(0.0, -2 * np.pi / length))
    for j in range(modes):
        count, at = reach[j, 1] - reach[j, 0], reach[j, 2]
        if count <= 0:
            continue
        rate = complex(-decay_per_s[j], 2 * np.pi * freq_hz[j])
        top = 1 - np.exp(rate / sr * length)
        state[j] = amplitude[j] * np.exp(rate * late_s) * complex(0.0, -0.5)
        turn[j] = np.exp(rate / sr * hop)
        turned = np.exp(rate / sr) * np.exp(complex(0.0, -2 * np.pi * (reach[j, 0] - 3) / length))
        for k in range(count + 6):
            bottom_re, bottom_im = 1 - turned.real, -turned.imag
            geometric[k] = top * complex(bottom_re, -bottom_im) / (bottom_re * bottom_re + bottom_im * bottom_im + 1e-300)
            turned *= step
        for k in range(count):
            value = (
                WINDOW[0] * geometric[k + 3]
                - 0.5 * WINDOW[1] * (geometric[k + 2] + geometric[k + 4])
                + 0.5 * WINDOW[2] * (geometric[k + 1] + geometric[k + 5])
                - 0.5 * WINDOW[3] * (geometric[k] + geometric[k + 6])
            )
            shapes[0, at + k], shapes[1, at + k] = value.real, value.imag
    return shapes, state, turn


@njit(cache=True, nogil=True)
def _runs(used, band):  # type: ignore[no-untyped-def]
    """(r, 3) runs of used bins that feed one triangle: first slot, slot after the last, the lower triangle; those outside are left out."""
    runs = np.zeros((len(used), 3), np.int64)
    count = 0
    for i in range(len(used)):
        here = band[used[i]]
        if here == OUTSIDE:
            continue
        if count and runs[count - 1, 2] == here:
            runs[count - 1, 1] = i + 1
        else:
            runs[count] = i, i + 1, here
            count += 1
    return runs[:count]


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"}, error_model="numpy")
def _compare(reach, slot, used, shapes, state, turn, floor, band, share, scale, loud, table, out, weight):  # type: ignore[no-untyped-def]
    """Σ weight·ΔT² of one level; state is used up."""
    frames, bands = loud.shape
    sum_re, sum_im, power = np.zeros(len(used)), np.zeros(len(used)), np.zeros(bands + 2)
    bits = power.view(np.int64)
    runs, upper_share = _runs(used, band), share[used]
    alive = np.nonzero(reach[:, 1] > reach[:, 0])[0]
    living = len(alive)
    root = np.sqrt(weight)
    total = 0.0
    for m in range(frames):
        sum_re[:] = 0.0
        sum_im[:] = 0.0
        kept = 0
        for i in range(living):
            j = alive[i]
            real, imag = state[j].real, state[j].imag
            if real * real + imag * imag < 0.25 * floor * floor:
                continue
            alive[kept] = j
            kept += 1
            here, count = reach[j, 2], reach[j, 1] - reach[j, 0]
            first = slot[reach[j, 0]]
            into_re, into_im = sum_re[first : first + count], sum_im[first : first + count]
            shape_re, shape_im = shapes[0, here : here + count], shapes[1, here : here + count]
            for k in range(count):
                into_re[k] += real * shape_re[k] - imag * shape_im[k]
                into_im[k] += real * shape_im[k] + imag * shape_re[k]
            state[j] *= turn[j]
        living = kept
        power[:] = 0.0
        if living:
            for r in range(len(runs)):
                whole, upper = 0.0, 0.0
                for i in range(runs[r, 0], runs[r, 1]):
                    value = sum_re[i] * sum_re[i] + sum_im[i] * sum_im[i]
                    whole += value
                    upper += value * upper_share[i]
                power[runs[r, 2] + 1] += (whole - upper) * scale
                power[runs[r, 2] + 2] += upper * scale
        for b in range(bands):
            heard = 0.0
            cell = (bits[b + 1] >> 49) - ((1023 + TABLE_FROM) << 3)
            if cell >= 0:
                cell = min(cell, table.shape[1] - 2)
                x = (bits[b + 1] & ((1 << 49) - 1)) * (1.0 / (1 << 49))
                y0, y1, s0 = table[b, cell, 0], table[b, cell + 1, 0], table[b, cell, 1]
                # the cell after an octave's last is twice as wide, its slope a cell twice as steep
                s1 = table[b, cell + 1, 1] * (0.5 if cell & 7 == 7 else 1.0)
                heard = y0 + x * (s0 + x * (3 * (y1 - y0) - 2 * s0 - s1 + x * (2 * (y0 - y1) + s0 + s1)))
            difference = heard - loud[m, b]
            total += difference * difference
            if len(out):
                out[m * bands + b] = root * difference
    return weight * total
