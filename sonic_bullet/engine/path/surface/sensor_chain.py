"""Chain of a sensor on a surface: from velocity to what the instrument gives, as one FIR filter, and its own noise.

    ContactMicrophone: velocity -> d/dt -> acceleration -> its frequency response, minimum phase -> + white noise

d/dt: antisymmetric taps of even number, least squares of the relative error to 0.85 of half the rate [Oppenheim,
Schafer 2010, sec. 7.5: type IV]: within 0.1 %, and 7.5 samples late. Noise of sample n depends on seed, sensor
and n alone.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sonic_bullet.engine.path.minimum_phase import minimum_phase
from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.records import Array, ContactMicrophone, Sensor, SensorResponse
from sonic_bullet.signal.elementary import log

DIFFERENTIATOR_TAPS = 16


@lru_cache(maxsize=8)
def differentiator(sr: int) -> Array:
    """Return taps (DIFFERENTIATOR_TAPS,) of d/dt at a rate in Hz, 7.5 samples late.

    Stated, so that they are the same on each machine; tests/engine/path/surface/test_differentiator.py derives them
    again.
    """
    half = np.array([
        1.2628972856638743, -0.13137912613460453, 0.04131976343399517, -0.01705351056581586,
        0.007615737634007094, -0.0033399063345495583, 0.0013038060529511897, -0.00032344182296292767,
    ])  # fmt: skip
    return np.asarray(sr * np.concatenate([half[::-1], -half]))


@WhileAlive
def response_taps(response: SensorResponse, sr: int) -> Array:
    """Return taps (≤ 2048,) of a response at a rate in Hz, of minimum phase."""
    most_taps = 2048  # of a response: 12 Hz between two points of it, at 48 kHz, where it is that narrow
    left_out = 1e-5  # of the taps' norm: what a response's tail is cut at, -100 dB
    size = 4 * most_taps
    magnitude = response.at(np.fft.rfftfreq(size, 1 / sr))
    taps = minimum_phase(log(magnitude))[:most_taps]
    rest = np.sqrt(np.cumsum(taps[::-1] ** 2)[::-1])
    return np.asarray(taps[: max(1, int(np.count_nonzero(rest > left_out * rest[0])))])


def sensor_taps(sensor: Sensor, sr: int) -> Array:
    """Return the taps (t,) of a sensor's chain; none where it passes on what it reads."""
    if not isinstance(sensor, ContactMicrophone):
        return np.zeros(0)
    taps = differentiator(sr)
    if sensor.response is None:
        return taps
    further = response_taps(sensor.response, sr)
    both = np.zeros(len(taps) + len(further) - 1)
    for i, tap in enumerate(taps):  # np.convolve is BLAS's, whose bits follow the processor
        both[i : i + len(further)] += tap * further
    return both


def sensor_noise(density: float, sr: int, key: tuple[int, int], first: int, count: int) -> Array:
    """Return white noise (count,) of a one-sided density per √Hz, from absolute sample ``first`` on.

    key: seed, and number of the sensor.
    """
    noise_block = 1024  # Samples of noise that are drawn at once, on the grid of absolute time
    blocks = range(first // noise_block, -(-(first + count) // noise_block))
    drawn = [np.random.Generator(np.random.PCG64([*key, block])).standard_normal(noise_block) for block in blocks]
    whole = np.concatenate(drawn) if drawn else np.zeros(0)
    at = first - blocks.start * noise_block
    return np.asarray(density * np.sqrt(sr / 2) * whole[at : at + count])
