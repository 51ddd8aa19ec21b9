"""`amplitude-damping`: friction and plasticity take more of a loud mode than of a soft one.

    ȧ = −d a (1 + (c a)^p)      ->      (a₀/a(t))^p = (1 + (c a₀)^p) e^{pdt} − (c a₀)^p
        [Adhikari 2013, ch. 1; equivalent damping: Nayfeh & Mook 1979, § 3.3]

p = 1: drag that goes with velocity²; p = 2: with velocity³. Identified by the envelopes of single modes, or degenerate
modes: early decay faster than late, the more so the harder the strike; d is the mode's, c common to all, and degenerate
modes have the axes that the envelopes give (axes.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.amplitude_pitch import MEASURES, _per_velocity
from sonic_bullet.effects.common.axes import TurnsPairs
from sonic_bullet.effects.protocol import BaselineChange, ChangesBaseline, Number, Numbers, Owner, Ring, Stage, Traits

POWERS = (1.0, 2.0)


@dataclass(frozen=True)
class AmplitudeDamping(TurnsPairs, ChangesBaseline):
    """Decay that grows with the level, and what was fitted with it."""

    id: ClassVar[str] = "amplitude-damping"
    stage: ClassVar[Stage] = Stage.BANK
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "Nayfeh & Mook 1979, section 3.3"
    traits: ClassVar[Traits] = Traits(by_line=True)

    damping_growth: Annotated[float, Number("c, 1/level that doubles the decay", least=0.0, free=1, key="choke")]
    measure: Annotated[str, Number("of the level", known=MEASURES)] = "velocity"
    alpha_per_s: Annotated[float, Number("by decays at low level", shown=False)] = float("nan")
    beta_s: Annotated[float, Number("by decays at low level", shown=False)] = float("nan")
    louder: Annotated[float, Number("modes at the onset over the linear model's", least=1e-6, shown=False)] = 1.0
    freq_hz: Annotated[Numbers, Number("(p,), of degenerate modes", least=1e-3, table="twins")] = ()
    turn_rad: Annotated[Numbers, Number("(p,), of their axes, from the mesh's", free=1, table="twins")] = ()
    power: Annotated[float, Number("p: other powers have no closed form", known=POWERS, free=1)] = 1.0

    def apply(self, x: Ring) -> Ring:
        """Add the damping growth to the modes in the bank."""
        return replace(
            x,
            damping_growth=x.damping_growth + self.damping_growth * _per_velocity(x, self.measure),
            damping_growth_power=self.power,
        )

    def baseline_change(self) -> BaselineChange:
        """Return the material's α and β by the decays at low level, and the gain at the onset."""
        if not np.isfinite(self.alpha_per_s):
            return BaselineChange(onset_gain=self.louder)
        return BaselineChange(self.alpha_per_s, self.beta_s, onset_gain=self.louder)
