"""What is between object and file: a room by its statistics, ambient noise, a microphone.

    h = δ(t) + Σ_b n_b(t) e^{-ln(10³) t/T_b},  n_b noise of an octave    late energy over direct, in each octave:
    (r/r_c)², r_c² = 0.057² V/T_b                                        [Polack 1988; Kuttruff 2009, eq. 5.44]

Half of the takes are made where people live, half where they record. T60 in the middle of dwellings: 0.5 s, whatever
their size and the octave [ISO 16283-1:2014, 3.12, the reason for its reference time]; about it the spread of real rooms
in offices and houses, 0.3 to 1.3 s [Eaton et al. 2016, IEEE/ACM TASLP 24(10), the rooms of the ACE corpus]. Of studios:
0.25 s (V/100 m³)^(1/3) ± 0.05 s, 0.1 to 0.3 s for those drawn here [EBU Tech. 3276:1998, 2.2]. The air takes its own at
high octaves [ISO 9613-1 at 20 °C, 50 %].

Noise is the room's own, from a quiet bedroom's 20 dB to the 43 dB of rooms people live in [Seacord 1940, JASA 12(1)];
who records comes so near, or strikes so hard, that it lies 20 dB below the peak. Its spectrum is between white, of
microphones, and that of rooms, -5 dB an octave [Hoth 1941, JASA 12(4)], which goes on to their rumble at 16 Hz [the RC
curves: ASHRAE Handbook, HVAC Applications 2011, ch. 48].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.session.drawn_recording import ChainSpread

OCTAVES_HZ = 125.0 * 2.0 ** np.arange(8)
AIR_T60_S = np.array([1e3, 1e3, 300.0, 120.0, 40.0, 13.0, 5.2, 1.6])
"""T60 by the air alone, 55.3/(4 m c), m of ISO 9613-1 at 20 °C and 50 %, by octave from 125 Hz on."""
MIDDLE_T60_S, T60_SPREAD, OCTAVE_SPREAD = 0.5, 0.4, 0.15
"""Of dwellings: median and standard deviation of the logarithm of T60; of all, that of each octave about it."""
STUDIO_SHARE, STUDIO_T60_S, STUDIO_TOLERANCE_S = 0.5, 0.25, 0.05
"""Of takes; T60 at 100 m³."""
VOLUME_M3 = (15.0, 120.0)
NOISE_DB, NOISE_SLOPE_DB = (20.0, 43.0), (-6.0, 0.0)
"""Noise, its rms from 50 Hz on over 20 µPa; and its slope an octave."""
HEARD_HZ, RUMBLE_HZ = 50.0, 16.0
"""Where noise is measured from, and where its slope ends below."""
LEAST_BELOW_DB = 20.0
"""Noise below the peak, at least: of takes that people keep."""
CHAIN = ChainSpread(response_db=3)
"""Of a microphone: octaves differ by 3 dB."""
DIRECT_S = 2.5e-3
"""Until then what comes counts as direct; nearer walls than 0.4 m are none."""


@dataclass(frozen=True, slots=True)
class DrawnRoom:
    """A room: volume, T60 (8,) from 125 Hz on, and the seed of its echoes."""

    volume_m3: float
    t60_s: tuple[float, ...]
    seed: int


def draw_room(rng: np.random.Generator) -> DrawnRoom:
    """Draw a room."""
    volume = float(np.exp(rng.uniform(*np.log(VOLUME_M3))))
    if rng.random() < STUDIO_SHARE:
        middle = STUDIO_T60_S * (volume / 100) ** (1 / 3) + STUDIO_TOLERANCE_S * rng.uniform(-1, 1)
    else:
        middle = MIDDLE_T60_S * np.exp(T60_SPREAD * rng.normal())
    walls = middle * np.exp(OCTAVE_SPREAD * rng.normal(size=len(OCTAVES_HZ)))
    return DrawnRoom(volume, tuple((1 / (1 / walls + 1 / AIR_T60_S)).tolist()), int(rng.integers(2**62)))


def room_response(room: DrawnRoom, distance_m: float, sr: int) -> Array:
    """Compute a response (n,): 1 at its first sample, then the late sound as it is at a distance."""
    longest_s = min(1.0, 0.8 * max(room.t60_s))  # there it is 48 dB down
    n = round(longest_s * sr)
    at_s = np.arange(n) / sr
    noise = np.fft.rfft(np.random.default_rng(room.seed).normal(size=n))
    octave = np.log2(np.maximum(np.fft.rfftfreq(n, 1 / sr), 1.0) / OCTAVES_HZ[0])
    late = np.zeros(n)
    for k, t60 in enumerate(room.t60_s):
        beside = np.clip(1 - np.abs(octave - k), 0, 1)  # of one noise, so amplitudes fill up to 1
        if k == 0:
            beside[octave < 0] = 1.0
        if k == len(room.t60_s) - 1:
            beside[octave > k] = 1.0
        band = np.fft.irfft(noise * beside, n)
        rate = np.log(1e3) / t60
        energy = (distance_m / 0.057) ** 2 * t60 / room.volume_m3  # over the direct sound's, whose spectrum is 1
        late += np.sqrt(energy * 2 * rate / sr) * np.exp(-rate * at_s) * band
    late[: round(DIRECT_S * sr)] = 0.0
    late[0] = 1.0
    return late


def noise_rms_pa(noise_db: float, peak_pa: float) -> float:
    """Return the noise of a take whose sound has a peak."""
    return min(2e-5 * 10 ** (noise_db / 20), peak_pa * 10 ** (-LEAST_BELOW_DB / 20))


def noise_of(rms_pa: float, slope_db: float, sr: int, n: int, seed: int | tuple[int, int]) -> Array:
    """Make noise (n,) in Pa, its spectrum's slope in dB an octave from 16 Hz on; rms_pa: of what is above 50 Hz."""
    at_hz = np.fft.rfftfreq(n, 1 / sr)
    white = np.fft.rfft(np.random.default_rng(seed).normal(size=n))
    spectrum = white * (np.maximum(at_hz, RUMBLE_HZ) / HEARD_HZ) ** (slope_db / (20 * np.log10(2)))
    heard = np.sqrt(2 * (np.abs(spectrum[at_hz >= HEARD_HZ]) ** 2).sum()) / n
    return np.asarray(np.fft.irfft(spectrum, n) * (rms_pa / heard))
