"""Objects as people own them: numbers drawn from ranges -> a shape at its largest size, as it stands on a table.

Middles of the ranges are objects of the YCB set [Calli et al. 2015, IEEE Robotics & Automation Magazine 22(3), the
table of objects: mug 80 x 82 mm, bowl 159 x 53 mm, plate 258 x 24 mm, wine glass 89 x 137 mm, skillet 270 x 25 mm, fork
and spoon 198 mm, soup can 66 x 101 mm]; ends are what shops sell about these: 0.6 to 1.3 of them. Others name theirs in
`KINDS`. Walls are of the material: `WALLS_M`. Bodies of revolution are profiles turned around z, which the Fourier
series solves in a second or two; what has a handle, bend or corner costs finite elements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold

from sonic_bullet.apps.dataset.household.materials import CLASS_OF
from sonic_bullet.records import Array, Shape

WALLS_M: Mapping[str, tuple[float, float]] = {
    "porcelain": (2.5e-3, 6e-3),  # table ware: hotel porcelain to earthenware
    "glass": (1.5e-3, 5e-3),  # tumblers to pressed bowls
    "plastic": (1.8e-3, 4e-3),  # injection moulding's usual walls
    "wood": (4e-3, 12e-3),  # turned bowls, boards
    "steel": (0.8e-3, 3e-3), "aluminium": (1.0e-3, 4e-3), "brass": (0.8e-3, 3e-3), "copper": (0.8e-3, 2.5e-3),
}  # fmt: skip
"""Walls in m, by material. Thinner sheet, such as a tin's 0.2 mm, has more modes than are solved: tins here are of
heavy gauge."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of object.

    Parameters
    ----------
    build
        From a generator and a wall in m to a shape.
    materials
        That it is made of; names of presets.
    edge_m
        Of finite elements, where the shape needs them: coarse, so that an object costs some seconds. Halving a box's
        moved its lowest modes by 4 %, far less than its sizes differ. None: no elements.
    sheet
        Whether its shape is the middle surface of its wall: of cutlery, whose tines and edges no tetrahedra fill.
    """

    build: Callable[[np.random.Generator, float], Shape]
    materials: tuple[str, ...]
    edge_m: float | None = None
    sheet: bool = False


def _revolve_profile(profile: list[tuple[float, float]]) -> Shape:
    """Turn a closed profile (r, z) around z; its surface is a mesh about the centre of mass."""
    made = trimesh.creation.revolve(np.array([*profile, profile[0]]), sections=48)
    return _mesh(made)


def _mesh(made: trimesh.Trimesh) -> Shape:
    made.merge_vertices()
    made.update_faces(made.nondegenerate_faces())
    made.fix_normals()
    return Shape("mesh", vertex_m=made.vertices - made.center_mass, face=made.faces)


def _vessel(radius_m: float, height_m: float, wall_m: float, foot: float, belly: float) -> Shape:
    """Make a vessel: the outer radius goes from foot·radius at the bottom to radius at the rim as height^(1/belly)."""
    level = np.linspace(0, 1, 13)
    outer = radius_m * (foot + (1 - foot) * level ** (1 / belly))
    inner = np.maximum(outer - wall_m, 0.2 * outer)
    up = [(0.0, 0.0), *zip(outer, height_m * level, strict=True)]
    z = wall_m + (height_m - wall_m) * level
    down = list(zip(inner[::-1], z[::-1], strict=True))
    return _revolve_profile([*((float(r), float(h)) for r, h in (*up, *down)), (0.0, wall_m)])


def _cup(rng: np.random.Generator, wall_m: float) -> Shape:
    return _vessel(rng.uniform(0.03, 0.05), rng.uniform(0.05, 0.11), wall_m, rng.uniform(0.6, 1.0), rng.uniform(1, 2))


def _bowl(rng: np.random.Generator, wall_m: float) -> Shape:
    radius = rng.uniform(0.05, 0.11)
    return _vessel(radius, radius * rng.uniform(0.5, 0.9), wall_m, rng.uniform(0.35, 0.6), rng.uniform(1.3, 2.5))


def _plate(rng: np.random.Generator, wall_m: float) -> Shape:
    radius = rng.uniform(0.08, 0.145)
    return _vessel(radius, rng.uniform(0.015, 0.03), wall_m, rng.uniform(0.55, 0.75), rng.uniform(0.5, 1.0))


def _glass(rng: np.random.Generator, wall_m: float) -> Shape:
    return _vessel(rng.uniform(0.028, 0.045), rng.uniform(0.08, 0.16), wall_m, rng.uniform(0.7, 1.0), 1.0)


def _pan(rng: np.random.Generator, wall_m: float) -> Shape:
    return _vessel(rng.uniform(0.08, 0.14), rng.uniform(0.03, 0.1), wall_m, rng.uniform(0.8, 1.0), rng.uniform(1, 2))


def _tin(rng: np.random.Generator, wall_m: float) -> Shape:
    return _vessel(rng.uniform(0.026, 0.05), rng.uniform(0.04, 0.12), wall_m, 1.0, 1.0)


def _round_tray(rng: np.random.Generator, wall_m: float) -> Shape:
    return _vessel(rng.uniform(0.1, 0.17), rng.uniform(0.012, 0.03), wall_m, rng.uniform(0.9, 1.0), 1.0)


def _lid(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make a pot's lid, a shallow dome; its knob is left out."""
    radius, rise = rng.uniform(0.07, 0.14), rng.uniform(0.008, 0.03)
    x = np.linspace(0, 1, 13)
    dome = [(float(radius * s), float(rise * (1 - s**2))) for s in x]
    return _revolve_profile([*dome, *((r, z + wall_m) for r, z in reversed(dome))])


