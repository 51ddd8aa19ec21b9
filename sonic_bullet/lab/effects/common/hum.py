"""Hum: a tone at the mains and its multiples that is there before, during and after, however hard the strike.

Σ_i a_i cos(2π i f₀ t + φ_i),
    f₀ about 50 or 60 Hz: identified by the last third of every recording, where the body's sound is weakest

One recording does not distinguish hum from a mode with a slow decay; nor do strikes of one strength, unless several
multiples are present, as modes are not in tune with the mains, or one so low that no mode is to be expected there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.records import Array
from sonic_bullet.records.units import MAINS_HZ
from sonic_bullet.signal.exponential_law import mean_by_median
from sonic_bullet.signal.short_time import power_spectrum


@dataclass(frozen=True, slots=True, eq=False)
class Hum:
    """A tone and its harmonics.

    Attributes
    ----------
    hz : float
        f₀ in Hz.
    amplitude : (i,)
        Of the first multiples, 0 where one is absent.
    phase_rad : (i,)
        At the onset.
    """

    hz: float
    amplitude: tuple[float, ...]
    phase_rad: tuple[float, ...]


def hum_of(signals: Array, noise: Array, sr: int, known_hz: float = 0.0) -> Hum | None:
    """Find the hum of recordings.

    Parameters
    ----------
    signals : (s, n)
        The recordings.
    noise : (s,)
        Rms of their noise.
    sr : int
        Sampling rate in Hz.
    known_hz : float
        Frequency found in other recordings; then one recording is enough.

    Returns
    -------
    Hum or None
        None where no tone has one amplitude in all recordings, and from first to last.
    """
    above = 30.0  # times the power beside it
    fewest_recordings, least_s = 2, 0.2  # recordings, and the length of their tails
    # multiples where no mode is to be expected; loudest over softest peak of strikes, with which a mode would go
    low, unlike = 2, 2.0
    still = 0.2  # ln of its amplitude in the second half of the tails over that in the first, at most: modes fade
    most = 8  # multiples
    start = signals.shape[1] - signals.shape[1] // 3
    tail = signals[:, start:]
    n = tail.shape[1]
    if len(signals) < (1 if known_hz else fewest_recordings) or n < least_s * sr:
        return None
    shape = np.hanning(n)
    power, hz = power_spectrum(tail, shape, 4 * n), np.fft.rfftfreq(4 * n, 1 / sr)
    floor = (shape**2).sum() * np.median(noise) ** 2
    best: tuple[float, int, Array] | None = None
    multiple = np.arange(1, most + 1)
    for mains in [known_hz] if known_hz else MAINS_HZ:
        near = np.flatnonzero(np.abs(hz - mains) < (hz[1] if known_hz else 1.2 * mains / 50))
        if not len(near):
            continue
        # pink rooms
        background = np.array(
            [mean_by_median(power[:, np.abs(np.abs(hz - i * mains) - 0.3 * mains) < 0.15 * mains], 1) for i in multiple]
        )
        least = np.maximum(background, floor)  # (i, s)
        tone = np.array(
            [(power[:, np.minimum(i * near, len(hz) - 1)] / least[i - 1][:, None]).min(axis=0) for i in multiple]
        )
        score = np.log1p(tone / above).sum(axis=0)
        at = int(score.argmax())
        if score[at] > (1.0 if best is None else best[0]):
            best = float(score[at]), int(near[at]), least
    if best is None:
        return None
    _, line, least = best
    time, step = (start + np.arange(n)) / sr, hz[1] - hz[0]

    def waves(f: float) -> Array:
        return np.stack([(tail * shape) @ np.exp(-2j * np.pi * i * f * time) for i in multiple], axis=1)  # (s, i)

    def quiet(f: float) -> float:
        return -float((np.abs(waves(f)) ** 2).sum())

    exact = search_number(quiet, hz[line] + step * np.array([-1.0, 0.0, 1.0]), 1e-4)[1]  # between the steps
    wave = waves(exact)
    size = 2 * np.abs(wave) / shape.sum()
    half = n // 2
    parts = np.stack([np.hanning(half) * tail[:, i * half : (i + 1) * half] for i in (0, 1)])
    turn = np.exp(-2j * np.pi * exact * np.outer(np.arange(half) / sr, multiple))
    fades = np.diff(np.log(np.abs(parts @ turn) + 1e-300), axis=0)[0].mean(axis=0)  # (i,)
    steady_hum = 1.6  # loudest over softest recording
    steady = (
        (size.max(axis=0) < steady_hum * size.min(axis=0))
        & (np.abs(wave) ** 2 > above * least.T).all(axis=0)
        & (np.abs(fades) < still)
    )
    peak = np.abs(signals).max(axis=1)
    alone = steady.sum() == 1 and not steady[:low].any() and peak.max() < unlike * peak.min()
    if not steady.any() or (alone and not known_hz):
        return None
    last = int(np.flatnonzero(steady).max()) + 1
    mean, phase = np.exp(np.log(size).mean(axis=0)), np.angle((wave / np.abs(wave)).sum(axis=0))
    return Hum(
        exact,
        tuple(float(a) if s else 0.0 for a, s in zip(mean[:last], steady[:last], strict=True)),
        tuple(map(float, phase[:last])),
    )


def subtract_hum(signals: Array, sr: int, hum: Hum) -> Array:
    """Subtract a hum from recordings (s, n), with amplitudes and phases fitted to the last third of each."""
    time = np.arange(signals.shape[1]) / sr
    turn = 2 * np.pi * hum.hz * np.outer(time, [i for i, a in enumerate(hum.amplitude, 1) if a])
    wave = np.concatenate([np.cos(turn), np.sin(turn)], axis=1)
    late = len(time) - len(time) // 3
    part = np.linalg.lstsq(wave[late:], signals[:, late:].T, rcond=None)[0]
    return np.asarray(signals - (wave @ part).T)


def without_hum(signals: Array, noise: Array, sr: int) -> Array:
    """Subtract the hum of recordings (s, n) over a noise (s,), if they have any."""
    hum = hum_of(signals, noise, sr)
    return signals if hum is None else subtract_hum(signals, sr, hum)
