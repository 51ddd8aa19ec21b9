"""A room around a scene: what its walls send back, added to the sound that comes straight.

    ShoeboxRoom + log -> room_fit: where it lies, and whether all is in it
        -> image_microphones: a microphone mirrored at a wall hears what the wall sends back; each body from its own
           place, in motion, by the run time's own path (reciprocity [Allen & Berkley, JASA 65, 1979, eq. 8-10])
        -> beyond them late_field: four microphones on a sphere, whose sound decays as noise
        -> room_plan: sensors = own, images, far ones; mixing = what of them is summed at once
        -> render (Setup.mixing) -> rows: own and flat early sound, early sound by reflections, far sound
        -> room_convolution: rows through their filters -> the log's own channels

    RoomResponse + log -> measured_room: what follows the direct sound, over it -> RoomPlan without further microphones

No level is chosen: images have 1/r and what walls keep, the late field the energy of the images that it stands for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sonic_bullet.records import RoomResponse, ShoeboxRoom
from sonic_bullet.records.coerce import as_kind

if TYPE_CHECKING:
    from sonic_bullet.engine.path.room.room_plan import RoomPlan
    from sonic_bullet.files.contact_log import ContactLog


def room_of(room: object, log: ContactLog) -> RoomPlan:
    """Plan a room of either kind for a log.

    Raises RecordError where it is none, SceneError where it does not go with the log, AudioError where pyroomacoustics
    is missing.
    """
    if isinstance(room, RoomResponse):
        from sonic_bullet.engine.path.room.measured_room import plan_response

        return plan_response(room, log)
    from sonic_bullet.engine.path.room.room_plan import plan_room

    remedy = "give a ShoeboxRoom, such as ShoeboxRoom([6, 4, 3]), or a RoomResponse"
    return plan_room(as_kind(room, ShoeboxRoom, "room", remedy), log)
