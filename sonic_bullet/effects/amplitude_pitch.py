"""`amplitude-pitch`: at large amplitude a body is stiffer, or softer: the frequency follows the square of the level.

ω(t) = ω (1 + b a²(t))
    [Nayfeh & Mook 1979, eq. 2.3.35: the Duffing oscillator]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.common.axes import TurnsPairs
from sonic_bullet.effects.protocol import Number, Numbers, Owner, Ring, Stage, Traits
from sonic_bullet.records import Array

MEASURES = ("impulse", "velocity", "displacement")


@dataclass(frozen=True)
class AmplitudePitch(TurnsPairs):
    """Rise of the frequency with the level."""

    id: ClassVar[str] = "amplitude-pitch"
    stage: ClassVar[Stage] = Stage.BANK
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "Nayfeh & Mook 1979, section 2.3"
    traits: ClassVar[Traits] = Traits(by_line=True)

    bend: Annotated[float, Number("b, relative rise of frequency per level²", free=1)]
    measure: Annotated[str, Number("of the level, in N·s, m/s or m", known=MEASURES)] = "velocity"
    freq_hz: Annotated[Numbers, Number("(p,), of degenerate modes", least=1e-3, table="twins")] = ()
    turn_rad: Annotated[Numbers, Number("(p,), of their axes, from the mesh's", free=1, table="twins")] = ()

    def apply(self, x: Ring) -> Ring:
        """Add the bend to the modes in the bank."""
        return replace(x, bend=x.bend + self.bend * _per_velocity(x, self.measure) ** 2)


def _per_velocity(x: Ring, measure: str) -> Array:
    """Compute the measure over the ring's own level (peak velocity)."""
    if measure == "displacement":
        return np.asarray(1 / (2 * np.pi * x.freq_hz))
    if measure == "impulse":
        return np.asarray(x.impulse_n_s / np.maximum(x.level, 1e-300))
    return np.ones(len(x.freq_hz))
