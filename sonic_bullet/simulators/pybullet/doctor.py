"""Settings of a PyBullet world that spoil its sound, and their remedies.

Each finding names an effect that was measured. Settings that PyBullet does not report are left out: damping and
activation states cannot be read at all (sleep is recognised by bodies that bear load and are exactly still).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.geometry import LARGEST_M, oversize
from sonic_bullet.records.errors import MeshError, SceneError
from sonic_bullet.records.simulated import with_body_id
from sonic_bullet.simulators.frames import NO_NUMBER
from sonic_bullet.simulators.polling import FORCE
from sonic_bullet.simulators.properties import SetValues
from sonic_bullet.simulators.pybullet import collision_shapes
from sonic_bullet.simulators.pybullet.body_facts import checked_mass_kg, describe_link
from sonic_bullet.simulators.pybullet.clients import client_id_of
from sonic_bullet.simulators.pybullet.colliding.pieces import collision_pieces
from sonic_bullet.simulators.pybullet.findings import Finding, all_links, name_links
from sonic_bullet.simulators.pybullet.poses import read_motion, read_roster
from sonic_bullet.simulators.pybullet.pybullet_world import PyBulletWorld
from sonic_bullet.simulators.pybullet.restitution import endless_bounces, lost_restitution
from sonic_bullet.simulators.pybullet.urdf_meshes import MeshSurface, lid_height_m, read_surfaces


def diagnose_world(
    world: PyBulletWorld | Any, steps: int = 0, *, seen: Mapping[int, SetValues] | None = None
) -> tuple[Finding, ...]:
    """Find what in a world would spoil its sound.

    Parameters
    ----------
    world
        A PyBulletWorld, or what `open_world` takes.
    steps
        Physics steps to look ahead, undone afterwards (saveState); 0: the present state alone.
    seen
        Values that were set, by client id; None: those the world's own hooks saw.

    Raises
    ------
    SceneError
        The client is not connected.
    """
    client_id = world.client_id if isinstance(world, PyBulletWorld) else client_id_of(world)
    known = (seen or {}).get(client_id) or (
        world.properties.set_values if isinstance(world, PyBulletWorld) else SetValues()
    )
    findings = [*_settings(client_id), *_empty(client_id), *_masses(client_id)]
    if not any(finding.severity == "error" for finding in findings):
        findings += [
            *lost_restitution(client_id, known),
            *endless_bounces(client_id, known),
            *_lids(client_id),
            *_scale(client_id, _list_sounding_links(world)),
            *_ahead(client_id, steps),
        ]
        if isinstance(world, PyBulletWorld):
            findings += [*_densities(world), *_find_oversized(world)]
    return tuple(findings)


def _settings(client_id: int) -> list[Finding]:
    longest_step_s = 1 / 120
    found = []
    settings = pybullet.getPhysicsEngineParameters(physicsClientId=client_id)
    if settings["numSubSteps"] > 1:
        found.append(
            Finding(
                "sub-steps",
                "warning",
                f"numSubSteps is {settings['numSubSteps']}: normal impulses come from the contact log, "
                "friction is computed from them",
                "set numSubSteps=0 and divide the time step instead",
            )
        )
    if settings["fixedTimeStep"] > longest_step_s * (1 + 1e-9):
        found.append(
            Finding(
                "long-step",
                "warning",
                f"a time step of {settings['fixedTimeStep']:.4g} s smears impacts over several milliseconds",
                "setTimeStep(1/240) or shorter",
            )
        )
    if settings["useRealTimeSimulation"]:
        found.append(
            Finding(
                "real-time",
                "error",
                "real-time simulation is on: PyBullet steps by itself and nobody sees the steps",
                "setRealTimeSimulation(0) and call stepSimulation",
            )
        )
    return found


def _empty(client_id: int) -> list[Finding]:
    """Find a world in which nothing can touch."""
    links = all_links(client_id)
    if not links:
        what, remedy = "there is no body in this world", "load some before stepping, into the client that steps"
        return [Finding("no-body", "error", what, remedy)]
    if not any(collision_pieces(client_id, *link) for link in links):
        what = (
            f"no link of the {len({body for body, _ in links})} bodies has a collision shape that PyBullet "
            "describes: nothing can touch"
        )
        remedy = "give bodies collision shapes: createCollisionShape, or <collision> in their URDF"
        return [Finding("no-shape", "error", what, remedy)]
    return []


def _masses(client_id: int) -> list[Finding]:
    found = []
    for body, link in all_links(client_id):
        try:
            checked_mass_kg(pybullet.getDynamicsInfo(body, link, physicsClientId=client_id), body, link)
        except SceneError as error:
            found.append(Finding("mass", "error", error.what, error.remedy))
    for body in read_motion(client_id, read_roster(client_id)).broken:
        remedy = "check its mass, inertia and what touches it; remove it or reset the scene"
        found.append(Finding("nan", "error", f"body {body} has {NO_NUMBER}", remedy))
    return found


def _lids(client_id: int) -> list[Finding]:
    """Find moving meshes whose hull closes an opening, by object, as Bullet makes a hull of each object of a file."""
    lid_share = 0.15
    found = []
    for body, link in all_links(client_id):
        if pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)[0] == 0:
            continue
        deep = 0.0
        for vertex, face in _hull_surfaces(client_id, body, link):
            size = float(np.prod(np.maximum(np.ptp(vertex, axis=0), 1e-9)) ** (1 / 3))
            deep = max(deep, lid_height_m(vertex, face) / size)
        if deep > lid_share:
            found.append(
                Finding(
                    "hull-lid",
                    "warning",
                    f"{describe_link(client_id, body, link)} is hollow, but moving meshes collide "
                    "as their convex hull: hits land on an invisible lid",
                    "decompose it with pybullet.vhacd, build it of several shapes, or fix it with mass 0 and "
                    "GEOM_FORCE_CONCAVE_TRIMESH",
                )
            )
    return found


def _hull_surfaces(client_id: int, body: int, link: int) -> list[MeshSurface]:
    pieces = [piece for piece in collision_pieces(client_id, body, link) if piece.kind == pybullet.GEOM_MESH]
    surfaces: list[MeshSurface] = []
    for name, scale in {(piece.file, piece.size) for piece in pieces}:
        if name:
            try:
                surfaces += [(vertex * scale, face) for vertex, face in read_surfaces(Path(name))]
            except MeshError:
                continue
    if len(pieces) == 1 and not surfaces:
        visual = collision_shapes.visual_surface(client_id, body, link)
        if visual is not None:
            surfaces.append(visual)
    return surfaces


def _list_sounding_links(world: PyBulletWorld | Any) -> set[tuple[int, int]]:
    """Return the links that sound, whose size `_find_oversized` checks."""
    return (
        {(body.body_id, body.link) for body in world.bodies if body.model is not None}
        if isinstance(world, PyBulletWorld)
        else set()
    )


def _scale(client_id: int, sounding: set[tuple[int, int]]) -> list[Finding]:
    smallest_m = 1e-3
    found = []
    for body, link in all_links(client_id):
        if pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)[0] == 0 or not collision_pieces(
            client_id, body, link
        ):
            continue
        low, high = np.array(pybullet.getAABB(body, link, physicsClientId=client_id))
        size = float((high - low).max())
        if size < smallest_m or (size > LARGEST_M and (body, link) not in sounding):
            found.append(
                Finding(
                    "scale",
                    "warning",
                    f"{describe_link(client_id, body, link)} is {size:.3g} m long",
                    "PyBullet thinks in metres: load a mesh made in millimetres with scale 0.001",
                )
            )
    return found


def _ahead(client_id: int, steps: int) -> list[Finding]:
    """Find bodies that bear load and are exactly still, now or within the next steps."""
    if not steps:
        return _sleepers(client_id)
    state = pybullet.saveState(physicsClientId=client_id)
    try:
        found: list[Finding] = []
        for _ in range(steps):
            pybullet.stepSimulation(physicsClientId=client_id)
            found = _sleepers(client_id)
            if found:
                break
        return found
    finally:
        pybullet.restoreState(state, physicsClientId=client_id)
        pybullet.removeState(state, physicsClientId=client_id)


def _sleepers(client_id: int) -> list[Finding]:
    loaded = {
        raw[side] for raw in pybullet.getContactPoints(physicsClientId=client_id) if raw[FORCE] > 0 for side in (1, 2)
    }
    asleep = [
        (body, -1)
        for body, joints, fixed in read_roster(client_id).bodies
        if body in loaded
        and joints == 0
        and not fixed
        and not np.any(pybullet.getBaseVelocity(body, physicsClientId=client_id))
    ]
    if not asleep:
        return []
    return [
        Finding(
            "sleeping",
            "info",
            f"{name_links(client_id, asleep)} sleeps: its contacts are frozen and make no sound until it wakes",
            "changeDynamics(activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING)",
        )
    ]


def _find_oversized(world: PyBulletWorld) -> list[Finding]:
    """Find bodies that sound and are larger than anything that is struck, planes and terrains among them."""
    large = [
        (body, oversize(body.model.vertex_m, body.model.mass_kg))
        for body in world.bodies
        if body.model is not None and body.until_step < 0
    ]
    return [
        Finding(
            "scale",
            "warning",
            f"{with_body_id(body.name, body.body_id)} {words}",
            "load it with globalScaling=0.001, or give its mesh in metres, if its numbers are millimetres; "
            "leave it out of the sound if it is the ground",
        )
        for body, words in large
        if words
    ]


def _densities(world: PyBulletWorld) -> list[Finding]:
    density_ratio = 3.0
    found = []
    for body in world.bodies:
        if body.material is None or body.until_step >= 0 or body.mass_kg == 0:
            continue
        expected = (
            body.model.mass_kg
            if body.model is not None and body.model.mass_kg > 0
            else body.material.density_kg_m3 * body.volume_m3
        )
        if expected > 0 and not 1 / density_ratio <= body.mass_kg / expected <= density_ratio:
            found.append(
                Finding(
                    "density",
                    "warning",
                    f"{with_body_id(body.name, body.body_id)} weighs {body.mass_kg:.3g} kg, but a solid of "
                    f"{body.material.name} of that size {expected:.3g} kg",
                    "set its mass with changeDynamics, or check the mesh's scale",
                )
            )
    return found
