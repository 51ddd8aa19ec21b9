"""Tetrahedra by rule for the named shapes: the same numbers give the same mesh, bit for bit.

    box: a grid of cells, each cut into Kuhn's six tetrahedra, neighbours mirrored
    sphere: the icosahedron's twenty cones, cut n³-fold [Freudenthal 1942], projected radially onto shells
    cylinder: a hexagonal disc projected onto circles, times layers;
        capsule: that cylinder between two hexagonal half balls

Curved bodies are meshed straight and placed with all their quadratic nodes, so that the surface is a piecewise
parabola.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from sonic_bullet.modal.meshing.solid import Solid, quadratic
from sonic_bullet.records import Array


def box(size_m: Array, cells: tuple[int, int, int]) -> Solid:
    """Mesh a box of edges size_m (3,) about the origin, ``cells`` along x, y, z, six tetrahedra a cell."""
    nx, ny, nz = cells
    axes = [np.linspace(-s / 2, s / 2, n + 1) for s, n in zip(size_m, cells, strict=True)]
    corner = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    stride = np.array([(ny + 1) * (nz + 1), nz + 1, 1])
    cell = np.stack(np.meshgrid(np.arange(nx), np.arange(ny), np.arange(nz), indexing="ij"), axis=-1).reshape(-1, 3)
    path = np.array(
        [
            np.concatenate([np.zeros((1, 3), int), np.cumsum(np.eye(3, dtype=int)[list(p)], axis=0)])
            for p in permutations(range(3))
        ]
    )
    # Every other cell is its neighbour's mirror image: faces still match, and no diagonal of the box is stiffer than
    # another.
    step = path[None] ^ (cell % 2)[:, None, None, :]
    tet = ((cell[:, None, None, :] + step) @ stride).reshape(-1, 4)
    return quadratic(corner, tet, note=f"box of {nx} x {ny} x {nz} cells, 6 tetrahedra each")


def _lattice(n: int, dimension: int) -> Array:
    """Return the integer points (k, d) of the simplex n ≥ i₁ ≥ … ≥ i_d ≥ 0."""
    grid = np.stack(np.meshgrid(*[np.arange(n + 1)] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    return grid[(np.diff(grid, axis=1) <= 0).all(axis=1)]


def _subdivide(corner: Array, simplex: Array, n: int) -> tuple[Array, Array]:
    """Cut each edge of simplices (s, d+1) over corner (c, 3) into n: Freudenthal's subdivision.

    Neighbours match across shared faces.
    """
    d = simplex.shape[1] - 1
    simplex = np.sort(simplex, axis=1)  # one order for all, so that neighbours cut their shared face in the same way
    cells = _lattice(n, d)
    pieces = []
    for path in permutations(range(d)):
        steps = np.concatenate([np.zeros((1, d), int), np.cumsum(np.eye(d, dtype=int)[list(path)], axis=0)])
        piece = cells[:, None, :] + steps
        inside = (
            (piece[..., 0] <= n).all(axis=1)
            & (np.diff(piece, axis=2) <= 0).all(axis=(1, 2))
            & (piece[..., -1] >= 0).all(axis=1)
        )
        pieces.append(piece[inside])
    lattice = np.concatenate(pieces)  # (n^d, d+1, d)
    weight = np.concatenate([n - lattice[..., :1], lattice[..., :-1] - lattice[..., 1:], lattice[..., -1:]], axis=-1)
    dense = np.zeros((len(simplex), *weight.shape[:2], len(corner)), np.int32)
    for k, cell in enumerate(simplex):
        dense[k][..., cell] = weight
    unique, inverse = np.unique(dense.reshape(-1, len(corner)), axis=0, return_inverse=True)
    return unique @ corner / n, inverse.reshape(-1, d + 1)


def _gauge(point: Array, normal: Array) -> Array:
    """Compute how far out a point (k, 3) lies in the polytope {x: normal·x ≤ 1}: 1 on its surface."""
    return np.asarray(np.max(point @ normal.T, axis=1))


def _onto_ball(point: Array, normal: Array) -> Array:
    """Project the polytope's shells onto spheres along the radius."""
    length = np.linalg.norm(point, axis=1)
    return point * (_gauge(point, normal) / np.where(length > 0, length, 1))[:, None]


def _face_normals(corner: Array, face: Array) -> Array:
    """Compute normals (f, 3) with normal·x = 1 on the face: corner (c, 3), face (f, 3), none through the origin."""
    return np.linalg.solve(corner[face], np.ones((len(face), 3, 1)))[..., 0]


