"""How `damping-law` is looked for.

Identified by the decays of all modes of every object: smooth in frequency, the same for all strikes and sizes. The law
with the least Bayes information criterion is proposed, where it is better than Rayleigh's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.lab.effects.common.fitting import fit_numbers
from sonic_bullet.lab.effects.common.line_likelihood import decay_residuals
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.records import Array

LAW_GAIN_BIC = 6.0  # than Rayleigh's law
FEWEST_LAW_LINES = 5  # to look for a law
FEWEST_REFIT_LINES = 4  # to fit it again to a part of them


@dataclass(frozen=True)
class _Rayleigh:
    """Rayleigh's law."""

    alpha_per_s: float
    beta_s: float

    def decay_per_s(self, omega_per_s: Array) -> Array:
        """Compute the decays (k,) at ω (k,)."""
        return 0.5 * (self.alpha_per_s + self.beta_s * omega_per_s**2)


def propose_damping_law(evidence: Evidence) -> DampingLaw | None:
    """Fit each law to the decays of all lines; None where no law is better than Rayleigh's."""
    taken, most = 0.1, 0.95  # of what other effects take of a line's decay: how unsure it is; of the decay, at most
    omega = np.concatenate([h.omega for h in evidence.observed])
    decay = np.concatenate([h.decay_per_s for h in evidence.observed])
    spread = np.concatenate([h.decay_sd_per_s for h in evidence.observed])
    rayleigh = 0.5 * (evidence.alpha_per_s + evidence.beta_s * omega**2)
    # what effects found so far take
    extra = np.clip(np.concatenate([h.expected_decay_per_s for h in evidence.observed]) - rayleigh, 0.0, most * decay)
    decay, spread = decay - extra, np.hypot(spread, taken * extra)
    good = np.isfinite(decay) & (decay > 0) & ~np.isposinf(spread)  # in a room some lines tell no decay
    if good.sum() < (FEWEST_LAW_LINES if evidence.known is None else FEWEST_REFIT_LINES):
        return None
    omega, decay, spread = omega[good], decay[good], spread[good]
    per = np.log(len(omega))

    def residual(law: Any) -> Array:
        return decay_residuals(decay, spread, law.decay_per_s(omega))

    def bic(start: Any, *free: str) -> tuple[float, Any]:
        cost, law = fit_numbers(start, free, residual)
        return cost + len(free) * per, law

    flat = bic(DampingLaw("constant-loss", float(np.exp(-7.0))), "eta")
    eta, tau = flat[1].eta, 1 / float(np.median(omega))
    trials = [flat, *(bic(DampingLaw("power", eta, p), "eta", "exponent") for p in (0.5, 1.0, 1.6))]
    trials += [
        bic(DampingLaw("relaxation", eta * np.exp(-1.5), 1.0, eta * np.e, tau * np.exp(s)), "eta", "strength", "tau_s")
        for s in (-2.5, -1.0, 0.0, 1.0, 2.5)
    ]
    # a part of the lines may like another law as well; it is this one that is fitted again
    if isinstance(evidence.known, DampingLaw):
        trials = [t for t in trials if t[1].law == evidence.known.law]
    least, best = min(trials, key=lambda t: t[0])
    pair = _Rayleigh(2 * float(decay.min()), 2 * float(np.median(decay / omega**2)))
    plain = bic(pair, "alpha_per_s", "beta_s")[0]
    return best if evidence.known is not None or least < plain - LAW_GAIN_BIC else None
