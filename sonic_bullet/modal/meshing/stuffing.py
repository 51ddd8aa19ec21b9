"""Dirty surfaces -> tetrahedra: soup, holes, overlaps and self-crossings, always the same for the same surface.

    body-centred cubic lattice, φ = ± distance from the surface, + where the winding number says inside
        [Jacobson, Kavan, Sorkine-Hornung 2013, eq. 5; far groups of faces as dipoles: Barill et al. 2018, eq. 12]
    -> lattice nodes near the surface put on it -> tetrahedra cut where φ = 0       [Labelle & Shewchuk 2007, ch. 3]

Elements are all of one size and well shaped. The price: creases of the surface are rounded within an element.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from sonic_bullet import geometry
from sonic_bullet._engine import DIPOLE_FACES, DIPOLE_GROUPS, winding_numbers
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

EDGE_PAIRS = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
# A wedge 012 345 turned so that its vertex k comes first [Dompierre et al. 1999, table 1]
TURNED_WEDGES = np.array(
    [[0, 1, 2, 3, 4, 5], [1, 2, 0, 4, 5, 3], [2, 0, 1, 5, 3, 4], [3, 5, 4, 0, 2, 1], [4, 3, 5, 1, 0, 2],
     [5, 4, 3, 2, 1, 0]])  # fmt: skip


def stuff_lattice(vertex_m: Array, face: Array, edge_m: float, grown_m: float = 0.0) -> tuple[Array, Array]:
    """Fill what vertex_m (v, 3), face (f, 3) enclose by winding number: corners (n, 3) and tetrahedra (t, 4).

    Edges are edge_m and √3/2 of it. grown_m: what is so near to it is filled, too. Raises MeshError
    where the lattice would be too large, or nothing is inside.
    """
    warp_long, warp_short = 0.24999, 0.41189  # part of an edge [Labelle & Shewchuk 2007, table 1]
    point = vertex_m[face].reshape(-1, 3)
    node_m, corners, tet = _lattice(point.min(axis=0) - grown_m, point.max(axis=0) + grown_m, edge_m)
    index = geometry.surface_index(vertex_m, face)
    found, weight, distance = geometry.nearest(index, node_m)
    foot = np.einsum("kc,kcx->kx", weight, vertex_m[face[found]])
    phi = np.where(winding_number(vertex_m[face[index.order]], node_m) > 0.5, distance, -distance)
    if grown_m:
        away = (node_m - foot) / np.maximum(distance, 1e-300)[:, None]
        foot, phi = foot + grown_m * away, phi + grown_m
        distance = np.abs(phi)
    tet = tet[(phi[tet] > 0).any(axis=1)]
    a, b = np.unique(np.sort(tet[:, EDGE_PAIRS].reshape(-1, 2), axis=1), axis=0).T
    reach = np.where((a < corners) == (b < corners), warp_long, warp_short)
    for kind in (slice(0, corners), slice(corners, None)):
        across = phi[a] * phi[b] < 0
        part = np.where(across, phi[a], 0) / np.where(across, phi[a] - phi[b], 1)
        near = np.zeros(len(phi), bool)
        near[a[across & (part < reach)]] = near[b[across & (1 - part < reach)]] = True
        near[kind] &= distance[kind] < warp_short * edge_m  # at a hole's rim the surface is far
        near[: kind.start], near[kind.stop or len(near) :] = False, False
        node_m[near], phi[near] = foot[near], 0.0
    node_m, tet = _cut_elements(node_m, tet[(phi[tet] > 0).any(axis=1)], phi)
    if not len(tet):
        raise MeshError("mesh encloses no volume", "give thickness_m to make a sheet solid, or close the surface")
    return node_m, tet


def _lattice(low: Array, high: Array, edge_m: float) -> tuple[Array, int, Array]:
    """Build a body-centred cubic lattice about a box.

    Returns nodes (n, 3), how many of them are corners of cubes (first), and tetrahedra (t, 4): two neighbouring centres
    and an edge of the square between them.
    """
    most_cells = 400_000  # of the lattice about the body: 1 GB
    ring = ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))
    cells = np.ceil((high - low) / edge_m).astype(int) + 2
    if np.prod(cells.astype(float)) > most_cells:
        raise MeshError(
            f"mesh is not closed, and its walls are too thin for a lattice of {most_cells} cells",
            "close its surface, or give a simpler mesh",
        )
    origin = (low + high - cells * edge_m) / 2
    corner = np.stack(np.meshgrid(*(np.arange(k + 1) for k in cells), indexing="ij"), axis=-1).reshape(-1, 3)
    centre = np.stack(np.meshgrid(*(np.arange(k) for k in cells), indexing="ij"), axis=-1).reshape(-1, 3)
    node = origin + edge_m * np.concatenate([corner, centre + 0.5])

    def number(place: Array, size: Array) -> Array:
        return np.asarray((place[:, 0] * size[1] + place[:, 1]) * size[2] + place[:, 2])

    tets = []
    for axis, step in enumerate(np.eye(3, dtype=int)):
        here = centre[centre[:, axis] < cells[axis] - 1]
        one, two = (len(corner) + number(c, cells) for c in (here, here + step))
        u, v = np.delete(np.eye(3, dtype=int), axis, axis=0)
        square = [number(here + step + i * u + j * v, cells + 1) for i, j in ring]
        tets += [np.stack([one, two, p, q], axis=1) for p, q in pairwise(square)]
    return node, len(corner), np.concatenate(tets)


def winding_number(corner_m: Array, point_m: Array) -> Array:
    """Compute how often (k,) a surface winds round each point (k, 3).

    1 inside and 0 outside a closed one, between both at a hole. corner_m (f, 3, 3): faces, neighbours one after the
    other.
    """
    far = 3.0  # radii of a group, from its middle on
    corner_m = np.ascontiguousarray(corner_m, float)
    vector = np.cross(corner_m[:, 1] - corner_m[:, 0], corner_m[:, 2] - corner_m[:, 0]) / 2
    area = np.linalg.norm(vector, axis=1)
    levels, members = [], DIPOLE_FACES
    while True:  # groups of faces, groups of groups, until they are few
        start = np.arange(0, len(corner_m), members)
        total = np.add.reduceat(area, start)
        middle = np.add.reduceat(area[:, None] * corner_m.mean(axis=1), start) / np.maximum(total, 1e-300)[:, None]
        here = middle[np.arange(len(corner_m)) // members]
        reach = np.maximum.reduceat(np.linalg.norm(corner_m - here[:, None], axis=2).max(axis=1), start)
        levels.append(np.column_stack([middle, np.add.reduceat(vector, start), far * reach]))
        if len(start) <= DIPOLE_GROUPS:
            break
        members *= DIPOLE_GROUPS
    first = np.cumsum([0, *(len(level) for level in levels)])
    wound = np.empty(len(point_m))
    winding_numbers(corner_m, np.concatenate(levels), first, np.ascontiguousarray(point_m, float), wound)
    return wound


def _cut_elements(node_m: Array, tet: Array, phi: Array) -> tuple[Array, Array]:
    """Return nodes and tetrahedra of the part where φ > 0; edges are cut where φ, linear along them, is 0."""
    sign = np.sign(phi[tet]).astype(np.int64)
    order = np.argsort(-sign, axis=1, kind="stable")
    tet, sign = np.take_along_axis(tet, order, axis=1), np.take_along_axis(sign, order, axis=1)
    n = len(node_m)
    pair = tet[:, EDGE_PAIRS]
    code = pair.min(axis=2) * n + pair.max(axis=2)
    crossed = sign[:, EDGE_PAIRS[:, 0]] * sign[:, EDGE_PAIRS[:, 1]] < 0
    known, at = np.unique(code[crossed], return_inverse=True)
    low, high = known // n, known % n
    part = (phi[low] / (phi[low] - phi[high]))[:, None]
    node_m = np.concatenate([node_m, (1 - part) * node_m[low] + part * node_m[high]])
    cut = np.full(code.shape, -1)
    cut[crossed] = n + at
    edge = {(int(i), int(j)): cut[:, k] for k, (i, j) in enumerate(EDGE_PAIRS)}
    plus, minus = (sign > 0).sum(axis=1), (sign < 0).sum(axis=1)

    def end(k: int) -> Array:
        """Return the substitute of vertex k beside a single inner vertex 0: itself on the surface, else the cut."""
        return np.where(sign[:, k] < 0, edge[0, k], tet[:, k])

    whole = tet[minus == 0]
    single = np.stack([tet[:, 0], end(1), end(2), end(3)], axis=1)[(plus == 1) & (minus > 0)]
    flat = (plus == 2) & (minus == 1)
    pyramid = np.stack([tet[:, 0], tet[:, 1], edge[1, 3], edge[0, 3], tet[:, 2]], axis=1)[flat]
    two = (plus == 2) & (minus == 2)
    ridge = np.stack([tet[:, 0], edge[0, 2], edge[0, 3], tet[:, 1], edge[1, 2], edge[1, 3]], axis=1)[two]
    three = (plus == 3) & (minus == 1)
    base = np.stack([*tet[:, :3].T, edge[0, 3], edge[1, 3], edge[2, 3]], axis=1)[three]
    return node_m, np.concatenate([whole, single, *_of_pyramids(pyramid), *_of_wedges(np.concatenate([ridge, base]))])


def _of_pyramids(p: Array) -> list[Array]:
    """Cut pyramids (k, 5), base 0123, into tetrahedra through the base's least vertex, as the neighbour's face is."""
    even = (np.argmin(p[:, :4], axis=1) % 2 == 0)[:, None]
    return [
        np.where(even, p[:, [0, 1, 2, 4]], p[:, [0, 1, 3, 4]]),
        np.where(even, p[:, [0, 2, 3, 4]], p[:, [1, 2, 3, 4]]),
    ]


def _of_wedges(w: Array) -> list[Array]:
    """Cut wedges (k, 6), triangles 012 and 345, into tetrahedra, each side through its least vertex.

    [Dompierre et al. 1999, table 2]
    """
    w = np.take_along_axis(w, TURNED_WEDGES[np.argmin(w, axis=1)], axis=1)
    first = (np.minimum(w[:, 1], w[:, 5]) < np.minimum(w[:, 2], w[:, 4]))[:, None]
    return [
        np.where(first, w[:, [0, 1, 2, 5]], w[:, [0, 1, 2, 4]]),
        np.where(first, w[:, [0, 1, 5, 4]], w[:, [0, 4, 2, 5]]),
        w[:, [0, 4, 5, 3]],
    ]
