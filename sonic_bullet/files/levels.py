"""Level of a sound file: the factor between pascals and file units, from a full scale, a peak or a programme loudness.

g = 1/full_scale_pa                      calibrated (the default: 1.0 in the file = 1 Pa)
    10^(peak_dbfs/20)/max|x|             --peak-dbfs alone: of the samples
    10^((lufs - L(x))/20)                --lufs, L: programme loudness [ITU-R BS.1770-5, annex 1]

Where that loudness would pass a true peak of peak_dbfs (-1 dBTP by default) a limiter reduces it, and g rises until the
result has the loudness asked for. AudioReport holds the reduction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonic_bullet.files.recordings import LEAST_RECORDING_RATE_HZ
from sonic_bullet.files.storage.spooled_sound import GainCurve, KeptSound
from sonic_bullet.options.render import SAMPLE_RATES_HZ
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_whole, quote
from sonic_bullet.records.errors import AudioError

LUFS_WITHIN = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class FileLevel:
    """Level of a sound file.

    Parameters
    ----------
    gain_per_pa
        File units for one pascal.
    curve
        Additional factor per frame (fades, limiter); None: ones.
    limited_db, limited_s
        Largest reduction by the limiter, and how long it is more than 0.1 dB.
    """

    gain_per_pa: float
    curve: GainCurve | None = None
    limited_db: float = 0.0
    limited_s: float = 0.0


def find_level(
    sound: KeptSound, sr: int, peak_dbfs: float | None, lufs: float | None, full_scale_pa: float
) -> FileLevel:
    """Find the level by the module's equations, of the whole sound with its fades.

    A peak takes one pass over the sound; a loudness needs all of it in memory.

    Raises
    ------
    AudioError
        The level cannot be reached.
    """
    true_peak_dbtp = -1.0  # Maximum true peak of a programme [EBU R 128, rec. h].
    if sound.shape[0] == 0:
        raise AudioError(f"samples of shape {sound.shape}", "pass (channels, n)")
    if peak_dbfs is None and lufs is None:
        return FileLevel(1 / full_scale_pa, sound.curve)
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
    if lufs is None:
        assert peak_dbfs is not None
        return FileLevel(float(10 ** (peak_dbfs / 20)) / peak, sound.curve)
    return _loudness_level(sound, sr, peak, lufs, true_peak_dbtp if peak_dbfs is None else peak_dbfs)


def _loudness_level(sound: KeptSound, sr: int, peak_pa: float, lufs: float, ceiling_dbtp: float) -> FileLevel:
    """Find the level of a loudness below a true peak; raises AudioError."""
    limiter_looks = 6
    from sonic_bullet.files.loudness.true_peak import find_true_peak, sample_true_peaks

    gain = _loudness_gain(sound, sr, peak_pa, lufs)
    peak_db = 20 * np.log10(np.maximum(sample_true_peaks(sound.samples()) * gain, 1e-30))
    if peak_db.max() <= ceiling_dbtp:
        return FileLevel(gain, sound.curve)
    # margin below the ceiling: excess that meters of other interpolations read, of noise up to half the rate
    margin_db = 0.25
    goal_db = ceiling_dbtp - margin_db
    for _ in range(limiter_looks):  # a varying factor creates new peaks between samples: tenths of a dB
        rise, factor = _rise(sound.times(gain), sr, peak_db, lufs, goal_db)
        left = sound.with_limiter(factor)
        excess_db = 20 * math.log10(gain * rise * find_true_peak(left)) - (ceiling_dbtp - margin_db)
        if excess_db <= 0.0:
            break
        goal_db -= excess_db + 0.01
    taken_db = -20 * np.log10(np.maximum(factor, 1e-30))
    return FileLevel(gain * rise, left.curve, float(taken_db.max()), float((taken_db > 0.1).sum() / sr))


def _rise(sound: KeptSound, sr: int, peak_db: Array, lufs: float, goal_db: float) -> tuple[float, Array]:
    """Find the rise above ``lufs`` after which a limited sound has ``lufs``, and the limiter's factors, or AudioError.

    peak_db (n,): true peaks of the sound at that loudness; goal_db: ceiling of the limiter.
    """
    # Rise of g above the gain without a limiter: a step, and the limit beyond which a sound gets no flatter
    gain_rise_db, most_rise_db = 6.0, 36.0
    from scipy.optimize import brentq

    from sonic_bullet.files.loudness.limiter import limiter_factor
    from sonic_bullet.files.loudness.meter import integrated_lufs

    gain = 1.0 if sound.curve is None else sound.curve.gain

    def limited(rise_db: float, release_db_s: float) -> tuple[Array, float]:
        """Return the factors, and the measured loudness minus the one asked for."""
        factor = limiter_factor(peak_db + rise_db, sr, goal_db, release_db_s)
        measured = integrated_lufs(sound.with_limiter(factor).times(gain * 10 ** (rise_db / 20)), sr)
        return factor, (-math.inf if measured is None else measured) - lufs

    # 6 dB in 60 ms, longer than a period of 20 Hz: low tones are not distorted. Struck bodies decay faster; where their
    # loudness asks for it, the next is taken.
    releases_db_s = (100.0, 400.0, 1600.0, 6400.0)
    for release_db_s in releases_db_s:
        low_db = high_db = 0.0
        factor, missed = limited(0.0, release_db_s)
        while missed < -LUFS_WITHIN and high_db < most_rise_db:
            low_db, high_db = high_db, high_db + gain_rise_db
            factor, missed = limited(high_db, release_db_s)
        if missed >= -LUFS_WITHIN:
            break
    else:
        raise AudioError(
            f"{lufs:g} LUFS cannot be reached below that true peak: limited by {high_db:g} dB more than it asks for, "
            f"this sound has {lufs + missed:.1f} LUFS",
            f"give --lufs {math.floor(lufs + missed - 1)}, or a higher --peak-dbfs",
        )
    if missed > LUFS_WITHIN:
        high_db = brentq(lambda x: limited(x, release_db_s)[1], low_db, high_db, xtol=LUFS_WITHIN / 4, rtol=1e-6)
        factor, _ = limited(high_db, release_db_s)
    return float(10 ** (high_db / 20)), factor


def as_sound(samples: object) -> KeptSound:
    """Convert samples (channels, n) or (n,) to float64 sound, in a spool or in memory.

    Raises
    ------
    AudioError
        They are not an array of real numbers of that shape.
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
    except ValueError:  # rows of different lengths
        pass
    raise AudioError(f"samples is {quote(samples)}", "pass real numbers, (channels, n)")


