"""Capsules that an MJCF file gives by their two ends (fromto), read from the file.

PyBullet's getCollisionShapeData ends the process on them, and the visual shape has lost its position. The capsules that
were read are checked by the link's bounding box.

    saveWorld -> names of the MJCF files that a client ever loaded -> geoms of each body of them
    a link that draws a capsule -> a body of as many geoms, capsules as long -> drawn pieces, placed by fromto

Bullet makes such a capsule of two spheres, whose box is larger by its margin (measured: 0.04 m on each side). That
tells it from a capsule that can be queried.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pybullet

from sonic_bullet.simulators.pybullet.colliding.filled_space import fills
from sonic_bullet.simulators.pybullet.colliding.given_bodies import given_body, search_folders
from sonic_bullet.simulators.quiet import quiet_stdout

if TYPE_CHECKING:
    from sonic_bullet.simulators.pybullet.colliding.pieces import Piece

Ends = tuple[float, ...] | None
"""Both ends of a geom, 6 numbers, or None where it has no fromto."""


def loaded_files(client_id: int) -> tuple[str, ...]:
    """List the MJCF files that a client ever loaded, by the names given."""
    with tempfile.TemporaryDirectory(prefix="sonic-bullet-") as folder, quiet_stdout():
        place = Path(folder, "world.py")
        try:
            pybullet.saveWorld(str(place), physicsClientId=client_id)
            text = place.read_text(errors="replace")
        except (pybullet.error, OSError):
            return ()
    load_line = re.compile(r'^objects = p\.loadMJCF\("(.*)"\)$', re.MULTILINE)
    return tuple(dict.fromkeys(load_line.findall(text)))


def must_not_be_asked(client_id: int, body: int, drawn: tuple[Piece, ...]) -> bool:
    """Tell whether a query for the shape of a link with these visual pieces could end the process."""
    given = given_body(client_id, body)
    if all(piece.kind != pybullet.GEOM_CAPSULE for piece in drawn) or (given is not None and given.call != "loadMJCF"):
        return False
    return bool(loaded_files(client_id))


def read_capsules(client_id: int, body: int, link: int, drawn: tuple[Piece, ...]) -> tuple[Piece, ...] | None:
    """Return the collision pieces, body frame, of a link that must not be queried; None where they cannot be known."""
    margin_m = 0.04
    fine_turn = 0.2
    if fills(client_id, body, link, drawn, fine=fine_turn):
        return drawn
    info = pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)
    back = pybullet.invertTransform(info[3], info[4])
    found: list[tuple[Piece, ...]] = []
    for name in loaded_files(client_id):
        place = _place(name)
        for geoms in bodies_with_ends(place, place.stat().st_mtime_ns) if place is not None else ():
            placed = _place_capsules(drawn, geoms, back)
            if placed is not None:
                grown = [margin_m if ends is not None else 0.0 for ends in geoms]
                if fills(client_id, body, link, placed, grown, fine=fine_turn) and placed not in found:
                    found.append(placed)
    all_by_ends = [margin_m if piece.kind == pybullet.GEOM_CAPSULE else 0.0 for piece in drawn]
    if not found and fills(client_id, body, link, drawn, all_by_ends, fine=fine_turn):
        return drawn
    return found[0] if len(found) == 1 else None


def _place(name: str) -> Path | None:
    """Find the file of that name where PyBullet looks for it."""
    import pybullet_data

    main = getattr(sys.modules.get("__main__"), "__file__", None)
    folders = ["", *reversed(search_folders), pybullet_data.getDataPath(), *([str(Path(main).parent)] if main else [])]
    return next((place for folder in folders if (place := Path(folder, name)).is_file()), None)


@lru_cache(maxsize=64)
def bodies_with_ends(place: Path, _changed_ns: int) -> tuple[tuple[Ends, ...], ...]:
    """Return the geoms of each body of an MJCF file, those with fromto by their ends.

    Bodies without one are left out, and each of the world's own geoms is a body.
    """
    largest_file = 1 << 24
    try:
        data = place.read_bytes() if place.stat().st_size <= largest_file else b""
        root = ElementTree.fromstring(data) if b"<!" not in data.replace(b"<!--", b"") else None
    except (OSError, ElementTree.ParseError):
        return ()
    return () if root is None else tuple(geoms for geoms in _geoms(root) if any(geoms))


def _geoms(root: ElementTree.Element) -> Iterator[tuple[Ends, ...]]:
    for world in root.iter("worldbody"):
        for geom in world.findall("geom"):
            yield (_ends(geom),)
        for body in world.iter("body"):
            yield tuple(_ends(geom) for geom in body.findall("geom"))


def _ends(geom: ElementTree.Element) -> Ends:
    try:
        ends = tuple(float(x) for x in geom.get("fromto", "").split())
    except ValueError:
        return None
    return ends if len(ends) == 6 and np.isfinite(ends).all() else None


def _place_capsules(
    drawn: tuple[Piece, ...], geoms: tuple[Ends, ...], back: tuple[object, object]
) -> tuple[Piece, ...] | None:
    """Place the capsules among visual pieces by the ends of geoms; None where the lengths differ."""
    if len(drawn) != len(geoms):
        return None
    placed = []
    for piece, ends in zip(drawn, geoms, strict=True):
        if ends is None or piece.kind != pybullet.GEOM_CAPSULE:
            placed.append(piece)
            continue
        start, end = np.array(ends[:3]), np.array(ends[3:])
        length = float(np.linalg.norm(end - start))
        if abs(length - piece.size[0]) > 1e-4 * length + 1e-6:
            return None
        axis = (end - start) / length if length else np.array([0.0, 0, 1])
        position, quaternion = pybullet.multiplyTransforms(*back, (start + end) / 2, _z_to(axis))
        placed.append(piece._replace(position=position, quaternion=quaternion))
    return tuple(placed)


def _z_to(axis: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[float, ...]:
    """Compute the quaternion that rotates z to a unit vector (3,) or its opposite: the ends of a capsule are equal."""
    x, y, z = axis if axis[2] >= 0 else -axis
    q = np.array([-y, x, 0.0, 1 + z])
    return tuple((q / np.linalg.norm(q)).tolist())
