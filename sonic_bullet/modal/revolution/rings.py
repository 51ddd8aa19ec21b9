"""Recognition of bodies of revolution: balls, cylinders and capsules by name, closed meshes by their rings.

    vertices of one radius and height that go round without a wide gap -> a ring; one on the axis -> a pole
    vertices of no ring that lie on one curve (patches.py) -> that curve
    rings joined by faces -> sides of the section; a ring filled by faces of its own -> a flat end, a pole in its middle
    poles in pairs along the axis -> the body's inside

The section is the polygon of rings and poles, so that the body is round where the mesh is faceted. What does not fit is
no body of revolution: a handle, a spout, a dent, a prism of few sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.geometry import CREASE_RAD
from sonic_bullet.modal.meshing.shape_meshes import rotation
from sonic_bullet.modal.revolution.patches import Patch, patches
from sonic_bullet.records import Array, Shape

ROUND = 2e-5  # of the diagonal: what a ring's vertices may differ by
GAP = (
    0.45  # radians: the widest gap between neighbours on a ring; with fewer than 14 the area is 3 % less than a disc's
)
BETWEEN = 1.02  # a detour over a third ring of less than this times the direct length replaces the direct side
ARC = 256  # sides of a half circle: its area to 5e-5


@dataclass(frozen=True, slots=True, eq=False)
class Revolved:
    """A body of revolution.

    Attributes
    ----------
    outline_m : (p, 2) polygon of (r, z), counter-clockwise, on the axis where r = 0
    axes : (3, 3) as columns, the last the axis
    centre_m : (3,)
    """

    outline_m: Array
    axes: Array
    centre_m: Array

    @property
    def area_m2(self) -> float:
        """Area of the section."""
        r, z = self.outline_m.T
        return float((r * np.roll(z, -1) - np.roll(r, -1) * z).sum() / 2)

    @property
    def volume_m3(self) -> float:
        """Volume, by Pappus."""
        return float(_swept(self.outline_m).sum())

    @property
    def on_axis(self) -> Array:
        """Which sides (p,) of the outline lie on the axis: the body continues behind them."""
        r = self.outline_m[:, 0]
        return np.asarray((r == 0) & (np.roll(r, -1) == 0))

    def curvature_per_m(self, side: Array, at: Array) -> Array:
        """Compute the smooth outline's curvature (k,), positive where it bulges, at the part ``at`` (k,) of sides (k,).

        A bend is an arc that begins half the shorter side before it and ends as far behind. A corner has none, and a
        side that ends in one continues as it is. On the axis the outline meets its mirror image.
        """
        alike = 0.3  # relative difference of sides that are taken for chords of one arc
        along = np.roll(self.outline_m, -1, axis=0) - self.outline_m
        length, heading = np.linalg.norm(along, axis=1), np.arctan2(along[:, 1], along[:, 0])
        turn, short, on = turns(self.outline_m), np.minimum(length, np.roll(length, 1)), self.on_axis
        first, last = np.roll(on, 1), on
        turn = np.where(first, _wrapped(2 * heading), np.where(last, _wrapped(-2 * np.roll(heading, 1)), turn))
        short = np.where(first, length, np.where(last, np.roll(length, 1), short))
        smooth = np.abs(turn) < CREASE_RAD
        arc = np.where(smooth, turn / short, 0)
        after = (side + 1) % len(length)
        mine, other = np.where(at < 0.5, side, after), np.where(at < 0.5, after, side)
        away = np.minimum(at, 1 - at) * length[side]
        going_on = np.where(short[other] > (1 - alike) * length[side], arc[other], 0)
        return np.asarray(np.where(smooth[mine], np.where(away < (0.5 + ROUND) * short[mine], arc[mine], 0), going_on))

    def scaled(self, factor: float) -> Revolved:
        """Return the outline scaled by ``factor``; axes and centre stay."""
        return Revolved(self.outline_m * factor, self.axes, self.centre_m)


def turns(polygon: Array) -> Array:
    """Compute by how much (p,) in rad a closed polygon (p, 2) turns left at each corner."""
    along = np.roll(polygon, -1, axis=0) - polygon
    heading = np.arctan2(along[:, 1], along[:, 0])
    return _wrapped(heading - np.roll(heading, 1))


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def _swept(polygon: Array) -> Array:
    """Compute what each side (p,) of a polygon adds to the volume swept about the z axis."""
    r, z = polygon.T
    s, t = np.roll(r, -1), np.roll(z, -1)
    return np.asarray(np.pi / 3 * (r + s) * (r * t - s * z))


def of_shape(shape: Shape) -> Revolved | None:
    """Return the body of revolution that a named shape or a closed surface is, in the body's frame, else None."""
    turn = rotation(shape.quaternion_xyzw)
    if shape.kind == "mesh":
        found = recognised(shape.vertex_m, shape.face)
        return found and Revolved(found.outline_m, turn @ found.axes, turn @ found.centre_m + shape.position_m)
    outline = _named(shape)
    return None if outline is None else Revolved(outline, turn, np.asarray(shape.position_m, float))


