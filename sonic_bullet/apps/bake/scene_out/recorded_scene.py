"""A contact log, and the world it was recorded in where that is known -> RigidScene with the motion as paths.

x(t) of a path: poses at the starts of steps, every one up to 1000 a second
v(0) = (x(1) - x(0))/dt - g dt where nothing touches it: a semi-implicit step undone
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Body, Shape
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.rigid_scene import BodyPath, PhysicsMaterial, RigidBody, RigidScene

Link = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class RecordedScene:
    """A scene, and of each of its bodies the log's record, None for who is in no record."""

    scene: RigidScene
    members: tuple[Body | None, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Poses:
    """Poses at k steps of n links: time_s (k,), position_m (k, n, 3), quaternion_xyzw (k, n, 4), there (k, n)."""

    time_s: Array
    position_m: Array
    quaternion_xyzw: Array
    there: Array


def recorded_scene(log: ContactLog, world: RigidScene | None = None, links: Sequence[Link] = ()) -> RecordedScene:
    """Return bodies, joints and motion of a log.

    world, links: the scene before the first step, and whose its bodies are; None: bodies are as the log's models are.
    Raises SceneError where no body has a shape.
    """
    notes = list(world.notes) if world is not None else []
    if world is None:
        notes.append("joints are not in a contact log: bake the scene itself for them")
    records: dict[Link, list[int]] = {}
    for index, body in enumerate(log.bodies):
        records.setdefault((body.body_id, body.link), []).append(index)
    later = [link for link in records if link not in links]
    everyone = [*links, *later]
    poses = _poses(log, [records.get(link, ()) for link in everyone])
    bodies = list(world.bodies) if world is not None else []
    kept = list(range(len(bodies)))
    for column, link in enumerate(later, start=len(links)):
        record = log.bodies[records[link][-1]]
        made = _body_of(log, records[link][-1], poses, column)
        if made is None:
            notes.append(f"{record.name} is left out: the log has no shape of it; bake the scene itself")
            continue
        if record.since_step > 0:
            notes.append(f"{record.name} comes at {log.start_s[record.since_step]:.3g} s: in the file from the start")
        bodies.append(made)
        kept.append(column)
    if not bodies:
        raise SceneError("no body has a shape", "bake the scene itself, or add bodies")
    scene = RigidScene(
        tuple(bodies),
        (),
        world.gravity_m_s2 if world is not None else _gravity(log),
        tuple(notes),
        world.joints if world is not None else (),
        _paths(poses, kept, bodies),
    )
    named = (log.bodies[records[link][-1]] if link in records else None for link in (everyone[i] for i in kept))
    return RecordedScene(scene, tuple(named))


def _gravity(log: ContactLog) -> Array:
    return np.asarray(log.steps[0].gravity_m_s2) if len(log.steps) else np.zeros(3)


def _poses(log: ContactLog, who: Sequence[Sequence[int]]) -> _Poses:
    """Read poses of links, each with the indices of its records."""
    start_s, count = log.start_s, len(log.steps)
    rate = count / log.duration_s if count else 0.0
    keys_per_s = 1000.0
    most_poses = 2_000_000  # of all bodies: half a gigabyte as JSON, 56 MB as .glb
    stride = max(1, round(rate / keys_per_s), -(-count * len(who) // most_poses))
    taken = np.arange(0, count, stride)
    column = np.full(max(len(log.bodies), 1), -1)
    for number, indices in enumerate(who):
        column[list(indices)] = number
    position = np.zeros((len(taken), len(who), 3))
    turn = np.zeros((len(taken), len(who), 4))
    there = np.zeros((len(taken), len(who)), bool)
    first = 0
    for block in log.blocks():
        step = first + np.repeat(np.arange(len(block.step)), block.counts("pose"))
        to = column[block.pose["body"]]
        rows = (step % stride == 0) & (to >= 0)
        place = step[rows] // stride, to[rows]
        position[place], turn[place] = block.pose["position_m"][rows], block.pose["quaternion_xyzw"][rows]
        there[place] = True
        first += len(block.step)
    return _Poses(start_s[taken], position, turn, there)


def _body_of(log: ContactLog, index: int, poses: _Poses, column: int) -> RigidBody | None:
    """Make a body of its record; None without a surface or a pose."""
    from scipy.spatial.transform import Rotation

    body, seen = log.bodies[index], np.flatnonzero(poses.there[:, column])
    if body.model is None or not len(body.model.face) or not len(seen):
        return None
    first = int(seen[0])
    position, turn = poses.position_m[first, column], poses.quaternion_xyzw[first, column]
    velocity = spin = np.zeros(3)
    if body.mass_kg > 0 and len(seen) > 1 and seen[1] == first + 1:
        dt = float(poses.time_s[first + 1] - poses.time_s[first])
        step = log.steps[int(np.searchsorted(log.start_s, poses.time_s[first]))]
        touched = bool(((step.contacts.a == index) | (step.contacts.b == index)).any())
        velocity = (poses.position_m[first + 1, column] - position) / dt
        velocity = velocity if touched else velocity - np.asarray(step.gravity_m_s2) * dt
        turned = Rotation.from_quat(poses.quaternion_xyzw[first + 1, column]) * Rotation.from_quat(turn).inv()
        spin = turned.as_rotvec() / dt
    shape = Shape("mesh", vertex_m=body.model.vertex_m, face=body.model.face)
    moments = np.maximum(np.diag(body.inertia_kg_m2), 0.0)
    return RigidBody(
        body.name, (shape,), body.mass_kg, moments, position, turn, velocity, spin, _physics(log.dynamics(index))
    )


def _physics(dynamics: Mapping[str, float]) -> PhysicsMaterial:
    usual = PhysicsMaterial(friction_rule="multiply", restitution_rule="multiply")
    restitution = min(max(dynamics.get("restitution", usual.restitution), 0.0), 1.0)
    friction = dynamics.get("lateralFriction", usual.friction)
    return replace(usual, friction=friction, restitution=restitution)


def _paths(poses: _Poses, kept: Sequence[int], bodies: Sequence[RigidBody]) -> tuple[BodyPath, ...]:
    """Return the paths of bodies that move; kept: their columns."""
    found = []
    for number, (column, body) in enumerate(zip(kept, bodies, strict=True)):
        rows = np.flatnonzero(poses.there[:, column])
        if not len(rows):
            continue
        time, position, turn = poses.time_s[rows], poses.position_m[rows, column], poses.quaternion_xyzw[rows, column]
        if rows[0] > 0:  # a silent partner is recorded from its first touch on
            time = np.concatenate([[0.0], time])
            position = np.concatenate([body.position_m[None], position])
            turn = np.concatenate([body.quaternion_xyzw[None], turn])
        if (position != position[0]).any() or (turn != turn[0]).any():
            found.append(BodyPath(number, time, position, turn))
    return tuple(found)
