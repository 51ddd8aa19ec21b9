"""Boxes and extruded outlines recognised in a mesh, and filled by rule: elements as flat as the plate.

    all faces look along three right axes, and the volume is that of their extents         -> a box
    two parallel flat sides, all else at right angles to them, volume = area x thickness
        -> outline -> triangles -> prisms -> tetrahedra
The outline is cut by a Delaunay triangulation of its own resampled edge and a hexagonal lattice inside.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.modal.meshing.solid import Solid, largest_component, quadratic
from sonic_bullet.modal.meshing.structured import stack_triangles
from sonic_bullet.records import Array

RIGHT_ANGLE_SINE = 1e-5  # of the angle by which a right angle may be wrong
SAME_VOLUME = 1e-5  # relative difference of volumes taken as rounding


def _directions(vertex_m: Array, face: Array) -> Array:
    """Return distinct unit normals (k, 3) up to sign, the largest area first, at most eight."""
    normal, area = geometry.outward_normals(vertex_m, face), geometry.face_areas_m2(vertex_m, face)
    found: list[Array] = []
    left = area.copy()
    while left.max() > 0 and len(found) < 8:
        n = normal[int(np.argmax(left))]
        like = np.abs(normal @ n) > 1 - RIGHT_ANGLE_SINE**2
        found.append(n)
        area_like = np.where(like, area, 0).sum()
        left[like] = 0
        if area_like == 0:
            break
    weight = [float(area[np.abs(normal @ n) > 1 - RIGHT_ANGLE_SINE**2].sum()) for n in found]
    return np.array(found)[np.argsort(weight)[::-1]]


def as_box(vertex_m: Array, face: Array) -> tuple[Array, Array, Array] | None:
    """Recognise a closed surface that is a box, else return None.

    Returns size (3,), rotation (3, 3) with the axes as columns, centre (3,).
    """
    direction = _directions(vertex_m, face)
    x = direction[0]
    across = [n for n in direction[1:] if abs(float(n @ x)) < RIGHT_ANGLE_SINE]
    if not across:
        return None
    y = across[0] - x * (across[0] @ x)
    y /= np.linalg.norm(y)
    axes = np.stack([x, y, np.cross(x, y)], axis=1)
    # Names of the axes by the world axis they are nearest to, so that an upright box keeps its x, y and z.
    best = np.argsort(-np.abs(axes).max(axis=0), kind="stable")
    place = np.full(3, -1)
    for column in best:
        free = [row for row in np.argsort(-np.abs(axes[:, column]), kind="stable") if place[row] < 0]
        place[free[0]] = column
    axes = axes[:, place]
    axes = axes * np.where(axes[range(3), range(3)] < 0, -1.0, 1.0)
    if np.linalg.det(axes) < 0:
        axes[:, 2] *= -1
    # fans of polygons with nodes along their edges hold triangles without area
    whole = face[geometry.face_areas_m2(vertex_m, face) > 0]
    if (np.abs(geometry.outward_normals(vertex_m, whole) @ axes).max(axis=1) < 1 - RIGHT_ANGLE_SINE**2).any():
        return None
    along = vertex_m[np.unique(face)] @ axes
    size, middle = np.ptp(along, axis=0), (along.max(axis=0) + along.min(axis=0)) / 2
    if abs(geometry.volume_m3(vertex_m, face) / np.prod(size) - 1) > SAME_VOLUME:
        return None
    return size, axes, axes @ middle


def _loops(edge: Array) -> Iterator[Array]:
    """Yield closed walks along directed edges (e, 2); nothing where one branches or breaks."""
    follow = {int(a): int(b) for a, b in edge}
    if len(follow) != len(edge):
        return
    while follow:
        first, here = next(iter(follow.items()))
        del follow[first]
        walk = [first]
        while here != first:
            walk.append(here)
            if here not in follow:
                return
            here = follow.pop(here)
        yield np.array(walk)


def _resample_polygon(loop: Array, edge_m: float) -> Array:
    """Remove the vertices of a polygon (k, 2) on straight runs, and cut its sides to at most edge_m."""
    before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
    turn = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    bent = loop[turn > 1e-6 * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)]
    side = np.roll(bent, -1, axis=0) - bent
    cuts = np.maximum(1, np.ceil(np.linalg.norm(side, axis=1) / edge_m - 1e-9)).astype(int)
    return np.concatenate([a + s * (np.arange(k) / k)[:, None] for a, s, k in zip(bent, side, cuts, strict=True)])


def _inside(point: Array, sides: Array) -> Array:
    """Return which points (k, 2) lie inside sides (s, 2 ends, 2), by the parity of crossings."""
    a, b = sides[:, 0], sides[:, 1]
    px, py = point[:, :1], point[:, 1:]
    spans = (a[:, 1] > py) != (b[:, 1] > py)
    rise = b[:, 1] - a[:, 1]
    at = a[:, 0] + (py - a[:, 1]) * (b[:, 0] - a[:, 0]) / np.where(rise == 0, 1, rise)
    return np.asarray((spans & (px < at)).sum(axis=1) % 2 == 1)


def _gap(point: Array, sides: Array) -> Array:
    """Compute the distance (k,) of points (k, 2) from the nearest side."""
    along = sides[:, 1] - sides[:, 0]
    length2 = (along**2).sum(axis=1)
    t = np.clip(np.einsum("ksx,sx->ks", point[:, None] - sides[:, 0], along) / length2, 0, 1)
    return np.asarray(np.linalg.norm(point[:, None] - sides[:, 0] - t[..., None] * along, axis=2).min(axis=1))


def triangulate_polygons(loops: list[Array], area_m2: float, edge_m: float) -> tuple[Array, Array] | None:
    """Fill polygons (holes too) of area_m2 with triangles (t, 3) of about edge_m over points (p, 2).

    None where an edge is missed.
    """
    from scipy.spatial import Delaunay, QhullError

    for finer in (1.0, 0.5, 0.25):
        rings = [_resample_polygon(loop, edge_m * finer) for loop in loops]
        sides = np.concatenate([np.stack([r, np.roll(r, -1, axis=0)], axis=1) for r in rings])
        low, high = sides.reshape(-1, 2).min(axis=0), sides.reshape(-1, 2).max(axis=0)
        rows = max(1, int(np.ceil((high[1] - low[1]) / (edge_m * 0.75**0.5))))
        columns = max(1, int(np.ceil((high[0] - low[0]) / edge_m)))
        i, j = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
        lattice = np.stack(
            [low[0] + (i + 0.5 * (j % 2)) * (high[0] - low[0]) / columns, low[1] + j * (high[1] - low[1]) / rows],
            axis=-1,
        ).reshape(-1, 2)
        lattice = lattice[_inside(lattice, sides)]
        if len(lattice) * len(sides) > 20_000_000:
            return None
        if len(lattice):
            lattice = lattice[_gap(lattice, sides) > 0.55 * edge_m]
        points = np.concatenate([*rings, lattice])
        try:
            triangle = Delaunay(points).simplices
        except QhullError:
            return None
        a, b, c = (points[triangle[:, k]] for k in range(3))
        area = np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / 2
        keep = (area > 1e-9 * edge_m**2) & _inside((a + b + c) / 3, sides)
        if abs(area[keep].sum() / area_m2 - 1) < SAME_VOLUME:
            return points, triangle[keep]
    return None


def as_prism(vertex_m: Array, face: Array, edge_m: float | None, dof_budget: int) -> Solid | None:
    """Fill a closed surface that is an extruded outline with prisms, else return None.

    edge_m None: the finest within dof_budget unknowns.
    """
    normal, area = geometry.outward_normals(vertex_m, face), geometry.face_areas_m2(vertex_m, face)
    volume = geometry.volume_m3(vertex_m, face)
    diagonal = float(np.linalg.norm(np.ptp(vertex_m[np.unique(face)], axis=0)))
    for n in _directions(vertex_m, face)[:3]:
        along = normal @ n
        top, bottom = along > 1 - RIGHT_ANGLE_SINE**2, along < RIGHT_ANGLE_SINE**2 - 1
        if (~(top | bottom) & (np.abs(along) > 1e-4)).any() or not top.any() or not bottom.any():
            continue
        high, low = vertex_m[face[top]] @ n, vertex_m[face[bottom]] @ n
        thickness = float(high.mean() - low.mean())
        if (
            max(np.ptp(high), np.ptp(low)) > SAME_VOLUME * diagonal
            or thickness <= 0
            or abs(area[top].sum() * thickness / volume - 1) > SAME_VOLUME
        ):
            continue
        edge = np.stack([face[top], np.roll(face[top], -1, axis=1)], axis=-1).reshape(-1, 2)
        code = edge[:, 0].astype(np.int64) * len(vertex_m) + edge[:, 1]
        rim = edge[~np.isin(code, edge[:, 1].astype(np.int64) * len(vertex_m) + edge[:, 0])]
        u = np.eye(3)[int(np.argmin(np.abs(n)))]
        u = u - n * (u @ n)
        u /= np.linalg.norm(u)
        frame = np.stack([u, np.cross(n, u), n])
        walks = list(_loops(rim))
        if not walks or sum(len(w) for w in walks) != len(rim):
            continue
        if edge_m is None:
            tries = diagonal / np.geomspace(6, 300, 60)
            dof = 12 * area[top].sum() / (0.866 * tries**2) * (2 * np.maximum(1, np.round(thickness / tries)) + 1)
            edge_m = float(tries[max(0, int(np.searchsorted(dof, dof_budget)) - 1)])
        plane = triangulate_polygons([vertex_m[w] @ frame[:2].T for w in walks], float(area[top].sum()), edge_m)
        if plane is None:
            continue
        layers = max(1, round(thickness / edge_m))
        points, tet = stack_triangles(plane[0], plane[1], np.linspace(low.mean(), high.mean(), layers + 1))
        tet, said = largest_component(points, tet)  # of several outlines side by side
        cut = f"{layers} layers, 3 tetrahedra a prism, edge {edge_m:.3g} m{said}"
        return quadratic(points @ frame, tet, note=f"outline of {len(plane[1])} triangles in {cut}")
    return None
