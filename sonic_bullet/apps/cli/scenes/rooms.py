"""The room that a render is heard in: a box whose walls send sound back, or one that was measured.

options, checked -> ShoeboxRoom or RoomResponse -> room_of (path/room) -> render
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sonic_bullet.options.render import DEFAULT_ABSORPTION, RoomOptions
from sonic_bullet.records.errors import FileError

if TYPE_CHECKING:
    from sonic_bullet.records import RoomResponse, ShoeboxRoom


def read_room(options: RoomOptions) -> ShoeboxRoom | RoomResponse | None:
    """Read the options; None: free air. Raises FileError where one cannot be, RecordError where no room is such."""
    room, absorption, room_corner = options.room, options.absorption, options.room_corner
    if room is not None and options.response is not None:
        raise FileError("--room and --response say both what room it is", "give one of both")
    if room is None:
        for option, given in (("--absorption", absorption), ("--room-corner", room_corner)):
            if given is not None:
                raise FileError(f"{option} is of a room, and none is asked for", "give --room 6x4x3 too")
        if options.response is None:
            return None
        from sonic_bullet.files.responses.room_responses import read_room_response

        return read_room_response(options.response)
    from sonic_bullet.records import ShoeboxRoom

    size = _numbers("--room", room, "x", "give metres along x, y and z, such as 6x4x3")
    if len(size) != 3:
        raise FileError(f"--room {room[:40]} has {len(size)} sides", "give metres along x, y and z, such as 6x4x3")
    how = "give one number above 0 and at most 1, or one an octave: 0.1,0.15,0.2,0.3,0.3,0.4"
    kept = [DEFAULT_ABSORPTION] if absorption is None else _numbers("--absorption", absorption, ",", how)
    return ShoeboxRoom(size, kept, room_corner)


def _numbers(option: str, text: str, between: str, remedy: str) -> list[float]:
    try:
        return [float(part) for part in text.lower().split(between)]
    except ValueError:
        raise FileError(f"{option} {text[:40]} is not made of numbers", remedy) from None
