"""Bodies of a film, and their poses at each of its pictures.

    ContactLog: models -> meshes;  poses at step starts -> poses at k/fps, between two steps on the line (and the
        shorter arc) from one to the other
    PlacedLink (the scene's world at its end): shapes that the log lacks

A body with modes is drawn as its model's surface. A silent partner is in the log from its first touch on, and before
that drawn where it was then; a body that is never in the log is drawn where it is at the end.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from sonic_bullet.engine.runtime.clock import Clock
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Body, Microphone
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.pictures import VIEW_DEG, Camera, ColouredMesh, PlacedLink


@dataclass(frozen=True, slots=True, eq=False)
class Staging:
    """Meshes (k) in n pictures.

    Attributes
    ----------
    position_m, quaternion_xyzw, shown : (n, k, 3), (n, k, 4), (n, k)
    body : (k,) index in the log, -1 for bodies that are not in it
    step : (n,) the physics step that each picture lies in
    notes : what is not drawn
    """

    meshes: tuple[ColouredMesh, ...]
    body: Array
    position_m: Array
    quaternion_xyzw: Array
    shown: Array
    step: Array
    notes: tuple[str, ...]

    @property
    def still(self) -> Array:
        """Which meshes (k,) do not move in any picture."""
        stays = [(poses == poses[0]).all(axis=(0, 2)) for poses in (self.position_m, self.quaternion_xyzw)]
        return np.asarray(stays[0] & stays[1] & (self.shown == self.shown[0]).all(axis=0))


def duration_of(log: ContactLog) -> Fraction:
    """Compute how long a log lasts, exactly."""
    clock = Clock()
    for block in log.blocks():
        for dt_s, steps in ((dt_s, len(list(same))) for dt_s, same in itertools.groupby(block.step["dt_s"].tolist())):
            one = Clock().after(dt_s)
            end = Fraction(clock.ticks, clock.per_second) + steps * Fraction(one.ticks, one.per_second)
            clock = Clock(end.numerator, end.denominator)
    return Fraction(clock.ticks, clock.per_second)


def stage_log(log: ContactLog, fps: Fraction, pictures: int, standing: Sequence[PlacedLink] = ()) -> Staging:
    """Pose all meshes at each picture. Raises SceneError where there is nothing to draw."""
    places = {(one.body_id, one.link): one for one in standing}
    meshes: list[ColouredMesh] = []
    index: list[int] = []
    notes: list[str] = []
    how_it_is_drawn = "film the scene, or, of an animation that was scored, give it a material in the table of score"
    for i, body in enumerate(log.bodies):
        known = places.get((body.body_id, body.link))
        mesh = _coloured_mesh(body) or (known.mesh if known is not None else None)
        if mesh is None:
            notes.append(f"{body.name} is not drawn: the log has no shape of it; {how_it_is_drawn}")
            continue
        meshes.append(mesh)
        index.append(i)
    logged = {(body.body_id, body.link) for body in log.bodies}
    still = [one for one in standing if (one.body_id, one.link) not in logged]
    if not meshes and not still:
        raise SceneError("there is nothing to draw: no body has a shape", "film the scene itself, or add bodies")
    position, turned, shown, step = _poses(log, fps, pictures, np.array(index, np.int64))
    count = len(still)
    position = np.concatenate([position, np.tile(_stack([x.position_m for x in still], 3), (pictures, 1, 1))], axis=1)
    turned = np.concatenate([turned, np.tile(_stack([x.quaternion_xyzw for x in still], 4), (pictures, 1, 1))], axis=1)
    shown = np.concatenate([shown, np.ones((pictures, count), bool)], axis=1)
    who = np.array([*index, *([-1] * count)], np.int64)
    return Staging((*meshes, *(x.mesh for x in still)), who, position, turned, shown, step, tuple(notes))


def _stack(rows: Sequence[Array], size: int) -> Array:
    return np.array(rows, float).reshape(-1, size)


def _coloured_mesh(body: Body) -> ColouredMesh | None:
    """Return the coloured surface of a body's model; None where it has no surface."""
    colours = {
        "wood": (0.72, 0.53, 0.34),
        "porcelain": (0.93, 0.93, 0.90),
        "glass": (0.60, 0.80, 0.85),
        "metal": (0.60, 0.63, 0.68),
        "steel": (0.60, 0.63, 0.68),
        "brass": (0.80, 0.68, 0.35),
        "plastic": (0.85, 0.40, 0.35),
        "rubber": (0.25, 0.25, 0.27),
    }
    other_colour = (0.75, 0.72, 0.66)
    if body.model is None or not len(body.model.face):
        return None
    name = body.material.name.lower() if body.material is not None else ""
    colour = next((rgb for word, rgb in colours.items() if word in name), other_colour)
    return ColouredMesh(body.model.vertex_m, body.model.face, colour)


