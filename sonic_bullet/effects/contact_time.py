"""`contact-time`: a strike is a force pulse of finite length, so high modes take less of it.

A_k -> A_k F̂(f_k τ)/F̂(0),   τ = τ₀ (J/J₀)^{−1/5}   (Hertz), or τ₀ whatever J (flat faces)
    [Hertz 1882; Hunter 1957; Johnson 1985, ch. 11]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from sonic_bullet.effects.protocol import Effect, Impact, Number, Owner, Stage

HERTZ = -0.2
FORMS = ("half-sine", "hertz", "raised-cosine")


@dataclass(frozen=True)
class ContactTime(Effect):
    """duration of the contact as a function of the strike's impulse."""

    id: ClassVar[str] = "contact-time"
    stage: ClassVar[Stage] = Stage.FORCE
    owner: ClassVar[Owner] = Owner.STRIKER
    reference: ClassVar[str] = "Hunter 1957; Johnson 1985, section 11.4"

    tau_s: Annotated[float, Number("duration at the impulse `impulse_n_s`", least=0.0, free=1)]
    impulse_n_s: Annotated[float, Number("reference impulse", least=0.0, key="J0_n_s")]
    exponent: Annotated[float, Number("of the impulse: the duration goes as impulse^exponent", free=1)] = HERTZ
    pulse: Annotated[str, Number("form of the force", known=FORMS)] = "half-sine"

    def duration_s(self, impulse_n_s: float) -> float:
        """Compute the duration at an impulse."""
        return float(self.tau_s * (impulse_n_s / self.impulse_n_s) ** self.exponent)

    def apply(self, x: Impact) -> Impact:
        """Set the impact's pulse and its duration."""
        return replace(x, tau_s=self.duration_s(x.impulse_n_s), pulse=self.pulse)
