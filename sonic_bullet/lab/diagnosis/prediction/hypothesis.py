"""Hypothesis on a case: α, β, the gain, corrections, and effects.

Effects of a stage act in the order in which they were found, those on a sound in that of its path: another resonator's
sound is in the room, and both go through the chain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sonic_bullet.effects.protocol import CARRIES, Effect, Mixing, Owner, Stage
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A state of the model of a case.

    Attributes
    ----------
    alpha_per_s, beta_s, gain : float
        α, β and σ of the case.
    effects : tuple of Effect
        In the order in which they were found.
    correction : dict of (m,)
        By object, relative; absent: the mesh's own frequencies.
    stretch : float
        ln of the factor of all frequencies, as E/ρ is fitted again with effects that move modes.
    poisson : float
        ν, where it is fitted again; else the baseline's.
    air : float
        What the modes lose to the air over what their bodies' shapes say, `Struck.radiated_per_s`; 0 without air.
    """

    alpha_per_s: float
    beta_s: float
    gain: float
    effects: tuple[Effect, ...] = ()
    correction: dict[str, Array] | None = None
    stretch: float = 0.0
    poisson: float | None = None
    air: float = 0.0

    def at(self, stage: Stage, *, fitted: bool = True) -> tuple[Effect, ...]:
        """Return the effects of a stage; for an object that was not fitted only those that carry over."""
        mine = (e for e in self.effects if e.stage is stage and (fitted or carries(e)))
        return tuple(sorted(mine, key=lambda e: tuple(Owner).index(e.owner)) if stage is Stage.SOUND else mine)


def carries(effect: Effect) -> bool:
    """Decide whether an effect acts on other objects of the material: the medium's does, by each object's own shape."""
    return effect.owner in CARRIES or effect.traits.needs_unknown_medium


def moves(h: Hypothesis) -> bool:
    """Decide whether an effect moves modes, so that lines are paired and corrections learnt anew."""
    return any(e.stage is Stage.MATERIAL or e.traits.moves_modes for e in h.effects)


def moves_itself(h: Hypothesis, effect: Effect) -> bool:
    """Decide whether one effect moves modes, whatever the others do."""
    return moves(replace(h, effects=(effect,)))


def mixes_neighbours(effect: Effect | type[Effect]) -> bool:
    """Decide whether modes take on their neighbours' shapes under an effect."""
    return effect.traits.mixing is Mixing.NEIGHBOURS


def bends(h: Hypothesis) -> bool:
    """Decide whether an effect acts in the bank, so that lines are not those of linear modes."""
    return bool(h.at(Stage.BANK))


def mixes(h: Hypothesis) -> bool:
    """Decide whether an effect makes each mode a sum of all old ones."""
    return any(e.traits.mixing is Mixing.ALL for e in h.effects)
