"""Sides of a sheet -> one layer of curved wedges: one side meshed anew, each of its nodes set over to the other side.

outer side -> triangles of Netgen, as large as waves and bends allow -> strips along creases (strips.py)
corners, middles of edges -> on the outer side, on its creases, on its rim
a node x with wall t behind it, its triangles' normals n_i:  d·n_i = t of them all, in the least-squares sense
    inner node: nearest point to x − d of the inner side, of its creases, of its rim
"""

from __future__ import annotations

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.modal.meshing.on_surface import creases, nearest_on_lines
from sonic_bullet.modal.meshing.sizes import spread_points
from sonic_bullet.modal.meshing.tetrahedra import surface_triangles
from sonic_bullet.modal.sheets.sheet_sides import Sides, rim
from sonic_bullet.modal.sheets.strips import with_strips
from sonic_bullet.modal.sheets.wedges import TRIANGLE_EDGE, Layer, determinants, volume
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

NOT_FOLLOWED = MeshError("the wedges of a sheet do not follow its sides", "give a simpler mesh")


def layer_of(vertex_m: Array, face: Array, sides: Sides, edge_m: float, scale: float) -> Layer:
    """Mesh a sheet that is the closed surface vertex_m (v, 3), face (f, 3) by wedges at most edge_m wide.

    scale: of the widths where it is bent. Raises MeshError where wedges do not fill it.
    """
    # width over √(R t): a bend's decay takes 0.8 of it and cubic elements follow; width over R
    by_decay, by_bend = 2.2, 0.5
    strips, growth, widest = 2.0, 4.0, 0.4  # narrowest strip over the wall, each next over it, widest over edge_m
    same_volume = 0.01
    bend = 2 * np.abs(geometry.face_curvature(sides.vertex_m, sides.outer))  # a cylinder's: the mean is half of it
    radius = 1 / np.maximum(bend, 1e-300)
    size = scale * np.minimum(by_decay * np.sqrt(sides.wall_m * radius), by_bend * radius)
    size = np.maximum(size, sides.wall_m)
    bent = size < edge_m
    point, size = spread_points(sides.vertex_m[sides.outer[bent]], size[bent])
    corner, triangle = surface_triangles(vertex_m, face, edge_m, point, size)
    corner, triangle = _of_outer(sides, corner, triangle)
    lines = _Lines(sides.vertex_m, sides.outer)
    crease = lines.creases_of(corner, triangle)
    wall = float(np.median(sides.wall_m))
    widths = [w for w in (scale * strips * wall * growth**k for k in range(8)) if w < widest * edge_m][::-1]
    stripped = with_strips(corner, triangle, crease, widths if len(crease) else [])
    layer = _place_nodes(sides, lines, stripped.corner_m, stripped.triangle, crease, stripped.strip)
    if abs(volume(layer) / abs(geometry.volume_m3(vertex_m, face)) - 1) > same_volume:
        raise NOT_FOLLOWED
    return layer


class _Lines:
    """Creases and rim (e, 2, 3) of a side, in m."""

    def __init__(self, vertex_m: Array, face: Array) -> None:
        self.crease_m = vertex_m[creases(vertex_m, face)].reshape(-1, 2, 3)
        self.rim_m = vertex_m[rim(face)].reshape(-1, 2, 3)

    def creases_of(self, corner_m: Array, triangle: Array) -> Array:
        """Return the edges (e, 2) of triangles that follow the creases."""
        on_it, near = 1e-3, 0.1  # of an edge: how far its ends and its middle may be off
        if not len(self.crease_m):
            return np.zeros((0, 2), np.int64)
        edge, _, count = _edges(triangle)
        edge = edge[count == 2]
        end = corner_m[edge]
        length = np.linalg.norm(end[:, 1] - end[:, 0], axis=1)
        off = [_off_lines(self.crease_m, p) for p in (end[:, 0], end[:, 1], end.mean(axis=1))]
        return np.asarray(edge[(np.maximum(off[0], off[1]) < on_it * length) & (off[2] < near * length)])


