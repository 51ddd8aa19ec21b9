"""The room that a render is heard in: a box whose walls send sound back, or one that was measured.

options, checked -> ShoeboxRoom or RoomResponse of `Wish` -> room_of (path/room) -> render
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.apps.cli.parameters import Numbers
from sonic_bullet.records.errors import FileError

if TYPE_CHECKING:
    from sonic_bullet.records import RoomResponse, ShoeboxRoom

OPTIONS = ("room", "absorption", "room_corner", "response")


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
            click.option(
                "--response",
                metavar="FILE.wav",
                help="Hear it in the room of a measured impulse response, of one channel, or one a microphone; direct "
                "sound stays as it is.",
            ),
        )
    ):
        command = option(command)
    return command


def read_room(
    room: str | None,
    absorption: str | None,
    room_corner: tuple[float, float, float] | None,
    response: str | None,
) -> ShoeboxRoom | RoomResponse | None:
    """Read the options; None: free air. Raises FileError where one cannot be, RecordError where no room is such."""
    if room is not None and response is not None:
        raise FileError("--room and --response say both what room it is", "give one of both")
    if room is None:
        for option, given in (("--absorption", absorption), ("--room-corner", room_corner)):
            if given is not None:
                raise FileError(f"{option} is of a room, and none is asked for", "give --room 6x4x3 too")
        if response is None:
            return None
        from sonic_bullet.files.responses.room_responses import read_room_response

        return read_room_response(response)
    from sonic_bullet.records import ShoeboxRoom

    size = _numbers("--room", room, "x", "give metres along x, y and z, such as 6x4x3")
    if len(size) != 3:
        raise FileError(f"--room {room[:40]} has {len(size)} sides", "give metres along x, y and z, such as 6x4x3")
    how = "give one number above 0 and at most 1, or one an octave: 0.1,0.15,0.2,0.3,0.3,0.4"
    kept = [0.2] if absorption is None else _numbers("--absorption", absorption, ",", how)
    return ShoeboxRoom(size, kept, room_corner)


def _numbers(option: str, text: str, between: str, remedy: str) -> list[float]:
    try:
        return [float(part) for part in text.lower().split(between)]
    except ValueError:
        raise FileError(f"{option} {text[:40]} is not made of numbers", remedy) from None
