"""How loud a file is to be: the factor between pascals and file units, of a full scale, a peak or a programme loudness.

g = 1/full_scale_pa                      calibrated (the default: 1.0 in the file = 1 Pa)
    10^(peak_dbfs/20)/max|x|             --peak-dbfs
    10^((lufs - L(x))/20)                --lufs, L: programme loudness [ITU-R BS.1770-4, eq. 2 and 7, by pyloudnorm]
"""

from __future__ import annotations

import math

import numpy as np

from sonic_bullet.files.rows.spool import KeptSound
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_number, as_whole, shown
from sonic_bullet.records.errors import AudioError

SR_MIN_HZ, SR_MAX_HZ = 8000, 384_000


def gain_per_pa(sound: KeptSound, sr: int, peak_dbfs: float | None, lufs: float | None, full_scale_pa: float) -> float:
    """The factor g of the module's head; peak and loudness are of the whole sound: a peak takes a pass over it, a
    loudness all of it in memory.
    """
    if peak_dbfs is None and lufs is None:
        return 1 / full_scale_pa
    peak = float(sound.peaks().max(initial=0.0))
    if not math.isfinite(peak):
        raise AudioError(
            "the samples hold NaN or infinite numbers",
            "sound must be finite: examine the scene with 'sonic-bullet doctor'",
        )
    if peak < 1e-300:
        raise AudioError(
            "the sound is silent, so no level can be given to it",
            "leave out --peak-dbfs and --lufs, or make something collide",
        )
    if peak_dbfs is not None:
        return float(10 ** (peak_dbfs / 20)) / peak
    assert lufs is not None
    return float(10 ** ((lufs - _loudness_lufs(sound.samples() / peak, sr)) / 20)) / peak


def as_sound(samples: object) -> KeptSound:
    """Samples (channels, n) or (n,) as float64, kept or in memory. Raises AudioError where they are no array of real
    numbers of that shape.
    """
    if isinstance(samples, KeptSound):
        return samples
    try:
        sound = np.asarray(samples)
        if sound.dtype.kind in "biuf":
            sound = sound[None, :] if sound.ndim == 1 else sound
            if sound.ndim != 2:
                raise AudioError(f"samples of shape {sound.shape}", "pass (channels, n)")
            return KeptSound.of(sound.astype(float, copy=False))
    except ValueError:  # rows of several lengths
        pass
    raise AudioError(f"samples is {shown(samples)}", "pass real numbers, (channels, n)")


def check_sr(sr: object) -> int:
    """``sr`` as a whole number of Hz between 8000 and 384 000. Raises AudioError on anything else."""
    remedy = f"give a whole number of Hz between {SR_MIN_HZ} and {SR_MAX_HZ}, 48000 say"
    try:
        return as_whole(sr, "sr", remedy, least=SR_MIN_HZ, most=SR_MAX_HZ, error=AudioError)
    except AudioError:
        said = f"{sr:g} Hz" if isinstance(sr, float) else f"{shown(sr)} Hz"
        raise AudioError(f"sr: sample rate {said} cannot be", remedy) from None


def check_levels(peak_dbfs: float | None, lufs: float | None) -> None:
    """Raise AudioError where a level cannot be asked for: before anything is rendered."""
    if peak_dbfs is not None and lufs is not None:
        raise AudioError("both peak_dbfs and lufs are given", "give one of a peak and a loudness")
    if peak_dbfs is not None:
        as_number(
            peak_dbfs,
            "peak_dbfs, a level re full scale,",
            "give one between -200 and 0 dB, -1 say",
            least=-200,
            most=0,
            error=AudioError,
        )
    if lufs is not None:
        as_number(
            lufs,
            "lufs, a loudness level,",
            "give one between -200 and 200, -23 say",
            least=-200,
            most=200,
            error=AudioError,
        )


def _loudness_lufs(sound: Array, sr: int) -> float:
    """Gated programme loudness of (channels, n) [ITU-R BS.1770-4]."""
    import pyloudnorm

    if sound.shape[0] > 5:
        raise AudioError(f"loudness is defined for up to 5 channels, not {sound.shape[0]}", "use --peak-dbfs")
    if sound.shape[1] < math.ceil(0.4 * sr):
        raise AudioError(
            f"loudness needs 0.4 s of sound, here are {sound.shape[1] / sr:.3f} s", "use --peak-dbfs, or render longer"
        )
    loudness = float(pyloudnorm.Meter(sr).integrated_loudness(sound.T))
    if not math.isfinite(loudness):
        raise AudioError("the sound has no measurable loudness (a click under the gate of BS.1770)", "use --peak-dbfs")
    return loudness