def _bottle(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make a bottle; a wine bottle is 75 by 300 mm with a neck of 29 mm."""
    radius, height = rng.uniform(0.028, 0.042), rng.uniform(0.18, 0.3)
    neck, shoulder = rng.uniform(0.35, 0.5) * radius, rng.uniform(0.55, 0.75) * height
    outer = [(0.0, 0.0), (radius, 0.0), (radius, shoulder), (neck, shoulder + 1.2 * (radius - neck)), (neck, height)]
    in_neck = max(neck - wall_m, 0.3 * neck)
    inner = [
        (in_neck, height),
        (in_neck, shoulder + 1.2 * (radius - neck)),
        (radius - wall_m, shoulder),
        (radius - wall_m, 1.5 * wall_m),
        (0.0, 1.5 * wall_m),
    ]
    return _revolve_profile([*outer, *inner])


def _pipe(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make a pipe that lies along x; water pipes of EN 1057 and EN 10255 have 12 to 48 mm."""
    outer, length = rng.uniform(0.006, 0.024), rng.uniform(0.12, 0.4)
    inner = outer - min(wall_m, 0.6 * outer)
    made = trimesh.creation.annulus(inner, outer, length, sections=48)
    made.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return _mesh(made)


def _board(rng: np.random.Generator, wall_m: float) -> Shape:
    return Shape("box", np.array([rng.uniform(0.15, 0.4), rng.uniform(0.05, 0.28), 1.6 * wall_m]))


def _bar(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make a bar, as tools, handles and toys have, as thick as the geometric mean of its width and a wall.

    Xylophones' are 38 by 22 mm, glockenspiels' 25 to 32 by 8 to 10 mm [Fletcher & Rossing 1998, ch. 19].
    """
    wide = rng.uniform(0.015, 0.05)
    return Shape("box", np.array([rng.uniform(0.1, 0.45), wide, np.sqrt(wide * wall_m)]))


def _tile(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make a tile; ISO 13006 has edges from 97 mm on, 6 to 11 mm thick."""
    edge = rng.uniform(0.07, 0.2)
    return Shape("box", np.array([edge, edge * rng.uniform(0.5, 1.0), 1.8 * wall_m]))


def _box(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make an open box."""
    size = np.array([rng.uniform(0.08, 0.2), rng.uniform(0.06, 0.15), rng.uniform(0.04, 0.12)])
    hollow = trimesh.creation.box(size - [2 * wall_m, 2 * wall_m, 0])
    hollow.apply_translation([0, 0, wall_m])
    return _mesh(trimesh.boolean.difference([trimesh.creation.box(size), hollow], engine="manifold"))


def _tray(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make a flat tray: an open box with a low rim."""
    size = np.array([rng.uniform(0.2, 0.35), rng.uniform(0.14, 0.25), rng.uniform(0.012, 0.03)])
    hollow = trimesh.creation.box(size - [2 * wall_m, 2 * wall_m, 0])
    hollow.apply_translation([0, 0, wall_m])
    return _mesh(trimesh.boolean.difference([trimesh.creation.box(size), hollow], engine="manifold"))


def _mug(rng: np.random.Generator, wall_m: float) -> Shape:
    """Make a cup with a handle, half a ring beside it."""
    radius, height = rng.uniform(0.035, 0.045), rng.uniform(0.07, 0.11)
    wall = np.array(
        [(0.0, 0.0), (radius, 0.0), (radius, height), (radius - wall_m, height), (radius - wall_m, wall_m),
         (0.0, wall_m), (0.0, 0.0)]
    )  # fmt: skip
    cup = trimesh.creation.revolve(wall, sections=24)
    grip = rng.uniform(0.25, 0.35) * height
    turn = 2 * np.pi * np.arange(8) / 8
    thick = max(0.7 * wall_m, 2.5e-3)
    disc = np.column_stack([grip + thick * np.cos(turn), thick * np.sin(turn)])
    ring = _manifold_mesh(CrossSection([disc]).revolve(24, 180))  # in x, y, for y above 0
    at = np.column_stack([ring.vertices[:, 1], ring.vertices[:, 2], ring.vertices[:, 0]])
    ring.vertices = at + np.array([radius - 0.5 * wall_m, 0.0, 0.5 * height])
    ring.fix_normals()
    return _mesh(trimesh.boolean.union([cup, ring], engine="manifold"))


def _manifold_mesh(made: Manifold) -> trimesh.Trimesh:
    found = made.to_mesh()
    return trimesh.Trimesh(np.array(found.vert_properties[:, :3], float), np.array(found.tri_verts))


def _cutlery(outline: Array, bend_m: float) -> Shape:
    """Triangulate an outline (n, 2) in x, y and lift it along x as a handle is bent."""
    solid = _manifold_mesh(CrossSection([outline]).extrude(1e-3).refine_to_length(0.012))
    made = trimesh.Trimesh(solid.vertices, solid.faces[solid.face_normals[:, 2] > 0.5], process=False)
    made.remove_unreferenced_vertices()
    at = made.vertices.copy()
    at[:, 2] = bend_m * np.sin(np.pi * at[:, 0] / np.ptp(at[:, 0])) ** 2
    return Shape("mesh", vertex_m=at - made.area_faces @ made.triangles_center / made.area, face=made.faces)


def _fork(rng: np.random.Generator, wall_m: float) -> Shape:
    length, wide = rng.uniform(0.15, 0.21), rng.uniform(0.018, 0.026)
    neck, tine = 0.3 * wide, wide / 7
    outline = [(0.0, -0.3 * wide), (0.55 * length, -neck / 2), (0.68 * length, -wide / 2)]
    for k in range(4):  # tines of one width, gaps as wide
        low = -wide / 2 + 2 * k * tine
        outline += [(length, low), (length, low + tine)]
        if k < 3:
            outline += [(0.76 * length, low + tine), (0.76 * length, low + 2 * tine)]
    outline += [(0.68 * length, wide / 2), (0.55 * length, neck / 2), (0.0, 0.3 * wide)]
    return _cutlery(np.array(outline), rng.uniform(0.005, 0.015))


def _spoon(rng: np.random.Generator, wall_m: float) -> Shape:
    length, wide = rng.uniform(0.13, 0.3), rng.uniform(0.03, 0.05)
    turn = np.linspace(-0.85 * np.pi, 0.85 * np.pi, 13)
    round_end = np.column_stack([0.82 * length + 0.18 * length * np.cos(turn), 0.5 * wide * np.sin(turn)])
    outline = np.concatenate([[(0.0, -0.15 * wide)], round_end, [(0.0, 0.15 * wide)]])
    return _cutlery(outline, rng.uniform(0.005, 0.015))


KINDS: Mapping[str, Kind] = {
    "cup": Kind(_cup, ("porcelain", "plastic", "steel", "wood", "aluminium")),
    "mug": Kind(_mug, ("porcelain", "plastic", "glass"), edge_m=0.03),
    "bowl": Kind(_bowl, ("porcelain", "glass", "wood", "steel", "plastic", "brass")),
    "plate": Kind(_plate, ("porcelain", "glass", "plastic", "wood")),
    "glass": Kind(_glass, ("glass", "plastic")),
    "bottle": Kind(_bottle, ("glass", "plastic", "aluminium")),
    "pan": Kind(_pan, ("steel", "aluminium", "copper")),
    "pot-lid": Kind(_lid, ("steel", "glass", "aluminium", "copper")),
    "fork": Kind(_fork, ("steel", "wood", "plastic"), edge_m=0.012, sheet=True),
    "spoon": Kind(_spoon, ("steel", "wood", "plastic", "brass"), edge_m=0.02, sheet=True),
    "board": Kind(_board, ("wood", "plastic", "glass")),
    "box": Kind(_box, ("wood", "plastic", "steel"), edge_m=0.03),
    "tray": Kind(_tray, ("steel", "wood", "plastic", "aluminium", "brass"), edge_m=0.04),
    "round-tray": Kind(_round_tray, ("steel", "wood", "plastic", "aluminium", "brass")),
    "tin": Kind(_tin, ("steel", "aluminium")),
    "bar": Kind(_bar, ("steel", "aluminium", "brass", "wood", "plastic")),
    "tile": Kind(_tile, ("porcelain", "glass", "wood", "aluminium")),
    "pipe": Kind(_pipe, ("steel", "copper", "brass", "aluminium", "plastic", "glass", "wood")),
}


@dataclass(frozen=True, slots=True)
class DrawnObject:
    """A shape that was drawn: its name in a data set, kind, material, wall in m and the seed of its other numbers."""

    name: str
    kind: str
    material: str
    wall_m: float
    seed: int


def draw_object(rng: np.random.Generator, kinds: Sequence[str] = ()) -> DrawnObject:
    """Draw an object: each class of materials as often as the others, a material of it, a kind that is made of it.

    kinds: of `KINDS`, of which it is drawn; none: all.
    """
    known = {name: one for name, one in KINDS.items() if not kinds or name in kinds}
    made = [name for name in CLASS_OF if any(name in one.materials for one in known.values())]
    of = str(rng.choice(list(dict.fromkeys(CLASS_OF[name] for name in made))))
    material = str(rng.choice([name for name in made if CLASS_OF[name] == of]))
    kind = str(rng.choice([name for name, one in known.items() if material in one.materials]))
    low, high = np.log(WALLS_M[material])
    wall_m = float(np.exp(rng.uniform(low, high)))
    seed = int(rng.integers(2**62))
    return DrawnObject(f"{kind}-{seed:016x}", kind, material, wall_m, seed)


@lru_cache(maxsize=8)
def shape_of(kind: str, wall_m: float, seed: int) -> Shape:
    """Build the shape of an object."""
    return KINDS[kind].build(np.random.default_rng(seed), wall_m)
