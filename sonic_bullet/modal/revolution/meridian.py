"""Meridian of a surface of revolution, however it is triangulated: cut once, then read off all its vertices.

    half-plane through the axis, triangles -> chains from pole to pole, or one loop; radii interpolated along edges
    poles in pairs along the axis, the body's inside between them -> one closed walk
    vertices -> places along the walk, distances off it -> an axis without their first harmonic
    vertices in order -> outline: where a ring of them meets, and between rings as far apart as the mesh is fine
    no outline: a vertex off the curve of its neighbours, an edge's middle farther off than on a round ring of 14,
        another volume than the mesh's

The walk of the cut is replaced by the outline and the vertices are placed again, as their places then are finer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.geometry import volume_m3
from sonic_bullet.records import Array

ROUND = 2e-5
"""Of the diagonal: what vertices of one ring may differ by."""


class ProjectedPoints(NamedTuple):
    """Points beside a walk.

    Attributes
    ----------
    place : (v,) length along the walk to the nearest spot
    side : (v,) side of the walk that it lies on
    off : (v,) distance
    across : (v,) signed distance from that side's line, to its left
    """

    place: Array
    side: Array
    off: Array
    across: Array


def meridian(point: Array, face: Array) -> tuple[Array, Array, Array] | None:
    """Find the meridian of a closed surface that turns about an axis near the z axis.

    Parameters
    ----------
    point, face : (v, 3) in m, (f, 3); the surface, closed and without double vertices

    Returns
    -------
    outline : (p, 2) closed polygon (r, z) in m, on the axis where r = 0
    turn : (3, 3), shift : (3,); point @ turn.T + shift turns about the z axis itself
    """
    diagonal = float(np.linalg.norm(np.ptp(point, axis=0)))
    walk = _cut_meridian(point, face, diagonal)
    if walk is None:
        return None
    edge = np.unique(np.sort(np.concatenate([face[:, [0, 1]], face[:, [1, 2]], face[:, [2, 0]]]), axis=1), axis=0)
    length = np.linalg.norm(point[edge[:, 0]] - point[edge[:, 1]], axis=1)
    fine = np.bincount(edge.ravel(), np.repeat(length, 2)) / np.maximum(np.bincount(edge.ravel()), 1)
    turn, shift = np.eye(3), np.zeros(3)
    for _ in range(8):
        at = project_on_walk(walk, to_meridian(point))
        if np.quantile(at.off, 0.9) > 0.01 * diagonal:
            return None
        by, off = _align_axis(walk, point, at)
        if np.abs(by - np.eye(3)).max() + np.abs(off).max() / diagonal < 1e-3 * ROUND:
            break
        point, turn, shift = point @ by.T + off, by @ turn, by @ shift + off
        walk = _outline(walk, to_meridian(point), at.place, fine, diagonal)
        if not _has_area(walk):
            return None
    flat = to_meridian(point)
    at = project_on_walk(walk, flat)
    order = np.lexsort((at.across, at.place))
    outline = _outline(walk, flat, at.place, fine, diagonal)
    if not _has_area(outline) or not _is_one_curve(walk, flat[order], at.place[order], diagonal):
        return None
    whole = _is_round(outline, point[edge].mean(axis=1), flat[edge, 0].mean(axis=1), length, diagonal)
    return (outline, turn, shift) if whole and _holds(outline, volume_m3(point, face)) else None


def _has_area(outline: Array) -> bool:
    """Say whether an outline (p, 2) has three corners, and one off the axis: all of a prism's may be one ring."""
    return len(outline) > 2 and bool((outline[:, 0] > 0).any())


def to_meridian(point: Array) -> Array:
    """Return (r, z) of points (v, 3)."""
    return np.stack([np.hypot(point[:, 0], point[:, 1]), point[:, 2]], axis=1)


