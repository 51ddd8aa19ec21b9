"""What `add` was told of each link, so that a world can begin anew with the same bodies.

add's arguments -> AddedLinks -> reset: who of them is still there, in the order in which they last were added
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from math import nan
from typing import Any

from sonic_bullet.listener.frames import Roster, decode
from sonic_bullet.listener.pybullet.body_facts import describe, link_name
from sonic_bullet.listener.pybullet.pieces import collision_pieces
from sonic_bullet.records import Body, Material, ModalModel, Shape


class AddedLinks:
    """State of that for one client, by the code of a link."""

    def __init__(self, client_id: int) -> None:
        self._client_id = client_id
        self._told: dict[int, tuple[Hashable, dict[str, Any]]] = {}

    def tell(self, code: int, how: dict[str, Any]) -> None:
        """A link that exists was added; how: arguments of `added_body`."""
        self._told.pop(code, None)
        self._told[code] = likeness(self._client_id, *decode(code)), how

    def forget(self, codes: Iterable[int]) -> None:
        """Links are gone."""
        for code in codes:
            self._told.pop(code, None)

    def of(self, body: int | None) -> list[int]:
        """Codes of the links of a body, or of all."""
        return [code for code in self._told if body is None or decode(code)[0] == body]

    def still_there(self, roster: Roster, *, seen: bool) -> Iterator[tuple[int, dict[str, Any]]]:
        """Code and arguments of those whom a roster holds. seen: who was removed was forgotten; else a link of the same
        code is the same only where its name and shape are.
        """
        there = set(roster.code.tolist())
        for code, (alike, how) in self._told.items():
            if code in there and (seen or alike == likeness(self._client_id, *decode(code))):
                yield code, how


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
    name: str | None,
) -> Body:
    """The record of a link that exists, with what it is made of. volume_m3 None: the model's, or 0; shapes: in place of
    its collision shape; a lone sphere tells its curvature. Raises SceneError on absurd mass or inertia.
    """
    record = describe(client_id, body, link, epoch)
    volume = volume_m3 if volume_m3 is not None else (model.volume_m3 if model else 0.0)
    record = replace(record, material=material, model=model, volume_m3=volume, name=name or record.name)
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
