"""Late field of a room: noise that decays, in place of the images that are too many to follow.

    h²(t) = 4πc/V · exp(-2δt)  a second,   2δ = -c S ln(1 - α)/4V,   T60 = 3 ln 10/δ
        [Kuttruff, Room Acoustics, 4th ed. 2000, eq. 4.6 (4πc³t²/V images a second, each 1/(ct)²), eq. 5.23 (Eyring)]

It begins where the images end: as what arrives at a microphone at that distance does, so four of them, on a tetrahedron
round the scene, are its sources. They hear a body from four sides: the mean square over them is that over all
directions for a monopole and for a dipole, to the letter. Each has noise of its own. At the microphones that noise
comes as plane waves from all around, so that two of them, the channels of ambisonics and two ears are as coherent as
in a diffuse field [Kuttruff 2000, sec. 8.6]. α by octaves from 125 Hz on is straight over log f between them.

It has no modes of its own: below 2000 √(T60/V) Hz (Schroeder's frequency) a real room is less even.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.engine.path.minimum_phase import minimum_phase
from sonic_bullet.engine.path.space.ear_filters import FILTER_MARGIN, ear_filters
from sonic_bullet.radiation.far_field import spread_directions
from sonic_bullet.records import Air, Ambisonics, Array, Binaural, Microphone, ShoeboxRoom

TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)


def reverberation_time_s(room: ShoeboxRoom, air: Air) -> Array:
    """Compute Eyring's T60 (bands,) of a room, 0 where its walls keep all."""
    return np.asarray(3 * np.log(10) / np.maximum(_decay(room, air), 1e-12)) * (room.absorption < 1)


def _decay(room: ShoeboxRoom, air: Air) -> Array:
    """Compute δ (bands,) in 1/s."""
    x, y, z = room.size_m
    surface, volume = 2 * (x * y + y * z + z * x), x * y * z
    with np.errstate(divide="ignore"):
        return np.asarray(air.sound_speed_m_s * surface * -np.log1p(-room.absorption) / (8 * volume))


def band_weights(frequency_hz: Array, bands: int) -> Array:
    """Compute how much of each band is in frequencies: (bands, f), 1 in sum."""
    lowest_hz = 125.0  # of the octaves that absorption is given for: those of the tables [ISO 354:2003]
    place = np.clip(np.log2(np.maximum(frequency_hz, 1e-3) / lowest_hz), 0, bands - 1)
    return np.asarray(np.maximum(0, 1 - np.abs(place - np.arange(bands)[:, None])))


def early_filters(room: ShoeboxRoom, orders: Array, sr: int) -> Array:
    """Make filters (g, t) of so many reflections each: of least phase, for a wall sends nothing back ahead of time."""
    early_taps = 512
    size = 4 * early_taps
    alpha = room.absorption @ band_weights(np.fft.rfftfreq(size, 1 / sr), len(room.absorption))
    return minimum_phase(0.5 * np.asarray(orders)[:, None] * np.log(np.maximum(1 - alpha, 1e-12)))[:, :early_taps]


def late_filters(
    room: ShoeboxRoom, air: Air, receivers: Sequence[tuple[Microphone, int]], channels: int, sr: int, begin_s: float
) -> Array:
    """Make filters (channels, 4, t) from the four far microphones, times their distance, to channels of receivers."""
    decay_db = 90.0  # how far the noise is followed down: 16 bits hold no more
    longest_noise_s = 30.0
    longest_s = min(float(reverberation_time_s(room, air).max()) * decay_db / 60, longest_noise_s)
    taps = int(np.ceil(max(longest_s - begin_s, 0.0) * sr))
    made = np.zeros((channels, len(TETRAHEDRON), taps))
    if not taps:
        return made
    rng = np.random.default_rng(0)  # a room is the same room for every take
    size = taps + taps % 2
    frequency_hz = np.fft.rfftfreq(size, 1 / sr)
    decay, time_s = _decay(room, air), begin_s + np.arange(taps) / sr
    weights = band_weights(frequency_hz, len(decay))
    x, y, z = room.size_m
    waves = 32  # plane waves that noise comes as: more than the 16 channels of third order, which they tell apart
    level = np.sqrt(4 * np.pi * air.sound_speed_m_s / (x * y * z) / sr / len(TETRAHEDRON)) * np.sqrt(size / 2 / waves)
    middle = np.mean([one.position_m for one, _ in receivers], axis=0)
    half = spread_directions(waves // 2)[0]
    spectrum = np.zeros((len(TETRAHEDRON), channels, len(frequency_hz)), complex)
    for direction in np.concatenate([half, -half]):
        hears = []
        for microphone, first in receivers:
            early_s = direction @ (microphone.position_m - middle) / air.sound_speed_m_s
            response = _response_of(microphone, direction, frequency_hz, sr)
            if early_s != 0:
                response = response * np.exp(2j * np.pi * early_s * frequency_hz)
            hears.append((slice(first, first + microphone.channels), response))
        for far in range(len(TETRAHEDRON)):
            wave = rng.standard_normal(2 * len(frequency_hz)).view(complex)
            for channel, response in hears:
                spectrum[far, channel] += wave * response
    for band, rate in enumerate(decay):
        if np.isfinite(rate):
            noise = np.fft.irfft(spectrum * weights[band], size)[:, :, :taps]
            made += level * np.exp(-rate * time_s) * noise.transpose(1, 0, 2)
    return made


def _response_of(microphone: Microphone, direction: Array, frequency_hz: Array, sr: int) -> Array:
    """Compute what each channel hears of a plane wave from a direction (3,): (channels, f), or (channels, 1)."""
    from scipy.spatial.transform import Rotation

    away = Rotation.from_quat(microphone.quaternion_xyzw).inv().apply(direction)
    if isinstance(microphone, Ambisonics):
        weight = np.zeros(microphone.channels)
        _engine.spherical_harmonics(away, microphone.order, weight)
        return weight[:, None]
    if isinstance(microphone, Binaural):
        response = ear_filters(microphone.head, sr).at(away[None])[0]
        size = 2 * (len(frequency_hz) - 1)
        return np.asarray(np.fft.rfft(response, size) * np.exp(2j * np.pi * FILTER_MARGIN / sr * frequency_hz))
    return np.ones((1, 1))
