"""Shapes -> one solid of quadratic tetrahedra in the body frame, with its surface and that surface's curvature.

one box, sphere, cylinder or capsule   -> meshed by rule (named_shapes.py, structured.py)
a mesh, or several shapes as one solid -> their surfaces together (surfaces.py) -> filled (filling.py)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sonic_bullet import _engine, geometry
from sonic_bullet.modal.meshing.filling import (
    THICKENED_TETS,
    Filler,
    TooThinError,
    coarse_edge_m,
    fill_by_lattice,
    fill_surface,
)
from sonic_bullet.modal.meshing.named_shapes import alone, box_cells, mesh_named_shape, place_points, rotation, soup
from sonic_bullet.modal.meshing.solid import Solid, SolidSurface, surface
from sonic_bullet.modal.meshing.surfaces import Skin, pieces_of_faces, prepare_surface
from sonic_bullet.modal.meshing.unions import unite_pieces
from sonic_bullet.modal.sparse.ordering import dissection
from sonic_bullet.records import Array, Shape, TouchedSurface
from sonic_bullet.records.errors import MeshError

__all__ = ["FilledBody", "box_cells", "check_fillable", "fill", "rotation"]


@dataclass(frozen=True, slots=True, eq=False)
class FilledBody:
    """A body ready to be assembled: solid, its skin, curvature_per_m (f,) of the skin's faces, `ModalModel.touched`."""

    solid: Solid
    skin: SolidSurface
    curvature_per_m: Array
    touched: TouchedSurface | None = None


@lru_cache(maxsize=32)
def skin_of(shapes: tuple[Shape, ...], thickness_m: float | None) -> Skin:
    """Return the prepared surface of shapes, the same record for the same records. Raises MeshError."""
    return prepare_surface(*soup(shapes), thickness_m)


@lru_cache(maxsize=32)
def _unite_pieces(skin: Skin) -> Skin:
    """Return the skin with its closed pieces made one, where there are several."""
    piece = pieces_of_faces(skin.face)
    if piece.max() == 0 or not geometry.is_closed(skin.face):
        return skin

    vertex, face, done, grown = unite_pieces(skin.vertex_m, skin.face, piece)
    if not done:
        return skin
    area = float(geometry.face_areas_m2(vertex, face).sum())
    wall_m = 2 * geometry.volume_m3(vertex, face) / area
    return Skin(vertex, face, wall_m, skin.note + done, grown=grown)


def fill(
    shapes: tuple[Shape, ...],
    edge_m: float | None,
    thickness_m: float | None,
    *,
    filler: Filler = "any",
) -> FilledBody:
    """Fill the union of ``shapes`` to one solid in the body frame, its nodes in elimination order.

    filler: as `fill_surface`. Raises MeshError.
    """
    if edge_m is not None and not (np.isfinite(edge_m) and edge_m > 0):
        raise MeshError(f"edge_m is {edge_m}", "give an element size above zero")
    vertex, face = np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    one = alone(shapes, thickness_m)
    if one is not None:
        made = mesh_named_shape(one, edge_m)
        made = Solid(place_points(one, made.node_m), made.tet, made.affine, made.note)
    else:
        skin_given = skin_of(shapes, thickness_m)
        solids = shapes if thickness_m is None and all(shape.kind != "mesh" for shape in shapes) else ()
        try:
            made = fill_surface(_unite_pieces(skin_given), edge_m, filler=filler, solids=solids)
        except TooThinError as error:
            if filler == "any":
                united = _unite_pieces(skin_given)
                made = fill_by_lattice(united, coarse_edge_m(united, THICKENED_TETS), error.what)
            else:
                raise
        vertex, face = skin_given.vertex_m, skin_given.face
    return _filled_body(made, one, vertex, face)


def _filled_body(made: Solid, one: Shape | None, vertex: Array, face: Array) -> FilledBody:
    """Return a solid in elimination order, with its skin and that skin's curvature."""
    order = dissection(made.node_m, made.tet)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    solid = replace(made, node_m=made.node_m[order], tet=place[made.tet])
    skin = surface(solid)
    return FilledBody(solid, skin, *_curvature(one, vertex, face, solid.node_m[skin.node], skin.face))


def check_fillable(shapes: tuple[Shape, ...], thickness_m: float | None) -> int:
    """Check what can be seen without filling, and count the triangles to be filled.

    Raises MeshError for no extent, no volume, a sheet without a wall. Whether a surface that passes through itself can
    be filled is known only when it is.
    """
    if not shapes:
        raise MeshError("body has no shape", "give it a collision or visual shape, or pass mesh=")
    if any(shape.kind == "plane" for shape in shapes):
        return 0
    one = alone(shapes, thickness_m)
    if one is not None:
        mesh_named_shape(one, float(one.size_m.max()))
        return 0
    return len(skin_of(shapes, thickness_m).face)


class Outline(NamedTuple):
    """Surface of a body that is not filled: vertex_m (v, 3), face (f, 3), what it encloses and what was assumed."""

    vertex_m: Array
    face: Array
    volume_m3: float
    assumed_wall_m: float


def outline(shapes: tuple[Shape, ...], thickness_m: float | None) -> Outline:
    """Return the surface that `fill` would fill, its pieces united. Raises MeshError as `check_fillable` does."""
    if not shapes:
        raise MeshError("body has no shape", "give it a collision or visual shape, or pass mesh=")
    one = alone(shapes, thickness_m)
    if one is not None:
        return Outline(*soup(shapes), geometry.shape_volume_m3(one), 0.0)
    skin = skin_of(shapes, thickness_m)
    united = _unite_pieces(skin)
    volume = abs(geometry.volume_m3(united.vertex_m, united.face))
    return Outline(united.vertex_m, united.face, volume, skin.thickness_m if skin.guessed else 0.0)


def united_skin(shapes: tuple[Shape, ...], thickness_m: float | None) -> Skin | None:
    """Return the surface that `fill` fills, None of a named shape alone."""
    return None if alone(shapes, thickness_m) is not None else _unite_pieces(skin_of(shapes, thickness_m))


def _curvature(
    one: Shape | None, vertex_m: Array, face: Array, skin_m: Array, skin_face: Array
) -> tuple[Array, TouchedSurface | None]:
    """Compute the curvature of the skin's faces, and return the given surface where some of them lean from it.

    Known of a ball and a box, estimated of other named shapes, else the given mesh's own nearby. A contact leans from a
    face as from a crease where the face, not the body, leans: a lattice bevels edges, and a large element cuts bends.
    """
    if one is not None and one.kind == "sphere":
        return np.full(len(skin_face), 1 / float(one.size_m[0])), None
    if one is not None:
        return geometry.face_curvature(skin_m, skin_face), None
    given = geometry.face_curvature(vertex_m, face)
    normal = geometry.outward_normals(skin_m, skin_face)
    nearest, _, _ = geometry.closest_point(vertex_m, face, skin_m[skin_face].mean(axis=1), normal)
    cosine = (normal * geometry.outward_normals(vertex_m, face)[nearest]).sum(axis=1)
    leans = bool((cosine < _engine.CREASE_COS).any())
    return np.asarray(given[nearest]), TouchedSurface(vertex_m, face, given) if leans else None
