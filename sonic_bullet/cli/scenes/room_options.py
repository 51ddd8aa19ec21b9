"""The room that a render is heard in: a box whose walls send sound back.

options -> RoomWish, checked -> ShoeboxRoom of `Wish` -> plan_room -> render (render/room)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.cli.parameters import Numbers
from sonic_bullet.records.errors import FileError

if TYPE_CHECKING:
    from sonic_bullet.records import ShoeboxRoom

OPTIONS = ("room", "absorption", "room_corner")


def room_options(command: Any) -> Any:
    """Add the options of `read_room`."""
    for option in reversed(
        (
            click.option(
                "--room",
                metavar="LxWxH",
                help="Hear it in a box of that size along x, y and z, in m: echoes, then a tail. Extra: room. "
                "[default: free air]",
            ),
            click.option(
                "--absorption",
                metavar="A[,…]",
                help="Fraction of energy that the walls keep, above 0, at most 1: one number, or one an octave from "
                "125 Hz on. [default: 0.2]",
            ),
            click.option(
                "--room-corner",
                type=Numbers("X,Y,Z"),
                help="The room's corner of least x, y, z, in m. [default: the scene in its middle, on its floor]",
            ),
        )
    ):
        command = option(command)
    return command


def read_room(
    room: str | None, absorption: str | None, room_corner: tuple[float, float, float] | None
) -> ShoeboxRoom | None:
    """Read the options; None: free air. Raises FileError where one cannot be, RecordError where no room is such."""
    if room is None:
        for option, given in (("--absorption", absorption), ("--room-corner", room_corner)):
            if given is not None:
                raise FileError(f"{option} is of a room, and none is asked for", "give --room 6x4x3 too")
        return None
    from sonic_bullet.records import ShoeboxRoom

    size = _numbers("--room", room, "x", "give metres along x, y and z, such as 6x4x3")
    if len(size) != 3:
        raise FileError(f"--room {room[:40]} has {len(size)} sides", "give metres along x, y and z, such as 6x4x3")
    how = "give one number above 0 and at most 1, or one an octave: 0.1,0.15,0.2,0.3,0.3,0.4"
    kept = [0.2] if absorption is None else _numbers("--absorption", absorption, ",", how)
    return ShoeboxRoom(size, kept, room_corner)  # type: ignore[arg-type]  # the record makes arrays of them


def _numbers(option: str, text: str, between: str, remedy: str) -> list[float]:
    try:
        return [float(part) for part in text.lower().split(between)]
    except ValueError:
        raise FileError(f"{option} {text[:40]} is not made of numbers", remedy) from None