def _edges(triangle: Array) -> tuple[Array, Array, Array]:
    """Return the edges (e, 2) of triangles, which each of theirs (3t,) is, and how many triangles have it."""
    pair = np.sort(triangle[:, TRIANGLE_EDGE], axis=2).reshape(-1, 2)
    edge, at, count = np.unique(pair, axis=0, return_inverse=True, return_counts=True)
    return edge, at.ravel(), count


def _off_lines(line_m: Array, point_m: Array) -> Array:
    return np.asarray(np.linalg.norm(nearest_on_lines(line_m, point_m) - point_m, axis=1))


def _of_outer(sides: Sides, corner_m: Array, triangle: Array) -> tuple[Array, Array]:
    """Keep the triangles that lie on the outer side. Raises MeshError where they leave some of it out."""
    alike = 0.5  # cosine of the angle to the side's normal: the rim looks another way, the inner side the opposite one
    same_area = 0.05  # chords of bends and holes change it: the volume is checked once edges are curved
    normal = geometry.outward_normals(corner_m, triangle)
    found, _, _ = geometry.closest_point(sides.vertex_m, sides.outer, corner_m[triangle].mean(axis=1))
    along = np.einsum("tx,tx->t", normal, geometry.outward_normals(sides.vertex_m, sides.outer)[found])
    used, kept = np.unique(triangle[along > alike], return_inverse=True)
    if not len(used):
        raise NOT_FOLLOWED
    corner_m, triangle = corner_m[used], kept.reshape(-1, 3)
    area = float(geometry.face_areas_m2(corner_m, triangle).sum())
    if abs(area / float(geometry.face_areas_m2(sides.vertex_m, sides.outer).sum()) - 1) > same_area:
        raise NOT_FOLLOWED
    return corner_m, triangle


def _place_nodes(sides: Sides, lines: _Lines, corner_m: Array, triangle: Array, crease: Array, strip: Array) -> Layer:
    """Set corners and middles of edges on both sides."""
    n = len(corner_m)
    edge, at, count = _edges(triangle)
    six = np.concatenate([triangle, n + at.reshape(-1, 3)], axis=1)
    on_rim = np.concatenate([np.zeros(n, bool), count == 1])
    on_rim[edge[count == 1]] = True
    code = np.sort(crease, axis=1) @ np.array([n, 1])
    on_crease = np.concatenate([np.zeros(n, bool), np.isin(edge @ np.array([n, 1]), code)])
    on_crease[crease.ravel()] = True
    outer = np.concatenate([corner_m, corner_m[edge].mean(axis=1)])
    flat = geometry.outward_normals(outer, triangle)
    mean = np.zeros_like(outer)
    np.add.at(mean, six.ravel(), np.repeat(flat, 6, axis=0))
    index = geometry.surface_index(sides.vertex_m, sides.outer)
    found, part, _ = geometry.nearest(index, outer, mean)
    smooth = ~(on_rim | on_crease)
    outer[smooth] = np.einsum("kc,kcx->kx", part, sides.vertex_m[sides.outer[found]])[smooth]
    outer[on_crease & ~on_rim] = _on(lines.crease_m, outer[on_crease & ~on_rim])
    outer[on_rim] = _on(lines.rim_m, outer[on_rim])
    at_corner = geometry.corner_normals(sides.vertex_m, sides.outer)[found]
    normal = np.einsum("kc,kcx->kx", part, at_corner)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    depth = normal * _behind_m(sides, outer, normal)[:, None]
    wall = np.where(smooth, np.linalg.norm(depth, axis=1), sides.wall_m[found])
    lined = np.flatnonzero(~smooth)
    depth[lined] = _inward(six, flat, lined, len(outer)) * wall[lined][:, None]
    target = outer - depth
    inner, _ = _nearest_inner(sides, target, -normal)
    other = _Lines(sides.vertex_m, sides.inner)
    if len(other.crease_m):
        inner[on_crease & ~on_rim] = _near(other.crease_m, target, inner, wall)[on_crease & ~on_rim]
    if len(other.rim_m):
        inner[on_rim] = _near(other.rim_m, target, inner, 4 * wall)[on_rim]
    for a, b, c, d in strip.tolist():  # the middle of a strip's cut: bent as its long edges are
        mids = [_middle(edge, n, pair) for pair in ((a, c), (a, b), (c, d))]
        outer[mids[0]], inner[mids[0]] = outer[mids[1:]].mean(axis=0), inner[mids[1:]].mean(axis=0)
    return _unfold_layer(Layer(outer, inner, six))


