"""A prepared surface -> a solid of quadratic tetrahedra.

a box or an extruded outline  -> by rule (prisms.py): thin plates need flat elements
any other closed surface      -> Netgen (tetrahedra.py), the middles of its edges put on the surface (on_surface.py)
what Netgen refuses, lumps of many triangles -> simplified below an element (Manifold), and again
lumps whose pieces meet only grown -> no Netgen: slivers stand where they meet
a union of named solids that Netgen refuses -> united by Open CASCADE and filled (_compound.py)
one that is not closed, or that Netgen still refuses: it passes through itself   -> a lattice (stuffing.py)
walls too thin for a lattice, and drafts -> thicker walls that bend as these do (`fill_by_lattice`)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal.meshing import named_shapes, prisms
from sonic_bullet.modal.meshing.on_surface import fit_to_surface
from sonic_bullet.modal.meshing.sizes import chunkiness, curved_sizes, dof_budget, edge_within_m
from sonic_bullet.modal.meshing.solid import Solid, corner_volume_m3, largest_component, quadratic
from sonic_bullet.modal.meshing.stuffing import stuff_lattice
from sonic_bullet.modal.meshing.surfaces import Skin
from sonic_bullet.modal.meshing.tetrahedra import EndlessError, TooLargeError, compound_tetrahedra, tetrahedra
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError

Filler = Literal["any", "netgen", "simple", "lattice", "draft"]
"""How a surface that no rule fits is filled: by Netgen or a substitute, by Netgen or not at all, with its detail left
out, by a lattice of this edge or not at all, by a lattice of this edge with walls as thick as it needs."""

BENDING_NOTE = "and bending as they do"  # in the note of a solid whose walls stand for thinner ones
LATTICE_NOTE = "lattice"  # first word of the note of a solid filled by a lattice
TETS_A_CUBE = 12.0  # of the lattice's edge
LATTICE_EDGE_OF_WALL = 0.8  # of a wall's thickness: a larger edge may miss it
# tetrahedra that a lattice may have, or as many as are asked for; their number over what its volume predicts
LATTICE_TETS = 8000
LATTICE_EXCESS = 1.25
# tetrahedra of walls that stand for thinner ones: twice as many move the first modes of a shell of 1.4 mm by 1 to 7 %,
# half as many by 0 to 4, and what they stand for is no nearer
THICKENED_TETS = 2500
LATTICE_WALL_EDGES = 1.5  # a wall of so many holds one tetrahedron between its sides everywhere

MOST_TETS = 60_000  # a third of a million unknowns, 1.5 GB
FINER_ATTEMPT = 0.6  # from one attempt to the next: both sides of a bent wall touch where elements are too large
# of an edge: the detail left out where Netgen refuses the surface as it is, and the height of triangles that it
# would refuse: slivers of unions, on which it takes ten times as long
DETAIL_LEFT_OUT = 0.05
SLIVER_HEIGHT = 0.01
# a lump of more is simplified first: Netgen takes over 20 s for 20 000, of thin bodies 2 s
MOST_WHOLE_FACES = 4000


class TooThinError(MeshError):
    """Walls so thin that elements for them are more than allowed."""


def by_rule(skin: Skin, edge_m: float | None) -> Solid | None:
    """Fill a surface that is a box or an extruded outline, else return None."""
    vertex, face = skin.vertex_m, skin.face
    if not geometry.is_closed(face):
        return None
    found = prisms.as_box(vertex, face)
    if found is not None:
        size, axes, centre = found
        made = named_shapes.box(size, edge_m)
        return Solid(made.node_m @ axes.T + centre, made.tet, note=made.note + skin.note)
    prism = prisms.as_prism(vertex, face, edge_m, dof_budget(skin.thickness_m, _diagonal_m(vertex)))
    return Solid(prism.node_m, prism.tet, note=prism.note + skin.note) if prism is not None else None


def fill_surface(skin: Skin, edge_m: float | None, *, filler: Filler = "any", solids: Sequence[Shape] = ()) -> Solid:
    """Fill any prepared surface.

    edge_m: by default from a budget of unknowns. solids: those whose union it is, where they are named. Raises
    MeshError.
    """
    lattice_least = 0.4  # of a wall's thickness: least edge of a lattice
    made = by_rule(skin, edge_m)
    if made is not None:
        return made
    thickness, diagonal = skin.thickness_m, _diagonal_m(skin.vertex_m)
    volume = abs(geometry.volume_m3(skin.vertex_m, skin.face))
    dof_per_tet = 5.6  # measured on meshes of bars, slabs and bowls
    tets = dof_budget(thickness, diagonal) / dof_per_tet
    edge = edge_m or edge_within_m(volume, thickness, tets)
    if filler in ("draft", "lattice"):
        return (
            fill_by_lattice(skin, edge, "a draft") if filler == "draft" else _of_lattice(skin, edge, edge, "as before")
        )
    of_lattice = edge_m or min((TETS_A_CUBE * volume / tets) ** (1 / 3), LATTICE_EDGE_OF_WALL * thickness)
    finest = lattice_least * thickness
    if not geometry.is_closed(skin.face):
        return _of_lattice(skin, of_lattice, finest, "its surface is open")
    whole, simple = skin, simplify_surface(skin, DETAIL_LEFT_OUT * edge)
    detailed = filler == "simple" or has_detail(whole) or _slivers(whole, edge)
    attempts = [*([] if detailed else [(whole, edge)]), (simple, edge), (simple, FINER_ATTEMPT * edge)]
    refused: MeshError | None = None
    if skin.grown and chunkiness(thickness, diagonal) > 0:
        # Netgen refuses nine of ten lumps of random_urdfs whose pieces met only grown, after seconds, at either size
        attempts, refused = [], MeshError("its pieces meet only grown", "repair the mesh, or give a simpler one")
    for tried, size in attempts:
        try:
            return _by_netgen(skin, tried, size)
        except EndlessError:
            raise
        except TooLargeError as error:
            refused = error
            break
        except MeshError as error:
            refused = error
    assert refused is not None
    made = _of_solids(skin, solids, edge) if solids else None
    if made is not None:
        return made
    if filler != "any":
        raise refused
    return _of_lattice(skin, of_lattice, finest, refused.what)


def simplify_surface(skin: Skin, tolerance_m: float) -> Skin:
    """Remove detail smaller than tolerance_m from a closed surface; one that passes through itself is left as it is."""
    import manifold3d

    vertex, face = np.ascontiguousarray(skin.vertex_m), np.ascontiguousarray(skin.face, np.uint64)
    solid = manifold3d.Manifold(manifold3d.Mesh64(vertex, face)).simplify(tolerance_m)
    mesh = solid.to_mesh64()
    if solid.status() != manifold3d.Error.NoError or not len(mesh.tri_verts):
        return skin
    corner, triangle = np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts).astype(np.int64)
    return replace(skin, vertex_m=corner, face=triangle)


def has_detail(skin: Skin) -> bool:
    """Return whether a surface is simplified before anything else is tried."""
    return len(skin.face) > MOST_WHOLE_FACES and chunkiness(skin.thickness_m, _diagonal_m(skin.vertex_m)) > 0


def _slivers(skin: Skin, edge_m: float) -> bool:
    """Return whether the surface has triangles too flat for a mesh of edge_m, as a union of pieces leaves them."""
    corner = skin.vertex_m[skin.face]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    height = 2 * geometry.face_areas_m2(skin.vertex_m, skin.face) / longest
    return bool(height.min() < SLIVER_HEIGHT * edge_m)


def _by_netgen(skin: Skin, tried: Skin, edge_m: float) -> Solid:
    report_progress(f"filling {len(tried.face)} triangles with tetrahedra of {edge_m:.3g} m")
    corner, tet = tetrahedra(tried.vertex_m, tried.face, edge_m, *curved_sizes(tried.vertex_m, tried.face, edge_m))
    _check_filled(skin, corner, tet)
    tet, said = _largest(corner, tet)
    note = f"Netgen, {len(tet)} tetrahedra, edge {edge_m:.3g} m{skin.note}{said}"
    return fit_to_surface(quadratic(corner, tet, note=note), skin.vertex_m, skin.face)


def _of_solids(skin: Skin, solids: Sequence[Shape], edge_m: float) -> Solid | None:
    """Fill the union of named solids, None where that fails. Raises EndlessError."""
    report_progress(f"filling the union of {len(solids)} solids with tetrahedra of {edge_m:.3g} m")
    try:
        corner, tet = compound_tetrahedra(solids, edge_m)
        _check_filled(skin, corner, tet)
        tet, said = _largest(corner, tet)
    except EndlessError:
        raise
    except MeshError:
        return None
    note = f"Netgen, {len(tet)} tetrahedra, edge {edge_m:.3g} m, of {len(solids)} solids united exactly{said}"
    return quadratic(corner, tet, note=note)


def coarse_edge_m(skin: Skin, tets: float) -> float:
    """Return the edge of a lattice of about so many tetrahedra, walls as thick as it needs."""
    area = float(geometry.face_areas_m2(skin.vertex_m, skin.face).sum()) / 2
    lump = (TETS_A_CUBE * area * skin.thickness_m / tets) ** (1 / 3)
    if LATTICE_WALL_EDGES * lump <= skin.thickness_m:
        return float(lump)
    return float(np.sqrt(TETS_A_CUBE * LATTICE_WALL_EDGES * area / tets))


def fill_by_lattice(skin: Skin, edge_m: float, why: str) -> Solid:
    """Fill by a lattice of edge_m, with walls of `LATTICE_WALL_EDGES` edges where the body's are thinner on the mean.

    Whatever it is, open, torn or through itself, all within half of what is missing of its surface is filled, along its
    principal axes. What it gained at its rims is taken back by scaling. Raises MeshError.
    """
    wall_m = max(skin.thickness_m, LATTICE_WALL_EDGES * edge_m)
    grown_m = (wall_m - skin.thickness_m) / 2
    report_progress(f"filling {len(skin.face)} triangles with a lattice of {edge_m:.3g} m: {why}")
    area = geometry.face_areas_m2(skin.vertex_m, skin.face)
    centre = skin.vertex_m[skin.face].mean(axis=1)
    middle = area @ centre / area.sum()
    turn = np.linalg.eigh(np.einsum("f,fi,fj->ij", area, centre - middle, centre - middle))[1]
    turn[:, 0] *= np.sign(np.linalg.det(turn))  # a mirror image would be inside out
    vertex = (skin.vertex_m - middle) @ turn
    corner, tet = stuff_lattice(vertex, skin.face, edge_m, grown_m)
    tet, said = _largest(corner, tet)
    note = f"{LATTICE_NOTE}, {len(tet)} tetrahedra, edge {edge_m:.3g} m ({why}){skin.note}{said}"
    if not grown_m:
        return fit_to_surface(quadratic(corner @ turn.T + middle, tet, note=note), skin.vertex_m, skin.face)
    here, there = vertex[skin.face].reshape(-1, 3), corner[np.unique(tet)]
    long = np.ptp(here, axis=0) > wall_m  # across what is no longer than a wall, the wall itself has grown
    size = np.where(long, np.ptp(here, axis=0) / np.ptp(there, axis=0), 1.0)
    corner = (here.min(axis=0) + here.max(axis=0)) / 2 + (corner - (there.min(axis=0) + there.max(axis=0)) / 2) * size
    volume = area.sum() / 2 * skin.thickness_m
    ratio = float(np.abs(corner_volume_m3(corner, tet)).sum() / volume)
    note += f"; walls of {skin.thickness_m:.2g} m, on the mean, filled {ratio:.3g} times as thick, {BENDING_NOTE}"
    return replace(quadratic(corner @ turn.T + middle, tet, note=note), thickened=ratio)


def stands_for_thinner(note: str) -> bool:
    """Return whether a note says that walls stand for thinner ones; solved bodies come from the cache with it alone."""
    return BENDING_NOTE in note


def _of_lattice(skin: Skin, edge_m: float, finest_m: float, why: str) -> Solid:
    """Fill by a lattice, its edge reduced from edge_m until it holds the walls, down to finest_m or `LATTICE_TETS`."""
    filled_m3 = LATTICE_EXCESS * TETS_A_CUBE * abs(geometry.volume_m3(skin.vertex_m, skin.face))
    edge, least = (
        max(edge_m, (filled_m3 / MOST_TETS) ** (1 / 3)),
        max(finest_m, (filled_m3 / LATTICE_TETS) ** (1 / 3)),
    )
    if (filled_m3 / LATTICE_TETS) ** (1 / 3) > skin.thickness_m and geometry.is_closed(skin.face):
        raise _too_thin(skin)
    while True:
        report_progress(f"filling {len(skin.face)} triangles with a lattice of {edge:.3g} m: {why}")
        try:
            corner, tet = stuff_lattice(skin.vertex_m, skin.face, edge)
            _check_filled(skin, corner, tet)
            break
        except MeshError as error:  # some walls are thinner than the mean, and than an edge
            if edge <= least:
                raise _too_thin(skin) from error
            edge = max(FINER_ATTEMPT * edge, least)
    tet, said = _largest(corner, tet)
    note = f"{LATTICE_NOTE}, {len(tet)} tetrahedra, edge {edge:.3g} m ({why}){skin.note}{said}"
    return fit_to_surface(quadratic(corner, tet, note=note), skin.vertex_m, skin.face)


def _too_thin(skin: Skin) -> TooThinError:
    return TooThinError(
        f"Netgen cannot fill the mesh, and a lattice needs over {LATTICE_TETS} tetrahedra for its walls"
        f" ({skin.thickness_m:.2g} m on the mean)",
        "repair the mesh, or give thicker walls",
    )


def _largest(corner_m: Array, tet: Array) -> tuple[Array, str]:
    """Return the tetrahedra of the largest piece, and what was left out. Raises MeshError where they are too many."""
    tet, said = largest_component(corner_m, tet)
    if len(tet) > MOST_TETS:
        raise TooThinError(f"mesh needs {len(tet)} tetrahedra, more than {MOST_TETS}", "give a simpler mesh")
    return tet, said


def _check_filled(skin: Skin, node: Array, tet: Array) -> None:
    """Raise MeshError where tetrahedra do not hold what a closed surface encloses."""
    if not geometry.is_closed(skin.face):
        return
    kept = float(np.abs(corner_volume_m3(node, tet)).sum()) / geometry.volume_m3(skin.vertex_m, skin.face)
    # Volume of a fill over the enclosed one, least and most. Wide, for a surface that passes through itself encloses
    # some of it twice.
    filled_range = (0.6, 1.7)
    if not filled_range[0] < kept < filled_range[1]:
        raise MeshError(
            f"filling the mesh with tetrahedra turns its volume to {kept:.0%}",
            "give a mesh with thicker walls, or a simpler one",
        )


def _diagonal_m(vertex_m: Array) -> float:
    return float(np.linalg.norm(np.ptp(vertex_m, axis=0)))
