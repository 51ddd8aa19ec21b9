"""From modal velocity to pressure: a far-field map of each mode, and what radiating costs it.

    p(r̂) = (iωρ₀/4π) ∮ [v + ik (r̂·n) ψ] e^{ik r̂·x} dS             at 1 m, v = φ·n for unit modal velocity   [Pierce 1989, eq. 4-6.4, e^{iωt}]
    near field p_s = iωρ₀ ψ:  ψ = [(1 - w) φ₀/ℓ + w v]/q,           w = k²/(k² + 1/ℓ²)
    φ₀, ℓ = ∮φ₀v/∮v²                                               air moved at k = 0, `added_mass`
    q(k) = 1/L + √(κ² + (1/L + ik)²),  q(0) = 1/ℓ                   its change with k; L the body's middle principal extent
    |p| = √<|p(r̂)|²>,  Δd = 2π <|p|²>/ρ₀c                          mean over directions; power = 4π<|p|²>/2ρ₀c = 2 Δd · ½|z|²

q interpolates -k h_l'(ka)/h_l(ka) of a sphere (a = L/2): exact for l = 0, for every l at k → 0 (q = (l+1)/a), and for k → ∞ to second
order (1/a + ik); a flat wave of wavenumber κ » 1/L gives √(κ² - k²). Where ψ falls short is the near field on bodies
of many wavelengths; there the first term rules.

The mean is a product Gauss rule in the body's principal frame: exact while twice the body's radius is below its degree over k.
The weight is complex: size the mean over directions, phase that of the direction of the strongest pressure, counted from the instant
sound leaves the surface on that side. A shape and its negative sound the same.
v vertices, f faces, m modes, s patches, n directions in pairs ±r̂.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from sonic_bullet.records import Air, Array, ModalModel
from sonic_bullet.synth.added_mass import moved_air

_MODES_AT_ONCE = 32
MOST_PATCHES = 2500
MOST_TRIANGLES = 700  # of the near field's mesh
LEAST_RINGS, MOST_RINGS = 6, 16  # of directions between the poles


def radiation(model: ModalModel, air: Air) -> tuple[Array, Array]:
    """Pressure weight (m,) complex, in Pa·m per modal velocity (m/s·√kg), and radiation damping (m,) in 1/s.

    Pressure at distance r is Re(weight·z)/r, z the modal state of `bank`. Zero for a model without a surface. Source: the module's equations.
    """
    m = model.mode_count
    corner, face = _sound_faces(model)
    if m == 0 or len(face) == 0:
        return np.zeros(m, complex), np.zeros(m)
    k = 2 * np.pi * model.freq_hz / air.sound_speed_m_s
    corner, turn = _principal(corner)
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(twice, axis=1) / 2
    normal = twice / (2 * area[:, None])
    extent = np.sort(np.ptp(corner.reshape(-1, 3), axis=0))
    patch, place = _patches(corner, area, normal, MOST_PATCHES)
    coarse, nearest = _near_mesh(corner, area, normal)
    bend = np.zeros(m)
    moment = np.zeros((m, 10, len(place)))
    for lo in range(0, m, _MODES_AT_ONCE):
        some = slice(lo, min(lo + _MODES_AT_ONCE, m))
        bend[some] = _moments(model.shape[:, :, some].astype(float)[face], turn, corner, area, normal, patch, place, coarse, nearest, moment[some])
    near = _near(k, bend, extent[1])
    point = corner.reshape(-1, 3)
    rings = np.clip(np.ceil(k * np.linalg.norm(point, axis=1).max()) + 4, LEAST_RINGS, MOST_RINGS).astype(int)
    weight = np.zeros(m, complex)
    for count in np.unique(rings):
        some = np.flatnonzero(rings == count)
        direction, share = directions(int(count))
        ahead, behind = _map(k[some], 1 / near[some], k[some] ** 2 / (k[some] ** 2 + bend[some] ** 2), moment[some], place, direction)
        pressure = np.concatenate([ahead, behind], axis=1) * (1j * k[some] * air.sound_speed_m_s * air.density_kg_m3 / (4 * np.pi))[:, None]
        both = np.concatenate([direction, -direction])
        mean = np.abs(pressure) ** 2 @ np.concatenate([share, share])
        best = np.argmax(np.abs(pressure), axis=1)
        lead = pressure[np.arange(len(some)), best] * np.exp(-1j * k[some] * np.array([(point @ both[b]).max() for b in best]))
        size = np.abs(lead)
        weight[some] = np.sqrt(mean) * np.where(size > 0, lead / np.where(size > 0, size, 1), 1)
    impedance = air.density_kg_m3 * air.sound_speed_m_s
    return weight, 2 * np.pi * np.abs(weight) ** 2 / impedance


def directions(rings: int) -> tuple[Array, Array]:
    """Unit vectors (n, 3) of the upper half sphere and shares (n,), ½ in all: with their negatives exact to degree 2·rings - 1 [Stroud 1971, sec. 2.7]."""
    height, share = np.polynomial.legendre.leggauss(rings + rings % 2)
    height, share = height[height > 0], share[height > 0]
    turns = 4 * ((rings + 1) // 2)
    angle = 2 * np.pi * (np.arange(turns) + 0.5) / turns
    radius = np.sqrt(1 - height**2)[:, None]
    vector = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.broadcast_to(height[:, None], (len(height), turns))], axis=-1)
    return np.ascontiguousarray(vector.reshape(-1, 3)), np.repeat(share / (2 * turns), turns)


def _sound_faces(model: ModalModel) -> tuple[Array, Array]:
    """Corners (f, 3, 3) and faces (f, 3) that have an area."""
    corner = model.vertex_m[model.face]
    twice = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=-1)
    keep = twice > 1e-12 * twice.max(initial=0.0)
    return corner[keep], model.face[keep]


def _principal(corner: Array) -> tuple[Array, Array]:
    """Corners about the surface's centroid along its principal axes, longest first, and the rows of that frame (3, 3)."""
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    centre = corner.mean(axis=1)
    middle = area @ centre / area.sum()
    turn = np.linalg.eigh(np.einsum("f,fi,fj->ij", area, centre - middle, centre - middle))[1][:, ::-1].T
    turn[2] *= np.sign(np.linalg.det(turn))
    return (corner - middle) @ turn.T, turn