def _named(shape: Shape) -> Array | None:
    radius, half = float(shape.size_m[0]), float(shape.size_m[1]) / 2
    if shape.kind == "cylinder":
        return np.array([[0, -half], [radius, -half], [radius, half], [0, half]])
    if shape.kind not in ("sphere", "capsule"):
        return None
    half = half if shape.kind == "capsule" else 0.0
    angle = np.linspace(-np.pi / 2, np.pi / 2, ARC + 1)
    arc = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    arc[[0, -1], 0] = 0
    if half == 0:
        return arc
    low, high = arc[: ARC // 2 + 1], arc[ARC // 2 :]
    end = np.array([0, half])
    return np.concatenate([low - end, high + end])


def recognised(vertex_m: Array, face: Array) -> Revolved | None:
    """Recognise the body of revolution that a closed surface, outward, is, else return None."""
    used, face = np.unique(face, return_inverse=True)
    vertex_m, face = geometry.welded(vertex_m[used], face.reshape(-1, 3))
    if len(face) == 0 or not geometry.is_closed(face) or not geometry.volume_m3(vertex_m, face) > 0:
        return None
    _, centre, inertia = geometry.inertia(vertex_m, face, 1.0)
    _, direction = np.linalg.eigh(inertia)
    for k in range(3):
        axes = np.roll(direction, 2 - k, axis=1)
        axes = axes * [1, 1, np.sign(np.linalg.det(axes))]
        outline = _outline((vertex_m - centre) @ axes, face)
        if outline is not None:
            return Revolved(outline, axes, centre)
    return None


def _outline(point: Array, face: Array) -> Array | None:
    """Return the polygon (p, 2), counter-clockwise, of the rings of a surface about the z axis.

    None where there are no rings, or they make no closed outline.
    """
    same = 0.02  # relative difference of volumes
    diagonal = float(np.linalg.norm(np.ptp(point, axis=0)))
    ring, middle, filled = _rings(point, diagonal)
    between = patches(point, face, ring, middle) if len(middle) else None
    if between is None:
        return None
    whole = ring[face]
    sides = _sides(whole[(whole >= 0).all(axis=1)], middle, filled, between)
    walk = None if sides is None else _walked(sides[0])
    if sides is None or walk is None:
        return None
    outline, share = sides[1][walk], sides[2][walk]
    if float((outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1]).sum()) < 0:
        outline, share = outline[::-1], share[::-1]
    expected = float((_swept(outline) * (share + np.roll(share, -1)) / 2).sum())
    return outline if abs(geometry.volume_m3(point, face) / expected - 1) < same else None


