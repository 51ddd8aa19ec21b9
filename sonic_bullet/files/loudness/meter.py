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
    from scipy.signal import sosfilt

    channels, frames = sound.shape
    sections = k_weighting(sr)
    state = np.zeros((len(sections), channels, 2))
    energy = np.zeros(frames * BLOCKS_PER_S // sr + 1)
    start, weight = 0, np.array(CHANNEL_WEIGHT[:channels])
    for block in sound.blocks():
        weighted, state = sosfilt(sections, block, axis=1, zi=state)
        at = np.arange(start, start + block.shape[1]) * BLOCKS_PER_S // sr
        energy += np.bincount(at, weight @ weighted**2, minlength=len(energy))
        start += block.shape[1]
    return energy[:-1] * BLOCKS_PER_S / sr


def k_weighting(sr: int) -> Array:
    """Return the head's shelf and the high pass as second-order sections (2, 6)."""
    from pyloudnorm import Meter

    stages = Meter(sr)._filters.values()
    return np.array([np.concatenate([stage.passband_gain * stage.b, stage.a]) for stage in stages])


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
