"""`damping-law`: a material's loss that is not Rayleigh's.

    constant-loss  d = ηω/2                                                   [Cremer, Heckl, Petersson 2005, ch. 3.2]
    power          d = ½ η ω₁ (ω/ω₁)^p,  ω₁ = 2π·1000/s
        (a loss factor that goes as a power of frequency)
    with a floor   T60 = (ln 1000)/d + T₀
        (real bodies of ceramic and iron level off: docs/measured/damping.md; a constant loss or a power)
    relaxation     d = ½ ω [η + Δ ωτ/(1 + (ωτ)²)]
        [Zener 1948, ch. 5; Nowick & Berry 1972, eq. 3.5-2]

Identified by the decays of all modes of every object: smooth in frequency, the same for all strikes and sizes. The law
with the least Bayes information criterion is proposed, where it is better than Rayleigh's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from sonic_bullet.effects.common.fitting import fitted
from sonic_bullet.effects.protocol import Effect, Evidence, Number, Owner, Stage, Traits, ascending
from sonic_bullet.records import Array, Material, ModalModel

OMEGA_1 = 2000 * np.pi


class _LawSearch(NamedTuple):
    """Numbers of the search for a law."""

    better: float = 6.0  # in BIC, than Rayleigh's law
    fewest_lines: int = 5  # lines: to look for a law, and to fit it again to a part of them
    again: int = 4


LAW_SEARCH = _LawSearch()


@dataclass(frozen=True)
class DampingLaw(Effect):
    """Loss of a material as a function of frequency."""

    id: ClassVar[str] = "damping-law"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.MATERIAL
    reference: ClassVar[str] = "Cremer, Heckl, Petersson 2005, ch. 3; Nowick & Berry 1972, ch. 3"
    traits: ClassVar[Traits] = Traits(replaces_rayleigh=True)

    law: Annotated[str, Number("which", known=("constant-loss", "power", "relaxation"))]
    eta: Annotated[float, Number("loss factor η (at 1 kHz for a power)", least=0.0, free=1)]
    exponent: Annotated[float, Number("p, of the decay as a power of ω", free=1, of="exponent")] = 1.0
    strength: Annotated[float, Number("Δ of the relaxation", least=0.0, free=1, of="strength")] = 0.0
    tau_s: Annotated[float, Number("τ of the relaxation", least=0.0, free=1, of="tau_s")] = 0.0
    floor_s: Annotated[float, Number("T₀, below which T60 does not fall", least=0.0, free=1, of="floor_s")] = 0.0

    def decay_per_s(self, omega_per_s: Array) -> Array:
        """Compute the decays (k,) at undamped ω (k,) in rad/s."""
        w = np.asarray(omega_per_s, float)
        if self.law == "power":
            decay = np.asarray(0.5 * self.eta * OMEGA_1 * (w / OMEGA_1) ** self.exponent)
        else:
            decay = np.asarray(0.5 * w * (self.eta + self.strength * w * self.tau_s / (1 + (w * self.tau_s) ** 2)))
        return decay / (1 + decay * self.floor_s / np.log(1000)) if self.floor_s else decay

    def apply(self, x: ModalModel) -> ModalModel:
        """Set the decays of a body's modes by the law."""
        if self.eta == 0 and self.strength == 0:  # no law at all: the material's own stays
            return x
        omega = np.sqrt(x.omega0_squared_per_s2)
        decay = np.minimum(self.decay_per_s(omega), 0.99 * omega)
        freq = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
        return ascending(x, freq, decay)

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        """Fit each law to the decays of all lines; None where no law is better than Rayleigh's."""
        taken, most = 0.1, 0.95  # of what other effects take of a line's decay: how unsure it is; of the decay, at most
        scatter = 0.02  # of a decay about its law, relative, that no law is asked to explain
        omega = np.concatenate([h.omega for h in evidence.observed])
        decay = np.concatenate([h.decay_per_s for h in evidence.observed])
        spread = np.concatenate([h.decay_sd_per_s for h in evidence.observed])
        rayleigh = 0.5 * (evidence.alpha_per_s + evidence.beta_s * omega**2)
        # what effects found so far take
        extra = np.clip(
            np.concatenate([h.expected_decay_per_s for h in evidence.observed]) - rayleigh, 0.0, most * decay
        )
        decay, spread = decay - extra, np.hypot(spread, taken * extra)
        good = np.isfinite(decay) & (decay > 0) & ~np.isposinf(spread)  # in a room some lines tell no decay
        if good.sum() < (LAW_SEARCH.fewest_lines if evidence.known is None else LAW_SEARCH.again):
            return None
        omega, decay = omega[good], decay[good]
        sd = np.hypot(np.nan_to_num(spread[good] / decay, nan=0.05), scatter)
        per = np.log(len(omega))

        def residual(law: Any) -> Array:
            return np.asarray((np.log(np.maximum(law.decay_per_s(omega), 1e-9)) - np.log(decay)) / sd)

        def bic(start: Any, *free: str) -> tuple[float, Any]:
            cost, law = fitted(start, free, residual)
            return cost + len(free) * per, law

        flat = bic(cls("constant-loss", float(np.exp(-7.0))), "eta")
        eta, tau = flat[1].eta, 1 / float(np.median(omega))
        trials = [flat, *(bic(cls("power", eta, p), "eta", "exponent") for p in (0.5, 1.0, 1.6))]
        trials += [
            bic(cls("relaxation", eta * np.exp(-1.5), 1.0, eta * np.e, tau * np.exp(s)), "eta", "strength", "tau_s")
            for s in (-2.5, -1.0, 0.0, 1.0, 2.5)
        ]
        # a part of the lines may like another law as well; it is this one that is fitted again
        if isinstance(evidence.known, cls):
            trials = [t for t in trials if t[1].law == evidence.known.law]
        least, best = min(trials, key=lambda t: t[0])
        pair = _Rayleigh(2 * float(decay.min()), 2 * float(np.median(decay / omega**2)))
        plain = bic(pair, "alpha_per_s", "beta_s")[0]
        return best if evidence.known is not None or least < plain - LAW_SEARCH.better else None


def own_decay_per_s(material: Material, lambda_per_s2: Array) -> Array:
    """Compute a material's own decays (k,) at eigenvalues λ (k,): its law's, or Rayleigh's without one, 0 of neither.

    Without what a body radiates, and without what depends on its shape.
    """
    square = np.asarray(lambda_per_s2, float)
    alpha_per_s, beta_s = (0.0 if one is None else one for one in (material.alpha_per_s, material.beta_s))
    found = np.asarray(0.5 * (alpha_per_s + beta_s * square))
    for law in (effect for effect in material.effects if isinstance(effect, DampingLaw)):
        found = law.decay_per_s(np.sqrt(np.maximum(square, 0.0)))
    return found


@dataclass(frozen=True)
class _Rayleigh:
    """Rayleigh's law."""

    alpha_per_s: float
    beta_s: float

    def decay_per_s(self, omega_per_s: Array) -> Array:
        """Compute the decays (k,) at ω (k,)."""
        return 0.5 * (self.alpha_per_s + self.beta_s * omega_per_s**2)
