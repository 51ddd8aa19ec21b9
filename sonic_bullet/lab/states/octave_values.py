"""What octaves of a take say where its lines are too dense to be told apart: level, decay, and how noise-like it is.

take -> octaves (masks of its spectrum, half an octave's slopes) -> energy in blocks
level:      energy of the first 50 ms
T60:        −60 dB over the slope of the level from half its power, when the strike is over, down to −25 dB
    [ISO 3382-1, 3.4, has −5 to −25 dB]
late T60:   the same from −20 to −40 dB, or as far as the noise lets see: wires, a stand and a room ring on after a
    head or a bar, and a single slope through both is neither's
flatness:   10 lg (geometric over arithmetic mean of the power over frequency): −2.5 dB of Gaussian noise, less of
    lines                                                                         [Gray & Markel 1974, eq. 6]
attack:     energy of the first 10 ms over that of the first 80 ms, in dB: a tail of reflections lowers it
    [as clarity, ISO 3382-1, A.2.3]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.states.recorded_states import Take
from sonic_bullet.records import Array
from sonic_bullet.signal.octave_bands import in_octave

OCTAVES_HZ = (63.0, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0)
LEVEL_S = 0.05
"""Over which an octave's level is taken: three periods at 63 Hz, and little of a decay."""
STRIKE_ATTACK_S = (0.01, 0.08)
"""Before the first reflections of most rooms, and after the middle of their early ones."""


@dataclass(frozen=True, slots=True, eq=False)
class OctaveValues:
    """Values of takes (t) by octave (o): level, T60 early and late, flatness, attack; NaN where noise hides them."""

    octave_hz: Array
    level_db: Array
    t60_s: Array
    late_t60_s: Array
    flatness_db: Array
    attack_db: Array


def octave_values(takes: tuple[Take, ...], sr: int) -> OctaveValues:
    """Measure the octaves of takes."""
    octave_hz = np.array([f for f in OCTAVES_HZ if f * 2**0.5 < 0.49 * sr])
    level, t60, late, flatness, attack = (np.full((len(takes), len(octave_hz)), np.nan) for _ in range(5))
    for k, take in enumerate(takes):
        for j, (power, block_s) in enumerate(octave_energies(take.signal, sr, octave_hz)):
            noise = noise_of(power, block_s)
            first = max(1, round(LEVEL_S / block_s))
            early = float(power[:first].mean()) - noise
            if early > noise:
                level[k, j] = 10 * np.log10(early)
                t60[k, j], late[k, j] = decay_times_s(power, block_s, noise, float(octave_hz[j]))
                if block_s <= STRIKE_ATTACK_S[0]:
                    head, whole = (power[: round(s / block_s)].sum() for s in STRIKE_ATTACK_S)
                    attack[k, j] = 10 * np.log10(head / whole)
        flatness[k] = _flatness_db(take.signal, sr, octave_hz, level[k])
    return OctaveValues(octave_hz, level, t60, late, flatness, attack)


def octave_masks(freq_hz: Array, octave_hz: Array) -> Array:
    """Return masks (o, f) that sum to 1 between the lowest and the highest octave, of cosines over log frequency."""
    place = np.log2(np.maximum(freq_hz, 1e-3) / octave_hz[0])
    away = np.abs(place - np.arange(len(octave_hz))[:, None])
    slope = 0.5  # of an octave over which one mask hands over to the next
    return np.asarray(np.cos(np.pi / 2 * np.clip((away - (0.5 - slope / 2)) / slope, 0, 1)) ** 2)


def octave_energies(signal: Array, sr: int, octave_hz: Array) -> list[tuple[Array, float]]:
    """Return the mean power in blocks of each octave, and their length in s."""
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(signal) + sr // 10, real=True)
    spectrum = rfft(signal, size)
    masks = np.sqrt(octave_masks(np.fft.rfftfreq(size, 1 / sr), octave_hz))
    found = []
    for mask in masks:
        block = round(sr * 0.002)
        count = len(signal) // block
        band = irfft(spectrum * mask, size)[: count * block]
        found.append(((band.reshape(count, block) ** 2).mean(axis=1), block / sr))
    return found


def noise_of(power: Array, block_s: float) -> float:
    """Mean power of what is left at a take's end: of its last tenth, where that no longer falls."""
    tail = power[-max(4, len(power) // 10) :]
    return float(np.median(tail))


def decay_times_s(power: Array, block_s: float, noise: float, middle_hz: float) -> tuple[float, float]:
    """Return T60 of a power in blocks, early and late; NaN where less than `least_db` of a decay are seen."""
    struck_db, early_db, least_db = -5.0, -25.0, 10.0  # the decay that T20 is of [ISO 3382-1, 3.4]
    late_db = (-20.0, -40.0)
    periods, smoothed_s = 2.0, 0.004  # over which a level is taken
    above = 4.0  # times the noise
    width = max(1, round(max(smoothed_s, periods / middle_hz) / block_s))
    smooth = np.convolve(power, np.ones(width) / width, "valid")
    within = max(1, round(0.1 / block_s))
    start = int(np.argmax(smooth[:within]))
    level = 10 * np.log10(np.maximum(smooth[start:], 1e-30) / max(float(smooth[start]), 1e-30))
    lowest = 10 * np.log10(above * max(noise, 1e-30) / max(float(smooth[start]), 1e-30))

    def slope(high_db: float, low_db: float) -> float:
        begun = np.flatnonzero(level <= high_db) if high_db < 0 else np.zeros(1, int)
        low_db = max(low_db, lowest)
        if not len(begun) or high_db - low_db < least_db:
            return float("nan")
        done = np.flatnonzero(level < low_db)
        stop = int(done[0]) if len(done) else len(level)
        part = level[begun[0] : stop]
        if len(part) < 4 or part[0] - part.min() < 0.7 * least_db:
            return float("nan")
        fall = float(np.polyfit(np.arange(len(part)) * block_s, part, 1)[0])
        return -60 / fall if fall < 0 else float("nan")

    return slope(struck_db, early_db), slope(*late_db)


def _flatness_db(signal: Array, sr: int, octave_hz: Array, level_db: Array) -> Array:
    """Flatness (o,) of what rings from 20 to 320 ms after the onset; NaN of an octave that is hidden."""
    part = signal[round(0.02 * sr) : round(0.32 * sr)]
    if len(part) < 0.1 * sr:
        return np.full(len(octave_hz), np.nan)
    power = np.abs(np.fft.rfft(part * np.hanning(len(part)))) ** 2
    freq = np.fft.rfftfreq(len(part), 1 / sr)
    found = np.full(len(octave_hz), np.nan)
    for j, middle in enumerate(octave_hz):
        inside = power[in_octave(freq, middle)]
        if len(inside) >= 16 and np.isfinite(level_db[j]):
            found[j] = 10 * (np.log10(np.maximum(inside, 1e-300)).mean() - np.log10(max(inside.mean(), 1e-300)))
    return found