def _rings(point: Array, diagonal: float) -> tuple[Array, Array, Array]:
    """Find the rings of a surface about the z axis.

    Returns the ring (v,) of each vertex, -1 for none; radius and height (k, 2) of each ring, radius 0 on the axis; and
    the fraction (k,) of its disc that the ring's polygon fills.
    """
    bore = 1e-3  # of the diagonal: the least radius of a ring
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    flat = np.stack([np.hypot(point[:, 0], point[:, 1]), point[:, 2]], axis=1)
    pair = cKDTree(flat).query_pairs(ROUND * diagonal, output_type="ndarray")
    n = len(point)
    _, ring = connected_components(
        coo_array((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(n, n)), directed=False
    )
    count = np.bincount(ring)
    middle = np.stack([np.bincount(ring, flat[:, k]) / count for k in range(2)], axis=1)
    pole = (count == 1) & (middle[:, 0] < ROUND * diagonal)
    angle = np.arctan2(point[:, 1], point[:, 0])
    order = np.lexsort((angle, ring))
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    step = np.diff(angle[order], append=0)
    last = start + count - 1
    step[last] = angle[order][start] + 2 * np.pi - angle[order][last]
    widest = np.zeros(len(count))
    np.maximum.at(widest, ring[order], step)
    filled = np.bincount(ring[order], np.sin(step)) / (2 * np.pi)
    filled[pole] = 1.0  # no area: any fraction does
    middle[pole, 0] = 0
    good = pole | ((widest < GAP) & (middle[:, 0] > bore * diagonal))
    number = np.where(good, np.cumsum(good) - 1, -1)
    return number[ring], middle[good], filled[good]


def _sides(
    triple: Array, middle: Array, filled: Array, between: list[Patch]
) -> tuple[list[list[int]], Array, Array] | None:
    """Join the rings along the outline, from the rings triple (f, 3) of the faces; None where poles do not pair.

    Returns the neighbours of each ring, and the rings with what is added to them: the points of patches between, and a
    pole for each flat end that has none.
    """
    edge = np.unique(np.sort(np.concatenate([triple[:, [0, 1]], triple[:, [1, 2]], triple[:, [2, 0]]]), axis=1), axis=0)
    edge = edge[edge[:, 0] != edge[:, 1]]
    ends = np.unique(triple[(triple == triple[:, :1]).all(axis=1), 0])
    wide, narrow = np.where(middle[edge[:, :1], 0] > middle[edge[:, 1:], 0], edge, edge[:, ::-1]).T
    level = np.abs(middle[wide, 1] - middle[narrow, 1]) < 1e-3 * np.abs(middle[wide, 0] - middle[narrow, 0])
    ends = np.setdiff1d(ends, wide[level])  # a flat ring ends at the narrower radius
    added = np.stack([ends, len(middle) + np.arange(len(ends))], axis=1)
    middle = np.concatenate([middle, np.stack([np.zeros(len(ends)), middle[ends, 1]], axis=1)])
    filled = np.concatenate([filled, filled[ends]])
    joined = []
    for (start, end), curve in between:
        walk = [start, *range(len(middle), len(middle) + len(curve)), *([end] if end >= 0 else [])]
        joined += list(pairwise(walk))
        middle = np.concatenate([middle, curve])
        filled = np.concatenate([filled, np.full(len(curve), filled[start])])
    pole = np.flatnonzero(middle[:, 0] == 0)
    pole = pole[np.argsort(middle[pole, 1], kind="stable")]
    if len(pole) % 2:
        return None
    edge = np.concatenate([edge, added, np.array(joined, int).reshape(-1, 2), pole.reshape(-1, 2)])
    neighbours: list[set[int]] = [set() for _ in middle]
    for a, b in edge.tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    # A diagonal may join a ring to the next but one: where a third lies on the way, it is no side.
    side: list[list[int]] = [[] for _ in middle]
    for a, b in edge.tolist():
        direct = float(np.linalg.norm(middle[a] - middle[b]))
        over = any(
            np.linalg.norm(middle[a] - middle[c]) + np.linalg.norm(middle[c] - middle[b]) < BETWEEN * direct
            for c in neighbours[a] & neighbours[b]
        )
        if not over:
            side[a].append(b)
            side[b].append(a)
    return side, middle, filled


def _walked(side: list[list[int]]) -> list[int] | None:
    """Return all rings in the order in which they are joined, None where that is no single closed walk."""
    if len(side) < 3 or any(len(s) != 2 for s in side):
        return None
    walk, here = [0], side[0][0]
    while here != 0:
        following = [s for s in side[here] if s != walk[-1]]
        walk.append(here)
        if len(following) != 1 or len(walk) > len(side):
            return None
        here = following[0]
    return walk if len(walk) == len(side) else None