def _cut_meridian(point: Array, face: Array, diagonal: float) -> Array | None:
    """Cut the surface with a half-plane: the closed walk (k, 2) of (r, z), None where that is not one walk.

    Poles have r = 0; a side between two poles is the body's inside.
    """
    angle = np.sort(np.arctan2(point[:, 1], point[:, 0])[to_meridian(point)[:, 0] > ROUND * diagonal] % np.pi)
    if not len(angle):
        return None
    gap = np.diff(angle, append=angle[0] + np.pi)
    middle = angle[np.argmax(gap)] + gap.max() / 2
    along = point[:, 0] * np.cos(middle) + point[:, 1] * np.sin(middle)
    away = point[:, 1] * np.cos(middle) - point[:, 0] * np.sin(middle)
    ends = np.stack([face, np.roll(face, -1, axis=1)], axis=2)  # (f, 3 edges, 2)
    crossed = (away[ends[..., 0]] >= 0) != (away[ends[..., 1]] >= 0)
    two = np.sort(ends[crossed], axis=1)
    key, number, count = np.unique(two[:, 0] * len(point) + two[:, 1], return_inverse=True, return_counts=True)
    if not len(key) or (count != 2).any():
        return None
    i, j = key // len(point), key % len(point)
    share = away[i] / (away[i] - away[j])
    out, height = (x[i] + share * (x[j] - x[i]) for x in (along, point[:, 2]))
    radius = np.hypot(point[:, 0], point[:, 1])
    flat = np.stack([radius[i] + share * (radius[j] - radius[i]), height], axis=1)
    chains: list[Array] = []
    for loop in _loops(number.reshape(-1, 2)):
        ours = out[loop] > 1e-9 * diagonal
        if ours.all():
            chains.append(flat[loop])
        elif ours.any():
            first = int(np.flatnonzero(ours & ~np.roll(ours, 1))[0])
            chains += _from_pole_to_pole(np.roll(loop, -first), out, flat, diagonal)
    return _join_chains(chains)


def _loops(segment: Array) -> list[Array]:
    """List the closed walks (k,) over segments (s, 2) of nodes, each node in two of them."""
    at = np.argsort(segment.ravel(), kind="stable").reshape(-1, 2) // 2
    ends, of, seen = segment.tolist(), at.tolist(), [False] * len(at)
    loops = []
    for first in range(len(at)):
        if seen[first]:
            continue
        node, by, loop = first, of[first][0], []
        while not seen[node]:
            seen[node] = True
            loop.append(node)
            node = ends[by][1] if ends[by][0] == node else ends[by][0]
            by = of[node][1] if of[node][0] == by else of[node][0]
        loops.append(np.array(loop))
    return loops


def _from_pole_to_pole(loop: Array, out: Array, flat: Array, diagonal: float) -> list[Array]:
    """Cut a loop, which begins on our side, where it crosses the axis: chains (k, 2), on the axis at both ends."""
    ours = out[loop] > 1e-9 * diagonal
    before, after = np.roll(loop, 1), np.roll(loop, -1)
    starts, ends = np.flatnonzero(ours & ~np.roll(ours, 1)), np.flatnonzero(ours & ~np.roll(ours, -1))

    def pole(a: int, b: int) -> Array:
        return np.array([0.0, flat[a, 1] + (flat[b, 1] - flat[a, 1]) * out[a] / (out[a] - out[b])])

    return [
        np.vstack([pole(loop[a], before[a]), flat[loop[a : b + 1]], pole(loop[b], after[b])])
        for a, b in zip(starts, ends, strict=True)
    ]


def _join_chains(chains: list[Array]) -> Array | None:
    """Join chains along the axis to one closed walk, None where they make several."""
    if len(chains) == 1:
        return chains[0]
    if not chains or any(chain[0, 0] > 0 for chain in chains):
        return None
    poles = sorted((float(chain[end, 1]), c, end) for c, chain in enumerate(chains) for end in (0, -1))
    partner: dict[tuple[int, int], tuple[int, int]] = {}
    for (_, c, end), (_, other, its_end) in zip(poles[::2], poles[1::2], strict=True):
        partner[c, end], partner[other, its_end] = (other, its_end), (c, end)
    walk, here = [], (0, 0)
    for _ in chains:
        c, end = here
        walk.append(chains[c] if end == 0 else chains[c][::-1])
        here = partner[c, -1 if end == 0 else 0]
        if here == (0, 0):
            break
    return np.concatenate(walk) if len(walk) == len(chains) else None


