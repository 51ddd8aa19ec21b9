"""A RigidScene in a PyBullet world: bodies, friction and restitution of pairs, drives.

    RigidBody -> collision shapes in its principal frame -> multibody -> dynamics, speeds
    PhysicsMaterial of two bodies, combined -> a factor each, whose products PyBullet takes for the pair
    SpeedDrive -> a force before each step: F = I + m Δv/dt, I = Σ k m Δv/dt, at most most_n  [PI control]
    RigidJoint, BodyPath of a body of mass 0 -> rigid_joints, kinematic_bodies

PyBullet multiplies both bodies' friction, and so their restitution. Where the file's pairs are no products, the nearest
are taken by least squares of logarithms, over the pairs that can meet, and named.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.rigid_scene import CombineRule, PhysicsMaterial, RigidBody, RigidScene, SpeedDrive
from sonic_bullet.simulators.animated import AnimatedBody
from sonic_bullet.simulators.pybullet.restitution import keep_restitution
from sonic_bullet.simulators.pybullet.rigid.kinematic_bodies import as_kinematic, follow_path
from sonic_bullet.simulators.pybullet.rigid.rigid_joints import make_joints
from sonic_bullet.simulators.pybullet.staged.body_shapes import collision_options, compound


def build_rigid_scene(client: Any, scene: RigidScene) -> tuple[list[int], Callable[[], None], tuple[str, ...]]:
    """Make the bodies of a scene in an empty world.

    Their ids, what is to be called before each step, and notes. Raises what PyBullet refuses.
    """
    client.setGravity(*scene.gravity_m_s2.tolist())
    friction, some = pair_factors(scene.bodies, combined_friction)
    restitution, more = pair_factors(scene.bodies, combined_restitution)
    driven = {path.body: path for path in scene.paths if scene.bodies[path.body].mass_kg <= 0}
    ids = [
        _make_body(client, as_kinematic(body) if i in driven else body, float(friction[i]), float(restitution[i]))
        for i, body in enumerate(scene.bodies)
    ]
    keep_restitution(client)
    notes = list(make_joints(client, scene, ids))
    movers: list[Callable[[], None]] = [_lifter(client, one, x) for one, x in zip(ids, scene.bodies, strict=True)
        if x.mass_kg > 0 and x.gravity_factor != 1]  # fmt: skip
    movers += [follow_path(client, ids[i], path) for i, path in driven.items()]
    locked_factor = 1e6  # times its moments that a body has whose turns are locked
    for drive in scene.drives:
        movers.append(_motor(client, ids, drive, scene.bodies[drive.body].mass_kg))
        if drive.turns_locked:
            moments = client.getDynamicsInfo(ids[drive.body], -1)[2]
            client.changeDynamics(ids[drive.body], -1, localInertiaDiagonal=[locked_factor * x for x in moments])

    def act() -> None:
        for move in movers:
            move()

    notes += [f"friction of {words}" for words in some] + [f"restitution of {words}" for words in more]
    return ids, act, tuple(notes)


def _make_body(client: Any, body: RigidBody, friction: float, restitution: float) -> int:
    stand_in = AnimatedBody(body.name, body.shapes, min(body.mass_kg, 1e6), np.ones(3))
    options = [one for shape in body.shapes for one in collision_options(shape, stand_in)]
    made = client.createMultiBody(
        body.mass_kg,
        compound(options, client._client),
        basePosition=body.position_m.tolist(),
        baseOrientation=body.quaternion_xyzw.tolist(),
    )
    more: dict[str, Any] = {"lateralFriction": friction, "restitution": restitution}
    more |= {"spinningFriction": 0, "rollingFriction": 0, "linearDamping": 0, "angularDamping": 0}
    if body.mass_kg > 0 and (body.inertia_kg_m2 > 0).all():
        more["localInertiaDiagonal"] = body.inertia_kg_m2.tolist()
    client.changeDynamics(made, -1, **more)
    if body.mass_kg > 0:
        client.resetBaseVelocity(made, body.velocity_m_s.tolist(), body.spin_rad_s.tolist())
    return int(made)


def combined_friction(a: PhysicsMaterial, b: PhysicsMaterial) -> float:
    """Friction of a pair."""
    return _combine_coefficients(a.friction, b.friction, a.friction_rule, b.friction_rule)


def combined_restitution(a: PhysicsMaterial, b: PhysicsMaterial) -> float:
    """Restitution of a pair."""
    return _combine_coefficients(a.restitution, b.restitution, a.restitution_rule, b.restitution_rule)


def _combine_coefficients(a: float, b: float, of_a: CombineRule, of_b: CombineRule) -> float:
    # of two rules the later counts [KHR_physics_rigid_bodies, Physics Materials]
    combine_rules = ("average", "minimum", "multiply", "maximum")
    match max(of_a, of_b, key=combine_rules.index):
        case "average":
            return (a + b) / 2
        case "minimum":
            return min(a, b)
        case "maximum":
            return max(a, b)
    return a * b


def pair_factors(
    bodies: Sequence[RigidBody], combine: Callable[[PhysicsMaterial, PhysicsMaterial], float]
) -> tuple[Array, tuple[str, ...]]:
    """Find a factor (b,) for each body, whose products are nearest to the pairs' values; words on those that are off.

    Only pairs of which one can move count.
    """
    kinds = list(dict.fromkeys(body.physics for body in bodies))
    count = len(kinds)
    rule = "friction" if combine is combined_friction else "restitution"
    if all(getattr(kind, f"{rule}_rule") == "multiply" for kind in kinds):
        return np.array([getattr(body.physics, rule) for body in bodies]), ()
    moving = {body.physics for body in bodies if body.mass_kg > 0}
    several = {kind for kind in moving if sum(body.physics == kind and body.mass_kg > 0 for body in bodies) > 1}
    still = {body.physics for body in bodies if body.mass_kg <= 0}
    rows, values, pairs = [], [], []
    for i in range(count):
        for j in range(i, count):
            a, b = kinds[i], kinds[j]
            meets = (a in several or (a in moving and a in still)) if i == j else (
                a in moving or b in moving
            )  # fmt: skip
            if meets:
                pairs.append((i, j, combine(a, b)))
    factor = np.zeros(count)
    positive = [(i, j, value) for i, j, value in pairs if value > 0]
    for i, j, value in positive:
        row = np.zeros(count)
        row[i] += 1
        row[j] += 1
        rows.append(row)
        values.append(np.log(value))
    if rows:
        found = np.exp(np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0])
        used = np.array(rows).any(axis=0)
        factor = np.where(used, found, 0.0)
    notes = []
    pair_tolerance = 0.01
    for i, j, value in pairs:
        got = float(factor[i] * factor[j])
        if abs(got - value) > pair_tolerance * max(value, 0.01):
            who = [next(b.name for b in bodies if b.physics == kinds[k]) for k in (i, j)]
            notes.append(f"{who[0]} on {who[1]} is {got:.3g} in place of {value:.3g}: PyBullet multiplies")
    return np.array([factor[kinds.index(body.physics)] for body in bodies]), tuple(notes)


def _lifter(client: Any, body_id: int, body: RigidBody) -> Callable[[], None]:
    """Make what takes, or adds, gravity of a body that feels another share of it."""

    def move() -> None:
        from pybullet import WORLD_FRAME

        settings = client.getPhysicsEngineParameters()
        gravity = np.array([settings[f"gravityAcceleration{axis}"] for axis in "XYZ"])
        force = (body.gravity_factor - 1) * body.mass_kg * gravity
        place = client.getBasePositionAndOrientation(body_id)[0]
        client.applyExternalForce(body_id, -1, force.tolist(), place, WORLD_FRAME)

    return move


def _motor(client: Any, ids: Sequence[int], drive: SpeedDrive, mass_kg: float) -> Callable[[], None]:
    """Make what drives a body: its speed lags by F/damping, as the drive's law says."""
    integral, proportional = 0.3, 0.7
    along, dt = drive.direction, client.getPhysicsEngineParameters()["fixedTimeStep"]
    kept, last = 0.0, 0.0

    def move() -> None:
        from pybullet import WORLD_FRAME

        nonlocal kept, last
        own = np.array(client.getBaseVelocity(ids[drive.body])[0])
        other = np.array(client.getBaseVelocity(ids[drive.partner])[0]) if drive.partner >= 0 else np.zeros(3)
        lag = last / drive.damping_n_s_m if drive.damping_n_s_m > 0 else 0.0
        missing = (drive.speed_m_s - lag - float(along @ (own - other))) * mass_kg / dt
        kept = float(np.clip(kept + integral * missing, -drive.most_n, drive.most_n))
        last = float(np.clip(kept + proportional * missing, -drive.most_n, drive.most_n))
        if drive.damping_n_s_m <= 0:
            last = kept = 0.0
        place = client.getBasePositionAndOrientation(ids[drive.body])[0]
        client.applyExternalForce(ids[drive.body], -1, (last * along).tolist(), place, WORLD_FRAME)

    return move
