"""`amplitude-pitch`: a body that moves far is stiffer, or softer: the frequency follows the square of its level down as it decays.

    ω(t) = ω (1 + b a²(t))                                                    [Nayfeh & Mook 1979, eq. 2.3.35: the Duffing oscillator]

Read off the phase of single modes: θ(t) = θ₀ + δ t + b a₀² ω (1 − e^{−2dt})/2d, θ₀ each strike's own, δ the mode's, b of all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.envelope import Envelopes, envelopes, levels
from sonic_bullet.effects.values import Evidence, Heard, Owner, Ring, Stage
from sonic_bullet.records import Array

MEASURES = ("impulse", "velocity", "displacement")
SURE = 8.0  # spreads that b must stand off zero
BETTER = 0.4  # of the phase's misfit must go


@dataclass(frozen=True)
class AmplitudePitch:
    """bend: relative rise of frequency per level². measure: of the level, one of MEASURES, in N·s, m/s or m."""

    id: ClassVar[str] = "amplitude-pitch"
    stage: ClassVar[Stage] = Stage.BANK
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "Nayfeh & Mook 1979, section 2.3"

    bend: float
    measure: str = "velocity"

    def apply(self, x: Ring) -> Ring:
        """The ringing with the effect in it."""
        return replace(x, bend=x.bend + self.bend * _per_velocity(x, self.measure) ** 2)

    def parameters(self) -> dict[str, Any]:
        """What it says, for people and JSON, in SI units."""
        return {"bend": self.bend, "measure": self.measure}

    def freedom(self) -> int:
        return 1

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        best: tuple[float, float, str] | None = None
        need = SURE if evidence.known is None else 1.0
        for h in evidence.heard:
            e = envelopes(h)
            if e is None:
                continue
            for name, level in levels(h).items():
                bend, sd, share = _slope(e, h, level[:, e.line])
                if abs(bend) > need * sd and share > BETTER * (evidence.known is None) and (best is None or share > best[0]):
                    best = (share, bend, name)
        return cls(best[1], best[2]) if best is not None else None


def _per_velocity(x: Ring, measure: str) -> Array:
    """The measure over the ring's own level (peak velocity)."""
    if measure == "displacement":
        return np.asarray(1 / (2 * np.pi * x.freq_hz))
    if measure == "impulse":
        return np.asarray(x.impulse_n_s / np.maximum(x.level, 1e-300))
    return np.ones(len(x.freq_hz))


def _slope(e: Envelopes, h: Heard, level: Array) -> tuple[float, float, float]:
    """b, its spread by the modes' own scatter, and the share of the phases' misfit it takes away."""
    top, bottom, before, after, parts = 0.0, 0.0, 0.0, 0.0, []
    for q, k in enumerate(e.line):
        decay, omega = max(float(h.decay_per_s[k]), 1e-3), 2 * np.pi * float(h.freq_hz[k])
        rows, sides, weights, ramps = [], [], [], []
        for s in range(len(e.z)):
            use = e.good[s, q]
            if use.sum() < 8:
                continue
            t, phase = e.time_s[q, use], np.unwrap(np.angle(e.z[s, q, use]))
            w = np.minimum((np.abs(e.z[s, q, use]) / max(e.noise[s, q], 1e-12)) ** 2, 1e4)
            curve = level[s, q] ** 2 * omega * -np.expm1(-2 * decay * t) / (2 * decay)
            rows.append(phase - np.average(phase, weights=w))
            sides.append(curve - np.average(curve, weights=w))
            ramps.append(t - np.average(t, weights=w))
            weights.append(w)
        if len(rows) < 2 and not (rows and len(rows[0]) > 30):
            continue
        y, x, t, w = (np.concatenate(part) for part in (rows, sides, ramps, weights))
        y, x = y - t * (w * t * y).sum() / (w * t * t).sum(), x - t * (w * t * x).sum() / (w * t * t).sum()
        xx, xy, yy = float((w * x * x).sum()), float((w * x * y).sum()), float((w * y * y).sum())
        if xx <= 0 or yy <= 0:
            continue
        parts.append((xy / xx, xx / yy))  # weight by how much of it the misfit could say
    if len(parts) < 1:
        return 0.0, np.inf, 0.0
    value, weight = np.array(parts).T
    centre = _median(value, weight)
    for _ in range(10):
        off = np.abs(value - centre)
        near = weight / (1 + (off / (2 * _median(off, weight) + 1e-12 * abs(centre) + 1e-200)) ** 2)
        centre = float((near * value).sum() / near.sum())
    top = float((weight * (value - centre) ** 2).sum())
    bottom = float((weight * value**2).sum())
    sd = float(np.sqrt(top / weight.sum() / max(len(value) - 1, 1))) if len(value) > 1 else abs(centre) / (SURE + 1)
    before, after = bottom, top
    explained = float((weight * value**2).sum() - (weight * (value - centre) ** 2).sum()) / len(value)  # share of the misfit, mean over modes
    return centre, max(sd, 1e-300), min(max(explained, 0.0), 1 - after / max(before, 1e-300))


def _median(value: Array, weight: Array) -> float:
    order = np.argsort(value)
    total = np.cumsum(weight[order])
    return float(value[order][np.searchsorted(total, total[-1] / 2)])
