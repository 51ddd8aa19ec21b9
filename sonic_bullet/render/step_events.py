"""What happened in one step, by value: strikes as pulses, friction as drives, read off the tables they are made in.

The run time itself does without; a residual, a test or whoever wants to know why something sounds asks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.render.synthesis_state import StepScratch


@dataclass(frozen=True, slots=True, eq=False)
class ForcePulse:
    """One strike. low, high: body indices. start_s: after the start of the step being rendered. length_s: of the pulse.
    flat: half-sine, not Hertz'.

    impulse_n_s (3,): world, on low. modes_low, modes_high (m,): Uᵀj of the whole impulse in N·s/√kg.
    share: of all these, what the pulse hands over (synth.pulse.compliance).
    """

    low: int
    high: int
    start_s: float
    length_s: float
    flat: bool
    impulse_n_s: Array
    modes_low: Array
    modes_high: Array
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A force signal on one pair. force_n (n,): on the lower body along the direction, its negative on the higher.

    Linear between the step's ends: gain0, gain1: Uᵀ on the modes of both bodies, each (m,) a newton; direction0,
    direction1 (3,) on the lower body, world.
    """

    low: int
    high: int
    force_n: Array
    gain0: tuple[Array, Array]
    gain1: tuple[Array, Array]
    direction0: Array
    direction1: Array


def pulses_of(
    scratch: StepScratch, found: int, modes: Array, begin_s: float, after_s: float
) -> list[tuple[float, ForcePulse]]:
    """The step's strikes, each with the time from which its start counts. modes (b,): of each body.

    begin_s, after_s: start of the step and of the one after it, for which a strike may have been found already.
    """
    pulses = []
    for row, push in zip(scratch.pulse[:found], scratch.push[:found], strict=True):
        low, high = (int(body) for body in row["body"])
        one = ForcePulse(
            low, high, float(row["start_s"]), float(row["length_s"]), bool(row["flat"]), row["impulse_n_s"].copy(),
            push[0, : modes[low]].copy(), push[1, : modes[high]].copy(), float(row["share"]),
        )  # fmt: skip
        pulses.append((after_s if row["ahead"] else begin_s, one))
    return pulses


def drives_of(scratch: StepScratch, drives: int, modes: Array, samples: int) -> list[Drive]:
    """The step's friction. modes (b,): of each body; samples: of the step."""
    force = scratch.force[: len(scratch.slot) * samples].reshape(len(scratch.slot), samples)
    found = []
    for d in range(drives):
        low, high = (int(body) for body in scratch.body[d])
        gain0, gain1 = (
            (gain[d, 0, : modes[low]].copy(), gain[d, 1, : modes[high]].copy())
            for gain in (scratch.gain0, scratch.gain1)
        )
        along = scratch.direction0[d].copy(), scratch.direction1[d].copy()
        found.append(Drive(low, high, force[d].copy(), gain0, gain1, *along))
    return found