def project_on_walk(walk: Array, flat: Array) -> ProjectedPoints:
    """Place points (v, 2) beside the sides of a closed walk (k, 2), those on the axis left out."""
    from scipy.spatial import cKDTree

    samples = 8192  # along the walk
    along = np.roll(walk, -1, axis=0) - walk
    length = np.linalg.norm(along, axis=1)
    start = np.cumsum(length) - length
    real = np.flatnonzero(((walk[:, 0] > 0) | (np.roll(walk[:, 0], -1) > 0)) & (length > 0))
    cuts = np.ceil(length[real] / length[real].sum() * samples).astype(int) + 1
    owner = np.repeat(real, cuts)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(cuts) - cuts, cuts)) / np.repeat(cuts, cuts)
    _, nearest = cKDTree(walk[owner] + share[:, None] * along[owner]).query(flat)
    side, unit = owner[nearest], along / np.where(length > 0, length, 1)[:, None]
    best, where, spot = np.full(len(flat), np.inf), side.copy(), np.zeros(len(flat))
    position = np.searchsorted(real, side)
    for step in (0, -1, 1):  # a sample at a side's end may be of the next one
        one = real[(position + step) % len(real)]
        arm = flat - walk[one]
        reach = np.clip((arm * unit[one]).sum(axis=1), 0, length[one])
        off = np.linalg.norm(arm - reach[:, None] * unit[one], axis=1)
        nearer = off < best
        best, where, spot = (
            np.where(nearer, off, best),
            np.where(nearer, one, where),
            np.where(nearer, start[one] + reach, spot),
        )
    arm, heading = flat - walk[where], unit[where]
    return ProjectedPoints(spot, where, best, heading[:, 0] * arm[:, 1] - heading[:, 1] * arm[:, 0])


def _with_poles(walk: Array, flat: Array, place: Array) -> tuple[Array, Array]:
    """Add the walk's poles to points (v, 2) in order of their places; return both in order."""
    length = np.linalg.norm(np.roll(walk, -1, axis=0) - walk, axis=1)
    pole = np.flatnonzero(walk[:, 0] == 0)
    flat, place = np.concatenate([flat, walk[pole]]), np.append(place, (np.cumsum(length) - length)[pole])
    order = np.argsort(place, kind="stable")
    return flat[order], place[order]


def _is_one_curve(walk: Array, flat: Array, place: Array, diagonal: float) -> bool:
    """Say whether each point (v, 2), in order, lies where those before and behind it let it be expected."""
    bent = 0.1  # of the distance to the nearer one
    flat, _ = _with_poles(walk, flat, place)
    before, after = np.roll(flat, 1, axis=0), np.roll(flat, -1, axis=0)
    chord, arm = after - before, flat - before
    square = (chord**2).sum(axis=1)
    share = np.clip((arm * chord).sum(axis=1) / np.where(square > 0, square, 1), 0, 1)
    off = np.linalg.norm(arm - share[:, None] * chord, axis=1)
    near = np.minimum(np.linalg.norm(arm, axis=1), np.linalg.norm(flat - after, axis=1))
    return bool((off <= ROUND * diagonal + bent * near)[flat[:, 0] > 0].all())


