"""Write a JSON tree and numbers as .glb, or as .gltf with its buffer inside [Khronos, glTF 2.0 Specification, 2021].

arrays -> GltfBuffer.append: one view and one accessor each [3.6.1, 3.6.2], all in one buffer, 4 bytes aligned
tree + buffer -> chunks JSON and BIN [4.4], or base64 in a data URI
"""

from __future__ import annotations

import base64
import os
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files.storage.atomic import replace_file
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

# numbers for kinds of values, and for what a view holds [glTF 2.0, sec. 3.6.2.2 and 5.11.5]
GLTF_FLOAT32 = 5126
GLTF_UINT32 = 5125
GLTF_VERTICES = 34962  # ARRAY_BUFFER
GLTF_TRIANGLES = 34963  # ELEMENT_ARRAY_BUFFER


@dataclass(slots=True)
class GltfBuffer:
    """Views, accessors and bytes of the numbers appended so far."""

    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    parts: list[bytes] = field(default_factory=list)
    size: int = 0

    def append(self, values: Array, *, target: int | None = None) -> int:
        """Add an accessor of values (n,) or (n, 3), float32, or uint32 where they are whole; return its number."""
        whole = values.dtype.kind in "iu"
        packed = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self.size, "byteLength": packed.nbytes}
        if target is not None:
            view["target"] = target
        rows = packed.reshape(len(packed), -1)
        self.views.append(view)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": GLTF_UINT32 if whole else GLTF_FLOAT32,
                "count": len(packed),
                "type": "SCALAR" if packed.ndim == 1 else f"VEC{packed.shape[1]}",
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        self.parts.append(packed.tobytes())
        self.size += packed.nbytes
        return len(self.accessors) - 1

    def append_bytes(self, data: bytes) -> int:
        """Add a view of bytes of any kind, padded to 4; return its number."""
        self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(data)})
        padded = data + bytes(-len(data) % 4)
        self.parts.append(padded)
        self.size += len(padded)
        return len(self.views) - 1


def write_gltf(path: str | os.PathLike[str], tree: dict[str, Any], buffer: GltfBuffer) -> None:
    """Write a tree with its buffer, whole or not at all: .glb, else .gltf; raises FileError."""
    largest_bytes = 1 << 30
    if buffer.size > largest_bytes:
        raise FileError(f"cannot write {path}: it would hold over a gigabyte", "keep fewer modes or points")
    data = b"".join(buffer.parts)
    binary = Path(path).suffix.lower() == ".glb"
    store: dict[str, Any] = {"byteLength": len(data)}
    if not binary:
        store["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    whole = tree | {"buffers": [store], "bufferViews": buffer.views, "accessors": buffer.accessors}
    with replace_file(path) as file:
        if not binary:
            file.write(json_bytes(whole, indent=1))
            return
        text = json_bytes(whole)
        text += b" " * (-len(text) % 4)
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(data), b"BIN\0") + data)
