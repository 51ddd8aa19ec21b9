"""How loud a file is to be: the factor between pascals and file units, of a full scale, a peak or a programme loudness.

g = 1/full_scale_pa                      calibrated (the default: 1.0 in the file = 1 Pa)
    10^(peak_dbfs/20)/max|x|             --peak-dbfs alone: of the samples
    10^((lufs - L(x))/20)                --lufs, L: programme loudness [ITU-R BS.1770-5, annex 1]

Where that loudness would pass a true peak of peak_dbfs (-1 dBTP unless it is given) a limiter holds it below, and g
rises until what it leaves has the loudness asked for. AudioReport says how much was taken off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonic_bullet.files.loudness.gain_curve import GainCurve
from sonic_bullet.files.rows.spool import KeptSound
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_number, as_whole, shown
from sonic_bullet.records.errors import AudioError

SR_MIN_HZ, SR_MAX_HZ = 8000, 384_000


TRUE_PEAK_DBTP = -1.0
"""Above which no programme is to go [EBU R 128, rec. h]."""
RISE_DB, MOST_RISE_DB = 6.0, 36.0
"""Of g above what the loudness asks for without a limiter: a step, and where a sound is as flat as it will be."""
LUFS_WITHIN = 0.01
LOOKS, MOST_STEPS = 6, 20


@dataclass(frozen=True, slots=True, eq=False)
class FileLevel:
    """gain_per_pa: file units for one pascal. curve: a factor a frame besides (fades, limiter), None: ones. limited_db:
    most that the limiter takes off, limited_s: for how long it takes more than 0.1 dB.
    """

    gain_per_pa: float
    curve: GainCurve | None = None
    limited_db: float = 0.0
    limited_s: float = 0.0


def find_level(
    sound: KeptSound, sr: int, peak_dbfs: float | None, lufs: float | None, full_scale_pa: float
) -> FileLevel:
    """The level of the module's head; peak and loudness are of the whole sound, its fades included: a peak takes a
    pass over it, a loudness all of it in memory. Raises AudioError where the level cannot be reached.
    """
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
    return _loudness_level(sound, sr, peak, lufs, TRUE_PEAK_DBTP if peak_dbfs is None else peak_dbfs)


def _loudness_level(sound: KeptSound, sr: int, peak_pa: float, lufs: float, ceiling_dbtp: float) -> FileLevel:
    """The level of a loudness below a true peak. Raises AudioError."""
    from sonic_bullet.files.loudness.limiter import MARGIN_DB
    from sonic_bullet.files.loudness.true_peak import find_true_peak, sample_true_peaks

    gain = _loudness_gain(sound, sr, peak_pa, lufs)
    peak_db = 20 * np.log10(np.maximum(sample_true_peaks(sound.samples()) * gain, 1e-30))
    if peak_db.max() <= ceiling_dbtp:
        return FileLevel(gain, sound.curve)
    goal_db = ceiling_dbtp - MARGIN_DB
    for _ in range(LOOKS):  # a factor that changes makes peaks of its own between samples: tenths of a dB
        rise, factor = _rise(sound.scaled(gain), sr, peak_db, lufs, goal_db)
        left = sound.limited(factor)
        excess_db = 20 * math.log10(gain * rise * find_true_peak(left)) - (ceiling_dbtp - MARGIN_DB)
        if excess_db <= 0.0:
            break
        goal_db -= excess_db + 0.01
    taken_db = -20 * np.log10(np.maximum(factor, 1e-30))
    return FileLevel(gain * rise, left.curve, float(taken_db.max()), float((taken_db > 0.1).sum() / sr))


def _rise(sound: KeptSound, sr: int, peak_db: Array, lufs: float, goal_db: float) -> tuple[float, Array]:
    """By how much more a sound of the loudness ``lufs`` must rise so that a limiter leaves it that, and the limiter's
    factors. peak_db (n,): its true peaks; goal_db: the limiter's ceiling. Raises AudioError.
    """
    from scipy.optimize import brentq

    from sonic_bullet.files.loudness.limiter import RELEASES_DB_S, limiter_factor
    from sonic_bullet.files.loudness.meter import integrated_lufs

    gain = 1.0 if sound.curve is None else sound.curve.gain

    def limited(rise_db: float, release_db_s: float) -> tuple[Array, float]:
        """The factors, and how far the loudness is from the one asked for."""
        factor = limiter_factor(peak_db + rise_db, sr, goal_db, release_db_s)
        measured = integrated_lufs(sound.limited(factor).scaled(gain * 10 ** (rise_db / 20)), sr)
        return factor, (-math.inf if measured is None else measured) - lufs

    for release_db_s in RELEASES_DB_S:
        low_db = high_db = 0.0
        factor, missed = limited(0.0, release_db_s)
        while missed < -LUFS_WITHIN and high_db < MOST_RISE_DB:
            low_db, high_db = high_db, high_db + RISE_DB
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


def _loudness_gain(sound: KeptSound, sr: int, peak_pa: float, lufs: float) -> float:
    """The gain that gives a sound a loudness [ITU-R BS.1770-5, annex 1], without a limiter: what of it lies above the
    gate hangs on the gain, so it is found by steps. Raises AudioError where it has none.
    """
    from sonic_bullet.files.loudness.meter import CHANNEL_WEIGHT, integrated_lufs

    channels, frames = sound.shape
    if channels > len(CHANNEL_WEIGHT):
        raise AudioError(f"loudness is defined for up to 5 channels, not {channels}", "use --peak-dbfs")
    if frames < math.ceil(0.4 * sr):
        raise AudioError(
            f"loudness needs 0.4 s of sound, here are {frames / sr:.3f} s", "use --peak-dbfs, or render longer"
        )
    gain, best, nearest_lu = 1 / peak_pa, 0.0, math.inf
    for _ in range(MOST_STEPS):
        measured = integrated_lufs(sound.scaled(gain), sr)
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
