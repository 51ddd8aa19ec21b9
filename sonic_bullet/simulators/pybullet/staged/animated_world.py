"""PyBullet as the `PoseStage` of an animation, and the animation as a `World`.

Bodies that overlap in a pose are not pushed apart (contactERP = 0): poses of animations overlap by up to a centimetre,
and at 240 Hz Bullet's own correction (0.2 of the depth a step) would throw them at half a metre per second.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pybullet

from sonic_bullet._engine import RAW
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import AnimationError, SceneError
from sonic_bullet.simulators.animated import AnimatedBody, Rollout, matrices, rotation
from sonic_bullet.simulators.frames import LINK_STATE, Motion, rotate_orientations
from sonic_bullet.simulators.polling import NO_RAW, RawContact
from sonic_bullet.simulators.pybullet.clients import direct_client, disconnect
from sonic_bullet.simulators.pybullet.pybullet_world import PyBulletWorld
from sonic_bullet.simulators.pybullet.questions import Settings, contact_points, step_reader
from sonic_bullet.simulators.pybullet.staged.body_shapes import collision_options, compound


class AnimatedStage:
    """Bodies in a client of their own; see listener.animated.PoseStage."""

    def __init__(self, bodies: Sequence[AnimatedBody], gravity_m_s2: Array) -> None:
        self.bodies, self.gravity_m_s2 = tuple(bodies), gravity_m_s2
        self.client = direct_client()
        self.client_id: int = self.client._client
        self.held = np.array([one.mass_kg == 0 or one.driven for one in bodies], bool)
        self.round = np.array([len(b.shapes) == 1 and b.shapes[0].kind == "sphere" for b in bodies], bool)
        cid = self.client_id
        pybullet.setGravity(*map(float, gravity_m_s2), physicsClientId=cid)
        pybullet.setPhysicsEngineParameter(
            erp=0, contactERP=0, deterministicOverlappingPairs=1, physicsClientId=cid
        )  # fmt: skip
        self.ids = [self._made(body) for body in bodies]
        self.row_of = {body: row for row, body in enumerate(self.ids)}
        corners = np.array([pybullet.getAABB(body, physicsClientId=cid) for body in self.ids])  # as made: at the origin
        self.middle_m, self.half_m = corners.mean(axis=1), np.diff(corners, axis=1)[:, 0] / 2
        self.extent_m = np.linalg.norm(self.half_m, axis=1)
        self.reach_m = np.linalg.norm(np.abs(self.middle_m) + self.half_m, axis=1)
        self._holds = False
        self._reader = step_reader(cid)

    def __enter__(self) -> AnimatedStage:
        """Return the stage."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the stage."""
        self.close()

    def close(self) -> None:
        """End the client; a second call does nothing."""
        disconnect(self.client)

    def _made(self, body: AnimatedBody) -> int:
        ask, cid = pybullet, self.client_id
        made_of = [options for shape in body.shapes for options in collision_options(shape, body)]
        if len(made_of) > 1 and any("indices" in options for options in made_of):
            raise AnimationError(
                f"body '{body.name}': one of its meshes has too many faces", "make it a body of its own"
            )
        shape = compound(made_of, cid)
        if shape < 0:
            raise AnimationError(f"body '{body.name}': PyBullet makes no collision shape of it", "simplify its mesh")
        made = int(ask.createMultiBody(body.mass_kg, shape, physicsClientId=cid))
        ask.changeDynamics(
            made, -1, localInertiaDiagonal=body.inertia_kg_m2.tolist() if body.mass_kg else [0, 0, 0],
            restitution=body.restitution, lateralFriction=body.friction, linearDamping=0, angularDamping=0,
            contactProcessingThreshold=0, physicsClientId=cid,
        )  # fmt: skip
        return made

    def boxes(self, motion: Array) -> tuple[Array, Array]:
        """Return the corners of the bodies' boxes, see PoseStage."""
        frame = matrices(motion["quaternion_xyzw"])
        middle = motion["position_m"] + np.einsum("bij,bj->bi", frame, self.middle_m)
        half = np.einsum("bij,bj->bi", np.abs(frame), self.half_m)
        return middle - half, middle + half

    def rows(self, body_id: Array) -> Array:
        """Map body ids to indices, see PoseStage."""
        return np.array([self.row_of[body] for body in body_id.tolist()], np.int64)

    def hold(self, holds: bool) -> None:
        """Give driven bodies infinite mass, as a hand does, or their own mass again."""
        if holds == self._holds:
            return
        self._holds = holds
        for body, made in zip(self.bodies, self.ids, strict=True):
            if body.driven and body.mass_kg > 0:
                inertia = [0.0] * 3 if holds else body.inertia_kg_m2.tolist()
                pybullet.changeDynamics(
                    made, -1, mass=0 if holds else body.mass_kg, localInertiaDiagonal=inertia,
                    physicsClientId=self.client_id,
                )  # fmt: skip

    def _set(self, row: int, motion: Any) -> None:
        body, cid = self.ids[row], self.client_id
        pybullet.resetBasePositionAndOrientation(
            body, motion["position_m"].tolist(), motion["quaternion_xyzw"].tolist(), physicsClientId=cid
        )
        pybullet.resetBaseVelocity(
            body, motion["velocity_m_s"].tolist(), motion["spin_rad_s"].tolist(), physicsClientId=cid
        )

    def closest(self, motion: Array, pairs: Sequence[tuple[int, int]], reach_m: float) -> Array:
        """Find where pairs are near, see PoseStage."""
        for row in sorted({row for pair in pairs for row in pair}):
            self._set(row, motion[row])
        found: list[Array] = []
        for a, b in pairs:
            found += self._pair(motion, a, b, reach_m)
        return np.concatenate(found) if found else NO_RAW

    def _nearest(self, a: int, b: int, reach_m: float) -> list[tuple[Any, ...]]:
        return list(pybullet.getClosestPoints(self.ids[a], self.ids[b], reach_m, physicsClientId=self.client_id))

    def _pair(self, motion: Array, a: int, b: int, reach_m: float) -> list[Array]:
        # Displacement of the ends of a tilted body, to find the corners of a face that lies on another: Bullet's own
        # perturbed queries do as much (btConvexConvexAlgorithm, contact breaking threshold 0.02 m)
        tilt_m = 2e-3
        # Cosine of the largest angle between normals of one face: tilts of small bodies are a quarter of it
        same_face = 0.9
        points = self._nearest(a, b, reach_m)
        if not points:
            return []
        rows = [_raw(self.ids[a], self.ids[b], one[5], one[6], one[7], one[8]) for one in points]
        if self.round[a] or self.round[b]:
            return rows
        # the corners: from poses of the smaller body tilted to four sides, rotated back
        low = a if self.extent_m[a] <= self.extent_m[b] else b
        normals: list[Array] = []
        for one in points:
            if all(np.array(one[7]) @ normal < same_face for normal in normals):
                normals.append(np.array(one[7]))
        place, turn = motion[low]["position_m"], motion[low]["quaternion_xyzw"]
        angle = tilt_m / self.extent_m[low]
        for normal in normals:
            if sum(np.array(one[7]) @ normal > same_face for one in points) > 2:  # its corners are there
                continue
            side = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
            side /= np.linalg.norm(side)
            for axis in (side, -side, np.cross(normal, side), -np.cross(normal, side)):
                tilted = rotate_orientations(turn[None], angle * axis[None])[0]
                back = matrices(rotate_orientations(np.array([[0.0, 0, 0, 1]]), -angle * axis[None])[0])
                pybullet.resetBasePositionAndOrientation(
                    self.ids[low], place.tolist(), tilted.tolist(), physicsClientId=self.client_id
                )
                for one in self._nearest(a, b, reach_m + tilt_m):
                    if np.array(one[7]) @ normal < same_face:
                        continue
                    at = [np.array(one[5]), np.array(one[6])]
                    mine = 0 if low == a else 1
                    at[mine] = place + back @ (at[mine] - place)
                    gap = float((at[0] - at[1]) @ normal)
                    row = _raw(self.ids[a], self.ids[b], at[0], at[1], normal, gap)
                    known = (r for r in rows if r["normal"][0] @ normal > same_face)
                    if gap < reach_m and all(np.abs(row["point_a_m"] - r["point_a_m"]).max() > 1e-3 for r in known):
                        rows.append(row)
        pybullet.resetBasePositionAndOrientation(
            self.ids[low], place.tolist(), turn.tolist(), physicsClientId=self.client_id
        )
        return rows

    def shoot(
        self, start: Array, end: Array, steps: int, dt_s: float, restitution: Array, *, polled: bool = False
    ) -> Rollout:
        """Simulate from a start, see PoseStage."""
        cid, many = self.client_id, len(self.ids)
        self.hold(True)
        pybullet.setTimeStep(dt_s, physicsClientId=cid)
        course = interpolate_motion(start, end, steps, dt_s)
        motion, raws = np.zeros((steps + 1, many), LINK_STATE), []
        touching, loaded = np.zeros((many, many), bool), np.zeros((many, many), bool)
        for row in range(many):
            self._set(row, start[row] if not self.held[row] else course[0, row])
            if not self.held[row]:
                pybullet.changeDynamics(self.ids[row], -1, restitution=float(restitution[row]), physicsClientId=cid)
        moved = [row for row in range(many) if self.held[row] and start[row] != course[-1, row]]
        motion[0] = np.where(self.held, course[0], start)
        for step in range(steps):
            for row in moved if step else ():
                self._set(row, course[step, row])
            pybullet.stepSimulation(physicsClientId=cid)
            points, raw = self._contacts(polled)
            now = self._loaded_pairs(points)
            motion[step + 1] = self._after(course[step + 1])
            fresh = now & ~loaded if step else np.zeros_like(now)  # a start that overlaps is a pose as it was given
            self._carry_back(points, fresh, motion[step], motion[step + 1], dt_s)
            loaded, touching = now, touching | now
            raws.append(raw)
        late = self._struck_late(motion, loaded, dt_s, polled)
        raws[-1] = np.concatenate([raws[-1], late[0]])
        return Rollout(motion, tuple(raws), touching | late[1])

    def _loaded_pairs(self, points: Sequence[tuple[Any, ...]]) -> Array:
        """Return the pairs (b, b) that exchange a force."""
        found = np.zeros((len(self.ids), len(self.ids)), bool)
        for one in points:
            if one[9] > 0:
                a, b = self.row_of[one[1]], self.row_of[one[2]]
                found[a, b] = found[b, a] = True
        return found

    def _after(self, course: Array) -> Array:
        """Return MOTION (b,) now; held bodies as `course` has them."""
        made, cid = course.copy(), self.client_id
        for row in np.flatnonzero(~self.held).tolist():
            out, body = made[row], self.ids[row]
            out["position_m"], out["quaternion_xyzw"] = pybullet.getBasePositionAndOrientation(
                body, physicsClientId=cid
            )
            out["velocity_m_s"], out["spin_rad_s"] = pybullet.getBaseVelocity(body, physicsClientId=cid)
        return made

    def _carry_back(
        self, points: Sequence[tuple[Any, ...]], fresh: Array, before: Array, after: Array, dt_s: float
    ) -> bool:
        """Move bodies to where they were had they been struck at contact, not at Bullet's first overlap.

        That is at most a step earlier; `after` (b,) is changed in place. fresh (b, b): pairs to look at. Returns
        whether there was such an impact.
        """
        early_s = np.zeros(len(self.ids))
        falls = 2 * float(np.linalg.norm(self.gravity_m_s2)) * dt_s
        for one in points if fresh.any() else ():
            a, b = self.row_of[one[1]], self.row_of[one[2]]
            if not (fresh[a, b] and one[9] > 0 and one[8] < 0):
                continue
            speed = -_point_speed(before[a], one[5]) @ one[7] + _point_speed(before[b], one[6]) @ one[7]
            if speed > falls:  # a resting body falls for a step at each pose
                early_s[[a, b]] = np.maximum(early_s[[a, b]], min(-one[8] / speed, dt_s))
        for row in np.flatnonzero((early_s > 0) & ~self.held).tolist():
            out = after[row]
            out["position_m"] += early_s[row] * (out["velocity_m_s"] - before[row]["velocity_m_s"])
            turn = early_s[row] * (out["spin_rad_s"] - before[row]["spin_rad_s"])
            out["quaternion_xyzw"] = rotate_orientations(out["quaternion_xyzw"][None], turn[None])[0]
            self._set(row, out)
        return bool(early_s.any())

    def _contacts(self, polled: bool) -> tuple[tuple[RawContact, ...], Array]:
        """Return all contacts of the step just made; polled: and rows of RAW of those that carry a force, else none."""
        if not polled:
            return tuple(pybullet.getContactPoints(physicsClientId=self.client_id)), NO_RAW
        return contact_points(self.client_id, self._reader, stepped=True), self._reader.reported

    def _struck_late(self, motion: Array, loaded: Array, dt_s: float, polled: bool) -> tuple[Array, Array]:
        """Find pairs that meet in the last step of a shot and overlap at its end, by a step of a microsecond.

        Bullet would find them a step later. Returns RAW rows and the pairs (b, b); their motion goes into the last of
        `motion`.
        """
        moment_s = 1e-6  # length of the step that finds overlaps: nothing moves in it
        cid = self.client_id
        pybullet.setTimeStep(moment_s, physicsClientId=cid)
        pybullet.stepSimulation(physicsClientId=cid)
        points, raw = self._contacts(polled)
        fresh = self._loaded_pairs(points) & ~loaded
        before, after = motion[-1].copy(), self._after(motion[-1])
        if not self._carry_back(points, fresh, before, after, dt_s):
            return NO_RAW, np.zeros_like(loaded)
        motion[-1] = after
        rows = self.rows(raw["body_a"]), self.rows(raw["body_b"])
        late = raw[fresh[rows] & (raw["force_n"] > 0)].copy()
        one: Any
        for one in late:  # in the step's own terms: its length, and the pose at its start
            a, b = self.row_of[int(one["body_a"])], self.row_of[int(one["body_b"])]
            travel_m = [dt_s * _point_speed(before[i], one[p]) for i, p in ((a, "point_a_m"), (b, "point_b_m"))]
            one["point_a_m"] -= travel_m[0]
            one["point_b_m"] -= travel_m[1]
            one["gap_m"] -= (travel_m[0] - travel_m[1]) @ one["normal"]
            for force in ("force_n", "friction_1_n", "friction_2_n"):
                one[force] *= moment_s / dt_s
        return late, fresh


