"""Mesh files -> Shape: OBJ, STL, PLY, GLB and what else `files.meshes` reads; nothing is repaired."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.files.meshes import read_surfaces
from sonic_bullet.geometry import weld_vertices
from sonic_bullet.records import Shape
from sonic_bullet.records.errors import MeshError


def read_mesh(path: Path | str, scale: float = 1.0) -> Shape:
    """Read all triangles of a mesh file as one Shape of kind "mesh".

    Objects of a scene are placed and put together, polygons cut into triangles, identical vertices made one;
    orientation stays as it is.

    Parameters
    ----------
    scale
        Factor on all lengths, 0.001 for a file in millimetres.

    Raises
    ------
    FileError
        The file cannot be read.
    MeshError
        It holds no triangle, a NaN or a face of no vertex.
    """
    path = Path(path)
    if not (np.isfinite(scale) and scale > 0):
        raise MeshError(f"mesh scale is {scale}", "give a scale above zero")
    parts = read_surfaces(path)
    if not parts:
        raise MeshError(
            f"'{path.name}' holds no triangle", "the file is empty or lies about its length: export it again"
        )
    offsets = np.cumsum([0] + [len(vertex) for vertex, _ in parts[:-1]])
    vertex = np.concatenate([vertex for vertex, _ in parts]) * scale
    face = np.concatenate([face + offset for (_, face), offset in zip(parts, offsets, strict=True)])
    if not np.isfinite(vertex[face]).all():
        raise MeshError(f"'{path.name}' holds NaN or infinite vertices", "repair the mesh file")
    vertex, face = weld_vertices(vertex, face)
    if len(face) == 0:
        raise MeshError(f"'{path.name}' holds no triangle with three different corners", "repair the mesh file")
    return Shape("mesh", vertex_m=vertex, face=face)