def _middle(edge: Array, n: int, pair: tuple[int, int]) -> int:
    """Return the node in the middle of an edge: edges (e, 2) are sorted."""
    low, high = min(pair), max(pair)
    start, stop = np.searchsorted(edge[:, 0], [low, low + 1])
    return n + int(start) + int(np.searchsorted(edge[start:stop, 1], high))


def _on(line_m: Array, point_m: Array) -> Array:
    return nearest_on_lines(line_m, point_m) if len(line_m) and len(point_m) else point_m


def _near(line_m: Array, target_m: Array, otherwise_m: Array, within_m: Array) -> Array:
    """Return the nearest points (k, 3) on lines, or the others where these are farther than within_m (k,)."""
    found = nearest_on_lines(line_m, target_m)
    close = np.linalg.norm(found - target_m, axis=1) < within_m
    return np.where(close[:, None], found, otherwise_m)


def _nearest_inner(sides: Sides, point_m: Array, normal: Array) -> tuple[Array, Array]:
    """Find the nearest points (k, 3) of the inner side, and how far they are (k,)."""
    index = geometry.surface_index(sides.vertex_m, sides.inner)
    found, part, distance = geometry.nearest(index, point_m, normal)
    return np.einsum("kc,kcx->kx", part, sides.vertex_m[sides.inner[found]]), distance


def _behind_m(sides: Sides, outer_m: Array, normal: Array) -> Array:
    """Compute the wall (k,) behind points of the outer side along their normals, twice corrected."""
    _, wall = _nearest_inner(sides, outer_m, -normal)
    for _ in range(2):
        at, _ = _nearest_inner(sides, outer_m - wall[:, None] * normal, -normal)
        wall = np.einsum("kx,kx->k", outer_m - at, normal)
    return wall


def _inward(six: Array, flat: Array, node: Array, count: int) -> Array:
    """Compute d (k, 3) of nodes with d·n = 1 for all their triangles' normals flat (t, 3), as short as possible."""
    least = 0.05  # of the normals that one direction holds: less is noise
    matrix, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for k in range(6):
        np.add.at(matrix, six[:, k], flat[:, :, None] * flat[:, None, :])
        np.add.at(right, six[:, k], flat)
    value, axis = np.linalg.eigh(matrix[node])
    along = np.einsum("kxa,kx->ka", axis, right[node])
    keep = value > least * value.sum(axis=1, keepdims=True)
    along = np.where(keep, along / np.maximum(value, 1e-300), 0.0)
    return np.asarray(np.einsum("kxa,ka->kx", axis, along))


def _unfold_layer(layer: Layer) -> Layer:
    """Return the layer with straight edges where a wedge would fold. Raises MeshError where straight ones do."""
    least = 0.2  # of the largest det J of a wedge
    outer, inner, six = layer.outer_m.copy(), layer.inner_m.copy(), layer.triangle
    for _ in range(len(six)):
        found = determinants(Layer(outer, inner, six))
        folded = np.flatnonzero(found.min(axis=1) < least * found.max(axis=1))
        if not len(folded):
            break
        middle, ends = six[folded][:, 3:], six[folded][:, TRIANGLE_EDGE]
        moved = (
            np.abs(outer[middle] - outer[ends].mean(axis=2)).max()
            + np.abs(inner[middle] - inner[ends].mean(axis=2)).max()
        )
        outer[middle], inner[middle] = outer[ends].mean(axis=2), inner[ends].mean(axis=2)
        if moved == 0:
            break
    if (determinants(Layer(outer, inner, six)) <= 0).any():
        raise NOT_FOLLOWED
    return Layer(outer, inner, six)
