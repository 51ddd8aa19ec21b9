"""Bodies laid out as bent boxes of bricks with 20 nodes, and their vibration modes.

    x(ξ) = Σ N_i(ξ) x_i,   K = ∫ Bᵀ C B |J| dξ,   M = ∫ ρ Nᵀ N |J| dξ
        [Zienkiewicz & Taylor, The Finite Element Method, ch. 8.6-8.7]
    corner  N = (1+ξξ_i)(1+ηη_i)(1+ζζ_i)(ξξ_i+ηη_i+ζζ_i−2)/8,   edge  N = (1−ξ²)(1+ηη_i)(1+ζζ_i)/4
    K u = λ M u,  uᵀMu = 1, by shift and invert below zero

Another element, mesh and assembly than the project's own (quadratic tetrahedra): what the two agree on is physics.
Voigt order xx yy zz yz xz xy, engineering strains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.records import Array

_CORNERS = [(i, j, k) for k in (0, 2) for j in (0, 2) for i in (0, 2)]
_EDGES = [(i, j, k) for k in range(3) for j in range(3) for i in range(3) if (i, j, k).count(1) == 1]
OFFSET = np.array(_CORNERS + _EDGES)  # (20, 3) in half cells
# faces of a cell as eight nodes around, counter-clockwise seen from outside
_RING = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]


@dataclass(frozen=True, slots=True, eq=False)
class Bricks:
    """node_m (n, 3), cell (c, 20) of nodes, skin (v,) nodes on the surface, face (f, 3) into skin, outward.

    centre (c, 3): of the cells, in the grid's 0..1.
    """

    node_m: Array
    cell: Array
    skin: Array
    face: Array
    centre: Array


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """A body's modes: value (m,) = ω² in 1/s², shape (v, 3, m) on its surface vertex_m (v, 3), face (f, 3); rigid (v,
    3, 6); mass_kg. All mass-normalised.
    """

    value: Array
    shape: Array
    rigid: Array
    vertex_m: Array
    face: Array
    mass_kg: float

    @property
    def freq_hz(self) -> Array:
        return np.asarray(np.sqrt(self.value) / (2 * np.pi))


def grid(
    cells: tuple[int, int, int],
    place: Callable[[Array], Array],
    *,
    closed: bool = False,
    keep: Callable[[Array], Array] | None = None,
) -> Bricks:
    """A grid of bricks, its points of 0..1 along each axis put where ``place`` says; closed: the first axis runs
    round; keep: which cells, by centre, stay.
    """
    n = np.array(cells)
    first = np.stack(np.meshgrid(*(np.arange(c) for c in n), indexing="ij"), axis=-1).reshape(-1, 3)
    centre = (first + 0.5) / n
    if keep is not None:
        first, centre = first[keep(centre)], centre[keep(centre)]
    lattice = 2 * first[:, None] + OFFSET  # (c, 20, 3)
    size = 2 * n + 1
    if closed:
        lattice[..., 0] %= 2 * n[0]
    code = (lattice[..., 0] * size[1] + lattice[..., 1]) * size[2] + lattice[..., 2]
    used, cell = np.unique(code, return_inverse=True)
    cell = cell.reshape(-1, 20)
    where = np.stack([used // (size[1] * size[2]), used // size[2] % size[1], used % size[2]], axis=1) / (2 * n)
    node = place(where)
    outer = outer_rings(cell)
    triangle = outer[:, [[7, 0, 1], [1, 2, 3], [3, 4, 5], [5, 6, 7], [7, 1, 3], [7, 3, 5]]].reshape(-1, 3)
    skin, face = np.unique(triangle, return_inverse=True)
    face = face.reshape(-1, 3)
    body = Bricks(node, cell, skin, face, centre)
    corner = node[skin][face]
    if np.einsum("fi,fi->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) < 0:
        body = Bricks(node, _mirrored(cell), skin, face[:, ::-1], centre)
    return body


def outer_rings(cell: Array) -> Array:
    """Faces (q, 8) of cells (c, 20) that belong to one cell alone: eight nodes around, corners first and every second,
    counter-clockwise seen from outside a cell that is not mirrored.
    """
    number = {(int(a), int(b), int(c)): i for i, (a, b, c) in enumerate(OFFSET)}
    sides = []
    for axis in range(3):
        for side in (0, 2):
            around = [
                number[_inserted(a, b, axis, side)]
                for a, b in (_RING if (side == 2) == (axis != 1) else _RING[:1] + _RING[:0:-1])
            ]
            sides.append(cell[:, around])
    ring = np.concatenate(sides)
    _, index, count = np.unique(np.sort(ring, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(ring[np.sort(index[count == 1])])


def _inserted(a: int, b: int, axis: int, side: int) -> tuple[int, int, int]:
    return ((side, a, b), (a, side, b), (a, b, side))[axis]


def _mirrored(cell: Array) -> Array:
    """The same cells with their first axis turned round, for places that mirror."""
    number = {(int(a), int(b), int(c)): i for i, (a, b, c) in enumerate(OFFSET)}
    return cell[:, [number[(2 - int(a), int(b), int(c))] for a, b, c in OFFSET]]


def shape_functions(points: Array) -> tuple[Array, Array]:
    """N (q, 20) and its gradient (q, 20, 3) at points (q, 3) of the cube ±1."""
    sign = OFFSET - 1.0
    value, slope = np.empty((len(points), 20)), np.empty((len(points), 20, 3))
    for i, s in enumerate(sign):
        part = np.where(s == 0, 1 - points**2, 1 + points * s)
        change = np.where(s == 0, -2 * points, s + 0 * points)
        others = [np.prod(np.delete(part, a, axis=1), axis=1) for a in range(3)]
        if 0 in s:
            value[:, i] = part.prod(axis=1) / 4
            for a in range(3):
                slope[:, i, a] = change[:, a] * others[a] / 4
        else:
            bend = points @ s - 2
            value[:, i] = part.prod(axis=1) * bend / 8
            for a in range(3):
                slope[:, i, a] = (change[:, a] * others[a] * bend + part.prod(axis=1) * s[a]) / 8
    return value, slope


def gauss_points(order: int) -> tuple[Array, Array]:
    """Points (order³, 3) in the cube ±1 and their weights."""
    point, weight = np.polynomial.legendre.leggauss(order)
    points = np.stack(np.meshgrid(point, point, point, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, np.einsum("i,j,k->ijk", weight, weight, weight).ravel()


def _strain(gradient: Array) -> Array:
    """B (c, 6, 60) from gradients (c, 20, 3)."""
    strain = np.zeros((len(gradient), 6, 20, 3))
    for row, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        strain[:, row, :, a] += gradient[:, :, b]
        if a != b:
            strain[:, row, :, b] += gradient[:, :, a]
    return strain.reshape(-1, 6, 60)


def _at_points(order: int) -> tuple[Array, Array, Array]:
    points, weight = gauss_points(order)
    return *shape_functions(points), weight


def _jacobian(body: Bricks, slope: Array, weight: float) -> tuple[Array, Array]:
    """Of each cell at a point: ∂x/∂ξ (c, 3, 3), and its weighted determinant (c,)."""
    jacobian = np.einsum("cid,ik->cdk", body.node_m[body.cell], slope)
    volume = np.linalg.det(jacobian) * weight
    if not (volume > 0).all():
        raise ValueError("a brick is turned inside out")
    return jacobian, volume


def matrices(
    body: Bricks, stiffness_pa: Array, density_kg_m3: float, softer: Array | None = None, *, mass_points: int = 3
) -> tuple[Any, Any]:
    """K and M, scipy CSC, of a body of stiffness (6, 6); softer (c,) multiplies the stiffness of each cell.

    K is integrated at 2³ points: five times nearer in thin plates than at 3³ [Zienkiewicz, Taylor & Too 1971]. M is
    at mass_points³.
    """
    from scipy.sparse import coo_array

    c = len(body.cell)
    stiff, mass = np.zeros((c, 60, 60)), np.zeros((c, 20, 20))
    for value, slope, weight in zip(*_at_points(mass_points), strict=True):
        _, volume = _jacobian(body, slope, weight)
        mass += density_kg_m3 * volume[:, None, None] * np.outer(value, value)
    for _, slope, weight in zip(*_at_points(2), strict=True):
        jacobian, volume = _jacobian(body, slope, weight)
        b_matrix = _strain(np.einsum("ik,ckd->cid", slope, np.linalg.inv(jacobian)))
        stiff += np.matmul(b_matrix.transpose(0, 2, 1), np.matmul(stiffness_pa * volume[:, None, None], b_matrix))
    if softer is not None:
        stiff *= softer[:, None, None]
    dof = (3 * body.cell[:, :, None] + np.arange(3)).reshape(c, 60)
    size = 3 * len(body.node_m)
    k_matrix = coo_array(
        (stiff.ravel(), (np.repeat(dof, 60, axis=1).ravel(), np.tile(dof, (1, 60)).ravel())), shape=(size, size)
    ).tocsc()
    entries = [
        coo_array(
            (
                mass.ravel(),
                (3 * np.repeat(body.cell, 20, axis=1).ravel() + a, 3 * np.tile(body.cell, (1, 20)).ravel() + a),
            ),
            shape=(size, size),
        )
        for a in range(3)
    ]
    return (k_matrix + k_matrix.T) / 2, (entries[0] + entries[1] + entries[2]).tocsc()


def isotropic(youngs_pa: float, poisson: float) -> Array:
    """Stiffness (6, 6) of an isotropic solid [Hughes 1987, ch. 2.7]."""
    shear = youngs_pa / (2 * (1 + poisson))
    lame = 2 * shear * poisson / (1 - 2 * poisson)
    tensor = np.diag([2 * shear] * 3 + [shear] * 3)
    tensor[:3, :3] += lame
    return tensor


def orthotropic(
    youngs_pa: tuple[float, float, float], shear_pa: tuple[float, float, float], poisson: tuple[float, float, float]
) -> Array:
    """Stiffness (6, 6) from E_x E_y E_z, G_yz G_xz G_xy and ν_yz ν_xz ν_xy: the compliance inverted [Bodig & Jayne
    1982, ch. 3].
    """
    ex, ey, ez = youngs_pa
    yz, xz, xy = poisson
    give = np.diag([1 / ex, 1 / ey, 1 / ez, *(1 / np.array(shear_pa))])
    give[0, 1] = give[1, 0] = -xy / ex
    give[0, 2] = give[2, 0] = -xz / ex
    give[1, 2] = give[2, 1] = -yz / ey
    return np.asarray(np.linalg.inv(give))


def modes(
    body: Bricks,
    stiffness_pa: Array,
    density_kg_m3: float,
    *,
    to_hz: float = 20_000.0,
    softer: Array | None = None,
    load_kg: dict[int, float] | None = None,
    mass_points: int = 3,
) -> Modes:
    """Modes up to to_hz of a free body; load_kg: point masses at its surface's vertices; mass_points: of `matrices`."""
    from scipy.sparse import coo_array

    from sonic_bullet.modal import lanczos
    from sonic_bullet.modal.sparse.ordering import dissection

    pascal = float(np.abs(stiffness_pa).max())
    k_matrix, m_matrix = matrices(body, stiffness_pa / pascal, 1.0, softer, mass_points=mass_points)
    rate = pascal / density_kg_m3
    mass = float(m_matrix[::3, ::3].sum()) * density_kg_m3
    for vertex, kilogram in (load_kg or {}).items():
        dof = 3 * body.skin[vertex] + np.arange(3)
        m_matrix = (
            m_matrix + coo_array((np.full(3, kilogram / density_kg_m3), (dof, dof)), shape=m_matrix.shape).tocsc()
        )
    order = dissection(body.node_m, body.cell)
    dof = (3 * order[:, None] + np.arange(3)).ravel()
    corner = body.node_m[body.skin][body.face]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2
    length = np.linalg.norm(np.ptp(body.node_m, axis=0))
    shift = -20 / length**2 * (2 * mass / density_kg_m3 / area / length) ** 2
    limit = (2 * np.pi * to_hz) ** 2 / rate
    found = lanczos.solve(
        k_matrix[dof][:, dof], m_matrix[dof][:, dof], shift, rigid=6, enough=lambda v: bool(v[-1] > limit), most=300
    )
    keep = found.lambda_per_s2 <= limit
    vector = np.empty((k_matrix.shape[0], int(keep.sum())))
    vector[dof] = found.vector[:, keep]
    shape = vector.reshape(-1, 3, vector.shape[1])[body.skin] / np.sqrt(density_kg_m3)
    from sonic_bullet.modal.fem import rigid_modes

    still = rigid_modes(body.node_m)
    gram = still.T @ (m_matrix @ still) * density_kg_m3
    rigid = (still @ np.linalg.inv(np.linalg.cholesky(gram)).T).reshape(-1, 3, 6)[body.skin]
    return Modes(found.lambda_per_s2[keep] * rate, shape, rigid, body.node_m[body.skin], body.face, mass)
