"""Options of `play`."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.options.option import Options, group, option
from sonic_bullet.options.render import SceneOptions, SpaceOptions, json_option

FULL_SCALE_PA = 20.0
"""120 dB SPL: of the package's scenes the table-top and the fall clip less than one sample in a thousand; rolling, the
softest, peaks 46 dB below.
"""
AHEAD_S = 0.018
"""Delay of a step before sound stops. With three steps of 1/240 s, a block of 5 ms and a card that holds 12 ms a
step sounds after 48 ms.
"""


@dataclass(frozen=True, slots=True)
class CardOptions(Options):
    """Sound card."""

    device: str | int | None = option(
        None,
        "Name or number of a sound card; 'null' for none, clocked in real time.",
        metavar="D",
        words=str,
        unset="the system's own",
    )
    full_scale_pa: float = option(
        FULL_SCALE_PA,
        "Pressure in Pa that is full scale: less is louder. What is beyond is clipped and counted.",
        "--full-scale",
        metavar="PA",
    )
    ahead_s: float = option(AHEAD_S, "How much sound waits, in s: how late a step may be.", "--ahead", metavar="S")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayOptions(Options):
    """Outputs."""

    card: CardOptions = group(CardOptions)
    scene: SceneOptions = group(SceneOptions)
    space: SpaceOptions = group(SpaceOptions)
    json_to: str | None = json_option()
