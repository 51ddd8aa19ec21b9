"""`damping-law`: a material's loss that is not Rayleigh's.

constant-loss  d = ηω/2                                                   [Cremer, Heckl, Petersson 2005, ch. 3.2]
power          d = ½ η ω₁ (ω/ω₁)^p,  ω₁ = 2π·1000/s
    (a loss factor that goes as a power of frequency)
with a floor   T60 = (ln 1000)/d + T₀
    (real bodies of ceramic and iron level off: docs/measured/damping.md; a constant loss or a power)
relaxation     d = ½ ω [η + Δ ωτ/(1 + (ωτ)²)]
    [Zener 1948, ch. 5; Nowick & Berry 1972, eq. 3.5-2]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Effect, Number, Owner, Stage, Traits, sort_modes
from sonic_bullet.records import Array, Material, ModalModel

OMEGA_1 = 2000 * np.pi


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
        return sort_modes(x, freq, decay)


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
