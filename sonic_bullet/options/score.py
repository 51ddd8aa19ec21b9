"""Options of `score`. `AnimationOptions` are also keywords of `score_animation`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from sonic_bullet.options.option import Options, group, option, require_option
from sonic_bullet.options.render import (
    DEFAULT_MICROPHONE,
    DEFAULT_SR,
    LevelOptions,
    Point,
    RoomOptions,
    SpaceOptions,
    json_option,
)

if TYPE_CHECKING:
    from sonic_bullet.records.sensors import MicrophoneLike


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnimationOptions(Options):
    """Animation."""

    material: str | None = option(None, "Of what moves and has none.", metavar="M", unset="plastic")
    fps: float | None = option(None, "Frames a second, in place of the file's own.", metavar="F")
    scale: float = option(1.0, "Of all lengths: 0.01 for centimetres.", metavar="X")
    sr: int = option(DEFAULT_SR, "Sample rate in Hz.", metavar="HZ", words=float)
    microphones: MicrophoneLike | None = option(
        None,
        "A microphone in the world, in m, z up, a channel each.",
        "--microphone",
        metavar="X,Y,Z",
        words=tuple[Point, ...],
        unset="{:g},{:g},{:g}; of a scene its own".format(*DEFAULT_MICROPHONE),
    )
    seed: int = option(0, "Seed of the surfaces' roughness.", least=0)
    rules: Sequence[Any] = ()  # `score.export.Rule`s
    tail_db: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreOptions(Options):
    """Outputs."""

    output: str = field(
        metadata=require_option("Sound file, as render has them.", "-o", "--output", metavar="NAME.wav")
    )
    contacts: str | None = option(None, "Also write the contact log, for render and film.", metavar="NAME.npz")
    table: str | None = option(None, "Who is made of what, by name patterns.", "--materials", metavar="TABLE.json")
    json_to: str | None = json_option()
    animation: AnimationOptions = group(AnimationOptions)
    level: LevelOptions = group(LevelOptions)
    space: SpaceOptions = group(SpaceOptions)
    room: RoomOptions = group(RoomOptions)
