"""The section of a body of revolution cut into curved cubic triangles, small where its wall is thin.

    size at the outline: the wall's thickness t there, or a part of the shortest bending wave of a wall of t
    size inside: the least of size + slope x distance over the outline
    outline -> points so far apart -> Delaunay, lattices inside, one a halving of the size -> sides bent to the outline

Lengths are those of a body without units (see model.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.modal.meshing.prisms import SAME, _gap, _inside
from sonic_bullet.modal.revolution.rings import Revolved, turns
from sonic_bullet.records import Array

WALL, WAVE = 0.75, 0.25  # a triangle's side: of the wall's thickness and of the shortest wave
BENT = 0.3  # radians that a side may turn
CORNER = 0.15  # radians: a turn that is kept as a corner
GROWTH = 0.5  # of size over distance
MOST_NODES = 30_000

WaveNumber = Callable[[Array], Array]


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """basis: scikit-fem's, cubic on curved triangles. rim_m (s, 3, 2): ends and middle of each side of the outline,
    walked with the body on the left.

    dof (s, 4): unknowns of each side at its start, at thirds, at its end. on_axis (s,).
    curvature (s,): of the smooth outline.
    """

    basis: Any
    rim_m: Array
    dof: Array
    on_axis: Array
    curvature: Array

    @property
    def nodes(self) -> int:
        return int(self.basis.N)


def thickness(outline: Array) -> Array:
    """Of the wall at the middle of each side (p,) of a closed polygon (p, 2), counter-clockwise: the way straight in to
    the other side.
    """
    after = np.roll(outline, -1, axis=0)
    along = after - outline
    middle, length = (outline + after) / 2, np.linalg.norm(along, axis=1)
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
    to = outline - middle[:, None]  # (p rays, p sides, 2)
    turned = inward[:, None, 0] * along[None, :, 1] - inward[:, None, 1] * along[None, :, 0]
    apart = np.abs(turned) > 1e-12 * length
    turned = np.where(apart, turned, 1)
    far = (to[..., 0] * along[None, :, 1] - to[..., 1] * along[None, :, 0]) / turned
    at = (to[..., 0] * inward[:, None, 1] - to[..., 1] * inward[:, None, 0]) / turned
    hit = apart & (at > -1e-9) & (at < 1 + 1e-9) & (far > 1e-9 * length.max())
    return np.asarray(np.where(hit, far, np.inf).min(axis=1))


def spread(start: float, length: Array, density: Array) -> Array:
    """Places along a walk from ``start`` over pieces of length (k,), each with length x density of the intervals
    between them; both ends are places.
    """
    filled = np.concatenate([[0], np.cumsum(length * density)])
    count = max(1, int(np.ceil(filled[-1] - 1e-9)))
    place: Array = np.interp(np.linspace(0, filled[-1], count + 1), filled, np.concatenate([[0], np.cumsum(length)]))
    return start + place


def _cut(outline: Array, size: Array) -> tuple[Array, Array, Array]:
    """Ends (s, 2) and middles (s, 2) of sides about size (p,) long along a closed polygon (p, 2), and which of its
    sides (s,) the middles lie on.
    """
    p = len(outline)
    along = np.roll(outline, -1, axis=0) - outline
    length, turn = np.linalg.norm(along, axis=1), np.abs(turns(outline))
    long = length > size
    corner = (turn > CORNER) | (long & np.roll(long, 1)) | (outline[:, 0] == 0)
    if not corner.any():
        corner[int(np.argmax(turn))] = True
    first = np.flatnonzero(corner)
    walked = np.concatenate([[0], np.cumsum(length)])
    smooth = np.where(corner, 0, turn)
    bend = (smooth + np.roll(smooth, -1)) / 2 / length / BENT
    places = []
    for a, b in zip(first, np.append(first[1:], first[0] + p), strict=True):
        mine = np.arange(a, b) % p
        places.append(
            spread(walked[a], length[mine], np.maximum(1 / size[mine], np.where(b - a > 1, bend[mine], 0)))[:-1]
        )
    place = np.concatenate(places)
    middle = (place + np.append(place[1:], place[0] + walked[-1])) / 2

    def at(s: Array) -> tuple[Array, Array]:
        s = s % walked[-1]
        k = np.clip(np.searchsorted(walked, s, side="right") - 1, 0, p - 1)
        return outline[k] + along[k] * ((s - walked[k]) / length[k])[:, None], k

    return at(place)[0], *at(middle)


def sizes(body: Revolved, wave_number: WaveNumber, finer: float) -> Array:
    """Wanted length (p,) of a triangle's sides along the outline. wave_number: of a wall's thickness (p,)."""
    wall = thickness(body.outline_m)
    side = np.minimum(WALL * wall, WAVE * 2 * np.pi / wave_number(wall)) / finer
    return np.asarray(side)


def sectioned(body: Revolved, wave_number: WaveNumber, finer: float = 1.0) -> Section | None:
    """Section cut into triangles that follow walls and waves; wave_number: of walls of thickness (k,). finer: by how
    much all are smaller.

    None where the outline crosses itself, or where it takes more than `MOST_NODES`.
    """
    from skfem import Basis, ElementTriP3, MeshTri, MeshTri2

    outline = body.outline_m
    size = sizes(body, wave_number, finer)
    for _ in range(4):
        rim, middle, which = _cut(outline, size)
        made = _filled(rim, size[which])
        if made is not None:
            break
        size = size / 1.5
    else:
        return None
    plain = MeshTri(np.ascontiguousarray(made[0].T), np.ascontiguousarray(made[1].T))
    code = plain.facets[0].astype(np.int64) * plain.p.shape[1] + plain.facets[1]
    start = np.arange(len(rim))
    ends = np.sort(np.stack([start, np.roll(start, -1)]), axis=0)
    facet = np.searchsorted(code, ends[0] * plain.p.shape[1] + ends[1])
    mesh = MeshTri2.from_mesh(plain)
    place = mesh.doflocs.copy()
    place[:, plain.p.shape[1] + facet] = middle.T
    basis = Basis(MeshTri2(place, mesh.t), ElementTriP3(), intorder=6)
    if basis.N > MOST_NODES:
        return None
    inner = basis.facet_dofs[:, facet]
    lower = start > np.roll(start, -1)
    inner[:, lower] = inner[::-1, lower]
    corner = basis.nodal_dofs[0][start]
    dof = np.stack([corner, inner[0], inner[1], np.roll(corner, -1)], axis=1)
    rim_m = np.stack([rim, middle, np.roll(rim, -1, axis=0)], axis=1)
    return Section(basis, rim_m, dof, body.on_axis[which], body.curvature_per_m[which])


def _filled(rim: Array, size: Array) -> tuple[Array, Array] | None:
    """Points (n, 2), the rim's first, and triangles (t, 3) inside a closed polygon rim (s, 2) with sides of about size
    (s,); None where a side is missed.
    """
    from scipy.spatial import Delaunay, QhullError

    after = np.roll(rim, -1, axis=0)
    sides = np.stack([rim, after], axis=1)
    middle = (rim + after) / 2
    own = np.minimum(size, 1.5 * np.linalg.norm(after - rim, axis=1))
    low, high = rim.min(axis=0), rim.max(axis=0)
    points, step = [rim], float(own.min())
    while step < 2 * float(own.max()) + GROWTH * float((high - low).max()):
        rows, columns = (int(n) for n in np.ceil((high - low)[::-1] / step / [0.75**0.5, 1]))
        if rows * columns * len(rim) < 60_000_000:
            i, j = (g.ravel() for g in np.meshgrid(np.arange(columns + 1), np.arange(rows + 1)))
            lattice = low + step * np.stack([i + 0.5 * (j % 2), j * 0.75**0.5], axis=1)
            lattice = lattice[_inside(lattice, sides)]
            if len(lattice):
                away = np.linalg.norm(lattice[:, None] - middle, axis=2)
                wanted = (own + GROWTH * away).min(axis=1)
                lattice = lattice[(wanted >= step) & (wanted < 2 * step) & (_gap(lattice, sides) > 0.55 * step)]
                points.append(lattice)
        step *= 2
    point = np.concatenate(points)
    try:
        triangle = Delaunay(point).simplices
    except QhullError:
        return None
    a, b, c = (point[triangle[:, k]] for k in range(3))
    area = np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / 2
    keep = (area > 1e-9 * float(size.min()) ** 2) & _inside((a + b + c) / 3, sides)
    whole = float((rim[:, 0] * after[:, 1] - after[:, 0] * rim[:, 1]).sum()) / 2
    triangle = triangle[keep]
    if abs(area[keep].sum() / whole - 1) > SAME:
        return None
    pair = np.sort(np.concatenate([triangle[:, [0, 1]], triangle[:, [1, 2]], triangle[:, [2, 0]]]), axis=1)
    n = len(point)
    side = np.sort(np.stack([np.arange(len(rim)), (np.arange(len(rim)) + 1) % len(rim)], axis=1), axis=1)
    if not np.isin(side[:, 0] * n + side[:, 1], pair[:, 0].astype(np.int64) * n + pair[:, 1]).all():
        return None
    return point, triangle
