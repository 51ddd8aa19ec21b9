"""Mesh files -> Shape: OBJ, STL, PLY, DAE and what else trimesh reads, with nothing repaired or merged on the way in."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.geometry import welded
from sonic_bullet.records import Shape
from sonic_bullet.records.errors import FileError, MeshError


def read_mesh(path: Path | str, scale: float = 1.0) -> Shape:
    """All triangles of a mesh file as one Shape of kind "mesh", times ``scale`` (0.001 for a file in millimetres).

    Objects of a scene are placed and put together, polygons cut into triangles, identical vertices made one; orientation stays as
    it is. Raises FileError where the file cannot be read, MeshError where it holds no triangle or a NaN.
    """
    import trimesh

    path = Path(path)
    if not path.is_file():
        raise FileError(f"mesh file '{path}' does not exist", "check the path")
    if not (np.isfinite(scale) and scale > 0):
        raise MeshError(f"mesh scale is {scale}", "give a scale above zero")
    kind = path.suffix.lower().lstrip(".")
    if kind not in trimesh.available_formats():
        raise MeshError(
            f"'{path.name}': mesh format '{kind}' is not known", "convert it to OBJ, STL or PLY" + (" (or: pip install pycollada)" if kind == "dae" else "")
        )
    try:
        scene = trimesh.load_scene(path, process=False, maintain_order=True, skip_materials=True)
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    except ImportError:  # a parser of text asks for a package to guess its encoding: the file is not of its kind
        raise MeshError(f"'{path.name}' is no {kind} file", "export the mesh again") from None
    except Exception as error:  # a parser meets anything in a foreign file, and throws anything
        raise MeshError(f"'{path.name}' cannot be read as {kind}: {type(error).__name__} {error}"[:300], "repair or export the mesh again") from error
    if not parts:
        raise MeshError(f"'{path.name}' holds no triangle", "the file is empty or lies about its length: export it again")
    offsets = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    vertex = np.concatenate([np.asarray(part.vertices, float) for part in parts]) * scale
    face = np.concatenate([np.asarray(part.faces) + offset for part, offset in zip(parts, offsets, strict=True)])
    if not np.isfinite(vertex[face]).all():
        raise MeshError(f"'{path.name}' holds NaN or infinite vertices", "repair the mesh file")
    vertex, face = welded(vertex, face)
    if len(face) == 0:
        raise MeshError(f"'{path.name}' holds no triangle with three different corners", "repair the mesh file")
    return Shape("mesh", vertex_m=vertex, face=face)