def _cells(point: Array, normal: Array, edge_m: float) -> Array:
    """Number (p,) of the cell of edge edge_m and the side it faces (of six) in which each point lies."""
    cell = np.floor((point - point.min(axis=0)) / edge_m + 0.3819).astype(np.int64)
    bias = normal * [1.0, 0.93, 0.87]  # no ties between sides
    axis = np.argmax(np.abs(bias), axis=1)
    side = 2 * axis + (bias[np.arange(len(axis)), axis] > 0)
    return np.unique(np.column_stack([cell, side]), axis=0, return_inverse=True)[1].ravel()


def _patches(corner: Array, area: Array, normal: Array, most: int) -> tuple[Array, Array]:
    """Patch (f,) of each face and place (s, 3) of each patch: its centroid. Neighbours that face the same side go together where there are too many."""
    centre = corner.mean(axis=1)
    patch = np.arange(len(area))
    edge_m = np.sqrt(area.sum() / most)
    while patch.max() >= most:
        patch = _cells(centre, normal, edge_m)
        edge_m *= 1.15
    total = np.bincount(patch, area)
    return patch, np.stack([np.bincount(patch, area * centre[:, i]) / total for i in range(3)], axis=1)


def _near_mesh(corner: Array, area: Array, normal: Array) -> tuple[Array, Array]:
    """Triangles (c, 3, 3) for the near field, at most `MOST_TRIANGLES`, and of each face (f,) the one that stands for it."""
    if len(corner) <= MOST_TRIANGLES:
        return corner, np.arange(len(corner))
    from scipy.spatial import cKDTree

    point, name = np.unique(np.round(corner.reshape(-1, 3) / (1e-7 * np.ptp(corner))), axis=0, return_inverse=True)
    name = name.reshape(-1, 3)
    point = point * (1e-7 * np.ptp(corner))
    outward = np.stack([np.bincount(name.ravel(), np.repeat(area * normal[:, i], 3), len(point)) for i in range(3)], axis=1)
    edge_m = np.sqrt(4 * area.sum() / MOST_TRIANGLES) / 1.5
    while True:
        cell = _cells(point, outward, edge_m)
        size = np.bincount(cell)
        middle = np.stack([np.bincount(cell, point[:, i]) / size for i in range(3)], axis=1)
        triangle = cell[name]
        triangle = triangle[(triangle[:, 0] != triangle[:, 1]) & (triangle[:, 1] != triangle[:, 2]) & (triangle[:, 2] != triangle[:, 0])]
        _, first, alike = np.unique(np.sort(triangle, axis=1), axis=0, return_index=True, return_inverse=True)
        odd = (triangle[:, 0] < triangle[:, 1]) ^ (triangle[:, 1] < triangle[:, 2]) ^ (triangle[:, 2] < triangle[:, 0])
        odd_ones = np.bincount(alike.ravel(), odd)
        triangle = triangle[first[(odd_ones == 0) | (odd_ones == np.bincount(alike.ravel()))]]  # folds cancel
        coarse = middle[triangle]
        twice = np.cross(coarse[:, 1] - coarse[:, 0], coarse[:, 2] - coarse[:, 0])
        length = np.linalg.norm(twice, axis=1)
        kept = length > 1e-3 * edge_m**2
        if kept.sum() <= MOST_TRIANGLES:
            break
        edge_m *= 1.1
    coarse, facing = coarse[kept], twice[kept] / length[kept, None]
    tree = cKDTree(np.hstack([coarse.mean(axis=1), edge_m * facing]))
    return coarse, tree.query(np.hstack([corner.mean(axis=1), edge_m * normal]))[1]


