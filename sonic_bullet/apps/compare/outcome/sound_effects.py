"""Audible differences of two sounds: first sample, levels by band and time, onsets, decay, loudness.

level_dB(band) = 10 lg ∫ |B|² df / ∫ |A|² df over an octave band [IEC 61260-1]
T60: the slope of the backward integral of p² between −5 and −25 dB [Schroeder, J. Acoust. Soc. Am. 37 (1965) 409], and
    of what would follow the recording's end, at the rate at which it falls there [ISO 3382-1:2009, 5.3.3]
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sonic_bullet.apps.compare.comparison_record import Consequence
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ, octave_power
from sonic_bullet.signal.short_time import power_spectrum, raised_cosine

# an onset: an envelope of 4 ms that rises by 10 dB above the 30 ms before; closer onsets are one
ONSET_FRAME_S = 0.004
ONSET_RISE_DB = 10.0
BEFORE_ONSET_S = 0.03


def at_common_rate(a: Array, b: Array, sr_a: int, sr_b: int) -> tuple[Array, Array, int]:
    """Resample both sounds (channels, n) to the lower of their rates."""
    low = min(sr_a, sr_b)

    def lowered(x: Array, sr: int) -> Array:
        if sr == low:
            return x
        from scipy.signal import resample_poly

        common = math.gcd(sr, low)
        return np.asarray(resample_poly(x, low // common, sr // common, axis=1))

    return lowered(a, sr_a), lowered(b, sr_b), low


def sound_effects(a: Array, b: Array, sr: int) -> list[Consequence]:
    """Find the differences of sounds (channels, n) at one rate, first difference first."""
    found: list[Consequence] = []
    n = min(a.shape[1], b.shape[1])
    if a.shape[0] != b.shape[0]:
        return [Consequence("channels", f"A has {format_count(a.shape[0], 'channel')}, B {b.shape[0]}", 0.0)]
    where = np.flatnonzero((a[:, :n] != b[:, :n]).any(axis=0))
    if len(where):
        first = int(where[0])
        equal = f"are equal for the first {first / sr * 1e3:.4g} ms" if first else "differ from the first sample on"
        found.append(Consequence("sample", f"A and B {equal}", first / sr))
    if a.shape[1] != b.shape[1]:
        found.append(Consequence("length", f"A lasts {a.shape[1] / sr:.4g} s, B {b.shape[1] / sr:.4g} s", n / sr))
    found += [one for one in (_levels(a, b, sr), _onsets(a, b, sr), _decay(a, b, sr), _loudness(a, b, sr)) if one]
    return found


def band_levels(x: Array, sr: int) -> Array:
    """Return mean squares (bands,) in octave bands, all channels together, dB re 1 Pa²; −inf where silent.

    The end fades out by half a Hann window: cut where it rings, a sound would be a click in bands without sound.
    """
    fade_s = 0.02  # a period of 50 Hz
    n, fade = max(x.shape[1], 1), min(round(fade_s * sr), x.shape[1])
    ending = raised_cosine((fade - np.arange(fade)) / (fade + 1))
    faded = np.concatenate([x[:, : x.shape[1] - fade], x[:, x.shape[1] - fade :] * ending], axis=1)
    power = power_spectrum(faded).sum(axis=0) * 2 / n**2
    freq = np.fft.rfftfreq(n, 1 / sr)
    sums = octave_power(power, freq, [f for f in AUDIBLE_OCTAVES_HZ if f / math.sqrt(2) < sr / 2])
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.array(sums)))


def _levels(a: Array, b: Array, sr: int) -> Consequence | None:
    one, other = band_levels(a, sr), band_levels(b, sr)
    top = max(one.max(initial=-np.inf), other.max(initial=-np.inf))
    if not math.isfinite(top):
        return None
    quiet_db = -80.0  # level re the loudest band below which bands are not compared
    loud = np.maximum(one, other) > top + quiet_db
    if not (np.isfinite(one[loud]).all() and np.isfinite(other[loud]).all()):
        which = "A" if not np.isfinite(one[loud]).all() else "B"
        return Consequence("level", f"{which} is silent in some bands where the other is not")
    change = other - one
    total = 10 * math.log10(float(np.square(b).mean()) / float(np.square(a).mean()))
    k = int(np.argmax(np.where(loud, np.abs(change), -1)))
    most = (
        f"; most in the octave at {_hz(AUDIBLE_OCTAVES_HZ[k])}: {level_words(change[k])}"
        if abs(change[k]) > 0.005
        else ""
    )
    values: dict[str, Any] = {"total_db": total, "band_hz": list(AUDIBLE_OCTAVES_HZ[: len(change)])}
    values["band_db"] = [round(float(x), 4) if good else None for x, good in zip(change, loud, strict=True)]
    return Consequence("level", f"B is {level_words(total)} than A in all{most}", None, values)


def level_words(change_db: float, unit: str = "dB", digits: int = 2) -> str:
    """Describe a change of level from A to B: "5 dB quieter"."""
    return f"{abs(change_db):.{digits}g} {unit} {'louder' if change_db >= 0 else 'quieter'}"


def onsets_s(x: Array, sr: int) -> list[float]:
    """Return the times of onsets, in s."""
    floor_db = -50.0  # Lowest level of an onset re the loudest moment
    hop = max(1, round(ONSET_FRAME_S * sr / 2))
    square = np.square(x).sum(axis=0)
    count = len(square) // hop
    if count < 4:
        return []
    envelope = square[: count * hop].reshape(count, hop).mean(axis=1)
    level = 10 * np.log10(envelope + 1e-300)
    back = max(2, round(BEFORE_ONSET_S * sr / hop))
    found: list[float] = []
    last = -back
    for i in range(count):
        before = level[max(0, i - back) : i].max(initial=-3000.0)
        if level[i] > level.max() + floor_db and level[i] > before + ONSET_RISE_DB and i - last >= back:
            found.append(i * hop / sr)
            last = i
    return found


def _onsets(a: Array, b: Array, sr: int) -> Consequence | None:
    one, other = onsets_s(a, sr), onsets_s(b, sr)
    if len(one) != len(other):
        shared = min(len(one), len(other))
        at = next((min(x, y) for x, y in zip(one, other, strict=False) if abs(x - y) > ONSET_FRAME_S), None)
        longer = one if len(one) > len(other) else other
        at = longer[shared] if at is None else at
        words = f"{format_count(len(one), 'onset')} in A, {len(other)} in B"
        return Consequence("onset", words, at, {"a_s": one, "b_s": other})
    moved = [(y - x, x) for x, y in zip(one, other, strict=True) if abs(y - x) > ONSET_FRAME_S / 2]
    if not moved:
        return None
    most = max(moved, key=lambda pair: abs(pair[0]))
    later = f"{abs(most[0]) * 1e3:.3g} ms {'later' if most[0] > 0 else 'earlier'}"
    words = f"{len(moved)} of {len(one)} onsets come at another time, the one at {most[1]:.3g} s in A {later} in B"
    return Consequence("onset", words, moved[0][1], {"a_s": one, "b_s": other})


def t60_s(x: Array, sr: int) -> float | None:
    """Return the time in which the sound after its loudest moment falls by 60 dB; None: it does not fall by 25.

    Where the recording ends has no part in it. Noise and what rolls on have none.
    """
    square = np.square(x).sum(axis=0)
    if not square.any():
        return None
    square = square[int(np.argmax(square)) :]
    after = _after_the_end(square)
    if after is None:
        return None
    left = np.cumsum(square[::-1])[::-1] + after
    level = 10 * np.log10(left / left[0] + 1e-300)
    i, j = (int(np.argmax(level <= db)) for db in (-5.0, -25.0))
    if not 0 < i < j:
        return None
    slope = np.polyfit(np.arange(i, j) / sr, level[i:j], 1)[0]
    return float(-60 / slope) if slope < 0 else None


def _after_the_end(square: Array) -> float | None:
    """Return the sum that would follow squares (n,) which fall as their last two quarters do: E₂²/(E₁ − E₂).

    None where they do not fall: noise, or what rolls on. 0 where that is so faint that −25 dB are reached before.
    """
    size = len(square) // 4
    if not size:
        return 0.0
    before, last = (float(part.sum()) for part in (square[-2 * size : -size], square[-size:]))
    falls_db = 3.0  # from one quarter to the next: what falls by less may be noise, and its sum is anything
    if before > last * 10 ** (falls_db / 10):
        return last**2 / (before - last)
    faint_db = -35.0  # of the whole: what moves the level at −25 dB by less than 2 dB
    return 0.0 if last <= float(square.sum()) * 10 ** (faint_db / 10) else None


def _decay(a: Array, b: Array, sr: int) -> Consequence | None:
    one, other = t60_s(a, sr), t60_s(b, sr)
    if one is None or other is None or abs(other / one - 1) < 0.005:
        return None
    words = f"T60 {one:.3g} s in A, {other:.3g} s in B ({(other / one - 1) * 100:+.2g} %)"
    return Consequence("decay", words, None, {"a_s": one, "b_s": other})


def _loudness(a: Array, b: Array, sr: int) -> Consequence | None:
    import pyloudnorm

    if min(a.shape[1], b.shape[1]) < math.ceil(0.4 * sr) or a.shape[0] > 5:
        return None
    peak = max(float(np.abs(a).max()), float(np.abs(b).max())) or 1.0
    one, other = (float(pyloudnorm.Meter(sr).integrated_loudness(x.T / peak)) for x in (a, b))
    if not (math.isfinite(one) and math.isfinite(other)) or abs(other - one) < 0.05:
        return None
    return Consequence("loudness", f"B is {level_words(other - one, 'LU')} than A", None, {"change_lu": other - one})


def _hz(f: float) -> str:
    return f"{f / 1000:g} kHz" if f >= 1000 else f"{f:g} Hz"
