"""Name, mass and inertia of a link by value, checked: Bullet accepts masses that are NaN, negative or 1e300."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.geometry.flat_faces import flat_faces
from sonic_bullet.machine.package_version import find_version
from sonic_bullet.records import Body, Material, ModalModel, Shape
from sonic_bullet.records.arrays import store
from sonic_bullet.records.coerce import LISTED, quote
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting
from sonic_bullet.records.simulated import Values, finite, with_body_id
from sonic_bullet.simulators.frames import NO_NUMBER, Roster, decode, encode, link_words
from sonic_bullet.simulators.known_bodies import sounding_body
from sonic_bullet.simulators.pybullet.colliding.pieces import collision_pieces, described_pieces
from sonic_bullet.simulators.pybullet.left_out import BodiesLeftOut
from sonic_bullet.simulators.pybullet.poses import (
    body_exists,
    body_ids,
    check_connected,
    is_soft,
    read_motion,
    roster_of,
)
from sonic_bullet.simulators.tables.known_world import KnownWorld


def check_exists(client_id: int, body: int, link: int) -> None:
    """Raise SceneError unless the world holds this link.

    getDynamicsInfo would end the process on a link that is not there.
    """
    if not body_exists(client_id, body):  # at once: a scene of hundreds of bodies is asked for each of them
        known = body_ids(client_id)
        few = ", ".join(map(str, known[:LISTED])) + (f" and {len(known) - LISTED} more" if len(known) > LISTED else "")
        raise SceneError(
            f"no body {quote(body)}; known: {few or 'none'}", "load it first, and use the id that loading returned"
        )
    joints = pybullet.getNumJoints(body, physicsClientId=client_id)
    if not -1 <= link < joints:
        raise SceneError(
            f"body {body} has no link {quote(link)}",
            "use -1, the base, its only link" if joints == 0 else f"use -1 (base) … {joints - 1}",
        )


def check_usable(client_id: int, body: int) -> None:
    """Raise SceneError where an existing body is soft, or its pose or speed is not a number."""
    if is_soft(client_id, body):
        raise SceneError(
            f"{describe_link(client_id, body)} is a soft body, which cannot sound",
            "load it as a rigid body with createMultiBody or loadURDF",
        )
    if read_motion(client_id, roster_of(client_id, [body])).broken:
        raise SceneError(
            f"body {body} has {NO_NUMBER}", "check its mass, inertia and what touches it; remove it or reset the scene"
        )


def link_name(client_id: int, body: int, link: int) -> str:
    """Return a name for messages: the body's, and the link's where it is not the base; "body 2" without any."""
    base, whole = (text.decode(errors="replace") for text in pybullet.getBodyInfo(body, physicsClientId=client_id))
    placeholder = "link0"  # name that createMultiBody gives to the base of a body without a name
    name = whole or (base if base != placeholder else "") or f"body {body}"
    return (
        name
        if link < 0
        else f"{name}/{pybullet.getJointInfo(body, link, physicsClientId=client_id)[12].decode(errors='replace')}"
    )


def describe_link(client_id: int, body: int, link: int = -1) -> str:
    """Return a link's name and its body's id for a message."""
    return with_body_id(link_name(client_id, body, link), body)


def link_names(client_id: int, body: int) -> list[str]:
    """Return the names that PyBullet has for a body's links, the base's first."""
    base = pybullet.getBodyInfo(body, physicsClientId=client_id)[0].decode(errors="replace")
    joints = range(pybullet.getNumJoints(body, physicsClientId=client_id))
    return [
        base,
        *(
            pybullet.getJointInfo(body, joint, physicsClientId=client_id)[12].decode(errors="replace")
            for joint in joints
        ),
    ]


def checked_mass_kg(info: tuple[Any, ...], body: int, link: int) -> float:
    """Return the mass in getDynamicsInfo's answer.

    Raises
    ------
    SceneError
        It is negative, absurd or not a number, or the inertia is not a number.
    """
    mass, inertia = info[0], info[2]
    heaviest_kg = 1e12
    if not (math.isfinite(mass) and 0 <= mass < heaviest_kg):
        raise SceneError(
            f"body {body}{link_words(link)} has mass {mass} kg",
            "give it a finite mass of zero or more with changeDynamics or in its URDF",
        )
    if not all(math.isfinite(x) and x >= 0 for x in inertia):
        raise SceneError(
            f"body {body}{link_words(link)} has inertia {inertia} kg m²",
            "give it a finite inertia with changeDynamics or in its URDF",
        )
    return float(mass)


def describe(client_id: int, body: int, link: int, epoch: int) -> Body:
    """Return the silent record of a link that exists; SceneError on absurd mass or inertia.

    getDynamicsInfo's inertia is diagonal in the body frame: both are the inertial frame (measured: R·diag·Rᵀ·ω stays
    constant in free spin, whatever localInertialOrn).
    """
    from sonic_bullet.simulators.pybullet.collision_shapes import primitive

    info = pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)
    mass = checked_mass_kg(info, body, link)
    pieces = collision_pieces(client_id, body, link)
    # shapes whose large faces are looked at where a body is not added: no file need be read for them
    flat_kinds = (pybullet.GEOM_BOX, pybullet.GEOM_PLANE)
    flat = [primitive(one, "") for one in pieces if mass == 0 and one.kind in flat_kinds]
    curvature = (
        1 / pieces[0].size[0]
        if len(pieces) == 1 and pieces[0].kind == pybullet.GEOM_SPHERE and pieces[0].size[0] > 0
        else math.nan
    )
    return Body(
        body,
        link,
        epoch,
        link_name(client_id, body, link),
        mass,
        np.diag(info[2]),
        curvature_per_m=curvature,
        dynamics=dynamics_of(info),
        flat_faces_m=flat_faces(flat),
    )


def dynamics(client_id: int, body: int, link: int) -> Values:
    """Query the properties of a link that exists, under the names of changeDynamics."""
    return dynamics_of(pybullet.getDynamicsInfo(body, link, physicsClientId=client_id))


def dynamics_of(info: tuple[Any, ...]) -> Values:
    """Name the entries of getDynamicsInfo's answer as changeDynamics does."""
    inertia = {f"localInertiaDiagonal{axis}": x for axis, x in zip("XYZ", info[2], strict=True)}
    # indices into getDynamicsInfo's answer; contactDamping and contactStiffness are -1 where none was set
    answer_places = {
        "mass": 0,
        "lateralFriction": 1,
        "restitution": 5,
        "rollingFriction": 6,
        "spinningFriction": 7,
        "contactDamping": 8,
        "contactStiffness": 9,
        "collisionMargin": 11,
    }
    return finite({**{name: info[place] for name, place in answer_places.items()}, **inertia})


