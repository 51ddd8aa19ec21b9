"""Section of a body of revolution cut into curved cubic triangles, small where its wall is thin.

    size at the outline: of the wall's thickness t there, more away from corners, or of the shortest bending wave of t
    size inside: the least of size + slope x distance over the outline
    outline -> points so far apart -> Delaunay, lattices inside, one a halving of the size
        -> graded towards corners that look inward (notches.py) -> sides bent to the outline

Lengths are those of a body without units (see modal_analysis.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.geometry import CREASE_RAD
from sonic_bullet.modal.meshing.prisms import SAME_VOLUME, _gap, _inside
from sonic_bullet.modal.revolution.notches import SectionTriangles, grade_triangles
from sonic_bullet.modal.revolution.rings import BodyOfRevolution, turns
from sonic_bullet.records import Array

WALL = 0.5  # a triangle's side over the wall's thickness at a corner
WAVE = 0.25  # a triangle's side over the shortest wave
BENT = 0.3  # radians that a side may turn
GROWTH = 0.5  # of size over distance


WaveNumber = Callable[[Array], Array]


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """Section meshed with cubic triangles.

    Attributes
    ----------
    basis : scikit-fem's, cubic on curved triangles
    rim_m : (s, 3, 2) start, middle and end of each side of the outline, walked with the body on the left
    dof : (s, 4) unknowns of each side at its start, at thirds, at its end
    facet : (s,) the basis' mesh's facet that each side is
    on_axis : (s,)
    curvature : (s,) of the smooth outline
    """

    basis: Any
    rim_m: Array
    dof: Array
    facet: Array
    on_axis: Array
    curvature: Array

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return int(self.basis.N)


def thickness(outline: Array) -> Array:
    """Compute the wall at the middle of each side (p,) of a closed polygon (p, 2), counter-clockwise.

    It is the distance straight in to the other side.
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


def spread_places(start: float, length: Array, density: Array) -> Array:
    """Return places along a walk from ``start`` over pieces of length (k,); both ends are places.

    Each piece has length x density of the intervals between them.
    """
    intervals = np.concatenate([[0], np.cumsum(length * density)])
    count = max(1, int(np.ceil(intervals[-1] - 1e-9)))
    place: Array = np.interp(
        np.linspace(0, intervals[-1], count + 1), intervals, np.concatenate([[0], np.cumsum(length)])
    )
    return start + place


@dataclass(frozen=True, slots=True, eq=False)
class _Outline:
    """An outline in short pieces.

    Attributes
    ----------
    point : (k, 2)
    corner : (k,) points that stay
    size : (k,) wanted at each piece
    owner : (k,) the body's side that each piece is of
    curvature : (k,) of the smooth outline
    """

    point: Array
    corner: Array
    size: Array
    owner: Array
    curvature: Array


def _measure_outline(body: BodyOfRevolution, wave_number: WaveNumber) -> _Outline:
    corner = 0.15  # radians: a larger turn is a corner
    pieces = 600  # of an outline, about, for which the size is found
    outline = body.outline_m
    along = np.roll(outline, -1, axis=0) - outline
    length, turn, wall = np.linalg.norm(along, axis=1), np.abs(turns(outline)), thickness(outline)
    cuts = np.ceil(length / np.maximum(np.minimum(wall, length), length.sum() / pieces)).astype(int)
    owner = np.repeat(np.arange(len(outline)), cuts)
    share = np.concatenate([np.arange(n) / n for n in cuts])
    point = outline[owner] + share[:, None] * along[owner]
    long = length > WALL * wall
    axial = outline[:, 0] == 0
    kept = (turn > corner) | (long & np.roll(long, 1)) | axial
    notch = outline[(turn > corner) & ~axial]
    middle = (point + np.roll(point, -1, axis=0)) / 2
    away = np.linalg.norm(middle[:, None] - notch, axis=2).min(axis=1, initial=np.inf)
    wall = thickness(point)
    size = np.minimum(np.minimum(WALL * wall + GROWTH * away, 3 * wall), WAVE * 2 * np.pi / wave_number(wall))
    curvature = body.curvature_per_m(owner, share + 0.5 / cuts[owner])
    return _Outline(point, (share == 0) & kept[owner], size, owner, curvature)


def _cut_outline(of: _Outline, finer: float) -> tuple[Array, Array, Array]:
    """Cut an outline into sides of the wanted size: ends (s, 2), middles (s, 2), and the piece (s,) of each middle."""
    outline, p = of.point, len(of.point)
    along = np.roll(outline, -1, axis=0) - outline
    length = np.linalg.norm(along, axis=1)
    smooth = np.where(of.corner, 0, np.abs(turns(outline)))
    first = np.flatnonzero(of.corner) if of.corner.any() else np.array([0])
    walked = np.concatenate([[0], np.cumsum(length)])
    density = np.maximum(finer / of.size, (smooth + np.roll(smooth, -1)) / 2 / length / BENT)
    places = []
    for a, b in zip(first, np.append(first[1:], first[0] + p), strict=True):
        mine = np.arange(a, b) % p
        places.append(spread_places(walked[a], length[mine], density[mine])[:-1])
    place = np.concatenate(places)
    middle = (place + np.append(place[1:], place[0] + walked[-1])) / 2

    def at(s: Array) -> tuple[Array, Array]:
        s = s % walked[-1]
        k = np.clip(np.searchsorted(walked, s, side="right") - 1, 0, p - 1)
        return outline[k] + along[k] * ((s - walked[k]) / length[k])[:, None], k

    spot, which = at(middle)
    return at(place)[0], spot, which


