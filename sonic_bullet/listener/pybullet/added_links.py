"""What `add` was told of each link, so that a world can begin anew with the same bodies.

add's arguments -> AddedLinks -> reset: who of them is still there, in the order in which they last were added
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import nan
from typing import Any

from pybullet import getDynamicsInfo

from sonic_bullet.listener.frames import Roster, decode
from sonic_bullet.listener.pybullet.body_facts import describe, dynamics_of, link_name
from sonic_bullet.listener.pybullet.pieces import collision_pieces
from sonic_bullet.records import Body, Material, ModalModel, Shape
from sonic_bullet.records.arrays import store
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.simulated import Values


class AddedLinks:
    """State of that for one client. told: by the code of a link, in the order in which they last were added."""

    def __init__(self, client_id: int) -> None:
        self._client_id = client_id
        self.links: dict[int, AddedLink] = {}

    def tell(self, code: int, how: dict[str, Any], record: Body) -> None:
        """A link that exists was added; how: arguments of `added_body`; record: what was made of it."""
        self.links.pop(code, None)
        self.links[code] = AddedLink(how, record, likeness(self._client_id, *decode(code)))

    def forget(self, codes: Iterable[int]) -> None:
        """Links are gone."""
        for code in codes:
            self.links.pop(code, None)

    def still_there(self, roster: Roster, *, seen: bool) -> dict[int, AddedLink]:
        """Those whom a roster holds. seen: who was removed was forgotten; else a link of the same code is the same only
        where its name and shape are.
        """
        there = set(roster.code.tolist())
        return {
            code: one
            for code, one in self.links.items()
            if code in there and (seen or one.likeness == likeness(self._client_id, *decode(code)))
        }

    def again(self, code: int, one: AddedLink, was_set: Values) -> Body:
        """The record of a link that is still there, as if it were added now, before the first step. was_set: of its
        values, where the simulator does not say. Raises SceneError on absurd mass or inertia.
        """
        body, link = decode(code)
        info = getDynamicsInfo(body, link, physicsClientId=self._client_id)
        if one.record.dynamics == {**was_set, **dynamics_of(info)}:
            made = copy(one.record)  # proven already; its inertia is among the dynamics
            store(made, name=link_name(self._client_id, body, link), epoch=0, since_step=0, until_step=-1)
            return made
        return added_body(self._client_id, body, link, 0, **one.how)


@dataclass(frozen=True, slots=True, eq=False)
class AddedLink:
    """how: arguments of `added_body`; record: as it was when it began; likeness: see there."""

    how: dict[str, Any]
    record: Body
    likeness: Hashable


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
) -> Body:
    """The record of a link that exists, with what it is made of. volume_m3 None: the model's, or 0; shapes: in place of
    its collision shape; a lone sphere tells its curvature. Raises SceneError on absurd mass or inertia.
    """
    record = describe(client_id, body, link, epoch)
    volume = volume_m3 if volume_m3 is not None else (model.volume_m3 if model else 0.0)
    record = replace(record, material=material, model=model, volume_m3=volume, options=options)
    if shapes:
        alone = shapes[0] if len(shapes) == 1 and shapes[0].kind == "sphere" else None
        record = replace(record, curvature_per_m=1 / float(alone.size_m[0]) if alone is not None else nan)
    return record


def likeness(client_id: int, body: int, link: int) -> Hashable:
    """What tells a link from another's that was given its id: its name and its shape, which nobody can change."""
    pieces = collision_pieces(client_id, body, link)
    return link_name(client_id, body, link), tuple(
        (piece.kind, piece.file, *(tuple(map(float, part)) for part in (piece.size, piece.position, piece.quaternion)))
        for piece in pieces
    )