def sphere(radius_m: float, n: int) -> Solid:
    """Mesh a ball about the origin: 20·n³ curved tetrahedra."""
    golden = (1 + 5**0.5) / 2
    base = np.array([[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)])
    corner = np.concatenate([np.roll(base, k, axis=1) for k in range(3)])
    near = np.linalg.norm(corner[:, None] - corner[None], axis=2) < 2.1
    face = np.array(
        [(i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]]
    )
    normal = _face_normals(corner, face)
    points, tet = _subdivide(
        np.concatenate([np.zeros((1, 3)), corner]), np.concatenate([np.zeros((20, 1), int), face + 1], axis=1), n
    )
    return quadratic(
        points, tet, lambda p: radius_m * _onto_ball(p, normal), f"sphere of 20 cones cut {n}-fold, curved"
    )


_HEXAGON = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(6) * np.pi / 3])


def _onto_disc(point: Array) -> Array:
    """Project hexagons about the z axis onto circles; z stays."""
    angle = (np.arange(6) + 0.5) * np.pi / 3
    normal = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) / np.cos(np.pi / 6)
    flat = point * [1, 1, 0]
    return np.asarray(_onto_ball(flat, normal) + point * [0, 0, 1])


def _prisms(triangle: Array, offset: int, layers: int) -> Array:
    """Stack triangle (k, 3) ``layers`` high as tetrahedra, vertex i of layer l at i + l·offset, cut by index order."""
    a, b, c = np.sort(triangle, axis=1).T
    tets = []
    for layer in range(layers):
        low, high = layer * offset, (layer + 1) * offset
        tets += [
            (a + low, b + low, c + low, c + high),
            (a + low, b + low, b + high, c + high),
            (a + low, a + high, b + high, c + high),
        ]
    return np.concatenate([np.stack(t, axis=1) for t in tets])


def stack_triangles(flat: Array, triangle: Array, height: Array) -> tuple[Array, Array]:
    """Stack triangles (t, 3) over points flat (p, 2) at each of height (l,): corners (p·l, 3) and tetrahedra."""
    points = np.concatenate([np.column_stack([flat, np.full(len(flat), z)]) for z in height])
    return points, _prisms(triangle, len(flat), len(height) - 1)


def _disc(n: int) -> tuple[Array, Array]:
    corner = np.concatenate([np.zeros((1, 3)), _HEXAGON])
    return _subdivide(corner, np.array([[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)]), n)


def cylinder(radius_m: float, length_m: float, n: int, layers: int) -> Solid:
    """Mesh a cylinder along z about the origin: 6·n² triangles in each of ``layers`` layers, 3 tetrahedra a prism."""
    disc, triangle = _disc(n)
    points, tet = stack_triangles(disc[:, :2], triangle, np.linspace(-0.5, 0.5, layers + 1))
    scale = np.array([radius_m, radius_m, length_m])
    return quadratic(points, tet, lambda p: _onto_disc(p) * scale, f"cylinder of {n} rings in {layers} layers, curved")


def capsule(radius_m: float, length_m: float, n: int, layers: int) -> Solid:
    """Mesh a capsule along z about the origin, length_m between the centres of its half balls."""
    half = 0.5 * length_m / radius_m
    disc, triangle = _disc(n)
    apex = np.array([0, 0, 1.0])
    ring = [[0, 1 + k, 1 + (k + 1) % 6, 7] for k in range(6)]
    cap, cap_tet = _subdivide(np.concatenate([np.zeros((1, 3)), _HEXAGON, apex[None]]), np.array(ring), n)
    normal = _face_normals(
        np.concatenate([_HEXAGON, apex[None], -apex[None]]),
        np.array([[k, (k + 1) % 6, e] for k in range(6) for e in (6, 7)]),
    )
    tube, tube_tet = stack_triangles(disc[:, :2], triangle, np.linspace(-half, half, layers + 1))
    shift = np.array([0, 0, half])
    points = np.concatenate([tube, cap + shift, cap * [1, 1, -1] - shift])
    tet = np.concatenate([tube_tet, cap_tet + len(tube), cap_tet + len(tube) + len(cap)])
    _, first, inverse = np.unique(
        np.round(points * 4 * 720720).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )

    def place(p: Array) -> Array:
        inside = np.clip(p[:, 2], -half, half)
        ball = p - np.stack([0 * inside, 0 * inside, inside], axis=1)
        placed = np.where((np.abs(p[:, 2]) <= half * (1 + 1e-12))[:, None], _onto_disc(ball), _onto_ball(ball, normal))
        placed[:, 2] += inside
        return radius_m * placed

    return quadratic(points[first], inverse.ravel()[tet], place, f"capsule of {n} rings in {layers} layers, curved")