@dataclass(frozen=True, slots=True, eq=False)
class AddedLink:
    """A link that was added. how: arguments of `added_body`; record: as it began; likeness: see `likeness`."""

    how: dict[str, Any]
    record: Body
    likeness: Hashable


class AddedLinks:
    """The links added to one client, by code, in the order in which they last were."""

    def __init__(self, client_id: int) -> None:
        self._client_id = client_id
        self.by_code: dict[int, AddedLink] = {}

    def tell(self, code: int, how: dict[str, Any], record: Body) -> None:
        """Store a link that was added; how: arguments of `added_body`; record: the result."""
        self.by_code.pop(code, None)
        self.by_code[code] = AddedLink(how, record, likeness(self._client_id, *decode(code)))

    def forget(self, codes: Iterable[int]) -> None:
        """Drop links that are gone."""
        for code in codes:
            self.by_code.pop(code, None)

    def still_there(self, roster: Roster) -> dict[int, AddedLink]:
        """Select those that a roster holds with the same name and shape."""
        there = set(roster.code.tolist())
        return {
            code: one
            for code, one in self.by_code.items()
            if code in there and one.likeness == likeness(self._client_id, *decode(code))
        }

    def record_anew(self, code: int, one: AddedLink, was_set: Values) -> Body:
        """Return a link's record as if it were added now, before the first step; SceneError on absurd mass or inertia.

        was_set: its values that were set, where the simulator does not report them.
        """
        body, link = decode(code)
        info = pybullet.getDynamicsInfo(body, link, physicsClientId=self._client_id)
        if one.record.dynamics == {**was_set, **dynamics_of(info)}:
            made = copy(one.record)  # checked already; its inertia is among the dynamics
            store(made, name=link_name(self._client_id, body, link), epoch=0, since_step=0, until_step=-1)
            return made
        return added_body(self._client_id, body, link, 0, **one.how)


