"""Where a room lies, and whether all that sounds and hears is in it.

poses of the log, at most 1000 of them, and hulls of bodies -> box of each body over the run
    -> no corner given: middle of all boxes and microphones above the middle of the floor, the lowest on it
    -> each box within the walls, or an error that names what is not
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Microphone, ShoeboxRoom
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.simulated import with_body_id


class RoomPlace(NamedTuple):
    """Place of a room: corner_m (3,); centre_m (3,) of what sounds, reach_m: how far a body goes from it."""

    corner_m: Array
    centre_m: Array
    reach_m: float


def place_room(room: ShoeboxRoom, log: ContactLog, microphones: Sequence[Microphone]) -> RoomPlace:
    """Place a room round a log. Raises SceneError where it is smaller than what is in it."""
    within_m = 1e-6
    named: list[tuple[str, Array]] = []
    for index, box in sorted(body_boxes(log).items()):
        body = log.bodies[index]
        named.append((with_body_id(body.name, body.body_id), box))
    sounding = np.array([box for _, box in named]).reshape(-1, 2, 3)
    for c, one in enumerate(microphones):
        if one.body_id is not None:
            raise SceneError(
                f"microphone {c} moves with a body, which has no image in a wall",
                "give --room microphones that stand or follow a path",
            )
        place = one.position_m[None] if one.path is None else one.path.position_m
        named.append((f"microphone {c}", np.array([place.min(axis=0), place.max(axis=0)])))
    boxes = np.array([box for _, box in named]).reshape(-1, 2, 3)
    least, most = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    corner = room.corner_m
    if corner is None:
        middle = (least + most) / 2 - room.size_m / 2
        corner = np.array([middle[0], middle[1], least[2]])
    for name, (low, high) in named:
        out = np.maximum(corner - low, high - corner - room.size_m)
        if out.max() > within_m:
            size = " x ".join(f"{x:g}" for x in room.size_m)
            raise SceneError(
                f"{name} is up to {out.max():.3g} m outside the room of {size} m along {'xyz'[int(out.argmax())]}",
                "give a larger --room, or another --room-corner",
            )
    sources = sounding if len(sounding) else boxes
    low, high = sources[:, 0].min(axis=0), sources[:, 1].max(axis=0)
    return RoomPlace(np.asarray(corner), (low + high) / 2, float(np.linalg.norm(high - low)) / 2)


def body_boxes(log: ContactLog) -> dict[int, Array]:
    """Find the box (2, 3) that each body that sounds stays in, by its index in the log."""
    from scipy.spatial.transform import Rotation

    hulls = {i: _hull(body.model.vertex_m) for i, body in enumerate(log.bodies) if body.model is not None}
    boxes: dict[int, Array] = {}
    moments = 1000  # at most so many steps are looked at: of 4 s at 240 Hz every one
    every = max(1, len(log.steps) // moments)
    first = 0
    for block in log.blocks():
        counts = block.counts("pose")
        step = first + np.repeat(np.arange(len(counts)), counts)
        first += len(counts)
        seen = block.pose[step % every == 0]
        for index in np.unique(seen["body"]).tolist():
            if index not in hulls:
                continue
            here = seen[seen["body"] == index]
            turned = Rotation.from_quat(here["quaternion_xyzw"]).as_matrix() @ hulls[index].T  # (k, 3, v)
            low = (here["position_m"] + turned.min(axis=2)).min(axis=0)
            high = (here["position_m"] + turned.max(axis=2)).max(axis=0)
            if index in boxes:
                low, high = np.minimum(low, boxes[index][0]), np.maximum(high, boxes[index][1])
            boxes[index] = np.array([low, high])
    return boxes


def _hull(vertex_m: Array) -> Array:
    """Find the vertices that the hull of others (v, 3) has; all of a flat one."""
    from scipy.spatial import ConvexHull, QhullError

    if len(vertex_m) < 8:
        return vertex_m
    try:
        return np.asarray(vertex_m[ConvexHull(vertex_m).vertices])
    except QhullError:
        return vertex_m
