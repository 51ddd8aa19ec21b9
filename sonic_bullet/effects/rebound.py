"""`rebound`: the striker bounces and hits again.

    f(t) = J Σ_i e^i δ(t − t_i),   t_{i+1} − t_i = g e^i       flight 2v/g' and impulse both fall by the restitution e at every bounce
                                                                                  [Goldsmith 1960, ch. 1; Falcon et al. 1998, eq. 1]
    g goes as the impulse (free flight), or is the arm's own, whatever J

Read off the recordings: what remains of them beside the model is the model again, later and weaker.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.values import Blow, Evidence, Heard, Owner, Stage
from sonic_bullet.records import Array

SPAN_S = (1.2e-3, 0.25)
MOST_HITS = 8
FAINT = 0.02
CLEAR = 8.0  # of the correlation's own scatter


@dataclass(frozen=True)
class Rebound:
    """First gap in s at the impulse impulse_n_s, going as impulse^exponent; restitution: of each next hit and gap against the last; ratio of gaps."""

    id: ClassVar[str] = "rebound"
    stage: ClassVar[Stage] = Stage.FORCE
    owner: ClassVar[Owner] = Owner.STRIKER
    reference: ClassVar[str] = "Goldsmith 1960, ch. 1; Falcon et al. 1998"

    gap_s: float
    impulse_n_s: float
    restitution: float
    exponent: float = 0.0
    shrink: float | None = None  # of the gaps; the restitution where None
    hits: int = MOST_HITS

    def apply(self, x: Blow) -> Blow:
        gap = self.gap_s * (x.impulse_n_s / self.impulse_n_s) ** self.exponent
        ratio = self.restitution if self.shrink is None else self.shrink
        share = self.restitution ** np.arange(self.hits)
        share = share[share > FAINT]
        when = gap * np.concatenate([[0.0], np.cumsum(ratio ** np.arange(len(share) - 1))])
        delay = (x.delay_s[:, None] + when).ravel()
        return replace(x, delay_s=delay, share=(x.share[:, None] * share).ravel())

    def parameters(self) -> dict[str, Any]:
        shrink = self.restitution if self.shrink is None else self.shrink
        return {
            "gap_s": self.gap_s,
            "J0_n_s": self.impulse_n_s,
            "restitution": self.restitution,
            "gap_ratio": shrink,
            "exponent": self.exponent,
            "hits": self.hits,
        }

    def freedom(self) -> int:
        return 3

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        found = [(h, _gaps(h)) for h in evidence.heard if h.signal is not None]
        found = [(h, g) for h, g in found if len(g) >= max(2, 0.6 * len(h.impulse_n_s))]
        if not found:
            return None
        h, gaps = max(found, key=lambda pair: len(pair[1]))
        strike = np.array(sorted(gaps))
        level = np.where(np.isfinite(h.impulse_n_s), h.impulse_n_s, 1.0)[strike]
        gap, ratio = (np.array([gaps[int(s)][i] for s in strike]) for i in range(2))
        reference = float(np.exp(np.log(level).mean()))
        exponent = min((0.0, 1.0, 0.5, -0.2), key=lambda p: _spread(np.log(gap) - p * np.log(level)))
        if _spread(np.log(gap) - exponent * np.log(level)) > 0.1:
            return None
        first = float(np.exp(np.median(np.log(gap) - exponent * np.log(level / reference))))
        return _best(cls, h, cls(first, reference, float(np.clip(np.median(ratio), 0.05, 0.95)), exponent))


def _spread(y: Array) -> float:
    return float(np.abs(y - np.median(y)).mean())


def _system(h: Heard) -> tuple[Array, Array]:
    """What makes the direct sounds the recorded ones: recorded over played, per strike (s, t), from −t/4; strongest at 0. And its scatter (s,)."""
    from sonic_bullet.effects.ringing import direct_as_expected

    assert h.signal is not None
    sound = direct_as_expected(h)
    n = h.signal.shape[1]
    size = 2 * n
    x, y = np.fft.rfft(sound, size, axis=1), np.fft.rfft(h.signal, size, axis=1)
    power = np.abs(x) ** 2
    lift = 0.01 * power.max(axis=1, keepdims=True) + (np.median(h.noise) ** 2 * n)
    tap = np.fft.irfft(np.conj(x) * y / (power + lift), size, axis=1)
    reach = int(SPAN_S[1] * h.sr)
    return tap[:, :reach], np.median(np.abs(tap[:, reach : 2 * reach]), axis=1) / 0.67


def _gaps(h: Heard) -> dict[int, tuple[float, float]]:
    """Per strike: delay of the second hit in s, and its share of the first."""
    tap, _ = _system(h)
    own, _ = _own(h)
    first = int(SPAN_S[0] * h.sr)
    found = {}
    for s in range(len(tap)):
        rest = tap[s] / max(abs(tap[s, 0]), 1e-300) - own[s] / max(abs(own[s, 0]), 1e-300)  # less what a single hit would show
        scatter = np.median(np.abs(rest[first:])) / 0.67
        i = first + int(np.argmax(rest[first:]))
        if rest[i] > CLEAR * scatter and rest[i] > 0.08:
            found[s] = (i / h.sr, float(np.clip(rest[i], 0.05, 0.95)))
    return found


def _own(h: Heard) -> tuple[Array, Array]:
    """The same of the played sounds themselves: what the method makes of a single hit."""
    from dataclasses import replace as changed

    from sonic_bullet.effects.ringing import direct_as_expected

    return _system(changed(h, signal=direct_as_expected(h)))


def _best(cls: type[Rebound], h: Heard, start: Rebound) -> Rebound:
    """Gap, restitution and ratio of gaps by least squares on the power spectra of the strikes' first half second."""
    from scipy.optimize import minimize

    assert h.signal is not None
    size = min(h.signal.shape[1], int(0.6 * h.sr))
    target = np.log(np.abs(np.fft.rfft(h.signal[:, :size] * np.hanning(2 * size)[size:], axis=1)) + 1e-9)
    f, d = h.freq_hz, h.decay_per_s
    bins = np.clip(np.round(f * size / h.sr).astype(int), 0, target.shape[1] - 1)
    del bins
    seen = np.abs(h.amplitude) / np.maximum(np.abs(h.expected), 1e-300)
    width = 0.05 + (h.amplitude_sd / np.maximum(np.abs(h.amplitude), 1e-300)) + 0.03 * np.abs(h.expected).max(axis=0) / np.maximum(np.abs(h.expected), 1e-300)

    def cost(p: Array) -> float:
        made = cls(float(np.exp(p[0])), start.impulse_n_s, float(1 / (1 + np.exp(-p[1]))), start.exponent, float(1 / (1 + np.exp(-p[2]))))
        total = 0.0
        for s, level in enumerate(h.impulse_n_s):
            blow = made.apply(Blow(float(level) if np.isfinite(level) else 1.0, np.zeros(1), np.ones(1)))
            comb = np.abs((blow.share[:, None] * np.exp((d - 2j * np.pi * f) * blow.delay_s[:, None])).sum(axis=0))
            off = (np.log(np.maximum(seen[s], 1e-9)) - np.log(np.maximum(comb, 1e-9))) / width[s]
            off -= np.median(off)
            total += float(np.log1p((off / 2.5) ** 2).sum())
        return total

    e = float(np.clip(start.restitution, 0.06, 0.94))
    best, least = start, np.inf
    for shift in np.linspace(-0.02, 0.02, 21):
        for share in (0.8 * e, e, min(1.2 * e, 0.94)):
            p = np.array([np.log(start.gap_s) + shift, np.log(share / (1 - share)), np.log(e / (1 - e))])
            if cost(p) < least:
                least, at = cost(p), p
    found = minimize(
        cost,
        at,
        method="Nelder-Mead",
        options={"xatol": 1e-5, "fatol": 1e-3, "maxfev": 250, "initial_simplex": at + np.vstack([np.zeros(3), np.diag([2e-3, 0.1, 0.1])])},
    )
    p = found.x
    best = cls(float(np.exp(p[0])), start.impulse_n_s, float(1 / (1 + np.exp(-p[1]))), start.exponent, float(1 / (1 + np.exp(-p[2]))))
    return best
