"""What is supposed of a case: α, β, the gain, corrections, and the effects in it.

Effects of a stage act in the order in which they were found, those on a sound in that of its path: what rings along
with the body sounds in the room, and both through the chain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from sonic_bullet.effects.protocol import CARRIES, Effect, Mixing, Owner, Stage
from sonic_bullet.records import Array

OWNER_ORDER = tuple(Owner)  # material, object, fixture, striker, room, chain: a sound's


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """α, β and gain σ of the case, and the effects in it. correction: by object, (m,) relative; absent: the mesh's own
    frequencies.

    stretch: ln of what all frequencies are multiplied with, as E/ρ is fitted again beside effects that move modes;
    poisson: ν, where it is; else the baseline's.
    """

    alpha_per_s: float
    beta_s: float
    gain: float
    effects: tuple[Effect, ...] = ()
    correction: dict[str, Array] | None = None
    stretch: float = 0.0
    poisson: float | None = None

    def at(self, stage: Stage, *, fitted: bool = True) -> tuple[Effect, ...]:
        """The effects of a stage; on an object that was not fitted only those that carry over."""
        mine = (e for e in self.effects if e.stage is stage and (fitted or e.owner in CARRIES))
        return tuple(sorted(mine, key=lambda e: OWNER_ORDER.index(e.owner)) if stage is Stage.SOUND else mine)


def moves(h: Hypothesis) -> bool:
    """Whether an effect moves modes, so that lines are paired and corrections learnt anew."""
    return any(e.stage is Stage.MATERIAL or e.traits.moves_modes for e in h.effects)


def moves_itself(h: Hypothesis, effect: Effect) -> bool:
    """Whether an effect moves modes, whatever the others do."""
    return moves(replace(h, effects=(effect,)))


def mixes_neighbours(effect: Effect | type[Effect]) -> bool:
    """Whether modes take on their neighbours' shapes under it."""
    return effect.traits.mixing is Mixing.NEIGHBOURS


def bends(h: Hypothesis) -> bool:
    """Whether an effect acts on ringing modes, so that lines are not what linear ones leave."""
    return bool(h.at(Stage.BANK))


def mixes(h: Hypothesis) -> bool:
    """Whether an effect makes all modes anew out of the old ones."""
    return any(e.traits.mixing is Mixing.ALL for e in h.effects)
