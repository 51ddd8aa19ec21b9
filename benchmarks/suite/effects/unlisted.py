"""Effects on no list: the right verdict is "unexplained", or none of the ids.

drift       the object cools: every strike has its own pitch, E ∝ 1 − 5·10⁻⁴ per kelvin
doppler     an echo from something that moves: x(t) + r x(t(1 + v/c) − T)
buzz        a loose part rattles while the surface moves out: bursts of noise, gated by the motion's sign and strength
octaves     one-sided contact: even harmonics of the sum, high-passed
string      a string coupled to the body: a comb of lines whose strength follows the struck place
tremolo     the object turns before the microphone: levels swing at 3-9 Hz
"""

from __future__ import annotations

import numpy as np

from benchmarks.suite.effects.base import Effect, Scene, jitter, pick
from sonic_bullet.records import Array


def drift(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """0.3, 0.8 or 2 % of pitch over the session, at random over the strikes."""
    part = pick(strength, 0.003, 0.008, 0.02)
    offsets = rng.uniform(-part, part, 64)

    def bend(x: Array, impulse: float, rate: float, which: int) -> Array:
        t = np.arange(len(x)) * (1 + offsets[which])
        return np.asarray(np.interp(t, np.arange(4 * len(x)) / 4, _finer(x), right=0.0))

    return Effect("unlisted:drift", "object", {"part": part}, sound=bend)


def _finer(x: Array) -> Array:
    from scipy.signal import resample

    return np.asarray(resample(x, 4 * len(x)))


def doppler(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """An echo of 0.1, 0.3 or 0.8, 5-30 ms late, its reflector moving at 2-8 m/s."""
    level, late, speed = pick(strength, 0.1, 0.3, 0.8), float(rng.uniform(0.005, 0.03)), float(rng.uniform(2, 8))

    def add(x: Array, impulse: float, rate: float, which: int) -> Array:
        t = np.arange(len(x)) * (1 - 2 * speed / 343) - late * rate
        return np.asarray(x + level * np.interp(t, np.arange(4 * len(x)) / 4, _finer(x), left=0.0))

    return Effect("unlisted:doppler", "room", {"level": level, "delay": late, "speed": speed}, sound=add)


def buzz(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Noise bursts of 0.05, 0.2 or 0.6 of what the motion exceeds."""
    level, seed = pick(strength, 0.05, 0.2, 0.6), int(rng.integers(2**31))
    gate = jitter(rng, 0.02)

    def add(x: Array, impulse: float, rate: float, which: int) -> Array:
        rattle = np.random.default_rng(seed + which).standard_normal(len(x))
        return x + level * np.maximum(x - gate, 0) * rattle

    return Effect("unlisted:buzz", "fixture", {"level": level, "gate": gate}, sound=add)


def octaves(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """x² of 0.1, 0.4 or 1.5 per unit of the loudest peak."""
    level = pick(strength, 0.2, 0.8, 3)

    def add(x: Array, impulse: float, rate: float, which: int) -> Array:
        from scipy.signal import butter, sosfilt

        return np.asarray(x + level * sosfilt(butter(2, 200, "high", fs=rate, output="sos"), x**2))

    return Effect("unlisted:octaves", "fixture", {"level": level}, sound=add)


def string(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Twelve lines at k f₁ √(1 + Bk²), driven by what the body does at the bridge: 0.03, 0.15 or 0.5 of it."""
    level, f1 = pick(strength, 0.03, 0.15, 0.5), float(rng.uniform(150, 500))
    k = np.arange(1, 13)
    lines = k * f1 * np.sqrt(1 + 4e-4 * k**2)

    def add(x: Array, impulse: float, rate: float, which: int) -> Array:
        from scipy.signal import lfilter

        out = np.zeros_like(x)
        for f in lines:
            pole = np.exp((-4 + 2j * np.pi * f) / rate)
            out += lfilter([0, pole.imag], [1, -2 * pole.real, abs(pole) ** 2], x)
        return np.asarray(x + level * out * 2 * np.pi * f1 / rate)

    return Effect("unlisted:string", "fixture", {"level": level, "f1": f1}, sound=add)


def tremolo(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Levels swing by 0.15, 0.4 or 0.8 at 3-9 Hz, each strike with its own phase."""
    depth, rate_hz = pick(strength, 0.15, 0.4, 0.8), float(rng.uniform(3, 9))
    turn = rng.uniform(0, 2 * np.pi, 64)

    def swing(x: Array, impulse: float, rate: float, which: int) -> Array:
        return np.asarray(x * (1 + depth * np.sin(2 * np.pi * rate_hz * np.arange(len(x)) / rate + turn[which])))

    return Effect("unlisted:tremolo", "room", {"depth": depth, "rate": rate_hz}, sound=swing)
