"""Arguments of the calls that made bodies, which PyBullet does not always keep.

It forgets the shape of bodies in maximal coordinates, triangle meshes given by their vertices, and its search paths.

    createCollisionShape -> its arguments -> createMultiBody, loadURDF -> GivenBody -> made anew in reduced ones

The body is made anew by the same call in a world of its own, where PyBullet can be queried. Users of a stored call
compare the bounding boxes first: an id may have been reused unobserved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pybullet
from pybullet import DIRECT, connect, createCollisionShape, createMultiBody, disconnect, loadURDF

from sonic_bullet.records import Array
from sonic_bullet.simulators.quiet import quiet_stdout

MAKERS = {
    "createCollisionShape": ("shapeType", "radius", "halfExtents", "height", "fileName", "meshScale", "planeNormal"),
    "createMultiBody": (
        "baseMass",
        "baseCollisionShapeIndex",
        "baseVisualShapeIndex",
        "basePosition",
        "baseOrientation",
        "baseInertialFramePosition",
        "baseInertialFrameOrientation",
    ),
    "loadURDF": ("fileName", "basePosition", "baseOrientation", "useMaximalCoordinates", "useFixedBase", "flags"),
    "loadMJCF": ("mjcfFileName",),
    "loadSDF": ("sdfFileName",),
    "loadBullet": ("bulletFileName",),
    "setAdditionalSearchPath": ("path",),
}
"""Calls that determine a body's shape, and their positional arguments."""
ENDERS = {"removeBody": ("bodyUniqueId",), "resetSimulation": ("flags",)}
"""Calls after which ids may be reused."""

# tolerances of the boxes of one shape: Bullet's margins of 1 mm, and its rounding
SAME_SIZE_M = 2e-3
SAME_SIZE_SHARE = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class GivenBody:
    """The call that made a body. shape: arguments of createCollisionShape, where that was called for it."""

    call: str
    arguments: Mapping[str, Any]
    shape: Mapping[str, Any] | None = None


@dataclass(slots=True)
class GivenBodies:
    """All calls stored of one client. whose: returns the client's object, None once it was dropped."""

    whose: Callable[[], object]
    shapes: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    bodies: dict[int, GivenBody] = field(default_factory=dict)


_of_client: dict[int, GivenBodies] = {}
search_folders: list[str] = []
"""PyBullet's search paths for files: it has one such list for the process, and does not report it."""


def begin(client_id: int) -> None:
    """Drop what was stored of a client id: a client was opened, closed or emptied."""
    _of_client.pop(client_id, None)


def given_body(client_id: int, body: int) -> GivenBody | None:
    """Return the call that made a body, where it is known."""
    found = _of_client.get(client_id)
    return None if found is None or found.whose() is None else found.bodies.get(body)


def remember_arguments(
    name: str, below: Callable[..., Any], client_id: int = 0, whose: Callable[[], object] = lambda: True
) -> Callable[..., Any]:
    """Wrap the function of that name (of MAKERS or ENDERS) to store its arguments.

    Parameters
    ----------
    client_id
        Of calls without one.
    whose
        Returns the client's object, where it has one.
    """

    def remembered(*args: Any, **kwargs: Any) -> Any:
        made = below(*args, **kwargs)
        given = {**dict(zip({**MAKERS, **ENDERS}[name], args, strict=False)), **kwargs}
        _remember(int(given.pop("physicsClientId", client_id)), name, given, made, whose)
        return made

    return remembered


def _remember(client_id: int, name: str, given: dict[str, Any], made: Any, whose: Callable[[], object]) -> None:
    if name == "setAdditionalSearchPath":
        search_folders.append(str(given.get("path", "")))
        return
    if name == "resetSimulation" or _of_client.get(client_id, GivenBodies(whose)).whose() is not whose():
        begin(client_id)
    ours = _of_client.setdefault(client_id, GivenBodies(whose))
    if name == "removeBody":
        ours.bodies.pop(given.get("bodyUniqueId", -1), None)
    elif name == "createCollisionShape":
        ours.shapes[made] = given
    elif name in MAKERS:
        shape = ours.shapes.get(given.get("baseCollisionShapeIndex", -1)) if name == "createMultiBody" else None
        for body in made if isinstance(made, tuple) else (made,):
            ours.bodies[body] = GivenBody(name, given, shape)


def is_maximal(client_id: int, body: int) -> bool:
    """Tell whether an existing body is in maximal coordinates."""
    rigid_body = 1  # Last entry but one of getDynamicsInfo for a body in maximal coordinates
    return bool(pybullet.getDynamicsInfo(body, -1, physicsClientId=client_id)[10] == rigid_body)


