"""Convert responses to a force to recordings of one impulse: velocity of a surface, or pressure.

    H(f) of acceleration, velocity, displacement  ->  V = H/(iω), H, iωH          [Ewins 2000, ch. 2.2, mobility]
    h(t) = ∫ V e^{iωt} df  ->  irfft(V·W)·sr, response in m/s (or Pa) to 1 N·s

A file holds one period with all that was measured, from W's lower edge on: modes are fitted over frequency. For what is
heard W falls to zero over the top fifth of the measured band, too, along the integral of a Kaiser window: a sharp edge
rings, and this one is over after √(π² + β²)/(π·width), before the impulse as after it.   [Kaiser & Schafer 1980]
Steps of Δf give a period 1/Δf; a mode that decays beyond it wraps around as A e^{pt}/(1 − e^{p/Δf}), with the same
pole p.

h jumps at the impulse, and no band represents a jump exactly: half of it is in the first sample, the rest rings around
it. Those samples are predicted from later ones, x_n = Σ a_k x_{n+k}.        [linear prediction: Makhoul 1975, eq. 2]
"""

from __future__ import annotations

import math

import numpy as np

from sonic_bullet.files.recordings import LEAST_RECORDING_RATE_HZ, MOST_SAMPLES
from sonic_bullet.files.uff.reader import Response
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

# which band of a response is heard
UFF_LOWEST_HZ = 20.0
# of the highest frequency measured: where the band begins of what is measured lower
UFF_LOWEST_OF_HIGHEST = 1 / 50
UFF_BAND_OF_HIGHEST = 0.8  # of the highest frequency measured: where W begins to fall and the band ends
UFF_OVERSAMPLED = 1.2  # of the least rate
UFF_KAISER_BETA = 10.0  # side lobes of 1e-5
UFF_RATE_ERROR = 5e-5  # relative: six figures of a step, and their last


