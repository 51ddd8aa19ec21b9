"""Effects of level and of the blow itself.

amplitude-pitch    ω(a) = ω₀ (1 + κ a²),  a = a₀ e^{−dt}:  phase ω₀ (t + κ a₀² (1 − e^{−2dt})/2d)
    [Duffing; Fletcher & Rossing, ch. 1.11]
amplitude-damping  ȧ = −d a (1 + (a/a₁)^p):  a = a₀ e^{−dt} (1 + (a₀/a₁)^p (1 − e^{−pdt}))^{−1/p}
    [Bernoulli's equation]
contact-time       pulse of length τ = τ₀ (J/J₀)^{−1/5}: sin^{3/2} (Hertz), sin, or sin²
    [Johnson, Contact mechanics, ch. 11.4]
rebound            the blow again after gaps that fall by r, weaker by r each
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.suite.effects.base import LOUD, Effect, Scene, jitter, pick
from benchmarks.suite.physics import Ring, ring
from sonic_bullet.records import Array

REACH = 32  # samples to both sides of a blow between two of them
POWERS = {"half-sine": 1.0, "hertz": 1.5, "raised-cosine": 2.0}


def _reference(rng: np.random.Generator, scene: Scene) -> tuple[float, float]:
    """The strongest mode's level at a loud strike, and the power of ω by which levels are weighed: displacement (0)
    or velocity (1).
    """
    power = float(rng.integers(2))
    damping = np.diag(0 * scene.body.modes.value + 1.0)
    rings = [ring(scene.body, damping, s, scene.sensor) for s in scene.strikes]
    return max(float((LOUD * r.level * np.abs(r.pole.imag) ** power).max()) for r in rings), power


def _summed(r: Ring, n: int, rate: float, shape: Callable[[int, Array], tuple[Array, Array]]) -> Array:
    """Σ Re r a(t) e^{iθ(t)}; shape(k, t) gives envelope and phase of mode k, which is followed until it has died away
    (140 dB).
    """
    out = np.zeros(n)
    for k, d in enumerate(-r.pole.real):
        last = min(n, int(16 * rate / max(d, 1e-3)) + 1)
        envelope, phase = shape(k, np.arange(last) / rate)
        out[:last] += envelope * (r.residue[k].real * np.cos(phase) - r.residue[k].imag * np.sin(phase))
    return out


def amplitude_pitch(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """The strongest mode of the loudest strikes shifts by 0.4, 1.5 or 5 % (twice that where only displacement, so few
    modes, counts); once in four down.
    """
    top, power = _reference(rng, scene)
    kappa = jitter(rng, pick(strength, 0.004, 0.015, 0.05) * (2 - power)) * (1 if rng.random() < 0.75 else -1)

    def run(r: Ring, impulse: float, n: int, rate: float) -> Array:
        a = impulse * r.level * np.abs(r.pole.imag) ** power / top
        d, omega = -r.pole.real, r.pole.imag

        def shape(k: int, t: Array) -> tuple[Array, Array]:
            return np.exp(-d[k] * t), omega[k] * (t + kappa * a[k] ** 2 * -np.expm1(-2 * d[k] * t) / (2 * d[k]))

        return _summed(r, n, rate, shape)

    truth = {"kappa": kappa, "level": top, "of": "velocity" if power else "displacement"}
    return Effect("amplitude-pitch", "object", truth, ring=run)


def amplitude_damping(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """The loudest modes lose 1.5, 4 or 12 times more than late ones."""
    top, power = _reference(rng, scene)
    p = float(rng.choice([1.0, 2.0]))
    more = jitter(rng, pick(strength, 1.5, 4, 12))

    def run(r: Ring, impulse: float, n: int, rate: float) -> Array:
        a = impulse * r.level * np.abs(r.pole.imag) ** power / top
        d, omega = -r.pole.real, r.pole.imag

        def shape(k: int, t: Array) -> tuple[Array, Array]:
            return np.exp(-d[k] * t) * (1 + more * a[k] ** p * -np.expm1(-p * d[k] * t)) ** (-1 / p), omega[k] * t

        return _summed(r, n, rate, shape)

    truth = {"more": more, "power": p, "level": top, "of": "velocity" if power else "displacement"}
    return Effect("amplitude-damping", "object", truth, ring=run)


def pulse(tau_s: float, rate: float, power: float) -> Array:
    """Taps of a sin^power pulse of unit area and length tau_s from sample 0, each the mean over its sample."""
    fine = 64
    x = (np.arange(fine * int(np.ceil(tau_s * rate) + 1)) + 0.5) / (fine * tau_s * rate)
    shape = np.where(x < 1, np.sin(np.pi * np.minimum(x, 1)), 0).clip(0) ** power
    return np.asarray(shape.reshape(-1, fine).sum(axis=1) / shape.sum())


def contact_time(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """τ of 60, 130 or 320 µs at 0.02 N·s."""
    tau = jitter(rng, pick(strength, 60e-6, 130e-6, 320e-6))
    form = str(rng.choice(list(POWERS)))
    exponent = -0.2 if form == "hertz" or rng.random() < 0.5 else 0.0
    taps = lambda impulse, rate: pulse(tau * (impulse / 0.02) ** exponent, rate, POWERS[form])  # noqa: E731
    return Effect("contact-time", "striker", {"tau": tau, "J0": 0.02, "form": form, "exponent": exponent}, pulse=taps)


def rebound(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Two to five blows, restitution 0.25, 0.45 or 0.7, first gap 4-25 ms, longer for louder strikes in half
    the cases.
    """
    r = jitter(rng, pick(strength, 0.25, 0.45, 0.7), 0.1)
    gap = jitter(rng, 0.01, 0.9)
    power = float(rng.choice([0.0, 1.0]))
    hits = int(rng.integers(2, 6))

    def taps(impulse: float, rate: float) -> Array:
        first = gap * (impulse / 0.02) ** power
        when = np.concatenate([[0], np.cumsum(first * r ** np.arange(hits - 1))]) * rate
        out = np.zeros(int(when[-1]) + REACH)
        for k, w in enumerate(when):
            at = np.arange(max(int(w) - REACH + 1, 0), int(w) + REACH)
            # between samples: a bounce is no softer there
            out[at] += r**k * np.sinc(at - w) * np.cos(np.pi * (at - w) / (2 * REACH)) ** 2
        return out

    return Effect(
        "rebound", "striker", {"restitution": r, "gap": gap, "J0": 0.02, "exponent": power, "hits": hits}, pulse=taps
    )
