"""Multi-level loudness images of a recording and of damped sinusoids, the latter without making a sample.

    s[n] = Σ_j Im A_j z_j^n,  z = e^{(−d + iω)/f_s},  n from the onset                      [Ren, Yeh, Lin 2013, eq. 13]
    P[m, k] = |Σ_n w[n] s[n + mH] e^{−iω_k n}|²                                             [eq. 9]
    Σ_n w[n] z^n e^{−iω_k n} = a₀D_k − ½a₁(D_{k−1} + D_{k+1}) + ½a₂(D_{k−2} + D_{k+2}) − ½a₃(D_{k−3} + D_{k+3}),
    D_k = (1 − z^N)/(1 − z e^{−iω_k})                  (a geometric sum; frame m is frame 0 times z^{mH})

w is Nuttall's window of four cosines with a continuous first derivative [Nuttall 1981, table II], side lobes below −93
dB, so a mode lives in few bins; modes that share a bin add as waves do, beats and all. Powers of bins go to triangles
every `bark_step` on the Bark axis and each triangle to sone at its middle. Each sine counts at f and −f. Neglected are
bins beyond a mode's main lobe and three of its half widths (skirts fall as (d/offset)³) and what has sunk under −30 dB
SPL: about 1e-9 of Π's scale. Every level doubles the window; a level weighs its hop, so that all levels count alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.estimator.perceptual import image_kernel as kernel
from sonic_bullet.estimator.perceptual.image_kernel import NODES, OUTSIDE, TABLE_FROM, TABLE_TO, WINDOW
from sonic_bullet.estimator.perceptual.loudness import bark, bark_to_hz, loudness
from sonic_bullet.records import Array
from sonic_bullet.records.errors import RecordError

BARK_LAST = 24.0
FLOOR_DB_SPL = -30.0


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
    """A recording's loudness in time, Bark and resolution, from its onset on.

    late_s: from the onset to the first sample.
    """

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


def pooled(power: Array, band: Array, share: Array, bands: int) -> Array:
    """(m, k) powers of bins -> (m, bands) of triangles. Bins of one triangle lie next to each other."""
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
    """Image of ``seconds`` of a recording (n,) from its onset; windows double from about ``shortest_s``, as many as
    fit.

    Raises RecordError where less than one window follows the onset, or nothing there is loud enough.
    """
    first = int(np.ceil(onset_s * sr - 1e-9))
    observed = np.ascontiguousarray(signal[first : first + int(seconds * sr)])
    bands = int(BARK_LAST / bark_step)
    middle_hz = bark_to_hz(bark_step * np.arange(1, bands + 1))
    shortest = 2 ** round(np.log2(shortest_s * sr))
    if len(observed) < shortest:
        raise RecordError(f"{len(observed)} samples follow the onset at {onset_s:.4f} s", f"an image needs {shortest}")
    made = []
    for step in range(levels):
        length = shortest * 2**step
        if length > len(observed):
            break
        band, share = _bins(length, sr, bark_step, bands)
        scale = 2 / (length * float((window(length) ** 2).sum()))
        power = pooled(np.abs(spectra(observed, length, length // 2)) ** 2 * scale, band, share, bands)
        made.append(Level(length, length // 2, band, share, scale, loudness(power, middle_hz, full_scale_db_spl)))
    norm = float(sum(level.hop * (level.loud**2).sum() for level in made))
    if norm <= 0:
        raise RecordError(
            f"nothing is heard at {full_scale_db_spl:g} dB SPL full scale", "raise the level that full scale stands for"
        )
    return Image(tuple(made), sr, first / sr - onset_s, middle_hz, _table(middle_hz), full_scale_db_spl, norm)


def _table(middle_hz: Array) -> Array:
    """Sone, and its slope, at powers 2^e(1 + i/8) of the reference's: what a float's own leading bits point at, no
    logarithm needed.
    """
    node = (2.0 ** np.arange(TABLE_FROM, TABLE_TO)[:, None] * (1 + np.arange(NODES) / NODES)).ravel()
    cell = np.repeat(2.0 ** np.arange(TABLE_FROM, TABLE_TO), NODES) / NODES

    def value(shift: float) -> Array:
        return loudness(node + shift * cell, middle_hz[:, None], 0.0)

    step = 1e-4
    return np.ascontiguousarray(np.stack([value(0.0), (value(step) - value(-step)) / (2 * step)], axis=-1))


def distance(
    target: Image, freq_hz: Array, decay_per_s: Array, amplitude: Array, differences: Array | None = None
) -> float:
    """Π_psycho over its value for silence: 0 the same image, 1 as far as silence. (m,) each, modes at 0 Hz are mute.

    differences, where given, takes every √hop·ΔT, level after level, frame after frame: its squares sum to the answer.
    Source: eq. 19.
    """
    # a sine is two spirals, and the one at −f reaches low bins: Im A e^{iωt} = Im(−A*) e^{−iωt}
    freq_hz, decay_per_s, amplitude = (
        np.concatenate([freq_hz, -freq_hz]),
        np.tile(decay_per_s, 2),
        np.concatenate([amplitude, -np.conj(amplitude)]),
    )
    total, at = 0.0, 0
    unit = 10 ** (target.full_scale_db_spl / 20)
    floor = 10 ** ((FLOOR_DB_SPL - target.full_scale_db_spl) / 20)
    for level in target.levels:
        cells = level.loud.size if differences is not None else 0
        reach = kernel.reach(freq_hz, decay_per_s, amplitude, float(target.sr), level.window, floor)
        bins = kernel.slots(reach, level.band)
        spirals = kernel.frame(
            freq_hz, decay_per_s, amplitude * unit, reach, float(target.sr), target.late_s, level.window, level.hop
        )
        out = np.empty(0) if differences is None else differences[at : at + cells]
        total += kernel.compare(
            reach,
            bins,
            spirals,
            floor * unit,
            (level.band, level.share, level.scale, level.loud),
            target.table,
            out,
            level.hop / target.norm,
        )
        at += cells
    return total