def mesh_section(body: BodyOfRevolution, wave_number: WaveNumber, finer: float = 1.0) -> Section | None:
    """Cut the section into triangles that follow walls and waves.

    Parameters
    ----------
    wave_number : of walls of thickness (k,)
    finer : factor by which all are smaller

    Returns
    -------
    The section, None where the outline crosses itself or takes more than 15,000 nodes.
    """
    outline = _measure_outline(body, wave_number)
    for _ in range(4):
        rim, middle, which = _cut_outline(outline, finer)
        made = _fill_polygon(rim, outline.size[which] / finer)
        if made is not None:
            turn = turns(rim)
            inward = np.flatnonzero((turn < -CREASE_RAD) & (rim[:, 0] > 0))
            fine = grade_triangles(SectionTriangles(*made, middle, which), inward)
            rim = fine.point[: len(fine.middle)]
            owner = outline.owner[fine.owner]
            return _section(
                fine.point, fine.triangle, rim, fine.middle, body.on_axis[owner], outline.curvature[fine.owner]
            )
        finer *= 1.5
    return None


def _section(
    point: Array, triangle: Array, rim: Array, middle: Array, on_axis: Array, curvature: Array
) -> Section | None:
    """Make the section of triangles (t, 3) over point (n, 2), the rim's (s, 2) first, bent to its middles (s, 2)."""
    from skfem import Basis, ElementTriP3, MeshTri, MeshTri2

    plain = MeshTri(np.ascontiguousarray(point.T), np.ascontiguousarray(triangle.T))
    code = plain.facets[0].astype(np.int64) * plain.p.shape[1] + plain.facets[1]
    start = np.arange(len(rim))
    ends = np.sort(np.stack([start, np.roll(start, -1)]), axis=0)
    facet = np.searchsorted(code, ends[0] * plain.p.shape[1] + ends[1])
    mesh = MeshTri2.from_mesh(plain)
    place = mesh.doflocs.copy()
    place[:, plain.p.shape[1] + facet] = middle.T
    basis = Basis(MeshTri2(place, mesh.t), ElementTriP3(), intorder=6)
    most_nodes = 15_000  # three unknowns each: a second or two for each wave around
    if most_nodes < basis.N:
        return None
    inner = basis.facet_dofs[:, facet]
    backward = start > np.roll(start, -1)
    inner[:, backward] = inner[::-1, backward]
    corner = basis.nodal_dofs[0][start]
    dof = np.stack([corner, inner[0], inner[1], np.roll(corner, -1)], axis=1)
    return Section(basis, np.stack([rim, middle, np.roll(rim, -1, axis=0)], axis=1), dof, facet, on_axis, curvature)


def _fill_polygon(rim: Array, size: Array) -> tuple[Array, Array] | None:
    """Fill a closed polygon rim (s, 2) with triangles (t, 3) of sides of about size (s,).

    Returns points (n, 2), the rim's first, and triangles; None where a side is missed.
    """
    most_distances = 10_000_000
    from scipy.spatial import Delaunay, QhullError

    after = np.roll(rim, -1, axis=0)
    sides = np.stack([rim, after], axis=1)
    middle = (rim + after) / 2
    own = np.minimum(size, 1.5 * np.linalg.norm(after - rim, axis=1))
    low, high = rim.min(axis=0), rim.max(axis=0)
    points, step = [rim], float(own.min())
    while step < 2 * float(own.max()) + GROWTH * float((high - low).max()):
        rows, columns = (int(n) for n in np.ceil((high - low)[::-1] / step / [2 * 0.75**0.5, 2]))
        if 4 * rows * columns * len(rim) < most_distances:
            i, j = (g.ravel() for g in np.meshgrid(np.arange(-columns, columns + 1), np.arange(-rows, rows + 1)))
            lattice = (low + high) / 2 + step * np.stack([i + 0.5 * (j % 2), j * 0.75**0.5], axis=1)
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
    if abs(area[keep].sum() / whole - 1) > SAME_VOLUME:
        return None
    pair = np.sort(np.concatenate([triangle[:, [0, 1]], triangle[:, [1, 2]], triangle[:, [2, 0]]]), axis=1)
    n = len(point)
    side = np.sort(np.stack([np.arange(len(rim)), (np.arange(len(rim)) + 1) % len(rim)], axis=1), axis=1)
    if not np.isin(side[:, 0] * n + side[:, 1], pair[:, 0].astype(np.int64) * n + pair[:, 1]).all():
        return None
    return point, triangle
