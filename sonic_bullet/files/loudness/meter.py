"""Loudness of a sound file by broadcasting standards.

    samples -> K-weighting -> energy of 100 ms -> of 400 ms, gated -> integrated loudness   [ITU-R BS.1770-5, annex 1]
                                               -> of 3 s -> largest: short-term             [EBU Tech 3341, sec. 2.2]
                                                         -> 10 to 95 %, gated: range        [EBU Tech 3342, sec. 4]
            -> interpolated -> largest magnitude: true peak                                 [ITU-R BS.1770-5, annex 2]

Computed by blocks, so that a sound may be longer than the memory. The filters are pyloudnorm's, at any rate; at 48 kHz
they are 0.04 dB below those of the standard's table, at all frequencies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sonic_bullet.files.loudness.true_peak import find_true_peak
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records import Array

CHANNEL_WEIGHT = (1.0, 1.0, 1.0, 1.41, 1.41)
"""L, R, C, Ls, Rs [ITU-R BS.1770-5, table 3]."""

# blocks, windows in blocks, and gates of a loudness meter [ITU-R BS.1770-5; EBU Tech 3342]
BLOCKS_PER_S = 10
MOMENTARY_BLOCKS = 4
SHORT_TERM_BLOCKS = 30
ABSOLUTE_GATE_LUFS = -70.0
RELATIVE_GATE_LU = -10.0
RANGE_GATE_LU = -20.0


@dataclass(frozen=True, slots=True)
class Loudness:
    """Loudness of a file.

    Parameters
    ----------
    integrated_lufs
        None for under 0.4 s, for over 5 channels, or where all is below the gate.
    short_term_lufs, range_lu
        The largest, and the range; None for under 3 s, too.
    true_peak_dbtp
        None of silence.
    """

    integrated_lufs: float | None
    short_term_lufs: float | None
    range_lu: float | None
    true_peak_dbtp: float | None

    def __str__(self) -> str:
        """Return the values that are known, in words."""
        said = (
            ("loudness ", self.integrated_lufs, "LUFS"),
            ("short-term at most ", self.short_term_lufs, "LUFS"),
            ("range ", self.range_lu, "LU"),
            ("true peak ", self.true_peak_dbtp, "dBTP"),
        )
        return ", ".join(f"{what}{x:.1f} {unit}" for what, x, unit in said if x is not None) or "silent"


def measure_loudness(sound: KeptSound, sr: int, gain: float = 1.0) -> Loudness:
    """Measure the loudness of a sound whose samples are multiplied by ``gain`` in its file."""
    energy = _block_energy(sound, sr) if 0 < sound.shape[0] <= len(CHANNEL_WEIGHT) else np.zeros(0)
    peak = gain * find_true_peak(sound)
    short = _windows(energy * gain**2, SHORT_TERM_BLOCKS)
    return Loudness(
        _gated_lufs(_windows(energy * gain**2, MOMENTARY_BLOCKS)),
        float(_lufs(short.max())) if len(short) and short.max() > 0 else None,
        _range_lu(short),
        20 * math.log10(peak) if peak > 0 else None,
    )


def integrated_lufs(sound: KeptSound, sr: int) -> float | None:
    """Measure the programme loudness alone, of up to 5 channels."""
    return _gated_lufs(_windows(_block_energy(sound, sr), MOMENTARY_BLOCKS))


def _block_energy(sound: KeptSound, sr: int) -> Array:
    """Compute the K-weighted mean square of each whole 100 ms, channels summed by their weights."""
    channels, frames = sound.shape
    sections = k_weighting(sr)
    past = np.zeros((len(sections) + 1, channels, 2))  # of the sound, and of what each section made of it
    energy = np.zeros(frames * BLOCKS_PER_S // sr + 1)
    start, weight = 0, np.array(CHANNEL_WEIGHT[:channels])
    for block in (one for one in sound.blocks() if one.size):
        made = [block]
        for section, (before, after) in zip(sections, pairwise(past), strict=True):
            made.append(np.stack([_filter(section, *one) for one in zip(made[-1], before, after, strict=True)]))
        past = np.stack([np.concatenate([old, new], axis=1)[:, -2:] for old, new in zip(past, made, strict=True)])
        at = np.arange(start, start + block.shape[1]) * BLOCKS_PER_S // sr
        energy += np.bincount(at, weight @ made[-1] ** 2, minlength=len(energy))
        start += block.shape[1]
    return energy[:-1] * BLOCKS_PER_S / sr


def _filter(section: Array, x: Array, x_before: Array, y_before: Array) -> Array:
    """Filter x (n,) by a second-order section (6,), after two samples before it of x and of the result.

    a₀ yₙ + a₁ yₙ₋₁ + a₂ yₙ₋₂ = b₀ xₙ + b₁ xₙ₋₁ + b₂ xₙ₋₂ is a banded triangle. scipy.signal, which filters, too, takes
    a second to load.
    """
    from scipy.linalg.blas import dtbsv

    b, a = section[:3], section[3:]
    right = np.convolve(np.concatenate([x_before, x]), b, mode="valid")
    right[:2] -= (a[2] * y_before + [a[1] * y_before[1], 0.0])[: len(x)]
    return np.asarray(dtbsv(2, np.repeat(a[:, None], len(x), axis=1), right, lower=1))


def k_weighting(sr: int) -> Array:
    """Return the head's shelf and the high pass as second-order sections (2, 6).

    Of R. Bristow-Johnson's cookbook: a shelf of 4 dB at 1.5 kHz, Q = 1/√2, and a high pass at 38 Hz, Q = 1/2.
    """
    shelf, high_pass = 2 * np.pi * np.array([1500.0, 38.0]) / sr
    root = 10 ** (4.0 / 40)
    up, down, turn = root + 1, root - 1, np.cos(shelf)
    slope = 2 * np.sqrt(root) * np.sin(shelf) / np.sqrt(2)
    rise = [root * (up + down * turn + slope), -2 * root * (down + up * turn), root * (up + down * turn - slope)]
    rest = [up - down * turn + slope, 2 * (down - up * turn), up - down * turn - slope]
    turn, alpha = np.cos(high_pass), np.sin(high_pass)
    made = np.array(
        [
            [*rise, *rest],
            [(1 + turn) / 2, -1 - turn, (1 + turn) / 2, 1 + alpha, -2 * turn, 1 - alpha],
        ]
    )
    return np.asarray(made / made[:, 3:4])


def _windows(energy: Array, count: int) -> Array:
    """Average each ``count`` blocks in a row."""
    total = np.concatenate([[0.0], np.cumsum(energy)])
    return np.maximum(total[count:] - total[:-count], 0.0) / count if len(total) > count else np.zeros(0)


def _lufs(energy: Array) -> Array:
    return -0.691 + 10 * np.log10(energy)


def _select_above(energy: Array, gate_lufs: float) -> Array:
    return energy[energy > 10 ** ((gate_lufs + 0.691) / 10)]


def _gate_blocks(energy: Array, relative_lu: float) -> Array:
    """Select blocks above the absolute gate and above the relative one, which is below the mean of the former."""
    loud = _select_above(energy, ABSOLUTE_GATE_LUFS)
    return _select_above(loud, float(_lufs(loud.mean())) + relative_lu) if len(loud) else loud


def _gated_lufs(energy: Array) -> float | None:
    loud = _gate_blocks(energy, RELATIVE_GATE_LU)
    return float(_lufs(loud.mean())) if len(loud) else None


def _range_lu(short: Array) -> float | None:
    loud = _gate_blocks(short, RANGE_GATE_LU)
    if not len(loud):
        return None
    low, high = np.percentile(_lufs(loud), (10, 95))
    return float(high - low)
