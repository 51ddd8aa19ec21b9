"""Lines of a sound by complex demodulation: nothing of the package is in it, so that it can judge the package.

y(t) e^{−iω₀t} smoothed by a Gaussian -> A(t) e^{iφ(t)};  d = −(ln A)′,  f = f₀ + φ′/2π   [Boashash 1992, II.A]
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

Array = np.ndarray


def envelope(sound: Array, sr: int, near_hz: float, *, reach: float = 0.02, width_s: float = 0.004) -> Array:
    """The complex envelope (n,) of the strongest line within ``reach`` of near_hz, about near_hz. width_s: of the
    Gaussian, which keeps away what is more than 1/width_s off.
    """
    t = np.arange(len(sound)) / sr
    power = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), 4 * len(sound)))
    hz = np.fft.rfftfreq(4 * len(sound), 1 / sr)
    near = np.abs(hz / near_hz - 1) < reach
    middle = hz[near][np.argmax(power[near])]
    k = np.arange(-int(4 * width_s * sr), int(4 * width_s * sr) + 1) / sr
    window = np.exp(-0.5 * (k / width_s) ** 2)
    smooth = fftconvolve(sound * np.exp(-2j * np.pi * middle * t), 2 * window / window.sum(), mode="same")
    return np.asarray(smooth * np.exp(2j * np.pi * (middle - near_hz) * t))


def line_at(sound: Array, sr: int, near_hz: float, start_s: float, stop_s: float, **how: float) -> tuple[float, ...]:
    """Frequency in Hz, decay in 1/s and amplitude of the line between two times: rms under the weight that a slope of a
    straight fit gives to what it is the mean of, 6/T³ (T²/4 − t²).
    """
    z = envelope(sound, sr, near_hz, **how)[int(start_s * sr) : int(stop_s * sr)]
    t = (np.arange(len(z)) - len(z) / 2) / sr
    decay = np.polyfit(t, np.log(np.abs(z)), 1)[0]
    weight = t[0] ** 2 - t**2
    turn = np.polyfit(t, np.unwrap(np.angle(z)), 1)[0]
    return near_hz + turn / (2 * np.pi), -decay, float(np.sqrt((weight * np.abs(z) ** 2).sum() / weight.sum()))