def _moments(shape, turn, corner, area, normal, patch, place, coarse, nearest, out) -> Array:
    """Fill out (m, 10, s) with patch sums of v, v·(x - place), n·φ₀/ℓ, n·v; return 1/ℓ (m,)."""
    speed = np.einsum("fi,fcim->fcm", normal @ turn, shape)
    flow = area[:, None] * speed.mean(axis=1)
    share = np.bincount(nearest, area, len(coarse))
    mean = np.stack([np.bincount(nearest, one, len(coarse)) for one in flow.T], axis=1) / np.where(share > 0, share, 1)[:, None]
    moved = moved_air(coarse, mean)
    square = share @ mean**2
    length = (share @ (moved * mean)) / np.where(square > 0, square, 1)
    length = np.maximum(length, 1e-3 * np.sqrt(area.sum()) / 10)
    level = area[:, None] * (moved / length)[nearest]
    arm = corner - place[patch][:, None]
    # ∫ v y over a triangle of linear v, y = area/12 (Σv Σy + Σvy)
    lever = area[:, None, None] / 12 * (np.einsum("fm,fi->fim", speed.sum(axis=1), arm.sum(axis=1)) + np.einsum("fcm,fci->fim", speed, arm))
    order = np.argsort(patch, kind="stable")
    start = np.searchsorted(patch[order], np.arange(len(place)))
    out[:, 0] = np.add.reduceat(flow[order], start).T
    out[:, 1:4] = np.add.reduceat(lever[order], start).transpose(2, 1, 0)
    for i in range(3):
        out[:, 4 + i] = np.add.reduceat(normal[order, i, None] * level[order], start).T
        out[:, 7 + i] = np.add.reduceat(normal[order, i, None] * flow[order], start).T
    return np.asarray(1 / length)


def _near(k: Array, bend: Array, middle_m: float) -> Array:
    """q (m,) in 1/m: the near field's wavenumber into the air at k, where it is bend (m,) at k = 0."""
    curved = np.minimum(1 / middle_m, bend / 2)
    within = np.maximum((bend - curved) ** 2 - curved**2, 0)
    return np.asarray(curved + np.sqrt(within + (curved + 1j * k) ** 2))


@njit(cache=True, nogil=True)
def _map(k, near, local, moment, place, direction):
    """Σ over patches [v + ik r̂·(v y + n ψ)] e^{ik r̂·x} (m, n) for directions (n, 3) and for their negatives; near (m,) = 1/q, local (m,) = w."""
    m, n = len(k), len(direction)
    ahead = np.empty((m, n), np.complex128)
    behind = np.empty((m, n), np.complex128)
    x, y, z = direction[:, 0].copy(), direction[:, 1].copy(), direction[:, 2].copy()
    for i in range(m):
        sums = np.zeros((6, n))
        a, b, c, d, e, f = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
        w = local[i]
        half = 0.5 / np.pi * k[i]
        for s in range(len(place)):
            p0, p1, p2 = half * place[s, 0], half * place[s, 1], half * place[s, 2]
            v, l0, l1, l2 = moment[i, 0, s], moment[i, 1, s], moment[i, 2, s], moment[i, 3, s]
            n0 = (1 - w) * moment[i, 4, s] + w * moment[i, 7, s]
            n1 = (1 - w) * moment[i, 5, s] + w * moment[i, 8, s]
            n2 = (1 - w) * moment[i, 6, s] + w * moment[i, 9, s]
            for j in range(n):
                turns = p0 * x[j] + p1 * y[j] + p2 * z[j]
                t = np.pi * (turns - np.floor(turns + 0.5))
                u = t * t
                # sine and cosine of half the angle, |t| ≤ π/2: Taylor to 1e-9, without calls so that it runs in vectors
                sn = t * (1 - u / 6 * (1 - u / 20 * (1 - u / 42 * (1 - u / 72 * (1 - u / 110 * (1 - u / 156))))))
                cs = 1 - u / 2 * (1 - u / 12 * (1 - u / 30 * (1 - u / 56 * (1 - u / 90 * (1 - u / 132 * (1 - u / 182))))))
                sine, cosine = 2 * sn * cs, 1 - 2 * sn * sn
                lever = l0 * x[j] + l1 * y[j] + l2 * z[j]
                level = n0 * x[j] + n1 * y[j] + n2 * z[j]
                a[j] += v * cosine
                b[j] += v * sine
                c[j] += lever * cosine
                d[j] += lever * sine
                e[j] += level * cosine
                f[j] += level * sine
        for j in range(n):
            first, second, third = complex(a[j], b[j]), complex(c[j], d[j]), complex(e[j], f[j])
            ahead[i, j] = first + 1j * k[i] * (second + third * near[i])
            behind[i, j] = first.conjugate() - 1j * k[i] * (second.conjugate() + third.conjugate() * near[i])
    return ahead, behind


def jerk_coefficient(volume_m3: float, air: Air) -> float:
    """K = 3ρ₀V/(8πc) in Pa·m per m/s³: a rigid compact body's far pressure is K cosθ · jerk(t - r/c)/r [Chadwick, Zheng, James 2012, eq. 9].

    θ from the jerk to the listener. The sphere's own law at small ka: displaced air and half as much again as added mass [Pierce 1989, sec. 4-2].
    """
    return 3 * air.density_kg_m3 * volume_m3 / (8 * np.pi * air.sound_speed_m_s)
