"""Effects after the body: other things that ring, the room, the recording chain.

Samples are in units of the file, the loudest plain strike at 0.5.

foreign-mode       x += level g J e^{−dt} sin ωt, wherever the body is struck
room               x += h * x,  h = reflections + noise · 10^{−3t/T}                     [Moorer 1979]
measurement-chain  clipped, filtered once, or hum added
"""

from __future__ import annotations

import numpy as np

from benchmarks.suite.effects.base import Effect, Scene, jitter, pick
from sonic_bullet.records import Array


def foreign_mode(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """One to three lines, 0.06, 0.3 or 1.2 of the body's own typical line, away from its modes by more than 1 %."""
    from benchmarks.suite.physics import rayleigh, ring

    rings = [ring(scene.body, rayleigh(scene.body.modes.value, scene.material), s, scene.sensor) for s in scene.strikes]
    typical = float(np.median([np.sort(np.abs(r.residue))[-5:].mean() for r in rings]))
    own = scene.body.modes.freq_hz
    lines: list[list[float]] = []
    while len(lines) < int(rng.integers(1, 4)):
        freq = float(np.exp(rng.uniform(np.log(250), np.log(9000))))
        if np.abs(own / freq - 1).min() > 0.01:
            lines.append(
                [
                    freq,
                    float(np.exp(rng.uniform(np.log(8), np.log(80)))),
                    jitter(rng, pick(strength, 0.06, 0.3, 1.2) * typical),
                ]
            )

    def add(x: Array, impulse: float, rate: float, which: int) -> Array:
        t = np.arange(len(x)) / rate
        return x + scene.gain * impulse * sum(a * np.exp(-d * t) * np.sin(2 * np.pi * f * t) for f, d, a in lines)

    return Effect("foreign-mode", "striker", {"modes": lines}, sound=add)


def impulse_response(
    rt60_s: float, wet: float, seed: int, rate: float, predelay_s: float, reflections: int, darker: float
) -> Array:
    """What comes after the direct sound, of energy wet; darker: how much sooner the treble dies (0: together)."""
    rng = np.random.default_rng(seed)
    n = int(1.2 * rt60_s * rate)
    t = np.arange(n) / rate
    tail = rng.standard_normal(n) * 10 ** (-3 * t / rt60_s)
    if darker:
        from scipy.signal import lfilter

        dull = lfilter([0.3], [1, -0.7], rng.standard_normal(n)) * 10 ** (-3 * t / rt60_s)
        tail = (tail * 10 ** (-3 * darker * t / rt60_s) + 1.5 * dull) / 2
    tail[: int((predelay_s + (0.012 if reflections else 0)) * rate)] = 0
    for when, gain in zip(
        rng.uniform(predelay_s, predelay_s + 0.015, reflections), rng.uniform(2, 8, reflections), strict=True
    ):
        tail[int(when * rate)] += gain * rng.choice([-1, 1])
    tail[0] = 0
    return np.asarray(tail * np.sqrt(wet / (tail**2).sum()))


def room(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """Energy of 0.03, 0.2 or 0.9 of the direct sound, rt60 0.25-1.2 s."""
    from scipy.signal import fftconvolve

    rt60, wet, seed = (
        float(rng.uniform(0.25, 1.2)),
        jitter(rng, pick(strength, 0.03, 0.2, 0.9)),
        int(rng.integers(2**31)),
    )
    how = {
        "predelay": float(rng.choice([0.0, 0.003, 0.007])),
        "reflections": int(rng.choice([0, 6, 12])),
        "darker": float(rng.choice([0.0, 1.0])),
    }
    h = impulse_response(rt60, wet, seed, scene.rate, how["predelay"], int(how["reflections"]), how["darker"])

    def add(x: Array, impulse: float, rate: float, which: int) -> Array:
        return np.asarray(x + fftconvolve(x, h)[: len(x)])

    return Effect("room", "room", {"rt60": rt60, "wet": wet, "seed": seed, **how}, sound=add)


def measurement_chain(strength: int, rng: np.random.Generator, scene: Scene) -> Effect:
    """A limit at 0.7, 0.4 or 0.15 of the loudest peak; or a filter of first or second order; or hum of 0.002, 0.01 or
    0.05.
    """
    from scipy.signal import butter, sosfilt

    kind = str(rng.choice(["clip", "high-pass", "low-pass", "hum"]))
    truth: dict[str, object] = {"kind": kind}
    if kind == "clip":
        limit = jitter(rng, pick(strength, 0.35, 0.2, 0.075), 0.1)
        truth["limit"] = limit
        return Effect("measurement-chain", "chain", truth, last=lambda x: np.clip(x, -limit, limit))
    if kind == "hum":
        mains, level = float(rng.choice([50, 60])), jitter(rng, pick(strength, 0.002, 0.01, 0.05))
        parts = level * np.array([1, 0.5, 0.3, 0.15])
        truth |= {"freq": mains, "levels": parts.tolist()}

        def hum(x: Array, impulse: float, rate: float, which: int) -> Array:
            t = np.arange(len(x)) / rate
            turn = 2.4 * which
            return np.asarray(
                x + sum(a * np.sin(2 * np.pi * mains * (k + 1) * t + turn * (k + 1)) for k, a in enumerate(parts))
            )

        return Effect("measurement-chain", "chain", truth, sound=hum)
    own = scene.body.modes.freq_hz
    low, high = np.quantile(own, [0.1, 0.9])
    order = int(rng.integers(1, 3))
    corner = jitter(
        rng,
        pick(strength, low, 1.6 * low, 3 * low) if kind == "high-pass" else pick(strength, high, high / 1.6, high / 3),
        0.1,
    )
    truth |= {"corner": corner, "order": order}
    sections = butter(order, corner, kind.replace("-", ""), fs=scene.rate, output="sos")
    return Effect(
        "measurement-chain", "chain", truth, sound=lambda x, impulse, rate, which: np.asarray(sosfilt(sections, x))
    )
