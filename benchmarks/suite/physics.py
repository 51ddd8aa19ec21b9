"""One strike as a case's sensor records it.

v(t) = g J cᵀ e^{At} b,  A = [[0, 1], [−Λ, −D]],  b = (0, φ(p)·e),  c = (0, φ(q)·n)
    [state space of q̈ + D q̇ + Λ q = b f]
D diagonal: Σ g J (φ(p)·e)(φ(q)·n) e^{−dt}(cos ωt − (d/ω) sin ωt),  ω = √(λ − d²)
x = noise + chain(room(pulse * v + what else rings))
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.suite.objects import Body, Material
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True)
class Strike:
    """A blow on a body: vertex, direction (3,), impulse in N·s."""

    vertex: int
    direction: tuple[float, float, float]
    impulse: float


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """What rings after a unit impulse: poles s (m,) in 1/s, residues r (m,): Re Σ r e^{st}. level (m,): the mode's
    displacement in m at its antinode.
    """

    pole: Array
    residue: Array
    level: Array


def rayleigh(value: Array, material: Material) -> Array:
    """Modal damping matrix (m, m) of D = α + βΛ [Rayleigh 1877]."""
    return np.diag(material.alpha + material.beta * value)


def ring(body: Body, damping: Array, strike: Strike, sensor: tuple[int, Array]) -> Ring:
    """Poles and residues of a strike at a sensor (vertex, direction), from the full damping matrix (m, m)."""
    modes = body.modes
    into = np.asarray(strike.direction) @ modes.shape[strike.vertex]
    out = sensor[1] @ modes.shape[sensor[0]]
    omega = np.sqrt(modes.value)
    antinode = np.linalg.norm(modes.shape, axis=1).max(axis=0)
    level = np.abs(into) * antinode / omega
    d = np.diag(damping) / 2
    if np.abs(damping - np.diag(np.diag(damping))).max() < 1e-9 * np.abs(damping).max():
        free = np.sqrt(np.maximum(modes.value - d**2, 1e-12))
        alive = modes.value > d**2
        return Ring((-d + 1j * free)[alive], (into * out * (1 + 1j * d / free))[alive], level[alive])
    m = len(omega)
    # scaled by ω, so that the matrix is balanced: state (ω q, q̇)
    state = np.block([[np.zeros((m, m)), np.diag(omega)], [-np.diag(omega), -damping]])
    pole, right = np.linalg.eig(state)
    left = np.linalg.inv(right)
    residue = (np.concatenate([0 * out, out]) @ right) * (left @ np.concatenate([0 * into, into]))
    up = pole.imag > 0
    near = np.argmin(np.abs(pole[up].imag[:, None] - omega), axis=1)
    return Ring(pole[up], 2 * residue[up], level[near])


def sounded(ring_: Ring, n: int, rate: float) -> Array:
    """Re Σ r e^{st} at n samples, by recursion in blocks."""
    block = 512
    t = np.arange(block) / rate
    inside = np.exp(ring_.pole[:, None] * t)
    starts = ring_.residue * np.exp(ring_.pole * block / rate) ** np.arange(-(-n // block))[:, None]
    return np.asarray((starts @ inside).real.ravel()[:n])


def noise(rng: np.random.Generator, n: int, sd: float, colour: str) -> Array:
    """A recorder's floor of standard deviation sd: "room" (white and rumble below 350 Hz), "white" or "pink"."""
    from scipy.signal import lfilter

    white = rng.standard_normal(n)
    if colour == "white":
        return sd * white
    if colour == "room":
        sound = white + lfilter([0.2], [1, -0.95], rng.standard_normal(n))
        return np.asarray(sd * sound / np.sqrt(1 + 0.04 / (1 - 0.95**2)))
    freq = np.fft.rfftfreq(n, 1 / n)
    shaped = np.fft.irfft(np.fft.rfft(white) / np.sqrt(np.maximum(freq, 20)), n)
    return np.asarray(sd * shaped / shaped.std())


Floor = Callable[[int], Any]
"""Mean power of a noise under Hann's window of a size: one number, or one a bin."""


def white_floor(sd: float) -> Floor:
    """The floor of white noise."""
    return lambda size: sd**2 * (np.hanning(size) ** 2).sum()


def floor_like(noise: Array) -> Floor:
    """The floor of a noise of which some is given (n,)."""

    def power(size: int) -> Array:
        from scipy.ndimage import uniform_filter1d

        frames = np.lib.stride_tricks.sliding_window_view(noise, size)[:: size // 2] * np.hanning(size)
        mean = (np.abs(np.fft.rfft(frames)) ** 2).mean(axis=0)
        return np.asarray(uniform_filter1d(mean, 9, mode="nearest"))

    return power


def spectral_distance_db(one: Array, two: Array, noise_floor: Floor) -> float:
    """Log-spectral distance, mean over three resolutions, of cells where either stands 10 dB above a floor: this
    suite's own measure.
    """
    total = []
    for size in (512, 2048, 8192):
        window = np.hanning(size)
        floor = 10 * np.log10(noise_floor(size)) + 10
        level = []
        for x in (one, two):
            frames = np.lib.stride_tricks.sliding_window_view(x, size)[:: size // 2] * window
            level.append(np.maximum(20 * np.log10(np.abs(np.fft.rfft(frames)) + 1e-12), floor))
        loud = np.maximum(*level) > floor
        total.append(np.sqrt(np.mean((level[0] - level[1])[loud] ** 2)) if loud.any() else 0.0)
    return float(np.mean(total))
