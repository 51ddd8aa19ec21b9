"""`contact-time`: a strike is a force pulse of finite length, so high modes take less of it.

    A_k -> A_k F̂(f_k τ)/F̂(0),   τ = τ₀ (J/J₀)^{−1/5}   (Hertz), or τ₀ whatever J (flat faces)        [Hertz 1882; Hunter 1957; Johnson 1985, ch. 11]

Read off the amplitudes: a roll-off common to all modes of a strike, with the pulse's zeros. Moments about the strike's own pattern; no phase is used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.pulses import PULSES, magnitude
from sonic_bullet.effects.values import Blow, Evidence, Heard, Owner, Stage
from sonic_bullet.records import Array

HERTZ = -0.2
AGAIN = 1.29  # times shorter or longer, where it is fitted again: √(5/3), half the way from the half-sine's first zero to its second
ROUGH = 0.03  # of a mode's strongest expected amplitude: the shapes' own error


@dataclass(frozen=True)
class ContactTime:
    """Duration tau_s at the impulse impulse_n_s, going as impulse^exponent; pulse: one of `pulses.PULSES`."""

    id: ClassVar[str] = "contact-time"
    stage: ClassVar[Stage] = Stage.FORCE
    owner: ClassVar[Owner] = Owner.STRIKER
    reference: ClassVar[str] = "Hunter 1957; Johnson 1985, section 11.4"

    tau_s: float
    impulse_n_s: float
    exponent: float = HERTZ
    pulse: str = "half-sine"

    def duration_s(self, impulse_n_s: float) -> float:
        return float(self.tau_s * (impulse_n_s / self.impulse_n_s) ** self.exponent)

    def apply(self, x: Blow) -> Blow:
        """The blow with the effect in it."""
        return replace(x, tau_s=self.duration_s(x.impulse_n_s), pulse=self.pulse)

    def parameters(self) -> dict[str, Any]:
        """What it says, for people and JSON, in SI units."""
        return {"tau_s": self.tau_s, "J0_n_s": self.impulse_n_s, "exponent": self.exponent, "pulse": self.pulse}

    def freedom(self) -> int:
        return 2

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        fewest = 4 if evidence.known is None else 3  # lines: to look for it, and to fit it again without one of them
        tables = [_table(h) for h in evidence.heard if len(h.freq_hz) >= fewest]
        if not tables:
            return None
        freq, level, told, heard, sd, most = (np.concatenate([t[i] for t in tables]) for i in range(6))
        if len(freq) < 4:
            return None
        reference = float(np.exp(np.log(level).mean()))
        grid = np.geomspace(0.15 / freq.max(), min(1.2 / freq.min(), 0.05), 90)
        pulses: tuple[str, ...] = PULSES
        if isinstance(evidence.known, cls):  # part of the evidence may have another pulse nearly as good far away; it is this one that is fitted again
            grid, pulses = evidence.known.duration_s(reference) * np.geomspace(1 / AGAIN, AGAIN, 24), (evidence.known.pulse,)
        plain = _cost(told, heard, sd, ROUGH * most)
        best: tuple[float, Self] | None = None
        for pulse in pulses:
            for exponent in (HERTZ, 0.0):
                share = (level / reference) ** exponent

                def at(tau: float, share: Array = share, pulse: str = pulse) -> float:
                    h = np.abs(magnitude(pulse, freq * tau * share))
                    h = h / max(float(h.max()), 1e-300)  # the gain is free: a pulse so long that it leaves nothing must not pass for a small one
                    return _cost(told * h, heard, sd, ROUGH * most * np.maximum(h, 0.02))

                costs = np.array([at(t) for t in grid])
                i = int(costs.argmin())
                tau = _golden(at, grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])
                cost = at(tau) + (0.0 if exponent else 1e-9)
                if best is None or cost < best[0]:
                    best = (cost, cls(tau, reference, exponent, pulse))
        assert best is not None
        return best[1] if evidence.known is not None or best[0] < plain - 4 * np.log(len(freq)) else None


def _table(h: Heard) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Per strike and line, flat: frequency, impulse, expected and heard magnitude, spread, the line's strongest expected magnitude."""
    told, heard = np.abs(h.expected), np.abs(h.amplitude)
    good = np.isfinite(told) & np.isfinite(heard) & np.isfinite(h.impulse_n_s)[:, None] & (told > 0)
    most = np.broadcast_to(told.max(axis=0, keepdims=True), told.shape)
    freq = np.broadcast_to(h.freq_hz, told.shape)
    level = np.broadcast_to(np.where(np.isfinite(h.impulse_n_s), h.impulse_n_s, 1.0)[:, None], told.shape)
    return freq[good], level[good], told[good], heard[good], h.amplitude_sd[good], most[good]


def _cost(told: Array, heard: Array, sd: Array, rough: Array) -> float:
    """Twice the negative log likelihood under Cauchy's law at the best common gain; rough (·): the shapes' own error, which grows with the gain."""
    weight, gain = np.ones(len(told)), float(np.median(heard) / max(float(np.median(told)), 1e-300))
    for _ in range(15):
        width = sd**2 + (gain * rough) ** 2
        gain = max(float((weight * told * heard / width).sum() / max(float((weight * told**2 / width).sum()), 1e-300)), 1e-12)
        weight = 1 / (1 + (heard - gain * told) ** 2 / width / 9)
    width = sd**2 + (gain * rough) ** 2
    return float((np.log(width) + 9 * np.log1p((heard - gain * told) ** 2 / width / 9)).sum())


def _golden(f: Any, low: float, high: float) -> float:
    from scipy.optimize import minimize_scalar

    return float(minimize_scalar(f, bounds=(low, high), method="bounded", options={"xatol": 1e-4 * low}).x)
