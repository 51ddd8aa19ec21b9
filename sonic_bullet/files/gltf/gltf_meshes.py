"""A glTF mesh -> vertices and triangles of its primitives [Khronos, glTF 2.0 Specification, 2021, sec. 3.7.2]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.gltf_tree import GltfTree
from sonic_bullet.records import Array


def mesh_triangles(file: GltfTree, mesh: Mapping[str, Any]) -> tuple[Array, Array]:
    """Vertices (v, 3) and triangles (f, 3) of all primitives that are triangles. Raises the file's error."""
    vertices, faces, at = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for part in mesh.get("primitives", ()):
        if part.get("mode", 4) != 4:
            continue
        vertex = file.accessor(part["attributes"]["POSITION"]).astype(float)
        index = file.accessor(part["indices"])[:, 0] if "indices" in part else np.arange(len(vertex))
        face = index.astype(np.int64)[: len(index) // 3 * 3].reshape(-1, 3)
        if len(face) and (face.min() < 0 or face.max() >= len(vertex)):
            raise file.error("a face names no vertex", file.remedy)
        vertices.append(vertex)
        faces.append(face + at)
        at += len(vertex)
    return np.concatenate(vertices), np.concatenate(faces)