def check_sr(sr: object, *, measured: bool = False) -> int:
    """Return ``sr`` as a whole number of Hz within `SAMPLE_RATES_HZ`.

    measured: of what was measured, not rendered to be heard, from 1000 Hz on, as recordings are read.

    Raises
    ------
    AudioError
        It is anything else.
    """
    sr_min_hz, sr_max_hz = SAMPLE_RATES_HZ
    if measured:
        sr_min_hz = LEAST_RECORDING_RATE_HZ
    remedy = f"give a whole number of Hz between {sr_min_hz} and {sr_max_hz}, 48000 say"
    try:
        return as_whole(sr, "sr", remedy, least=sr_min_hz, most=sr_max_hz, error=AudioError)
    except AudioError:
        said = f"{sr:g} Hz" if isinstance(sr, float) else f"{quote(sr)} Hz"
        raise AudioError(f"sr: sample rate {said} cannot be", remedy) from None


def _loudness_gain(sound: KeptSound, sr: int, peak_pa: float, lufs: float) -> float:
    """Find, by iteration, the gain to a loudness without a limiter [ITU-R BS.1770-5, annex 1]; AudioError if none.

    The part of the sound above the gate depends on the gain.
    """
    most_steps = 20
    from sonic_bullet.files.loudness.meter import CHANNEL_WEIGHT, integrated_lufs

    channels, frames = sound.shape
    if channels > len(CHANNEL_WEIGHT):
        raise AudioError(f"loudness is defined for up to 5 channels, not {channels}", "use --peak-dbfs")
    if frames < math.ceil(0.4 * sr):
        raise AudioError(
            f"loudness needs 0.4 s of sound, here are {frames / sr:.3f} s", "use --peak-dbfs, or render longer"
        )
    gain, best, nearest_lu = 1 / peak_pa, 0.0, math.inf
    for _ in range(most_steps):
        measured = integrated_lufs(sound.times(gain), sr)
        if measured is None:
            break
        if abs(measured - lufs) < nearest_lu:
            best, nearest_lu = gain, abs(measured - lufs)
        if nearest_lu < LUFS_WITHIN:
            break
        gain *= 10 ** ((lufs - measured) / 20)
    if nearest_lu > 1.0:
        raise AudioError("the sound has no measurable loudness (a click under the gate of BS.1770)", "use --peak-dbfs")
    return best
