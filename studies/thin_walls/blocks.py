"""Blocks of bricks and what they are put together from: sections swept round an axis, outlines drawn straight.

    block: cells, and a place x(a, b, c) of 0..1 -> bricks with 20 nodes (suite/bricks.py) -> welded where they meet
    disc:  a bulged square and four sectors round it (O-grid): no cell touches the axis with an edge or a point
    swept: a section's quadrilateral x(along, across) = (r, z), from 45° round

Two blocks meet where their lattices have the same nodes. Quadrilaterals of a section may meet a disc at the disc's rim.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.suite.bricks import Bricks, gauss_points, grid, outer_rings, shape_functions
from sonic_bullet.records import Array

Section = Callable[[Array, Array], tuple[Array, Array]]
"""(along, across) in 0..1 -> (r, z) in m of a part of a section; where it starts at the axis, along leads away."""

CORE, BULGE = 0.55, 0.12  # of a disc's square: half its side over the radius, and how far its sides bulge
STUB = 0.125  # of a bent handle's cells at each end: its straight part
WELD = 1e-7  # of the diagonal: nodes nearer are one


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """cells along a, b, c; place: (n, 3) in 0..1 -> (n, 3) in m; closed: a runs round."""

    cells: tuple[int, int, int]
    place: Callable[[Array], Array]
    closed: bool = False


def welded(blocks: Iterable[Block]) -> Bricks:
    """One mesh of 20-node bricks, of blocks whose nodes are one where they lie within `WELD` of the diagonal."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    parts = [grid(block.cells, block.place, closed=block.closed) for block in blocks]
    start = np.cumsum([0, *(len(part.node_m) for part in parts)])
    node = np.concatenate([part.node_m for part in parts])
    near = cKDTree(node).query_pairs(WELD * np.linalg.norm(np.ptp(node, axis=0)), output_type="ndarray")
    size = len(node)
    _, label = connected_components(coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(size, size)))
    _, first, one = np.unique(label, return_index=True, return_inverse=True)
    cell = one[np.concatenate([part.cell + begin for part, begin in zip(parts, start[:-1], strict=True)])]
    corner = outer_rings(cell)[:, ::2]
    skin, quad = np.unique(corner, return_inverse=True)
    quad = quad.reshape(-1, 4)
    face = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
    return Bricks(node[first], cell, skin, face, np.concatenate([part.centre for part in parts]))


def brick_volumes_m3(body: Bricks) -> Array:
    """Volumes of the bricks at their 27 points of Gauss (c, 27), weighted: all above zero where none is turned inside
    out.
    """
    points, weight = gauss_points(3)
    _, slope = shape_functions(points)
    return np.asarray(np.linalg.det(np.einsum("cid,qik->cqdk", body.node_m[body.cell], slope)) * weight)


def disc(quarter: int, rings: int, layers: int, section: Section) -> list[Block]:
    """The part of a body round its axis: section with along 0 on the axis, 1 at the rim; 4 × quarter cells round."""

    def place(x: Array, y: Array, across: Array) -> Array:
        along = np.hypot(x, y)
        r, z = section(along, across)
        share = np.divide(r, along, out=np.zeros_like(r), where=along > 0)
        return np.column_stack([share * x, share * y, z])

    def side(t: Array) -> tuple[Array, Array]:
        return CORE * (1 + BULGE * (1 - t**2)) / np.sqrt(2) * np.ones_like(t), CORE * t / np.sqrt(2)

    def core(p: Array) -> Array:
        t, u = 2 * p[:, 0] - 1, 2 * p[:, 1] - 1
        return place(side(u)[0] * t, side(t)[0] * u, p[:, 2])

    def sector(turn: int) -> Callable[[Array], Array]:
        cos, sin = ((1, 0), (0, 1), (-1, 0), (0, -1))[turn]

        def around(p: Array) -> Array:
            t, out = 2 * p[:, 0] - 1, p[:, 1]
            inner = side(t)
            x = (1 - out) * inner[0] + out * np.cos(np.pi / 4 * t)
            y = (1 - out) * inner[1] + out * np.sin(np.pi / 4 * t)
            return place(cos * x - sin * y, sin * x + cos * y, p[:, 2])

        return around

    return [
        Block((quarter, quarter, layers), core),
        *(Block((quarter, rings, layers), sector(turn)) for turn in range(4)),
    ]


def swept(quarter: int, along: int, across: int, section: Section) -> Block:
    """A quadrilateral of a section swept round; 4 × quarter cells."""

    def place(p: Array) -> Array:
        angle = 2 * np.pi * p[:, 0] - np.pi / 4
        r, z = section(p[:, 1], p[:, 2])
        return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])

    return Block((4 * quarter, along, across), place, closed=True)