def as_period(response: Response) -> tuple[Array, int, tuple[float, float]]:
    """Convert a response to samples with all that it holds: one period of it, where it is over frequency.

    Parameters
    ----------
    response : Response
        Of motion or pressure, over frequency or time.

    Returns
    -------
    (n,) array
        Velocity in m/s or pressure in Pa; per N·s where the response is per force.
    int
        Its rate in Hz.
    tuple of float
        The band that was measured, in Hz.

    Raises
    ------
    FileError
        Its rate is not a whole number of Hz, or it unpacks to too many samples.
    """
    off_grid = 0.01  # of a step
    motion_order = {"acceleration": -1, "velocity": 0, "displacement": 1}  # powers of iω from a quantity to velocity
    power = motion_order.get(response.quantity, 0)
    if not response.spectral:
        return _from_time(response, power)
    step, first = response.step, round(response.start / response.step)
    if abs(response.start / step - first) > off_grid:
        raise FileError(
            f"a response starts at {response.start:g} Hz in steps of {step:g} Hz", "export it from a multiple of them"
        )
    last = first + len(response.value) - 1
    count, sr = _length(max(2 * last, math.ceil(LEAST_RECORDING_RATE_HZ / step)), step)
    freq = sr / count * np.arange(first, last + 1)
    lowest = min(UFF_LOWEST_HZ, UFF_LOWEST_OF_HIGHEST * float(freq[-1]))
    low = max(lowest, 2 * step, response.start * 1.1)
    spectrum = np.zeros(count // 2 + 1, complex)
    spectrum[first : last + 1] = _differentiate(response.value, freq, power) * _rising_edge(
        (freq - low / 2) / (low / 2)
    )
    return np.fft.irfft(spectrum, count) * sr, sr, (low, float(freq[-1]))


def measured_band(measured_hz: tuple[float, float]) -> tuple[float, float]:
    """Return the band in Hz that is heard whole of one that was measured."""
    return measured_hz[0], UFF_BAND_OF_HIGHEST * measured_hz[1]


def period_spectrum(period: Array, sr: int, measured_hz: tuple[float, float]) -> tuple[Array, Array]:
    """Return the response (n,) that a period holds, the transform of what an impulse leaves, and its frequencies (n,).

    Parameters
    ----------
    period : (m,) array
        Samples, as `as_period` makes them.
    sr : int
        Their rate in Hz.
    measured_hz : tuple of float
        The band that was measured, in Hz.
    """
    freq = np.fft.rfftfreq(len(period), 1 / sr)
    inside = (freq > 0) & (freq >= measured_hz[0]) & (freq <= measured_hz[1] * (1 + UFF_RATE_ERROR))
    return np.fft.rfft(period)[inside] / sr, freq[inside]


def since_impulse(period: Array, sr: int, measured_hz: tuple[float, float]) -> Array:
    """Return what is heard (n,) of a period (m,) from the impulse on, until the next one begins to ring."""
    size = len(period)
    freq = np.fft.rfftfreq(size, 1 / sr)
    high = measured_hz[1]
    falling = _rising_edge((high - freq) / (high - measured_band(measured_hz)[1]))
    sound = np.fft.irfft(np.fft.rfft(period) * falling, size)
    # samples that W rings, before the impulse as after it
    jump = math.ceil(math.hypot(math.pi, UFF_KAISER_BETA) / (math.pi * (1 - UFF_BAND_OF_HIGHEST) * high) * sr)
    sound = sound[: max(size - jump, size // 2)]
    # what is sampled far above the band holds no jump: nothing to predict
    return _predicted_back(sound, jump) if sr < UFF_OVERSAMPLED * 2 * high else sound


def _predicted_back(sound: Array, jump: int) -> Array:
    """Predict the first samples of a recording (n,) from later ones; unchanged where it is too short."""
    prediction_order = 128  # of the prediction: two for each of 64 modes that begin at the jump
    exact = 1e-13  # of the largest eigenvalue: below it are rounding errors
    order = min(prediction_order, (len(sound) - jump) // 8)
    if order < 2:
        return sound
    window = np.lib.stride_tricks.sliding_window_view(sound[jump : jump + 7 * order], order + 1)
    value, vector = np.linalg.eigh(window[:, 1:].T @ window[:, 1:])
    keep = value > exact * value[-1]
    weight = vector[:, keep] @ ((vector[:, keep].T @ (window[:, 1:].T @ window[:, 0])) / value[keep])
    made = sound.copy()
    for n in range(jump - 1, -1, -1):
        made[n] = weight @ made[n + 1 : n + 1 + order]
    return made


def _from_time(response: Response, power: int) -> tuple[Array, int, tuple[float, float]]:
    """Convert a time record to velocity or pressure."""
    sr = round(1 / response.step)
    if not sr or abs(sr * response.step - 1) > UFF_RATE_ERROR:
        raise FileError(f"a time record has {1 / response.step:g} samples a second", "export it at a whole number")
    value = np.asarray(response.value, float)
    if power == 0:
        return value, sr, (UFF_LOWEST_HZ, 0.45 * sr)
    freq = np.fft.rfftfreq(len(value), 1 / sr)
    spectrum = _differentiate(np.fft.rfft(value), freq, power) * _weight(freq, UFF_LOWEST_HZ, 0.45 * sr)
    return np.fft.irfft(spectrum, len(value)), sr, (UFF_LOWEST_HZ, 0.45 * sr)


def _differentiate(value: Array, freq_hz: Array, power: int) -> Array:
    """Multiply a spectrum by (iω)^power; zero at zero frequency."""
    omega = np.where(freq_hz > 0, 2j * np.pi * freq_hz, 1.0)
    return np.asarray(np.where(freq_hz > 0, value * omega**power, 0.0))


def _weight(freq_hz: Array, low_hz: float, high_hz: float) -> Array:
    """Return one between two frequencies; falls to zero at half the first and at the last frequency."""
    return _rising_edge((freq_hz - low_hz / 2) / (low_hz / 2)) * _rising_edge(
        (freq_hz[-1] - freq_hz) / max(freq_hz[-1] - high_hz, 1e-9)
    )


def _rising_edge(at: Array) -> Array:
    """Return W's edge: zero below 0, one above 1."""
    steps = 4001  # of an edge
    step = np.cumsum(np.kaiser(steps, UFF_KAISER_BETA))
    return np.asarray(np.interp(at, np.linspace(0, 1, steps), step) / step[-1])


def _length(least: int, step_hz: float) -> tuple[int, int]:
    """Find an even number of samples, at least ``least``, with a whole rate in Hz at ``step_hz``, and that rate.

    Raises FileError where there is none.
    """
    lengths = 4096  # even numbers of samples to choose the whole rate from
    count = least + least % 2 + 2 * np.arange(lengths)
    if count[0] > MOST_SAMPLES:
        raise FileError(f"a response unpacks to {count[0]} samples", "export it in larger steps, or a smaller band")
    rate = count * step_hz
    off = np.abs(np.rint(rate) / rate - 1)
    good = np.flatnonzero(off <= max(float(off.min()), 1e-9))[0]
    if off[good] > UFF_RATE_ERROR:
        raise FileError(f"steps of {step_hz:g} Hz give no whole rate", "export it in steps of a whole number of Hz")
    return int(count[good]), round(float(rate[good]))