def added_body(
    client_id: int,
    body: int,
    link: int,
    epoch: int,
    *,
    material: Material | None,
    model: ModalModel | None,
    volume_m3: float | None,
    shapes: Sequence[Shape],
    options: ModalOptions | None,
    mounting: Mounting | None = None,
) -> Body:
    """Return the record of a link that exists (`sounding_body`); SceneError on absurd mass or inertia."""
    return sounding_body(
        describe(client_id, body, link, epoch),
        material=material,
        model=model,
        volume_m3=volume_m3,
        shapes=shapes,
        options=options,
        mounting=mounting,
    )


def likeness(client_id: int, body: int, link: int) -> Hashable:
    """Return name and shape, which cannot change, to tell a link from another that reuses its id."""
    pieces = collision_pieces(client_id, body, link)
    return link_name(client_id, body, link), tuple(
        (piece.kind, piece.file, *(tuple(map(float, part)) for part in (piece.size, piece.position, piece.quaternion)))
        for piece in pieces
    )


class AskedLinks(KnownWorld):
    """The queries of a world that need no step. client_id: the client."""

    client_id: int

    @property
    def left_out(self) -> BodiesLeftOut:
        """The bodies left out, and the messages about them."""
        raise NotImplementedError

    def likeness(self, body: int, link: int) -> Hashable:
        """Return what tells a link that exists from another that reuses its id."""
        return likeness(self.client_id, body, link)

    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """Return the body's id and its links of that number or name, "all" of them; raises SceneError, MeshError."""
        from sonic_bullet.simulators.pybullet.clients import links_called

        return links_called(self, body, link)

    def name_of(self, body: int, link: int = -1) -> str:
        """Return a link's name and its body's id for messages; SceneError for an unknown link."""
        check_connected(self.client_id)
        check_exists(self.client_id, body, link)
        own = link_name(self.client_id, body, link)
        return with_body_id(self.properties.names.name_link(int(encode(body, link)), own), body)

    def mass_of(self, body: int, link: int = -1) -> float | None:
        """Return the mass of a link in kg; SceneError on an absurd one."""
        return checked_mass_kg(pybullet.getDynamicsInfo(body, link, physicsClientId=self.client_id), body, link)

    def record_names(self, links: Sequence[tuple[int, int, str | None]]) -> list[str]:
        """Return the names that records of links (body, link, given name) have, or would have if all were added now."""
        return self.properties.names.predict_names(
            [(int(encode(body, link)), link_name(self.client_id, body, link), given) for body, link, given in links]
        )

    def all_links(self) -> tuple[tuple[int, int], ...]:
        """List (body, link) of every link that has a collision shape; none where the connection is lost."""
        from sonic_bullet.simulators.pybullet.clients import is_connected, links_with_shapes

        return links_with_shapes(self.client_id) if is_connected(self.client_id) else ()

    def link_name(self, body: int, link: int) -> str:
        """Return the link's own name, without its body's."""
        return link_names(self.client_id, body)[link + 1]

    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Return the geometry of a link in its body frame; SceneError for an unknown one, MeshError without any."""
        from sonic_bullet.simulators.pybullet.collision_shapes import shapes_of

        check_connected(self.client_id)
        check_exists(self.client_id, body, link)
        shapes = shapes_of(self.client_id, body, link)
        if described_pieces(self.client_id, body, link)[1]:
            self.left_out.meet_drawn(body, link_name(self.client_id, body, link))
        return shapes

    def with_motions(self, step: Step) -> Step:
        """Return the step with the motions of touched links of bodies that sensors are on."""
        if not self.felt or not len(step.contacts):
            return step
        from sonic_bullet.simulators.pybullet.jointed.joint_motions import touched_motions

        known = {i: self.records[i] for i in step.body.tolist()}
        touched = np.concatenate([step.contacts.a, step.contacts.b])
        motions = touched_motions(self.client_id, self.felt, known, touched, self.joint_springs)
        return step if motions is None else step.with_motions(motions)

    def versions(self) -> dict[str, str]:
        """Return PyBullet's version."""
        return {"pybullet": find_version("pybullet")}
