"""A sheet recognised in a closed surface: two sides a thin wall apart, and the rims between them.

    surface -> patches, cut along its creases
    a patch is a side where what lies behind most of it looks the other way, a wall away, else a rim
    neighbouring patches of sides -> pieces: a sheet has two of about the same area, each behind the other
A body with a rib, a solid part or a rounded rim has no two such sides: it is no sheet.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.records import Array


class Sides(NamedTuple):
    """A sheet: vertex_m (v, 3) of both sides outer (f, 3) and inner (g, 3); wall_m (f,) behind each outer face."""

    vertex_m: Array
    outer: Array
    inner: Array
    wall_m: Array


def sides_of(vertex_m: Array, face: Array) -> Sides | None:
    """Find the two sides of a closed surface that is a sheet, else return None."""
    walls, turned = 1.6, 0.5  # mean walls that the other side may be away, cosine of how far it may be turned
    most_of, whole, least_sides = (
        0.5,
        0.98,
        0.8,
    )  # area: of a patch that is a side, of both sides, of the lesser over all
    area = geometry.face_areas_m2(vertex_m, face)
    mean_m = 2 * geometry.volume_m3(vertex_m, face) / float(area.sum())
    normal, centre = geometry.outward_normals(vertex_m, face), vertex_m[face].mean(axis=1)
    index = replace(geometry.surface_index(vertex_m, face), wall_m=walls * mean_m)
    behind, part, distance = geometry.nearest(index, centre, -normal)
    at = np.einsum("kc,kcx->kx", part, vertex_m[face[behind]])
    side = (
        (np.einsum("fx,fx->f", normal[behind], normal) < -turned)
        & (np.einsum("fx,fx->f", at - centre, normal) < 0)
        & (distance < walls * mean_m)
    )
    patch = _label_pieces(face, _smooth_pairs(vertex_m, face))
    paired = np.bincount(patch, np.where(side, area, 0.0)) > most_of * np.bincount(patch, area)
    of_side = paired[patch]
    if area[of_side].sum() < least_sides * area.sum():
        return None
    one, two = _neighbours(face)
    both = of_side[one] & of_side[two]
    label = _label_pieces(face, (one[both], two[both]))
    size = np.bincount(label, np.where(of_side, area, 0.0))
    order = np.argsort(-size, kind="stable")[:2]
    if len(order) < 2 or size[order].sum() < whole * size.sum() or size[order[1]] < least_sides * size[order[0]]:
        return None
    for mine, other in (order, order[::-1]):
        across = side & (label == mine)
        if area[across & (label[behind] == other)].sum() < whole * area[across].sum():
            return None
    first, second = (of_side & (label == one) for one in order)
    wall_m = np.where(side, distance, np.median(distance[side]))
    return Sides(vertex_m, face[first], face[second], wall_m[first])


def rim(face: Array) -> Array:
    """Return the directed edges (e, 2) that one face only has."""
    edge = np.stack([face, np.roll(face, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    n = int(face.max()) + 1
    return edge[~np.isin(edge[:, 0] * n + edge[:, 1], edge[:, 1] * n + edge[:, 0])]


def _neighbours(face: Array) -> tuple[Array, Array]:
    """Return the pairs of faces (k,), (k,) that share an edge."""
    edge = np.sort(np.stack([face, np.roll(face, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1).astype(np.int64)
    code = edge[:, 0] * (int(face.max()) + 1) + edge[:, 1]
    order = np.argsort(code, kind="stable")
    same = np.flatnonzero(code[order][1:] == code[order][:-1])
    return order[same] // 3, order[same + 1] // 3


def _smooth_pairs(vertex_m: Array, face: Array) -> tuple[Array, Array]:
    """Return the neighbours that no crease parts."""
    normal = geometry.outward_normals(vertex_m, face)
    one, two = _neighbours(face)
    smooth = np.einsum("kx,kx->k", normal[one], normal[two]) > np.cos(geometry.CREASE_RAD)
    return one[smooth], two[smooth]


def _label_pieces(face: Array, pair: tuple[Array, Array]) -> Array:
    """Label (f,) the pieces of faces that hang together by these pairs."""
    return geometry.label_components(len(face), *pair)