def _poses(log: ContactLog, fps: Fraction, pictures: int, who: Array) -> tuple[Array, Array, Array, Array]:
    """Compute poses (n, k, 3), (n, k, 4) of the bodies (k,), whether they are there, and each picture's step (n,)."""
    start_s = log.start_s
    time_s = np.arange(pictures) * float(1 / fps)
    step = np.maximum(np.searchsorted(start_s, time_s + 1e-9, side="right") - 1, 0)
    position, turned = np.zeros((pictures, len(who), 3)), np.zeros((pictures, len(who), 4))
    turned[:, :, 3] = 1.0
    there = np.zeros((pictures, len(who)), bool)
    k, later = 0, iter(log.steps)
    next(later, None)
    for number, (here, after) in enumerate(itertools.zip_longest(log.steps, later)):
        while k < pictures and step[k] == number:
            share = min(max((time_s[k] - start_s[number]) / here.dt_s, 0.0), 1.0)
            there[k], position[k], turned[k] = _interpolate_poses(here, after, share, who, position[k], turned[k])
            k += 1
        if k == pictures:
            break
    for column, index in enumerate(who.tolist()):
        found = np.flatnonzero(there[:, column])
        if log.bodies[index].material is None and len(found):
            position[: found[0], column] = position[found[0], column]
            turned[: found[0], column] = turned[found[0], column]
            there[: found[0], column] = True
    return position, turned, there, step


def _interpolate_poses(
    here: Step, after: Step | None, share: float, who: Array, position: Array, turned: Array
) -> tuple[Array, Array, Array]:
    """Interpolate whether each body is there, and its pose, at a fraction of the step."""
    at = np.minimum(np.searchsorted(here.body, who), max(len(here.body) - 1, 0))
    there = (here.body[at] == who) if len(here.body) else np.zeros(len(who), bool)
    position, turned = position.copy(), turned.copy()
    position[there], turned[there] = here.position_m[at[there]], here.quaternion_xyzw[at[there]]
    if after is not None and share > 0 and len(after.body):
        then = np.minimum(np.searchsorted(after.body, who), len(after.body) - 1)
        goes = there & (after.body[then] == who) & ~after.teleported[then]
        p, q = after.position_m[then[goes]], after.quaternion_xyzw[then[goes]]
        q = np.where(np.einsum("ki,ki->k", q, turned[goes])[:, None] < 0, -q, q)
        position[goes] += share * (p - position[goes])
        mixed = turned[goes] + share * (q - turned[goes])
        turned[goes] = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return there, position, turned


def chosen_camera(
    log: ContactLog, staging: Staging, eye_m: Sequence[float] | None = None, target_m: Sequence[float] | None = None
) -> Camera:
    """Return the camera asked for, or one that shows what moves, from the first microphone's side, seen from above."""
    radius = np.array([_radius_m(mesh) for mesh in staging.meshes])
    moves = np.ptp(staging.position_m, axis=0).max(axis=1) > 1e-3
    wide_m = 20.0  # a mesh wider than this is ground, which need not be in view
    small = radius < wide_m
    seen = moves & small if (moves & small).any() else small if small.any() else np.ones(len(radius), bool)
    # percentiles, so that a body that falls for ever is not followed
    low, high = np.percentile(staging.position_m[:, seen].reshape(-1, 3), [5, 95], axis=0)
    reach = float(np.linalg.norm(high - low)) / 2 + float(radius[seen].max())
    target = np.array(target_m, float) if target_m is not None else (low + high) / 2
    if eye_m is not None:
        return Camera(np.array(eye_m, float), target)
    ears = [one.position_m for one in log.sensors if isinstance(one, Microphone)]
    side = np.mean(ears, axis=0) - target if ears else np.array([0.0, -1.0, 0.0])
    side[2] = 0
    length = float(np.linalg.norm(side))
    side = side / length if length > 1e-6 else np.array([0.0, -1.0, 0.0])
    # fraction of the sphere around all that moves that the picture's height shows at least: its ends are air
    view_share = 0.8
    away = view_share * reach / np.sin(np.radians(VIEW_DEG) / 2)
    elevation_rad = np.radians(30)
    return Camera(target + away * (np.cos(elevation_rad) * side + np.sin(elevation_rad) * np.array([0, 0, 1])), target)


def _radius_m(mesh: ColouredMesh) -> float:
    return float(np.linalg.norm(mesh.vertex_m, axis=1).max(initial=0.0))