def _point_speed(motion: Array, point_m: Any) -> Array:
    """Compute the velocity (3,) of a body's point at a place of the world."""
    return np.asarray(motion["velocity_m_s"] + np.cross(motion["spin_rad_s"], point_m - motion["position_m"]))


def _raw(a: int, b: int, point_a: Any, point_b: Any, normal: Any, gap: float) -> Array:
    row = np.zeros(1, RAW)
    row["body_a"], row["body_b"], row["link_a"], row["link_b"] = a, b, -1, -1
    row["point_a_m"], row["point_b_m"], row["normal"], row["gap_m"] = point_a, point_b, normal, gap
    return row


def interpolate_motion(start: Array, end: Array, steps: int, dt_s: float) -> Array:
    """Interpolate MOTION (steps + 1, b) straight from a pose to another, with the speed of that path."""
    course = np.zeros((steps + 1, len(start)), LINK_STATE)
    move = end["position_m"] - start["position_m"]
    turn = rotation(start["quaternion_xyzw"], end["quaternion_xyzw"])
    for step in range(steps + 1):
        share = step / steps
        course[step]["position_m"] = start["position_m"] + share * move
        course[step]["quaternion_xyzw"] = rotate_orientations(start["quaternion_xyzw"], share * turn)
        course[step]["velocity_m_s"], course[step]["spin_rad_s"] = move / (steps * dt_s), turn / (steps * dt_s)
    return course


