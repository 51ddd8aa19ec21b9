"""Options of `case new`."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.options.fit import SENSORS, guess_option, medium_option, sensor_at_option, sensor_direction_option
from sonic_bullet.options.option import Options, option
from sonic_bullet.options.render import Point


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseOptions(Options):
    """Recordings of one thing."""

    recordings: tuple[str, ...] = option(
        (),
        "The strikes' recordings, or a .uff or .unv file of responses.",
        metavar="A.wav [B.wav]...",
        unset="all in the folder",
    )
    split: bool = option(False, "Cut recordings of several strikes into takes of one each.")
    picture: str | None = option(None, "With --split, also draw where each recording is cut.", metavar="NAME.png")
    hold_out: int | None = option(None, "Hold every N-th take out of the fit, to judge it by.", metavar="N")
    force_channel: int | None = option(None, "Channel, from 0, that is the hammer's force, not sound.", metavar="K")
    force_newton: float | None = option(None, "Newton at its full scale, which gives impulses in N·s.", metavar="N")
    mesh: str | None = option(None, "Mesh of what was struck.", metavar="M")
    units: str = option("m", "Of the mesh.", choices=("m", "cm", "mm"))
    material: str | None = guess_option()
    sensor: str = option("pressure", "What was recorded: plain sum of modes, a microphone, a surface.", choices=SENSORS)
    sensor_at: Point | None = sensor_at_option()
    sensor_direction: Point | None = sensor_direction_option()
    medium: str | None = medium_option()
