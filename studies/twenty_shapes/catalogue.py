"""The twenty shapes: what CalculiX solves of each, and the closed surface of triangles that a user has.

drawn by Open CASCADE (drawings.py), or bricks: a can, an elliptic gong, glasses, with and without a dent
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.records import Array, Material, Shape
from studies.thin_walls.blocks import Block, disc, quad, swept
from studies.thin_walls.bodies import BODIES, STEEL, Detail, Stuff, ThinBody
from studies.thin_walls.calculix import ORDER
from studies.thin_walls.ours import dented
from studies.twenty_shapes.drawings import DRAWINGS, tetrahedra, triangles

ALUMINIUM = Stuff(70e9, 0.33, 2700.0)
LARGER = 1.4  # coarse edge of tetrahedra over the fine one's
ELLIPSE = 1.1  # half the gong's longer axis over the mean one

Cells = tuple[Array, Array, str]
"""Nodes (n, 3) in m, cells (c, k) in ccx's order, ccx's name of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """stuff; cells: of the coarse and of the fine mesh; surface: what a user has; ratio of their edges; truth: the name
    under which it is kept; edge_mm: of a drawing's fine cells.
    """

    stuff: Stuff
    cells: Callable[[bool], Cells]
    surface: Callable[[], Shape]
    ratio: float
    truth: str
    edge_mm: float | None = None

    @property
    def material(self) -> Material:
        return Material.isotropic(self.truth, **{k: getattr(self.stuff, k) for k in self.stuff.__slots__})


def _can(d: Detail) -> list[Block]:
    """⌀ 66 × 110 mm, wall and its one lid 0.3 mm."""
    outer, wall, height = 0.033, 0.0003, 0.110
    inner = outer - wall
    return [
        *disc(d.quarter, d.cells(4), d.across, quad((0, 0), (inner, 0), (inner, wall), (0, wall))),
        swept(d.quarter, d.across, d.across, quad((inner, 0), (outer, 0), (outer, wall), (inner, wall))),
        swept(d.quarter, d.cells(12), d.across, quad((inner, wall), (inner, height), (outer, height), (outer, wall))),
    ]


CAN = ThinBody("can", "⌀ 66 × 110 mm, wall and lid 0.3 mm", STEEL, _can, Detail(10, 1.0), Detail(14, 1.5))


def _brick_entry(body: ThinBody, *, ellipse: float = 1.0, dent: bool = False, truth: str = "") -> Entry:
    stretch = np.array([ellipse, 1 / ellipse, 1.0])

    def cells(fine: bool) -> Cells:
        made = body.bricks(fine=fine)
        return made.node_m * stretch, made.cell[:, ORDER], "C3D20R"

    def surface() -> Shape:
        shape = body.shape()
        shape = replace(shape, vertex_m=shape.vertex_m * stretch)
        return dented(shape) if dent else shape

    return Entry(body.stuff, cells, surface, body.fine.along / body.coarse.along, truth or body.name)


def _drawn(name: str, edge_mm: float, stuff: Stuff = STEEL) -> Entry:
    def cells(fine: bool) -> Cells:
        node, tet = tetrahedra(DRAWINGS[name](), edge_mm if fine else LARGER * edge_mm)
        return node, tet, "C3D10"

    def surface() -> Shape:
        vertex, face = triangles(DRAWINGS[name]())
        return Shape("mesh", vertex_m=vertex, face=face.astype(np.int32))

    return Entry(stuff, cells, surface, LARGER, name, edge_mm)


ENTRIES: dict[str, Entry] = {
    "nut": _drawn("nut", 1.35),
    "fork": _drawn("fork", 2.0),
    "bracket": _drawn("bracket", 2.7),
    "clip": _drawn("clip", 2.3),
    "perforated": _drawn("perforated", 2.8),
    "spanner": _drawn("spanner", 2.4),
    "wheel": _drawn("wheel", 3.8),
    "heat_sink": _drawn("heat_sink", 4.0, ALUMINIUM),
    "crank": _drawn("crank", 3.2),
    "flywheel": _drawn("flywheel", 5.2),
    "housing": _drawn("housing", 4.4, ALUMINIUM),
    "spoon": _drawn("spoon", 1.7),
    "hammer": _drawn("hammer", 4.6),
    "fan": _drawn("fan", 2.6, ALUMINIUM),
    "angle": _drawn("angle", 2.0),
    "mallet": _drawn("mallet", 5.0),
    "finned_block": _drawn("finned_block", 3.0, ALUMINIUM),
    "grooved_ring": _drawn("grooved_ring", 2.5),
    "can": _brick_entry(CAN),
    "can, dented": _brick_entry(CAN, dent=True),
    "wine-glass": _brick_entry(BODIES["wine-glass"]),
    "wine-glass, dented": _brick_entry(BODIES["wine-glass"], dent=True),
    "tumbler, dented": _brick_entry(BODIES["tumbler"], dent=True),
    "gong, elliptic": _brick_entry(BODIES["gong"], ellipse=ELLIPSE, truth="gong, elliptic"),
}