def quad(*corner: tuple[float, float]) -> Section:
    """Section of four corners (r, z): at along, across = (0, 0), (1, 0), (1, 1), (0, 1); bilinear."""
    (a, b, c, d) = np.array(corner)

    def section(s: Array, w: Array) -> tuple[Array, Array]:
        s, w = s[:, None], w[:, None]
        point = (1 - w) * ((1 - s) * a + s * b) + w * ((1 - s) * d + s * c)
        return point[:, 0], point[:, 1]

    return section


def strip(curve: Callable[[Array], tuple[Array, ...]], start_m: float, end_m: float) -> Section:
    """Section of a wall about its middle; curve: along -> r, z, unit normal's r, z; thickness at both ends, m."""

    def section(s: Array, w: Array) -> tuple[Array, Array]:
        r, z, across_r, across_z = curve(s)
        off = (w - 0.5) * (start_m + (end_m - start_m) * s)
        return r + off * across_r, z + off * across_z

    return section


def walk(
    start: tuple[float, float], heading_deg: float, thickness_m: float, steps: Iterable[tuple[float, float, float]]
) -> list[Section]:
    """Sections of a wall whose middle goes on from start = (r, z), 0° away from the axis, 90° up.

    steps: (length, 0, thickness at its end) straight on, or (radius, turn in degrees, thickness at its end) along an
    arc; radius and turn are negative to the right. Across leads to the right: outward of a bowl.
    """
    sections = []
    (r, z), heading = start, np.radians(heading_deg)
    for size, turn_deg, end_m in steps:
        curve = _line(r, z, heading, size) if turn_deg == 0 else _arc(r, z, heading, size, np.radians(turn_deg))
        sections.append(strip(curve, thickness_m, end_m))
        last = curve(np.ones(1))
        r, z, heading, thickness_m = float(last[0][0]), float(last[1][0]), heading + np.radians(turn_deg), end_m
    return sections


def _line(r: float, z: float, heading: float, length: float) -> Callable[[Array], tuple[Array, ...]]:
    cos, sin = np.cos(heading), np.sin(heading)
    return lambda s: (r + s * length * cos, z + s * length * sin, sin + 0 * s, -cos + 0 * s)


def _arc(r: float, z: float, heading: float, radius: float, turn: float) -> Callable[[Array], tuple[Array, ...]]:
    def curve(s: Array) -> tuple[Array, ...]:
        angle = heading + turn * s
        sin, cos = np.sin(angle), np.cos(angle)
        return r + radius * (sin - np.sin(heading)), z - radius * (cos - np.cos(heading)), sin, -cos

    return curve


def cartesian(
    x: Sequence[float],
    y: Sequence[float],
    z: Sequence[float],
    along_x: Sequence[int],
    along_y: Sequence[int],
    along_z: Sequence[int],
    keep: Callable[[float, float, float], bool] = lambda x, y, z: True,
) -> list[Block]:
    """Straight blocks between breaks x, y, z (m), so many cells in each interval; keep: those with this centre."""
    blocks = []
    for i, nx in enumerate(along_x):
        for j, ny in enumerate(along_y):
            for k, nz in enumerate(along_z):
                low, high = np.array([x[i], y[j], z[k]]), np.array([x[i + 1], y[j + 1], z[k + 1]])
                if keep(*((low + high) / 2)):
                    blocks.append(Block((nx, ny, nz), partial(_straight, low, high)))
    return blocks


def _straight(low: Array, high: Array, p: Array) -> Array:
    return np.asarray(low + p * (high - low))


def grip(
    quarter: int,
    wide: int,
    high: int,
    along: int,
    wall_m: float,
    middle_m: float,
    bend_m: float | None,
    bar_m: float,
    stub_m: float,
) -> Block:
    """A handle on a round wall of outer radius wall_m: as wide as `wide` of its 4 × quarter cells round, bar_m high.

    It leaves the wall along its radius; with bend_m it turns in half a circle of that mean radius, stub_m outside the
    wall, and comes back, its middle at height middle_m; without, it ends stub_m outside. Every end is a patch of wall.
    """
    half = np.pi / 4 * wide / quarter  # rad, half the patch; it begins at angle 0, a line of every lattice

    def place(p: Array) -> Array:
        side = wall_m * np.sin(half * (2 * p[:, 1] - 1))
        begin = np.sqrt(wall_m**2 - side**2)
        out, t = wall_m + stub_m, p[:, 0]
        off = (p[:, 2] - 0.5) * bar_m
        if bend_m is None:
            x, z = begin + t * (out - begin), middle_m + off
        else:
            radius = bend_m + off
            angle = np.pi * ((t - STUB) / (1 - 2 * STUB)).clip(0, 1)
            straight = np.minimum(t, 1 - t).clip(max=STUB) / STUB
            x = begin + straight * (out - begin) + radius * np.sin(angle)
            z = middle_m - radius * np.cos(angle)
        return np.column_stack([x * np.cos(half) - side * np.sin(half), x * np.sin(half) + side * np.cos(half), z])

    return Block((along, wide, high), place)
