"""Shapes -> one solid of quadratic tetrahedra in the body frame, with its surface and that surface's curvature.

one box, sphere, cylinder or capsule           -> laid out by rule (structured.py)
a mesh that is a box or an extruded outline    -> likewise (prisms.py)
any other mesh, or several shapes as one solid -> their surfaces together (surfaces.py) -> fTetWild (tetrahedra.py)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.modal.meshing import prisms, structured
from sonic_bullet.modal.meshing.solid import (
    COARSER,
    Solid,
    SolidSurface,
    corner_volume_m3,
    largest_component,
    quadratic,
    surface,
)
from sonic_bullet.modal.meshing.surfaces import SIZE_M, Skin, pieces_of_faces, prepared
from sonic_bullet.modal.ordering import dissection
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError

THIN_DOF, CHUNKY_DOF = 26_000, 10_000  # unknowns by default: a plate's factor stays sparse, a ball's does not
DOF_PER_TET = 5.6  # measured on fTetWild's meshes of bars, slabs and bowls
MOST_TETS = 7_000
LUMP_PASSES, MOST_PASSES = 2, 80
"""Of fTetWild's optimisation.

It makes elements finer until the worst is good; two passes and a lesser edge give lumps the same modes in half the
time.
"""
FILL_LIMITS_S = (28.0, 8.0, 6.0)
"""Processor seconds of each attempt, the next coarser than the last; a bowl of 14 400 triangles takes 15, on a busy
machine 22. A slower machine may come to a coarser one: the note says so (`solid.COARSER`)."""
FILLED = (0.6, 1.7)
"""Of the enclosed volume: what a fill may hold.

Wide, for a surface that passes through itself encloses some of it twice.
"""
ENVELOPE_OF_EDGE = 0.035  # a finer surface than its elements costs time and tells nothing
# of the thickness and of the diagonal: how far fTetWild may move the surface, the lesser counts
ENVELOPE = (0.04, 0.006)


@dataclass(frozen=True, slots=True, eq=False)
class Filled:
    """A body ready to be assembled: solid, its skin, curvature_per_m (f,) of the skin's faces."""

    solid: Solid
    skin: SolidSurface
    curvature_per_m: Array


def dof_budget(thickness_m: float, diagonal_m: float) -> int:
    """Unknowns spent by default on a body of thickness 2V/A: fewer the chunkier, more for very thin plates.

    A quadratic element of edge e bends true while e² « thickness x wavelength, so the number of elements in a plate
    grows as 1/thickness.
    """
    more = np.clip(0.007 * diagonal_m / thickness_m, 1, 3)
    return int((THIN_DOF + (CHUNKY_DOF - THIN_DOF) * chunkiness(thickness_m, diagonal_m)) * more)


def chunkiness(thickness_m: float, diagonal_m: float) -> float:
    """0 for slabs and bars (thickness 2V/A under 4 % of the diagonal) to 1 for lumps (over 7 %; a ball has 19 %)."""
    return float(np.clip((thickness_m / diagonal_m - 0.04) / 0.03, 0, 1))


def rotation(quaternion_xyzw: Array) -> Array:
    """Matrix (3, 3) of a quaternion [Shoemake 1985, eq. 10]."""
    length = float(np.linalg.norm(quaternion_xyzw))
    if not length > 0:
        raise MeshError("a shape's quaternion is zero", "give a rotation, (0, 0, 0, 1) for none")
    x, y, z, w = quaternion_xyzw / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _placed(shape: Shape, point: Array) -> Array:
    return np.asarray(point @ rotation(shape.quaternion_xyzw).T + shape.position_m)


def box_cells(size_m: Array, edge_m: float | None) -> tuple[int, int, int]:
    """Cells along x, y, z: of edge_m, or the finest even grid within the budget of unknowns."""
    if edge_m is None:
        budget = dof_budget(1 / float((1 / size_m).sum()), float(np.linalg.norm(size_m)))
        tries = size_m.max() / np.arange(4, 400)
        fits = 3 * np.prod(2 * np.maximum(1, np.round(size_m / tries[:, None])) + 1, axis=1) <= budget
        edge_m = float(tries[np.flatnonzero(fits)[-1]]) if fits.any() else float(tries[0])
        cells = np.maximum(1, np.round(size_m / edge_m)).astype(int)
        long = int(np.argmax(size_m))
        across = [k for k in range(3) if k != long]
        # a bar: its twist warps the section, which takes four cells either way
        if size_m[across].max() < size_m[long] / 4:
            cells[across] = np.maximum(cells[across], 4)
            cells[long] = max(8, int((budget / (3 * np.prod(2 * cells[across] + 1)) - 1) / 2))
        return int(cells[0]), int(cells[1]), int(cells[2])
    nx, ny, nz = (max(1, round(float(s) / edge_m)) for s in size_m)
    return nx, ny, nz


def _box(size_m: Array, edge_m: float | None) -> Solid:
    if not (size_m > 0).all():
        raise MeshError(f"box of size {size_m} m has no volume", "give edge lengths above zero")
    return structured.box(size_m, box_cells(size_m, edge_m))


