"""Read mesh files as triangles: OBJ here; STL, PLY, OFF, GLB and others by trimesh.

    f 1 2 3      the first vertex is 1        [Wavefront, Advanced Visualizer manual, appendix B1]
    f -3 -2 -1   the last vertex so far is -1

A face that names a missing vertex is refused: read as an index from the end, it would give another mesh.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records.arrays import Array
from sonic_bullet.records.errors import FileError, MeshError
from sonic_bullet.records.regular_files import check_regular

MeshSurface = tuple[Array, Array]
MESH_REMEDY = "repair the mesh, or export it again"


def read_surfaces(path: Path) -> list[MeshSurface]:
    """Read the objects of a mesh file in its own unit: (vertices (v, 3), faces (f, 3)) each.

    Polygons become fans; nothing is merged or repaired.

    Raises
    ------
    FileError
        The file cannot be read.
    MeshError
        Its kind is unknown, it is broken, or a face names a missing vertex (line or number of the face).
    """
    with reading_file(path, "mesh", MeshError, MESH_REMEDY):
        if not path.is_file():
            raise FileError(f"mesh file '{path}' does not exist", "check the path")
        surfaces = list(_obj(path) if path.suffix.lower() == ".obj" else _other(path))
        for vertex, face in surfaces:
            _check(path, vertex, face)
        return surfaces


def read_own_vertices(path: Path) -> MeshSurface:
    """Read all vertices (v, 3) of a mesh file in its order, unused ones too, and its faces (f, 3).

    Raises
    ------
    FileError, MeshError
        As `read_surfaces` does.
    """
    if path.suffix.lower() != ".obj":
        parts = read_surfaces(path)
        offsets = np.cumsum([0] + [len(vertex) for vertex, _ in parts[:-1]])
        faces = [face + offset for (_, face), offset in zip(parts, offsets, strict=True)]
        return np.concatenate([vertex for vertex, _ in parts]), np.concatenate(faces)
    with reading_file(path, "mesh", MeshError, MESH_REMEDY):
        if not path.is_file():
            raise FileError(f"mesh file '{path}' does not exist", "check the path")
        points, objects = _parsed_obj(path)
        return points, np.concatenate([np.array(faces).reshape(-1, 3) for faces in objects]) - 1


def _check(path: Path, vertex: Array, face: Array) -> None:
    wrong = np.argwhere((face < 0) | (face >= len(vertex)))
    if len(wrong):
        triangle, corner = (int(i) for i in wrong[0])
        raise MeshError(
            f"mesh file {path}: triangle {triangle + 1} names vertex {face[triangle, corner]} of 0 to "
            f"{len(vertex) - 1}",
            MESH_REMEDY,
        )


def _obj(path: Path) -> Iterator[MeshSurface]:
    """Yield each object of a Wavefront OBJ with the vertices that it uses."""
    points, objects = _parsed_obj(path)
    for faces in objects:
        if faces:
            used, index = np.unique(faces, return_inverse=True)
            yield points[used - 1], index.reshape(-1, 3)


def _parsed_obj(path: Path) -> tuple[Array, list[list[tuple[int, int, int]]]]:
    """Parse a Wavefront OBJ: its vertices (v, 3), and the triangles of each object by vertices counted from 1.

    Reads v, f, and o or g as the start of an object; skips texture and normals.
    """
    vertex: list[tuple[float, float, float]] = []
    objects: list[list[tuple[int, int, int]]] = [[]]  # of vertices as they are counted, from 1
    largest, largest_line, before = 0, 0, ""
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, part in enumerate(file, 1):
            if part.endswith("\\\n"):  # the line goes on
                before += part[:-2] + " "
                continue
            line, before = before + part, ""
            words = line.split()
            if not words or words[0] not in ("v", "f", "o", "g"):
                continue
            try:
                if words[0] == "v":
                    vertex.append(_vertex(words))
                elif words[0] == "f":
                    corner = _corners(line, words, len(vertex))
                    if corner and max(corner) > largest:
                        largest, largest_line = max(corner), number
                    objects[-1].extend((corner[0], corner[i], corner[i + 1]) for i in range(1, len(corner) - 1))
                elif objects[-1]:
                    objects.append([])
            except ValueError as error:
                raise MeshError(f"mesh file {path}, line {number}: {error}", MESH_REMEDY) from error
    if largest > len(vertex):  # known at the end only: a face may come before its vertices
        raise MeshError(
            f"mesh file {path}, line {largest_line}: a face names vertex {largest} of {len(vertex)}", MESH_REMEDY
        )
    return np.array(vertex, float).reshape(-1, 3), objects


def _vertex(words: list[str]) -> tuple[float, float, float]:
    if len(words) < 4 or "_" in words[1] + words[2] + words[3]:  # only Python allows an underscore in a number
        raise ValueError("a vertex is three numbers")
    return float(words[1]), float(words[2]), float(words[3])


def _corners(line: str, words: list[str], so_far: int) -> list[int]:
    """Return the numbers, from 1, of the vertices that a face names; raises ValueError."""
    first = [word.split("/", 1)[0] for word in words[1:]] if "/" in line else words[1:]
    if "_" in line:
        raise ValueError("a face names vertices by their numbers")
    corner = list(map(int, first))
    if corner and min(corner) < 1:
        wrong = next((index for index in corner if index == 0 or index < -so_far), None)
        if wrong is not None:
            raise ValueError(
                f"a face names vertex {wrong}, but they count from 1, or from -1 backwards to {-so_far} here"
            )
        corner = [index if index > 0 else so_far + index + 1 for index in corner]
    return corner


def _other(path: Path) -> Iterator[MeshSurface]:
    archives = {"zip", "bz2", "tar.gz", "tar.bz2"}
    several_files = {"gltf", "dae"}  # formats whose numbers may be in separate files
    import trimesh

    kind = path.suffix.lower().lstrip(".")
    if kind in archives or kind not in trimesh.available_formats():
        hint = " (or: pip install pycollada)" if kind == "dae" else ""
        raise MeshError(f"mesh file {path}: format '{kind}' is not known", "convert it to OBJ, STL or PLY" + hint)
    if kind == "off":
        _check_off(path)
    _check_counts(path, kind)
    try:
        if kind in several_files:
            scene = trimesh.load_scene(path, process=False, maintain_order=True, skip_materials=True)
        else:
            # a read of more bytes than the file has returns those there are, and allocates no more
            content = io.BytesIO(path.read_bytes())
            scene = trimesh.load_scene(content, file_type=kind, process=False, maintain_order=True, skip_materials=True)
    except ImportError:  # a parser of text asks for a package to guess its encoding: the file is not of its kind
        raise MeshError(f"mesh file {path} is no {kind} file", MESH_REMEDY) from None
    for part in scene.geometry.values():  # before they are placed: placing may follow a face's indices
        if isinstance(part, trimesh.Trimesh):
            _check(path, np.asarray(part.vertices), np.asarray(part.faces).reshape(-1, 3))
    for part in scene.dump():
        if isinstance(part, trimesh.Trimesh) and len(part.faces):
            yield np.asarray(part.vertices, float), np.asarray(part.faces)


def _check_off(path: Path) -> None:
    """Raise MeshError with the line of a wrong face of an OFF file, which trimesh does not report."""
    lines = [
        (number, line.split("#")[0].split())
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1)
    ]
    lines = [(number, words) for number, words in lines if words and words != ["OFF"]]
    if not lines or len(lines[0][1]) < 2 or not all(word.isdigit() for word in lines[0][1]):
        return  # of another kind, or none: trimesh reports it
    vertices, faces = (int(word) for word in lines[0][1][:2])
    for number, words in lines[1 + vertices : 1 + vertices + faces]:
        for word in words[1 : 1 + int(words[0])]:
            if not 0 <= int(word) < vertices:
                raise MeshError(
                    f"mesh file {path}, line {number}: a face names vertex {word} of 0 to {vertices - 1}", MESH_REMEDY
                )


def _check_counts(path: Path, kind: str) -> None:
    """Raise MeshError where a glTF accessor without a buffer (zeros) claims more numbers than the file has bytes."""
    if kind not in ("glb", "gltf"):
        return
    content = path.read_bytes()
    text = content[20 : 20 + struct.unpack("<I", content[12:16])[0]] if kind == "glb" else content
    tree = json.loads(text)
    for buffer in tree.get("buffers", ()):
        if not str(buffer.get("uri", "data:")).startswith("data:"):  # trimesh would wait for a pipe
            check_regular(path.parent / unquote(str(buffer["uri"])))
    for accessor in tree.get("accessors", ()):
        if "bufferView" not in accessor and accessor.get("count", 0) > len(content):
            raise MeshError(f"mesh file {path} claims {accessor['count']} numbers that it does not hold", MESH_REMEDY)
