"""Facts of one link by value: name, mass, inertia. Bullet takes NaN, negative and 1e300 masses silently; we do not."""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.listener.frames import NO_NUMBER, Roster, decode, encode, link_words
from sonic_bullet.listener.memory import make_ready
from sonic_bullet.listener.properties import Properties
from sonic_bullet.listener.pybullet.colliding.pieces import collision_pieces, described_pieces
from sonic_bullet.listener.pybullet.left_out import BodiesLeftOut
from sonic_bullet.listener.pybullet.poses import body_ids, check_connected, is_soft, read_motion, read_roster
from sonic_bullet.listener.world import World
from sonic_bullet.machine.package_version import find_version
from sonic_bullet.records import Body, Material, ModalModel, Shape
from sonic_bullet.records.arrays import store
from sonic_bullet.records.coerce import LISTED, shown
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting, usual_mounting
from sonic_bullet.records.simulated import Simulator, Values, finite, with_body_id

HEAVIEST_KG = 1e12
DYNAMICS = {
    "mass": 0,
    "lateralFriction": 1,
    "restitution": 5,
    "rollingFriction": 6,
    "spinningFriction": 7,
    "contactDamping": 8,
    "contactStiffness": 9,
    "collisionMargin": 11,
}
"""Places in getDynamicsInfo's answer; contactDamping and contactStiffness are -1 where none was set."""

PLACEHOLDER = "link0"
"""What createMultiBody calls the base of a body, which has no name then."""


def check_exists(client_id: int, body: int, link: int) -> None:
    """Raise SceneError unless the world holds this link.

    (getDynamicsInfo would end the process on a link that is not there.)
    """
    known = body_ids(client_id)
    if body not in known:
        few = ", ".join(map(str, known[:LISTED])) + (f" and {len(known) - LISTED} more" if len(known) > LISTED else "")
        raise SceneError(
            f"no body {shown(body)}; known: {few or 'none'}", "load it first, and use the id that loading returned"
        )
    joints = pybullet.getNumJoints(body, physicsClientId=client_id)
    if not -1 <= link < joints:
        raise SceneError(
            f"body {body} has no link {shown(link)}",
            "use -1, the base, its only link" if joints == 0 else f"use -1 (base) … {joints - 1}",
        )


def check_usable(client_id: int, body: int) -> None:
    """Raise SceneError where an existing body is soft, or its pose or speed is not a number."""
    if is_soft(client_id, body):
        raise SceneError(
            f"{describe_link(client_id, body)} is a soft body, which cannot sound",
            "load it as a rigid body with createMultiBody or loadURDF",
        )
    if read_motion(client_id, read_roster(client_id, [other for other in body_ids(client_id) if other != body])).broken:
        raise SceneError(
            f"body {body} has {NO_NUMBER}", "check its mass, inertia and what touches it; remove it or reset the scene"
        )


def link_name(client_id: int, body: int, link: int) -> str:
    """A name for people: the body's, and the link's where it is not the base; "body 2" where nobody gave any."""
    base, whole = (text.decode(errors="replace") for text in pybullet.getBodyInfo(body, physicsClientId=client_id))
    name = whole or (base if base != PLACEHOLDER else "") or f"body {body}"
    return (
        name
        if link < 0
        else f"{name}/{pybullet.getJointInfo(body, link, physicsClientId=client_id)[12].decode(errors='replace')}"
    )


def describe_link(client_id: int, body: int, link: int = -1) -> str:
    """A link in a message: its name and its body's id."""
    return with_body_id(link_name(client_id, body, link), body)


def link_names(client_id: int, body: int) -> list[str]:
    """The names that PyBullet has for a body's links, the base's first."""
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
    """Mass of getDynamicsInfo's answer; SceneError where it is negative, absurd or not a number, or the inertia is
    not one.
    """
    mass, inertia = info[0], info[2]
    if not (math.isfinite(mass) and 0 <= mass < HEAVIEST_KG):
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
    """The silent record of a link that exists. getDynamicsInfo's inertia is diagonal in the body frame: both are the
    inertial frame (measured: R·diag·Rᵀ·ω stays constant in free spin, whatever localInertialOrn). Raises SceneError on
    absurd mass or inertia."""
    info = pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)
    mass = checked_mass_kg(info, body, link)
    pieces = collision_pieces(client_id, body, link)
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
    )


def dynamics(client_id: int, body: int, link: int) -> Values:
    """What PyBullet says of a link that exists, under the names that changeDynamics has for it."""
    return dynamics_of(pybullet.getDynamicsInfo(body, link, physicsClientId=client_id))


def dynamics_of(info: tuple[Any, ...]) -> Values:
    """What getDynamicsInfo answered, under the names that changeDynamics has for it."""
    inertia = {f"localInertiaDiagonal{axis}": x for axis, x in zip("XYZ", info[2], strict=True)}
    return finite({**{name: info[place] for name, place in DYNAMICS.items()}, **inertia})


@dataclass(frozen=True, slots=True, eq=False)
class AddedLink:
    """how: arguments of `added_body`; record: as it was when it began; likeness: see there."""

    how: dict[str, Any]
    record: Body
    likeness: Hashable