def _named(shape: Shape, edge_m: float | None) -> Solid:
    """Structured solid of a named shape about its own origin."""
    if shape.kind == "box":
        return _box(shape.size_m, edge_m)
    radius, length = float(shape.size_m[0]), float(shape.size_m[1])
    if not radius > 0 or (shape.kind == "cylinder" and not length > 0):
        raise MeshError(
            f"{shape.kind} of radius {radius} m and length {length} m has no volume", "give sizes above zero"
        )
    if shape.kind == "sphere" or (shape.kind == "capsule" and length <= 0):
        return structured.sphere(radius, 5 if edge_m is None else max(2, round(radius / edge_m)))
    if edge_m is None:
        # A disc of n rings has 12 n² quadratic nodes on 2 l + 1 heights (the caps of a capsule count as one more
        # radius).
        whole = length + (radius if shape.kind == "capsule" else 0)
        thickness = 2 / (2 / radius + 2 / whole)
        budget = dof_budget(thickness, float(np.hypot(2 * radius, whole)))
        tries = radius / np.arange(2, 60)
        dof = 36 * np.round(radius / tries) ** 2 * (2 * np.maximum(1, np.round(whole / tries)) + 1)
        edge_m = float(tries[max(0, int(np.searchsorted(dof, budget)) - 1)])
    n, layers = max(2, round(radius / edge_m)), max(1, round(length / edge_m))
    return (structured.capsule if shape.kind == "capsule" else structured.cylinder)(radius, length, n, layers)


def _soup(shapes: tuple[Shape, ...]) -> tuple[Array, Array]:
    """All surfaces together in the body frame: vertices (v, 3), faces (f, 3)."""
    vertices, faces, offset = [], [], 0
    for shape in shapes:
        if shape.kind == "mesh":
            vertex, face = shape.vertex_m, shape.face
        else:
            solid = _named(shape, float(shape.size_m.max() if shape.kind == "box" else shape.size_m[0] / 4))
            skin = surface(solid)
            vertex, face = solid.node_m[skin.node], skin.face
        vertices.append(_placed(shape, vertex))
        faces.append(np.asarray(face, np.int64) + offset)
        offset += len(vertex)
    return np.concatenate(vertices), np.concatenate(faces)


def _edge_m(volume_m3: float, thickness_m: float, budget: int) -> float:
    """Edge that keeps fTetWild within the budget of unknowns: tetrahedra ≈ 9 V/e³ + 2 A/e², A = 2V/thickness.

    Fitted to its meshes of slabs and bowls; lumps come out twice as fine, so they are asked for less.
    """
    edges = thickness_m * np.geomspace(0.4, 20, 200)
    tets = 9 * volume_m3 / edges**3 + 4 * volume_m3 / thickness_m / edges**2
    return float(edges[min(199, int((tets * DOF_PER_TET > budget).sum()))])


def _united(skin: Skin) -> Skin:
    """The skin with its closed pieces made one, where there are several."""
    piece = pieces_of_faces(skin.face)
    if piece.max() == 0 or not geometry.is_closed(skin.face):
        return skin
    from sonic_bullet.modal.meshing.unions import joined

    vertex, face, done = joined(skin.vertex_m, skin.face, piece)
    if not done:
        return skin
    area = float(geometry.face_areas_m2(vertex, face).sum())
    return Skin(vertex, face, 2 * geometry.volume_m3(vertex, face) / area, skin.note + done)


def _meshed(skin: Skin, edge_m: float | None, say: Callable[[str], None]) -> Solid:
    """Solid of a prepared surface: by rule where a rule is known, else by fTetWild, coarser where that is too slow or
    too fine.
    """
    from sonic_bullet.modal.meshing.tetrahedra import TooSlow, tetrahedra

    vertex, face, thickness = skin.vertex_m, skin.face, skin.thickness_m
    diagonal = float(np.linalg.norm(np.ptp(vertex, axis=0)))
    budget = dof_budget(thickness, diagonal)
    if geometry.is_closed(face):
        found = prisms.as_box(vertex, face)
        if found is not None:
            size, axes, centre = found
            made = _box(size, edge_m)
            return Solid(made.node_m @ axes.T + centre, made.tet, note=made.note + skin.note)
        prism = prisms.as_prism(vertex, face, edge_m, budget)
        if prism is not None:
            return Solid(prism.node_m, prism.tet, note=prism.note + skin.note)
    # a curved shell takes a third more than a slab laid out by rule, a lump little more than half, for fTetWild makes
    # it finer than asked
    lump = chunkiness(thickness, diagonal)
    spent = int(budget * (1.35 - 0.77 * lump))
    passes = LUMP_PASSES if lump > 0.5 else MOST_PASSES
    edge = edge_m if edge_m is not None else _edge_m(geometry.volume_m3(vertex, face), thickness, spent)
    envelope = max(min(ENVELOPE[0] * thickness, ENVELOPE[1] * diagonal), ENVELOPE_OF_EDGE * edge)
    say(f"filling {len(face)} triangles with tetrahedra of {edge:.3g} m")
    too_fine = MeshError(f"mesh needs more than {MOST_TETS} tetrahedra", "give a simpler mesh")
    failure, said = too_fine, ""
    limits_s = FILL_LIMITS_S if edge_m is None else FILL_LIMITS_S[:1]
    for limit_s in limits_s:
        try:
            node, tet = tetrahedra(vertex, face, edge, envelope, passes=passes, time_limit_s=limit_s)
            _check_filled(vertex, face, node, tet)
        except MeshError as error:
            failure, coarsening = error, COARSER if isinstance(error, TooSlow) else "coarser"
        else:
            tet, pieces = largest_component(node, tet)
            if len(tet) <= MOST_TETS or edge_m is not None:
                note = f"fTetWild, {len(tet)} tetrahedra, edge {edge:.3g} m, envelope {envelope:.2g} m{skin.note}{said}"
                return quadratic(
                    node, tet, note=note + (f"; largest of {pieces} separate pieces kept" if pieces > 1 else "")
                )
            failure, coarsening = too_fine, "coarser"
        said = said if COARSER in said else f"; {coarsening}: {failure.what}"
        edge, envelope, passes = 1.6 * edge, 2.5 * envelope, LUMP_PASSES
    if len(limits_s) > 1:
        failure = MeshError(
            f"{failure.what}, the last of {len(limits_s)} attempts, each coarser, within {sum(limits_s):.0f} s in all",
            failure.remedy,
        )
    raise failure


