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

from sonic_bullet.effects.protocol import Effect, Evidence, Number, Owner, Stage, Traits, ascending
from sonic_bullet.records import Array, Material, ModalModel

LAWS = ("constant-loss", "power", "relaxation")
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

    law: Annotated[str, Number("which", known=LAWS)]
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
        y = np.log(decay)

        def cost(model: Array) -> Array:
            return np.asarray((np.log(np.maximum(model, 1e-9)) - y) / sd)

        trials = [(bic, cls(*values)) for bic, values in _fits(omega, cost)]
        # a part of the lines may like another law as well; it is this one that is fitted again
        if isinstance(evidence.known, cls):
            trials = [t for t in trials if t[1].law == evidence.known.law]
        bic, best = min(trials, key=lambda t: t[0])
        return (
            best
            if evidence.known is not None
            or bic < _least(omega, cost, _rayleigh, [_start(omega, decay)], 2)[0] - LAW_SEARCH.better
            else None
        )


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


def _rayleigh(p: Array, w: Array) -> Array:
    """Compute Rayleigh's decays at ω (k,) for p = (ln α, ln β)."""
    return np.asarray(0.5 * (np.exp(p[0]) + np.exp(p[1]) * w**2))


def _start(omega: Array, decay: Array) -> Array:
    """Estimate (ln α, ln β) to start the fit of Rayleigh's law from."""
    return np.array([np.log(2 * decay.min()), np.log(2 * np.median(decay / omega**2))])


def _fits(omega: Array, cost: Any) -> list[tuple[float, tuple[str, float, float, float, float]]]:
    """Fit each law: (BIC, fields)."""
    middle = np.log(np.median(omega))

    def power(p: Array, w: Array) -> Array:
        return np.asarray(0.5 * np.exp(p[0]) * OMEGA_1 * (w / OMEGA_1) ** p[1])

    def relax(p: Array, w: Array) -> Array:
        x = w * np.exp(p[2])
        return np.asarray(0.5 * w * (np.exp(p[0]) + np.exp(p[1]) * x / (1 + x * x)))

    loss, eta = _least(omega, cost, lambda p, w: 0.5 * np.exp(p[0]) * w, [np.array([-7.0])], 1)
    bent, pair = _least(omega, cost, power, [np.array([eta[0], s]) for s in (0.5, 1.0, 1.6)], 2)
    peak, three = _least(
        omega, cost, relax, [np.array([eta[0] - 1.5, eta[0] + 1, -middle + s]) for s in (-2.5, -1.0, 0.0, 1.0, 2.5)], 3
    )
    return [
        (loss, ("constant-loss", float(np.exp(eta[0])), 1.0, 0.0, 0.0)),
        (bent, ("power", float(np.exp(pair[0])), float(pair[1]), 0.0, 0.0)),
        (peak, ("relaxation", float(np.exp(three[0])), 1.0, float(np.exp(three[1])), float(np.exp(three[2])))),
    ]


def _least(omega: Array, cost: Any, law: Any, starts: list[Array], count: int) -> tuple[float, Array]:
    """Fit a law under Cauchy's loss from several starts: (BIC, parameters)."""
    from scipy.optimize import least_squares

    found = [
        least_squares(lambda p: cost(law(p, omega)), start, loss="cauchy", f_scale=2.0, bounds=(-40, 40))
        for start in starts
    ]
    best = min(found, key=lambda f: f.cost)
    return float(2 * best.cost + count * np.log(len(omega))), best.x