_kept: ContextVar[dict[str, tuple[int, int]] | None] = ContextVar("kept", default=None)  # call -> client, its body


@contextmanager
def kept_reduced_bodies() -> Iterator[None]:
    """Make bodies that one call makes in reduced coordinates but once within the block (`reduced_body`).

    A world of its own takes milliseconds, a body is asked for ten times, and marbles come by the thousand.
    """
    if _kept.get() is not None:
        yield
        return
    token = _kept.set({})
    try:
        yield
    finally:
        for alone, _ in (_kept.get() or {}).values():
            _end(alone)
        _kept.reset(token)


@contextmanager
def reduced_body(client_id: int, body: int) -> Iterator[tuple[int, int] | None]:
    """Make the same base in reduced coordinates, alone in a world; yield client and body id.

    None where the call is not known, or its result has another bounding box than the body.
    """
    # Arguments that determine the shape of a body in its own frame
    of_shape = {
        "createMultiBody": ("baseInertialFramePosition", "baseInertialFrameOrientation"),
        "loadURDF": ("fileName", "useFixedBase", "flags", "globalScaling"),
    }
    given = given_body(client_id, body)
    if given is None or given.call not in of_shape or (given.call == "createMultiBody" and given.shape is None):
        yield None
        return
    how = {name: given.arguments[name] for name in of_shape[given.call] if name in given.arguments}
    kept, call = _kept.get(), repr((given.shape if given.call == "createMultiBody" else None, how))
    other = kept.get(call) if kept is not None else None
    if other is None:
        other = _made_alone(given.shape if given.call == "createMultiBody" else None, how)
        if kept is not None:
            most_worlds = 8  # PyBullet has room for a thousand; scenes of maximal coordinates have few kinds of bodies
            if len(kept) == most_worlds:
                _end(kept.pop(next(iter(kept)))[0])
            kept[call] = other
    try:
        yield other if other[1] >= 0 and _one_box((client_id, body), other) else None
    finally:
        if kept is None:
            _end(other[0])


def _made_alone(shape: Mapping[str, Any] | None, how: Mapping[str, Any]) -> tuple[int, int]:
    """Make a body of a shape, or load one, alone in a world; return its client and its id, -1 where there is none."""
    with quiet_stdout():
        alone = int(connect(DIRECT))
    try:
        if shape is not None:
            made = createMultiBody(
                1.0, createCollisionShape(**shape, physicsClientId=alone), **how, physicsClientId=alone
            )
        else:
            made = loadURDF(**how, physicsClientId=alone)
    except (pybullet.error, TypeError):
        made = -1
    return alone, int(made)


def _end(alone: int) -> None:
    if alone >= 0:
        disconnect(alone)


def _one_box(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Tell whether two bodies have the same bounding box, the second moved to the pose of the first."""
    pose = pybullet.getBasePositionAndOrientation(one[1], physicsClientId=one[0])
    pybullet.resetBasePositionAndOrientation(other[1], *pose, physicsClientId=other[0])
    box, same = (np.array(pybullet.getAABB(body, -1, physicsClientId=client)) for client, body in (one, other))
    return bool(np.abs(box - same).max() < SAME_SIZE_M + SAME_SIZE_SHARE * float(np.ptp(box, axis=0).max()))


def given_triangles(client_id: int, body: int) -> tuple[Array, Array] | None:
    """Return vertices (v, 3) in the body frame and faces (f, 3) of a base whose shape was given by them."""
    given = given_body(client_id, body)
    shape = given.shape if given is not None else None
    if given is None or shape is None or not shape.get("vertices") or not shape.get("indices"):
        return None
    vertex = np.array(shape["vertices"], float).reshape(-1, 3) * np.array(shape.get("meshScale", (1.0, 1.0, 1.0)))
    face = np.array(shape["indices"], np.int64).reshape(-1, 3)
    place = shape.get("collisionFramePosition", (0, 0, 0)), shape.get("collisionFrameOrientation", (0, 0, 0, 1))
    frame = (
        given.arguments.get("baseInertialFramePosition", (0, 0, 0)),
        given.arguments.get("baseInertialFrameOrientation", (0, 0, 0, 1)),
    )
    position, quaternion = pybullet.multiplyTransforms(*pybullet.invertTransform(*frame), *place)
    turn = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
    return vertex @ turn.T + position, face