class AddedLinks:
    """State of that for one client. by_code: of a link, in the order in which they last were added."""

    def __init__(self, client_id: int) -> None:
        self._client_id = client_id
        self.by_code: dict[int, AddedLink] = {}

    def tell(self, code: int, how: dict[str, Any], record: Body) -> None:
        """A link that exists was added; how: arguments of `added_body`; record: what was made of it."""
        self.by_code.pop(code, None)
        self.by_code[code] = AddedLink(how, record, likeness(self._client_id, *decode(code)))

    def forget(self, codes: Iterable[int]) -> None:
        """Links are gone."""
        for code in codes:
            self.by_code.pop(code, None)

    def still_there(self, roster: Roster) -> dict[int, AddedLink]:
        """Those whom a roster holds: a link of the same code is the same only where its name and shape are."""
        there = set(roster.code.tolist())
        return {
            code: one
            for code, one in self.by_code.items()
            if code in there and one.likeness == likeness(self._client_id, *decode(code))
        }

    def again(self, code: int, one: AddedLink, was_set: Values) -> Body:
        """The record of a link that is still there, as if it were added now, before the first step. was_set: of its
        values, where the simulator does not say. Raises SceneError on absurd mass or inertia.
        """
        body, link = decode(code)
        info = pybullet.getDynamicsInfo(body, link, physicsClientId=self._client_id)
        if one.record.dynamics == {**was_set, **dynamics_of(info)}:
            made = copy(one.record)  # proven already; its inertia is among the dynamics
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
    """The record of a link that exists, with what it is made of. volume_m3 None: the model's, or 0; shapes: in place of
    its collision shape; a lone sphere tells its curvature. mounting: how it is held, None: as is usual for its mass.
    Raises SceneError on absurd mass or inertia.
    """
    record = describe(client_id, body, link, epoch)
    volume = volume_m3 if volume_m3 is not None else (model.volume_m3 if model else 0.0)
    held = usual_mounting(record.mass_kg) if mounting is None else mounting
    record = replace(record, material=material, model=model, volume_m3=volume, options=options, mounting=held)
    if shapes:
        alone = shapes[0] if len(shapes) == 1 and shapes[0].kind == "sphere" else None
        record = replace(record, curvature_per_m=1 / float(alone.size_m[0]) if alone is not None else math.nan)
    return record


def likeness(client_id: int, body: int, link: int) -> Hashable:
    """What tells a link from another's that was given its id: its name and its shape, which nobody can change."""
    pieces = collision_pieces(client_id, body, link)
    return link_name(client_id, body, link), tuple(
        (piece.kind, piece.file, *(tuple(map(float, part)) for part in (piece.size, piece.position, piece.quaternion)))
        for piece in pieces
    )


class AskedLinks(World):
    """What a world says without remembering steps. client_id: which client; properties: names and what was set."""

    client_id: int
    properties: Properties

    @property
    def left_out(self) -> BodiesLeftOut:
        """Who of the world is left out, and what was said of it."""
        raise NotImplementedError

    def likeness(self, body: int, link: int) -> Hashable:
        """What tells a link that exists from another's that was given its id."""
        return likeness(self.client_id, body, link)

    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """The body's id and its links of that number or name, "all" of them. Raises SceneError, MeshError."""
        from sonic_bullet.listener.pybullet.clients import links_called

        return links_called(self, body, link)

    def name_of(self, body: int, link: int = -1) -> str:
        """What people call a link: its name and its body's id. Raises SceneError for an unknown one."""
        check_connected(self.client_id)
        check_exists(self.client_id, body, link)
        own = link_name(self.client_id, body, link)
        return with_body_id(self.properties.names.called(int(encode(body, link)), own), body)

    def record_names(self, links: Sequence[tuple[int, int, str | None]]) -> list[str]:
        """What the records of links (body, link, name to be given) are or would be called, if all were added now."""
        return self.properties.names.expected(
            [(int(encode(body, link)), link_name(self.client_id, body, link), given) for body, link, given in links]
        )

    def all_links(self) -> tuple[tuple[int, int], ...]:
        """(body, link) of every link in the world that has a collision shape; none where the connection is lost."""
        from sonic_bullet.listener.pybullet.clients import is_connected, links_with_shapes

        return links_with_shapes(self.client_id) if is_connected(self.client_id) else ()

    def silence(self, names: Collection[str]) -> None:
        """Records of links, or of all links of bodies, called so are `silent` from now on."""
        self.properties.names.silent = frozenset(names)

    def link_name(self, body: int, link: int) -> str:
        """The link's own name, without its body's."""
        return link_names(self.client_id, body)[link + 1]

    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Geometry of a link in its body frame. Raises SceneError for an unknown one, MeshError where it has none."""
        from sonic_bullet.listener.pybullet.collision_shapes import shapes_of

        check_connected(self.client_id)
        check_exists(self.client_id, body, link)
        shapes = shapes_of(self.client_id, body, link)
        if described_pieces(self.client_id, body, link)[1]:
            self.left_out.meet_drawn(body, link_name(self.client_id, body, link))
        return shapes

    def make_ready(self) -> None:
        """Have the machine code that the first step would else wait for."""
        make_ready()

    def call(self, body: int, link: int, name: str) -> None:
        """Call a link so from now on. Raises SceneError where another living link has that name."""
        self.properties.names.call(int(encode(body, link)), name)

    @property
    def simulator(self) -> Simulator:
        """What PyBullet says of itself; without hooks, no more than it says when asked at the first step."""
        return self.properties.simulator({"pybullet": find_version("pybullet")})