def _outline(walk: Array, flat: Array, place: Array, fine: Array, diagonal: float) -> Array:
    """Thin points (v, 2) to an outline (p, 2): all poles and rings; others `apart` of the mesh's edges, fine (v,)."""
    apart = 0.4  # of the mesh's edges there: distance of the outline's points between rings
    ring = 14  # Vertices at one place of the meridian that are a ring
    ordered, _ = _with_poles(walk, flat, place)
    size = _with_poles(walk, np.stack([fine, fine], axis=1), place)[0][:, 0]
    step = np.linalg.norm(np.diff(ordered, axis=0, prepend=ordered[-1:]), axis=1) > ROUND * diagonal
    group = np.cumsum(step) - 1
    group[group < 0] = group[-1]  # a ring where the walk begins
    count = np.bincount(group)
    middle = np.stack([np.bincount(group, ordered[:, k]) / count for k in range(2)], axis=1)
    pole = np.unique(group[ordered[:, 0] == 0])
    middle[pole, 0] = 0
    size = np.bincount(group, size) / count
    whole = count >= ring
    whole[pole] = True
    first = int(np.argmax(whole))  # 0 where there is neither
    whole[first] = True
    middle, size, whole = np.roll(middle, -first, axis=0), np.roll(size, -first), np.roll(whole, -first)
    coming = np.append(np.flatnonzero(whole), len(middle))
    kept = [0]
    for k in range(1, len(middle)):
        ends = middle[[kept[-1], coming[np.searchsorted(coming, k)] % len(middle)]]
        if whole[k] or np.linalg.norm(ends - middle[k], axis=1).min() >= apart * size[k]:
            kept.append(k)
    return middle[kept]


def _is_round(outline: Array, middle: Array, radius: Array, length: Array, diagonal: float) -> bool:
    """Say whether edges' middles (e, 3) lie as near the outline as on rings without a gap of `widest_rad`."""
    widest_rad = 0.45  # Angle of an edge about the axis: a ring of fewer than 14 has an area 3 % less than its disc's
    allowed = np.maximum((1 - np.cos(widest_rad / 2)) * radius, 0.05 * length) + ROUND * diagonal
    return bool((project_on_walk(outline, to_meridian(middle)).off <= allowed).all())


def _holds(outline: Array, mesh_m3: float) -> bool:
    """Say whether the outline, turned, holds what the mesh does: corners of a thin plate lie on one circle, too.

    V = π/3 Σ (r² + r r' + r'²) (z' − z) over its sides; regular rings of 14 hold 0.967 of it.
    """
    most = 0.1  # relative difference
    (r, z), (r_next, z_next) = outline.T, np.roll(outline, -1, axis=0).T
    turned_m3 = np.pi / 3 * abs(float(((r * r + r * r_next + r_next * r_next) * (z_next - z)).sum()))
    return abs(abs(mesh_m3) - turned_m3) <= most * turned_m3


def _align_axis(walk: Array, point: Array, at: ProjectedPoints) -> tuple[Array, Array]:
    """Return the small turn (3, 3) and shift (3,) after which distances off the walk have no first harmonic.

    Least squares over sides with enough points, on each of which the true curve is a parabola beside it.
    """
    along = np.roll(walk, -1, axis=0) - walk
    heading = (along / np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None])[at.side]
    radius, height = to_meridian(point).T
    cos, sin = (point[:, k] / np.maximum(radius, 1e-300) for k in range(2))
    outward = -heading[:, 1], heading[:, 0]  # left of the walk, by r and z
    lever = outward[0] * height - outward[1] * radius
    gain = np.stack([cos * outward[0], sin * outward[0], -sin * lever, cos * lever], axis=1)
    order = np.argsort(at.side, kind="stable")
    rows: list[Array] = []
    right: list[Array] = []
    for mine in np.split(order, np.flatnonzero(np.diff(at.side[order])) + 1):
        if len(mine) < 12:
            continue
        s = at.place[mine] - at.place[mine].mean()
        s = s / max(np.abs(s).max(), 1e-300)
        q, _ = np.linalg.qr(np.stack([np.ones(len(s)), s, s * s], axis=1))
        for values, to in ((gain[mine], rows), (at.across[mine][:, None], right)):
            to.append(values - q @ (q.T @ values))
    if not rows:
        return np.eye(3), np.zeros(3)
    left, off = np.concatenate(rows), np.concatenate(right)[:, 0]
    move = np.zeros(4)
    for _ in range(3):
        rest = np.abs(off + left @ move)
        kept = rest <= 5 * np.median(rest) + 1e-300
        move = -np.linalg.lstsq(left[kept], off[kept], rcond=None)[0]
    x, y, a, b = move
    angle = float(np.hypot(a, b))
    cross = np.array([[0, 0, b], [0, 0, -a], [-b, a, 0]])
    turn = np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * cross @ cross
    return turn, np.array([x, y, 0.0])