class AnimatedWorld(PyBulletWorld):
    """The world of a stage, whose steps were found beforehand: MOTION (b,) at the start of each, and its RAW rows."""

    def __init__(self, stage: AnimatedStage, steps: Sequence[tuple[Array, Array]], dt_s: float) -> None:
        self._stage, self._found, self._at = stage, steps, 0
        stage.hold(False)
        super().__init__(stage.client, stage.client_id)
        x, y, z = map(float, stage.gravity_m_s2)
        self._settings = Settings(dt_s, 1, (x, y, z))
        for body, made in zip(stage.bodies, stage.ids, strict=True):
            self.call(made, -1, body.name)

    def name_of(self, body: int, link: int = -1) -> str:
        """Return the name in the animation."""
        return self._stage.bodies[self._stage.row_of[body]].name

    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Return the true geometry, not the hulls that collide."""
        return self._stage.bodies[self._stage.row_of[body]].shapes

    def listen(self, after: Any) -> bool:
        """Return False: the listener steps the animation itself."""
        return False

    def reset(self) -> None:
        """Raise SceneError: an animation is played once."""
        raise SceneError("an animation cannot begin anew", "score it again")

    def take_step(self) -> Step:
        """Return the next step."""
        return self.after_step()

    def after_step(self) -> Step:
        """Return the next step; `stepped` is False after the last."""
        self.stepped = self._at < len(self._found)
        if not self.stepped:
            return self._memory.empty_step(self._settings.dt_s, self._settings.gravity_m_s2)
        rows, raw = self._found[self._at]
        self._at += 1
        now = Motion(self._past.roster, rows)
        self._reader.give(raw)
        self._forget_touches()  # no body sleeps: one that rests to the bit still bears its load
        step = self._waiting_step() if self._usual(now, True) else self._unusual(now, True, None)
        self._past = now
        self.step_count += 1
        return step
