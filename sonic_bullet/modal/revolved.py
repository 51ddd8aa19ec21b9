"""Modes of a free body of revolution: a Fourier series around its axis, cubic triangles on its section.

    u_r = U cos mθ,  u_z = W cos mθ,  u_θ = V sin mθ
        [Zienkiewicz & Taylor, The Finite Element Method (2000), vol. 2, ch. 9.4-9.5]
    ε_rr = U,r   ε_zz = W,z   ε_θθ = (U + mV)/r   γ_rz = U,z + W,r   γ_rθ = V,r − (V + mU)/r   γ_zθ = V,z − mW/r

Each m is a small plane problem, each mode of m > 0 has a degenerate partner turned by π/2m, exactly. A surface is
recognised by its rings: vertices of one radius and height that go round evenly; the section is the polygon of the
rings, so that the body is round where the mesh is faceted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.modal.meshing.prisms import triangulated
from sonic_bullet.modal.meshing.solid import QUARTERS
from sonic_bullet.records import Array

ROUND = 2e-5  # of the diagonal: what a ring's vertices may differ by
GAP = 0.6  # radians: the widest gap between neighbours on a ring
BENT = 0.3  # radians that a parabola of the skin may turn
SAME = 0.02  # relative difference of volumes: facets lie within the circle


@dataclass(frozen=True, slots=True, eq=False)
class Revolved:
    """outline_m (p, 2) the section's polygon of (r, z), counter-clockwise; axes (3, 3) as columns, the last the axis;
    centre_m (3,).
    """

    outline_m: Array
    axes: Array
    centre_m: Array

    @property
    def area_m2(self) -> float:
        r, z = self.outline_m.T
        return float((r * np.roll(z, -1) - np.roll(r, -1) * z).sum() / 2)

    @property
    def volume_m3(self) -> float:
        """Pappus."""
        r, z = self.outline_m.T
        s, t = np.roll(r, -1), np.roll(z, -1)
        return float(np.pi / 3 * ((r + s) * (r * t - s * z)).sum())


def recognised(vertex_m: Array, face: Array) -> Revolved | None:
    """The body of revolution with a bored axis that a closed surface is, else None."""
    used, face = np.unique(face, return_inverse=True)
    vertex_m, face = geometry.welded(vertex_m[used], face.reshape(-1, 3))
    if not geometry.is_closed(face):
        return None
    volume = geometry.volume_m3(vertex_m, face)
    centre = vertex_m.mean(axis=0)
    _, direction = np.linalg.eigh(np.cov((vertex_m - centre).T))
    for k in range(3):
        axes = np.roll(direction, 2 - k, axis=1)
        axes = axes * [1, 1, np.sign(np.linalg.det(axes))]
        outline = _outline((vertex_m - centre) @ axes, face)
        if outline is None:
            continue
        found = Revolved(outline, axes, centre)
        if found.area_m2 < 0:
            found = Revolved(outline[::-1], axes, centre)
        if abs(found.volume_m3 / volume - 1) < SAME:
            return found
    return None


def _outline(point: Array, face: Array) -> Array | None:
    """Polygon (p, 2) of the rings of a surface about the z axis, in the order they are joined; None where they are no
    rings or no ring of rings.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    diagonal = float(np.linalg.norm(np.ptp(point, axis=0)))
    flat = np.stack([np.hypot(point[:, 0], point[:, 1]), point[:, 2]], axis=1)
    pair = cKDTree(flat).query_pairs(ROUND * diagonal, output_type="ndarray")
    n = len(point)
    rings, ring = connected_components(
        coo_array((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(n, n)), directed=False
    )
    count = np.bincount(ring)
    if rings < 3 or count.min() < 2 * np.pi / GAP:
        return None
    angle = np.arctan2(point[:, 1], point[:, 0])
    order = np.lexsort((angle, ring))
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    step = np.diff(angle[order], append=0)
    last = start + count - 1
    step[last] = angle[order][start] + 2 * np.pi - angle[order][last]
    if step.max() > GAP:
        return None
    middle = np.stack([np.bincount(ring, flat[:, k]) / count for k in range(2)], axis=1)
    if middle[:, 0].min() < 1e-3 * diagonal:
        return None
    edge = np.unique(np.sort(ring[np.concatenate([face[:, [0, 1]], face[:, [1, 2]], face[:, [2, 0]]])], axis=1), axis=0)
    edge = edge[edge[:, 0] != edge[:, 1]]
    neighbours: list[set[int]] = [set() for _ in range(rings)]
    for a, b in edge.tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    # A diagonal may join a ring to the next but one: where a third lies on the way, it is no side.
    side: list[list[int]] = [[] for _ in range(rings)]
    for a, b in edge.tolist():
        direct = np.linalg.norm(middle[a] - middle[b])
        over = any(
            np.linalg.norm(middle[a] - middle[c]) + np.linalg.norm(middle[c] - middle[b]) < 1.02 * direct
            for c in neighbours[a] & neighbours[b]
        )
        if not over:
            side[a].append(b)
            side[b].append(a)
    if any(len(s) != 2 for s in side):
        return None
    walk, here = [0], side[0][0]
    while here != 0:
        following = [s for s in side[here] if s != walk[-1]]
        walk.append(here)
        if len(following) != 1 or len(walk) > rings:
            return None
        here = following[0]
    return middle[walk] if len(walk) == rings else None


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """Cubic triangles on an outline. slopes: (∂r, ∂z, 1/r, 1) as sparse maps (q, n) to the points of integration,
    times √(weight r).

    order (n,): of elimination. rim (s, 4): the outline's sides as dofs, corner, two thirds, corner, walked round it;
    rim_m (s, 2) the first corners. shown (2k,): which of corners and middles (2s) the skin shows, the ends and middles
    of its parabolas in turn.
    """

    slopes: tuple[Any, Any, Any, Any]
    order: Array
    rim: Array
    rim_m: Array
    shown: Array

    def strains(self, m: int) -> tuple[Any, ...]:
        """The six strain maps rr zz θθ zθ rθ rz (q, 3n) of unknowns U, V, W."""
        from scipy.sparse import csr_array, hstack

        dr, dz, over, _ = self.slopes
        none = csr_array(dr.shape)
        rows = [
            (dr, none, none),
            (none, none, dz),
            (over, m * over, none),
            (none, dz, -m * over),
            (-m * over, dr - over, none),
            (dz, none, dr),
        ]
        return tuple(hstack(row, format="csr") for row in rows)

    def stiffness(self, strain: tuple[Any, ...], tensor: Array) -> Any:
        return sum(tensor[p, q] * (strain[p].T @ strain[q]) for p, q in zip(*np.nonzero(tensor), strict=True))


def sectioned(body: Revolved, edge_m: float, side_m: float) -> Section | None:
    """Section cut into triangles of about edge_m, its skin's parabolas as long as side_m.

    None where the outline crosses itself.
    """
    from scipy.sparse import csr_array
    from skfem import Basis, ElementTriP3, MeshTri

    from sonic_bullet.modal.ordering import dissection

    made = triangulated([body.outline_m], body.area_m2, edge_m)
    if made is None:
        return None
    mesh = MeshTri(np.ascontiguousarray(made[0].T), np.ascontiguousarray(made[1].T))
    basis = Basis(mesh, ElementTriP3(), intorder=6)
    r = np.asarray(basis.global_coordinates())[0]  # (t, q)
    weight = np.sqrt(basis.dx * r)
    n, (t, q) = basis.N, r.shape
    row = np.broadcast_to(np.arange(t * q), (10, t * q))
    column = np.repeat(basis.element_dofs[:, :, None], q, axis=2).reshape(10, -1)

    def mapped(values: list[Array]) -> Any:
        return csr_array(
            (np.stack([np.broadcast_to(v, (t, q)) * weight for v in values]).ravel(), (row.ravel(), column.ravel())),
            shape=(t * q, n),
        )

    fields = [basis.basis[i][0] for i in range(10)]
    value = [np.asarray(f) for f in fields]
    slopes = (
        mapped([f.grad[0] for f in fields]),
        mapped([f.grad[1] for f in fields]),
        mapped([v / r for v in value]),
        mapped(value),
    )
    facet = mesh.boundary_facets()
    corner, inner = mesh.facets[:, facet], basis.facet_dofs[:, facet]
    follow = {}
    for k in range(len(facet)):  # walked with the body on the left
        a, b = (int(c) for c in corner[:, k])
        third = mesh.p[:, np.setdiff1d(mesh.t[:, mesh.f2t[0, facet[k]]], [a, b])[0]]
        left = (mesh.p[0, b] - mesh.p[0, a]) * (third[1] - mesh.p[1, a]) - (mesh.p[1, b] - mesh.p[1, a]) * (
            third[0] - mesh.p[0, a]
        )
        a, b = (a, b) if left > 0 else (b, a)
        follow[a] = (b, k)
    walk, here = [], int(corner[0, 0])
    while here in follow:
        following, k = follow.pop(here)
        walk.append([here, inner[0, k], inner[1, k], following])
        here = following
    rim = np.array(walk)
    if len(rim) != len(facet):
        return None
    rim_m = mesh.p.T[rim[:, 0]]
    rim[:, [0, 3]] = basis.nodal_dofs[0][rim[:, [0, 3]]]
    return Section(slopes, dissection(basis.doflocs.T, basis.element_dofs.T), rim, rim_m, _shown(rim_m, side_m))


def _shown(corner_m: Array, side_m: float) -> Array:
    """Of the corners (even numbers) and middles (odd) of a closed polygon corner_m (s, 2): ends and middles of
    parabolas up to side_m long that turn little.
    """
    s = len(corner_m)
    along = np.roll(corner_m, -1, axis=0) - corner_m
    length = np.linalg.norm(along, axis=1)
    heading = np.arctan2(along[:, 1], along[:, 0])
    turn = np.abs((heading - np.roll(heading, 1) + np.pi) % (2 * np.pi) - np.pi)
    first = int(np.argmax(turn))
    shown, k = [], 0
    while k < s:
        count, long, bent = 1, length[(first + k) % s], 0.0
        while k + count < s:
            long, bent = long + length[(first + k + count) % s], bent + turn[(first + k + count) % s]
            if long > side_m or bent > BENT:
                break
            count += 1
        count -= count % 2 if count > 1 else 0
        shown += [2 * (first + k) % (2 * s), (2 * (first + k) + count) % (2 * s)]
        k += count
    return np.array(shown)


def skin(section: Section, cells: int) -> tuple[Array, Array]:
    """Points (v, 3) and triangles (f, 3), quarters of quadratic ones, of the surface with ``cells`` round it: rim nodes
    and middles, times angles.
    """
    s, a = len(section.shown), 2 * cells
    flat = np.empty((2 * len(section.rim), 2))
    flat[::2] = section.rim_m
    flat[1::2] = (section.rim_m + np.roll(section.rim_m, -1, axis=0)) / 2
    flat, angle = flat[section.shown], angles(cells)
    point = np.stack(
        [flat[:, :1] * np.cos(angle), flat[:, :1] * np.sin(angle), flat[:, 1:] + 0 * angle], axis=-1
    ).reshape(-1, 3)
    i, j = (g.ravel() for g in np.meshgrid(np.arange(0, s, 2), np.arange(0, a, 2), indexing="ij"))

    def at(di: int, dj: int) -> Array:
        return np.asarray((i + di) % s * a + (j + dj) % a)

    # counter-clockwise seen from outside: along the angle, then against the walk
    first = [at(0, 0), at(0, 2), at(2, 2), at(0, 1), at(1, 2), at(1, 1)]
    second = [at(0, 0), at(2, 2), at(2, 0), at(1, 1), at(2, 1), at(1, 0)]
    face = (
        np.stack([np.stack(first, axis=1), np.stack(second, axis=1)], axis=1).reshape(-1, 6)[:, QUARTERS].reshape(-1, 3)
    )
    if geometry.volume_m3(point, face) < 0:
        swapped = np.stack([np.stack([six[k] for k in (0, 2, 1, 5, 4, 3)], axis=1) for six in (first, second)], axis=1)
        face = swapped.reshape(-1, 6)[:, QUARTERS].reshape(-1, 3)
    return point, face.astype(np.int32)


def angles(cells: int) -> Array:
    """Angles (2·cells,) in rad about the axis at which the skin has its points."""
    return np.arange(2 * cells) * np.pi / cells


def shapes_at(section: Section, vector: Array, m: int, second: bool, cells: int) -> Array:
    """Displacements (v, 3, b) at `skin`'s points of vectors (3n, b), in the body's frame; ∫|u|² over the body is one
    where vᵀMv is.
    """
    n = len(section.order)
    field = vector.reshape(3, n, -1)
    corner, middle = (
        field[:, section.rim[:, 0]],
        (
            9 * (field[:, section.rim[:, 1]] + field[:, section.rim[:, 2]])
            - field[:, section.rim[:, 0]]
            - field[:, section.rim[:, 3]]
        )
        / 16,
    )
    rim = np.stack([corner, middle], axis=2).reshape(3, 2 * len(section.rim), 1, -1)[:, section.shown] / np.sqrt(
        2 * np.pi if m == 0 else np.pi
    )
    angle = angles(cells)[:, None]
    turned = m * angle - (np.pi / 2 if second else 0)
    even, odd = np.cos(turned), np.sin(turned) if m else np.ones_like(angle)
    out, around, up = rim[0] * even, rim[1] * odd, rim[2] * even
    moved = np.stack(
        [out * np.cos(angle) - around * np.sin(angle), out * np.sin(angle) + around * np.cos(angle), up], axis=2
    )
    return np.asarray(moved.reshape(-1, 3, moved.shape[-1]))