def _check_filled(vertex: Array, face: Array, node: Array, tet: Array) -> None:
    """Raise MeshError where tetrahedra do not hold what a closed surface of one piece encloses: its walls are thinner
    than the envelope.
    """
    if not geometry.is_closed(face) or pieces_of_faces(face).max() > 0:
        return
    kept = float(np.abs(corner_volume_m3(node, tet)).sum()) / geometry.volume_m3(vertex, face)
    if not FILLED[0] < kept < FILLED[1]:
        raise MeshError(
            f"filling the mesh with tetrahedra turns its volume to {kept:.0%}",
            "give a mesh with thicker walls, or a simpler one",
        )


def fill(
    shapes: tuple[Shape, ...], edge_m: float | None, thickness_m: float | None, say: Callable[[str], None]
) -> Filled:
    """One solid, the union of ``shapes``, in the body frame, its nodes in elimination order. Raises MeshError."""
    if edge_m is not None and not (np.isfinite(edge_m) and edge_m > 0):
        raise MeshError(f"edge_m is {edge_m}", "give an element size above zero")
    vertex, face = np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    one = _alone(shapes, thickness_m)
    if one is not None:
        made = _named(one, edge_m)
        made = Solid(_placed(one, made.node_m), made.tet, made.affine, made.note)
    else:
        skin_given = prepared(*_soup(shapes), thickness_m)
        vertex, face = skin_given.vertex_m, skin_given.face
        made = _meshed(_united(skin_given), edge_m, say)
    order = dissection(made.node_m, made.tet)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    solid = Solid(made.node_m[order], place[made.tet], made.affine, made.note)
    skin = surface(solid)
    return Filled(solid, skin, _curvature(one, vertex, face, solid.node_m[skin.node], skin.face))


def check_fillable(shapes: tuple[Shape, ...], thickness_m: float | None) -> int:
    """Raise MeshError where `fill` would for what can be seen at once: no extent, no volume, a sheet without a wall;
    the triangles to be filled.

    Whether a surface that passes through itself can be filled is known only when it is.
    """
    if not shapes:
        raise MeshError("body has no shape", "give it a collision or visual shape, or pass mesh=")
    if any(shape.kind == "plane" for shape in shapes):
        return 0
    one = _alone(shapes, thickness_m)
    if one is not None:
        _named(one, float(one.size_m.max()))
        return 0
    return len(prepared(*_soup(shapes), thickness_m).face)


def _alone(shapes: tuple[Shape, ...], thickness_m: float | None) -> Shape | None:
    """The one solid box, ball, cylinder or capsule that the shapes are, else None.

    Raises MeshError where its size is absurd.
    """
    if len(shapes) > 1 or shapes[0].kind == "mesh" or thickness_m is not None:
        return None
    one = shapes[0]
    if not SIZE_M[0] < one.size_m.max() < SIZE_M[1]:
        raise MeshError(
            f"{one.kind} is {one.size_m.max():.3g} m across", "check its unit and scale: metres are expected"
        )
    return one


def _curvature(one: Shape | None, vertex_m: Array, face: Array, skin_m: Array, skin_face: Array) -> Array:
    """Curvature of the skin's faces: known of a ball and a box, estimated of other named shapes, else the given mesh's
    own nearby.
    """
    if one is not None and one.kind == "sphere":
        return np.full(len(skin_face), 1 / float(one.size_m[0]))
    if one is not None:
        return geometry.face_curvature(skin_m, skin_face)
    given = geometry.face_curvature(vertex_m, face)
    if not given.any():
        return np.zeros(len(skin_face))
    nearest, _, _ = geometry.closest_point(
        vertex_m, face, skin_m[skin_face].mean(axis=1), geometry.outward_normals(skin_m, skin_face)
    )
    return np.asarray(given[nearest])
