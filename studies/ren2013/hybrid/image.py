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

from sonic_bullet.records import Array
from sonic_bullet.signal.perceptual.image import Level, band_middles, loudness_levels
from sonic_bullet.signal.perceptual.loudness import loudness
from studies.ren2013.hybrid import image_kernel as kernel
from studies.ren2013.hybrid.image_kernel import NODES, TABLE_FROM, TABLE_TO

FLOOR_DB_SPL = -30.0


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
    made = loudness_levels(
        signal, sr, onset_s, full_scale_db_spl,
        bark_step=bark_step, levels=levels, shortest_s=shortest_s, seconds=seconds,
    )  # fmt: skip
    middle_hz = band_middles(bark_step)
    norm = float(sum(level.hop * (level.loud**2).sum() for level in made))
    late_s = int(np.ceil(onset_s * sr - 1e-9)) / sr - onset_s
    return Image(made, sr, late_s, middle_hz, _table(middle_hz), full_scale_db_spl, norm)


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
