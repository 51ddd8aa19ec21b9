"""Takes of made bars that scatter in size and mass, one with a notch, one with another damping.

Euler and Bernoulli's free bar in both directions, and its torsion:
    f_k = β_k²/(2πL²) √(E/ρ) h/√12,    h the thickness or the width;      f_j = j/(2L) √(G/ρ) · 2 h/w  (thin)
        [Blevins 1979, tables 8-1, 8-16]
A notch at x, of length n and relative depth δ, lowers each by what its strain energy there loses (Rayleigh's quotient):
    Δf/f = −½ (1 − (1 − δ)³) n w''(x)²/∫w''²   of bending in thickness, (1 − (1 − δ)) across, θ' of torsion
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.states.recorded_states import RecordedState, take_of
from sonic_bullet.records import Array

ROOTS = np.array([4.730041, 7.853205, 10.995608, 14.137165, 17.278760, 20.420352])


def bar_modes(
    size_m: tuple[float, float, float], density: float, notch: tuple[float, float, float]
) -> tuple[Array, Array]:
    """Frequencies (k,) and the shapes (k, 101) along a steel bar; notch: place over length, its length in m, depth."""
    length, width, height = size_m
    x = np.linspace(0, 1, 101)
    place, long_m, deep = notch
    freq, shape = [], []
    for thick, lost in ((height, 1 - (1 - deep) ** 3), (width, deep)):
        for k, root in enumerate(ROOTS):
            sigma = (np.cosh(root) - np.cos(root)) / (np.sinh(root) - np.sin(root))
            curve = np.cosh(root * x) - np.cos(root * x) - sigma * (np.sinh(root * x) - np.sin(root * x))
            moved = np.cosh(root * x) + np.cos(root * x) - sigma * (np.sinh(root * x) + np.sin(root * x))
            share = np.interp(place, x, curve) ** 2 / (curve**2).mean() * long_m / length
            f = root**2 / (2 * np.pi * length**2) * np.sqrt(2e11 / density / 12) * thick
            freq.append(f * (1 - 0.5 * lost * share))
            shape.append(moved * (1.0 if thick == height else 0.3) / (1 + 0.1 * k))
    for j in range(1, 6):
        share = 2 * np.sin(j * np.pi * place) ** 2 * long_m / length
        f = j / (2 * length) * np.sqrt(7.7e10 / density) * 2 * height / width
        freq.append(f * (1 - 0.5 * (1 - (1 - deep) ** 3) * share))
        shape.append(0.5 * np.cos(j * np.pi * x))
    order = np.argsort(freq)
    return np.array(freq)[order], np.array(shape)[order]


def bars(
    seed: int, count: int = 12, notched: int | None = 4, damped: int | None = 9, takes: int = 2
) -> tuple[RecordedState, ...]:
    """Bars with ±1 % of scatter in each size and in mass."""
    rng = np.random.default_rng(seed)
    sr = 44100
    made = []
    for k in range(count):
        size = tuple(np.array([0.20, 0.025, 0.008]) * (1 + 0.01 * rng.standard_normal(3)))
        density = 7850 * (1 + 0.01 * rng.standard_normal())
        notch = (0.37, 0.004, 0.35) if k == notched else (0.37, 0.0, 0.0)
        freq, shape = bar_modes(size, density, notch)
        decay = 3.0 + 1.5e-3 * freq * (1 + 0.05 * rng.standard_normal(len(freq)))
        decay = decay * (1.6 if k == damped else 1.0)
        keep = freq < 15000
        signals = []
        for _ in range(takes):
            at = 0.21 + 0.01 * rng.standard_normal()
            t = np.arange(round(1.2 * sr)) / sr
            sound = np.zeros(len(t))
            for f, d, s in zip(freq[keep], decay[keep], shape[keep], strict=True):
                gain = np.interp(at, np.linspace(0, 1, 101), s) * s[0] / (1 + (f / 6000) ** 2)
                sound += gain * np.exp(-d * t) * np.sin(2 * np.pi * f * t)
            sound *= 0.3 / np.abs(sound).max() * 10 ** (rng.normal(0, 2) / 20)
            whole = np.concatenate([np.zeros(round(0.06 * sr)), sound])
            signals.append(whole + 1e-4 * rng.standard_normal(len(whole)))
        made.append(RecordedState(f"bar{k + 1:02d}", tuple(take_of(x, sr, f"t{i}") for i, x in enumerate(signals)), sr))
    return tuple(made)
