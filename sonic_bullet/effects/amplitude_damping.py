"""`amplitude-damping`: friction and plasticity take more of a loud mode than of a soft one.

    ȧ = −d a (1 + c a)      ->      a₀/a(t) = (1 + c a₀) e^{dt} − c a₀         [Adhikari 2013, ch. 1; equivalent damping: Nayfeh & Mook 1979, § 3.3]

Read off the envelopes of single modes: early decay faster than late, the more so the harder the strike; d is the mode's, c of all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.amplitude_pitch import _per_velocity
from sonic_bullet.effects.envelope import Envelopes, envelopes, levels
from sonic_bullet.effects.values import Evidence, Heard, Owner, Ring, Stage
from sonic_bullet.records import Array

BETTER = 3.0  # of ln variance of the envelopes' logarithms, all lines together
TELL = 3  # lines at least whose variance halves
LEAST = 0.05  # of c a₀ at the loudest


@dataclass(frozen=True)
class AmplitudeDamping:
    """choke: relative rise of the decay per level. measure: as in amplitude-pitch. alpha_per_s, beta_s: the material's, as the decays at low level tell them."""

    id: ClassVar[str] = "amplitude-damping"
    stage: ClassVar[Stage] = Stage.BANK
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "Nayfeh & Mook 1979, section 3.3"

    choke: float
    measure: str = "velocity"
    alpha_per_s: float = float("nan")
    beta_s: float = float("nan")

    def apply(self, x: Ring) -> Ring:
        """The ringing with the effect in it."""
        return replace(x, choke=x.choke + self.choke * _per_velocity(x, self.measure))

    def parameters(self) -> dict[str, Any]:
        """What it says, for people and JSON, in SI units."""
        return {"choke": self.choke, "measure": self.measure}

    def freedom(self) -> int:
        return 2

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        best: tuple[float, Self] | None = None
        for h in evidence.heard:
            e = envelopes(h)
            if e is None:
                continue
            for name, level in levels(h).items():
                found = _fitted(e, h, level[:, e.line], sure=evidence.known is None)
                if found is not None and found[2] > BETTER * (evidence.known is None) and (best is None or found[2] > best[0]):
                    best = (found[2], cls(found[0], name, *found[1]))
        return best[1] if best is not None else None


def _fitted(e: Envelopes, h: Heard, level: Array, *, sure: bool = True) -> tuple[float, tuple[float, float], float] | None:
    """c, (α, β) by the low-level decays, and how much of ln variance goes, all lines together."""
    rows = [r for r in (_rows(e, h, level, q) for q in range(len(e.line))) if r is not None]
    if len(rows) < 2:
        return None
    most = float(np.max([r[2].max() for r in rows]))
    plain, _ = _misfit(rows, 0.0)
    grid = np.geomspace(0.02, 30, 28) / most
    costs = np.array([_misfit(rows, c)[0].sum() for c in grid])
    i = int(costs.argmin())
    fine = np.geomspace(grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)], 13)
    inner = np.array([_misfit(rows, c)[0].sum() for c in fine])
    choke = float(fine[int(inner.argmin())])
    cost, ratio = _misfit(rows, choke)
    gain = plain - cost
    if choke * most < LEAST:
        return None
    if sure and ((gain > np.log(2)).sum() < TELL or -gain[gain < 0].sum() > 0.3 * gain[gain > 0].sum()):
        return None
    omega2 = np.array([h.omega[k] ** 2 for k in e.line])[[i for i in range(len(e.line)) if _rows(e, h, level, i) is not None]]
    low = ratio * np.array([r[4] for r in rows])
    return choke, _rayleigh(omega2, low), float(gain.sum())


def _rayleigh(omega2: Array, decay: Array) -> tuple[float, float]:
    """α, β >= 0 by relative least squares with Huber's weights."""
    from scipy.optimize import nnls

    columns = np.stack([0.5 * np.ones(len(omega2)), 0.5 * omega2], axis=1) / decay[:, None]
    scale = np.abs(columns).max(axis=0)
    trust, x = np.ones(len(decay)), np.zeros(2)
    for _ in range(10):
        x = nnls(columns / scale * trust[:, None], trust)[0]
        off = np.abs(columns / scale @ x - 1)
        trust = np.sqrt(np.minimum(1, 0.1 / np.maximum(off, 1e-9)))
    return float(x[0] / scale[0]), float(x[1] / scale[1])


def _rows(e: Envelopes, h: Heard, level: Array, q: int) -> tuple[Array, Array, Array, Array, float] | None:
    """Times, ln |z|, level, strike index of a line's clear frames, and the heard decay."""
    t, y, a, who = [], [], [], []
    for s in range(len(e.z)):
        use = e.good[s, q]
        if use.sum() < 8:
            continue
        t.append(e.time_s[q, use])
        y.append(np.log(np.abs(e.z[s, q, use])))
        a.append(np.full(int(use.sum()), level[s, q]))
        who.append(np.full(int(use.sum()), s))
    if not t:
        return None
    return np.concatenate(t), np.concatenate(y), np.concatenate(a), np.concatenate(who), max(float(h.decay_per_s[e.line[q]]), 1e-2)


def _misfit(rows: list[tuple[Array, Array, Array, Array, float]], choke: float) -> tuple[Array, Array]:
    """ln of the variance (r,) that each line leaves, and the ratio (r,) of its d to the heard one."""
    found, ratio = [], []
    scales = np.geomspace(0.2, 1.6, 41)
    for t, y, a, who, decay in rows:
        u = np.exp(np.minimum(decay * scales[:, None] * t, 300))
        left = y + np.log((1 + choke * a) * u - choke * a)
        mine = (who == np.unique(who)[:, None]).astype(float)
        left = left - (left @ mine.T / mine.sum(axis=1)) @ mine
        spread = (left**2).mean(axis=1)
        found.append(np.log(spread.min() + 2.5e-5))
        ratio.append(float(scales[int(spread.argmin())]))
    return np.array(found), np.array(ratio)
