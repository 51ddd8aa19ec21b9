"""Interpretation of a triangle mesh as a solid: outside found, sheets given a wall, boxes and plates recognised.

Choices, each given in the model's note:
    closed surface: the solid inside; turned inside out where it looks inward; with thickness_m a hollow body, its wall
        inward
    small holes, seams that do not meet (from outside, 0.025 of a turn around a point): filled
    open surface: a wall of thickness_m, half on either side, 0.02 of the diagonal by default; flat sheets need
        thickness_m
    open pieces beside a solid that is most of the area: left out
    loose pieces: they stay; the solid keeps its largest piece (solid.largest_component)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.modal.meshing.stuffing import winding_number
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import MeshError

FLAT_THICKNESS = 1e-4  # thickness 2V/A under this part of the diagonal is no volume but noise
BODY_SIZE_M = (1e-5, 1e4)


@dataclass(frozen=True, slots=True, eq=False)
class Skin:
    """A surface that bounds a solid.

    Attributes
    ----------
    vertex_m, face : (v, 3), (f, 3) outward
    thickness_m : 2V/A, or that of the wall
    note : the choices
    guessed : whether the thickness of its wall is a default
    grown : whether it is a union of pieces that were grown to meet: slivers stand where they do
    """

    vertex_m: Array
    face: Array
    thickness_m: float
    note: str = ""
    guessed: bool = False
    grown: bool = False


def _flips(face: Array) -> Array:
    """Return which faces (f,) to turn so that neighbours agree, each connected piece taken by its first face."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    f = len(face)
    edge = np.stack([face, np.roll(face, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    key = edge.min(axis=1) * (int(face.max()) + 1) + edge.max(axis=1)
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    first = first[count == 2]  # where three faces meet it is undetermined which two are neighbours
    one, two = order[first], order[first + 1]
    against = (edge[one, 0] == edge[two, 0]).astype(np.int64)  # both run the same way: they disagree
    graph = coo_array(
        (np.concatenate([against, against]) + 1, (np.concatenate([one, two]) // 3, np.concatenate([two, one]) // 3)),
        shape=(f, f),
    ).tocsr()
    label = geometry.label_components(f, one // 3, two // 3)
    flip = np.zeros(f, bool)
    disagree = {(int(a), int(b)): bool(d) for a, b, d in zip(one // 3, two // 3, against, strict=True)}
    for root in np.unique(label, return_index=True)[1]:
        walk, parent = breadth_first_order(graph, int(root), directed=False)
        for node in walk[1:]:
            up = int(parent[node])
            flip[node] = flip[up] ^ disagree.get((up, int(node)), disagree.get((int(node), up), False))
    return flip


def pieces_of_faces(face: Array) -> Array:
    """Label (f,) the piece that each face belongs to: faces that share a vertex are connected."""
    one, other = face[:, [0, 1]].ravel(), face[:, [1, 2]].ravel()
    return np.asarray(geometry.label_components(int(face.max()) + 1, one, other)[face[:, 0]])


def _boundary(face: Array) -> Array:
    """Return the directed edges (e, 2) that no face runs through the other way."""
    edge = np.stack([face, np.roll(face, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    n = int(face.max()) + 1
    return edge[~np.isin(edge[:, 0] * n + edge[:, 1], edge[:, 1] * n + edge[:, 0])]


def _cap_area_m2(vertex_m: Array, boundary: Array) -> float:
    """Compute the area of the flattest caps over the holes: half the sum of |∮ x × dx| over the loops."""
    if len(boundary) == 0:
        return 0.0
    label = geometry.label_components(len(vertex_m), boundary[:, 0], boundary[:, 1])
    loop = np.unique(label[boundary[:, 0]], return_inverse=True)[1]
    middle = vertex_m.mean(axis=0)
    swept = np.cross(vertex_m[boundary[:, 0]] - middle, vertex_m[boundary[:, 1]] - middle) / 2
    return float(np.linalg.norm(np.stack([np.bincount(loop, swept[:, x]) for x in range(3)], axis=1), axis=1).sum())


def _vertex_normals(vertex_m: Array, face: Array) -> Array:
    corner = geometry.corner_normals(vertex_m, face)
    mean = np.zeros_like(vertex_m)
    np.add.at(mean, face.ravel(), corner.reshape(-1, 3))
    length = np.linalg.norm(mean, axis=1)
    return np.asarray(mean / np.where(length > 0, length, 1)[:, None])


def _close_with_walls(vertex_m: Array, face: Array, out_m: float, in_m: float) -> tuple[Array, Array]:
    """Close an open surface: moved out_m along the normals, a copy moved in_m against them, rims between."""
    normal = _vertex_normals(vertex_m, face)
    n = len(vertex_m)
    rim = _boundary(face)
    a, b = rim[:, 0], rim[:, 1]
    sides = np.concatenate([np.stack([b, a, a + n], axis=1), np.stack([b, a + n, b + n], axis=1)])
    return np.concatenate([vertex_m + out_m * normal, vertex_m - in_m * normal]), np.concatenate(
        [face, face[:, ::-1] + n, sides]
    )


def _orient_faces(vertex_m: Array, face: Array) -> tuple[Array, str]:
    """Turn faces (f, 3) so that neighbours agree and the solid is inside, and describe what was done."""
    note = ""
    if not geometry.is_closed(face):
        flip = _flips(face)
        if flip.any():
            face = np.where(flip[:, None], face[:, ::-1], face)
            note = f"; {format_count(int(flip.sum()), 'face')} turned to agree with neighbours"
            label = pieces_of_faces(face)
            for piece in range(int(label.max()) + 1):
                mine = label == piece
                if geometry.volume_m3(vertex_m, face[mine]) < 0:
                    face[mine] = face[mine][:, ::-1]
    if geometry.volume_m3(vertex_m, face) < 0:
        face = face[:, ::-1]
        note += "; turned inside out"
    return face, note


def _solid_pieces(vertex_m: Array, face: Array) -> Array:
    """Return which faces (f,) are of pieces that enclose a volume but for small holes."""
    cap_part = 0.05  # of a piece's area: flat caps on its holes, below which it encloses a volume
    label = pieces_of_faces(face)
    solid = np.zeros(len(face), bool)
    for piece in np.unique(label):
        mine = label == piece
        area = geometry.face_areas_m2(vertex_m, face[mine]).sum()
        solid[mine] = _cap_area_m2(vertex_m, _boundary(face[mine])) < cap_part * area
    return solid


def _openness(vertex_m: Array, face: Array) -> float:
    """Average the winding number around points just outside over the area: 0 of a closed surface.

    Its pieces may share their edges or not.
    """
    samples = 2000  # faces outside which it is evaluated
    shown = face[:: -(-len(face) // samples)]
    area, normal = geometry.face_areas_m2(vertex_m, shown), geometry.outward_normals(vertex_m, shown)
    outside = vertex_m[shown].mean(axis=1) + FLAT_THICKNESS * np.linalg.norm(np.ptp(vertex_m, axis=0)) * normal
    near = geometry.surface_index(vertex_m, face).order
    return float(np.average(np.abs(winding_number(vertex_m[face[near]], outside)), weights=area))


def _check_wall(thickness_m: float | None, diagonal_m: float) -> None:
    """Raise MeshError for a wall that is none, or larger than its body."""
    if thickness_m is None:
        return
    if not (np.isfinite(thickness_m) and thickness_m > 0):
        raise MeshError(f"thickness_m is {thickness_m}", "give a wall thickness above zero")
    if thickness_m > diagonal_m:
        raise MeshError(
            f"wall of {thickness_m:g} m on a body of {diagonal_m:.3g} m", f"give metres: {thickness_m / 1000:g}?"
        )


def prepare_surface(vertex_m: Array, face: Array, thickness_m: float | None) -> Skin:
    """Prepare the surface that is to be filled.

    Raises MeshError for no triangle, NaN, an absurd size, or a sheet that it cannot thicken.
    """
    if not np.isfinite(vertex_m[face]).all():
        raise MeshError("mesh holds NaN or infinite vertices", "repair the mesh file")
    used, face = np.unique(face, return_inverse=True)
    vertex_m, face = geometry.weld_vertices(vertex_m[used], face.reshape(-1, 3))
    if len(face) == 0:
        raise MeshError("mesh has no triangle with three different corners", "repair the mesh file")
    diagonal_m = float(np.linalg.norm(np.ptp(vertex_m, axis=0)))
    if not BODY_SIZE_M[0] < diagonal_m < BODY_SIZE_M[1]:
        raise MeshError(f"mesh is {diagonal_m:.3g} m across", "check its unit and scale: metres are expected")
    _check_wall(thickness_m, diagonal_m)
    area = geometry.face_areas_m2(vertex_m, face)
    face = face[area > 1e-14 * diagonal_m**2]
    if len(face) == 0:
        raise MeshError("mesh has no area", "its vertices lie on one line: repair the mesh file")
    face, note = _orient_faces(vertex_m, face)
    area = geometry.face_areas_m2(vertex_m, face)
    solid = _solid_pieces(vertex_m, face)
    if 0.5 * area.sum() < area[solid].sum() < area.sum() and thickness_m is None:
        note += f"; {format_count(len(np.unique(pieces_of_faces(face)[~solid])), 'open piece')} left out"
        face, area = face[solid], area[solid]
    total = float(area.sum())
    volume = geometry.volume_m3(vertex_m, face)
    closed = geometry.is_closed(face)
    open_part = 0.025  # mean winding number just outside: a ball with a hole of 5 % of its area has it
    if 2 * volume / total > FLAT_THICKNESS * diagonal_m and (closed or _openness(vertex_m, face) < open_part):
        if not closed:
            note += "; holes filled"
        if thickness_m is None:
            return Skin(vertex_m, face, 2 * volume / total, note)
        inner_v, inner_f = vertex_m - thickness_m * _vertex_normals(vertex_m, face), face[:, ::-1] + len(vertex_m)
        return Skin(
            np.concatenate([vertex_m, inner_v]),
            np.concatenate([face, inner_f]),
            thickness_m,
            f"{note}; hollow, wall {thickness_m:.3g} m inward",
        )
    sheet_part = 0.02
    wall_m = thickness_m if thickness_m is not None else sheet_part * diagonal_m
    flat = (
        float(np.linalg.svd(vertex_m - vertex_m.mean(axis=0), compute_uv=False)[-1])
        < 1e-9 * diagonal_m * len(vertex_m) ** 0.5
    )
    if thickness_m is None and flat:
        raise MeshError(
            "mesh is a flat sheet without volume", "give it a wall, thickness_m or --thickness, to make it solid"
        )
    if closed:  # two coincident sides: one of them is the sheet
        _, first = np.unique(np.sort(face, axis=1), axis=0, return_index=True)
        if len(first) == len(face) or thickness_m is None:
            raise MeshError(
                f"mesh encloses no volume ({volume:.2g} m³ in {total:.2g} m²)",
                "give thickness_m to make the sheet solid",
            )
        face = face[np.sort(first)]
    vertex_m, face = _close_with_walls(vertex_m, face, wall_m / 2, wall_m / 2)
    note += f"; open surface given a wall of {wall_m:.3g} m"
    return Skin(vertex_m, face, wall_m, note, guessed=thickness_m is None)


def given_wall_m(note: str) -> float:
    """Return the wall that a note says an open surface was given, 0 where it says none.

    Solved bodies come from the cache with their note alone.
    """
    _, found, rest = note.partition("open surface given a wall of ")
    return float(rest.split(" ", 1)[0]) if found else 0.0
