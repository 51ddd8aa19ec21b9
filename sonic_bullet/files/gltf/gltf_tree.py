"""Read glTF 2.0 and GLB as a JSON tree and accessors [Khronos, glTF 2.0 Specification, 2021; sections in brackets].

GLB chunks [4.4], data URI, separate file -> buffers [3.6.1] -> accessors [3.6.2]

Sizes are compared with the bytes present before they are used.
"""

from __future__ import annotations

import base64
import json
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from sonic_bullet.files.storage.reading import refuse_lfs_pointer
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.records.regular_files import check_regular


@dataclass(frozen=True, slots=True, eq=False)
class GltfTree:
    """The JSON tree, and the bytes of each buffer. error, remedy: raised where they do not fit; folder: its own."""

    tree: dict[str, Any]
    buffer: tuple[bytes, ...]
    error: type[SonicBulletError]
    remedy: str
    folder: Path = Path()

    def neighbour(self, name: str) -> bytes:
        """Read a file that lies beside it; raises ``error`` where it would lie elsewhere."""
        return _neighbour(name, self.folder, self.error)

    def accessor(self, index: int) -> Array:
        """Read an accessor (n, width) as float, or integer where it is not normalised; raises ``error``."""
        component = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
        width_limit = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
        it = self.tree["accessors"][index]
        kind, width, count = np.dtype(component[it["componentType"]]), width_limit[it["type"]], int(it["count"])
        if "sparse" in it or "bufferView" not in it:
            raise self.error("an accessor is sparse or empty", "export with full accessors")
        view = self.tree["bufferViews"][it["bufferView"]]
        data = self.buffer[view["buffer"]]
        start = int(view.get("byteOffset", 0)) + int(it.get("byteOffset", 0))
        row = kind.itemsize * width
        stride = int(view.get("byteStride", row))
        if start < 0 or stride < row or count < 1 or start + (count - 1) * stride + row > len(data):
            raise self.error("an accessor claims more bytes than its buffer has", self.remedy)
        found = np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))
        if kind.kind == "f" or not it.get("normalized"):
            return np.array(found, float if kind.kind == "f" else np.int64)
        most = float(np.iinfo(kind).max)
        return np.maximum(found.astype(float) / most, -1.0)  # [3.11]


def read_tree(path: Path, error: type[SonicBulletError], remedy: str) -> GltfTree:
    """Read a .gltf or .glb with its buffers; raises ``error`` with ``remedy``, and the parser's exceptions."""
    raw, chunk = path.read_bytes(), b""
    if raw[:4] == b"glTF":  # [4.4]
        version, length = struct.unpack_from("<II", raw, 4)
        size, kind = struct.unpack_from("<I4s", raw, 12)
        if version != 2 or kind != b"JSON" or length > len(raw):
            raise error(f"{path} is no whole GLB of version 2", remedy)
        text, rest = raw[20 : 20 + size], 20 + size
        if rest + 8 <= len(raw):
            more, kind = struct.unpack_from("<I4s", raw, rest)
            chunk = raw[rest + 8 : rest + 8 + more] if kind == b"BIN\0" else b""
    else:
        text = raw
    tree = json.loads(text)
    if not isinstance(tree, dict) or str(tree.get("asset", {}).get("version", ""))[:2] != "2.":
        raise error(f"{path} is no glTF of version 2", remedy)
    needed = set(tree.get("extensionsRequired", ())) - {"KHR_mesh_quantization", "KHR_texture_transform"}
    packed = sorted(x for x in needed if "draco" in x.lower() or "meshopt" in x.lower())
    if packed:
        raise error(f"{path} is compressed with {packed[0]}", "export it without compression")
    buffers = tuple(_buffer(one, chunk, path, error, remedy) for one in tree.get("buffers", ()))
    return GltfTree(tree, buffers, error, remedy, path.parent)


def _buffer(one: Mapping[str, Any], chunk: bytes, path: Path, error: type[SonicBulletError], remedy: str) -> bytes:
    uri = one.get("uri")
    if uri is None:
        data = chunk
    elif uri.startswith("data:"):
        data = base64.b64decode(uri.split(",", 1)[1])
    else:
        data = _neighbour(unquote(uri), path.parent, error)
    if len(data) < int(one.get("byteLength", 0)):
        raise error("a buffer is shorter than it claims", remedy)
    return data


def _neighbour(uri: str, folder: Path, error: type[SonicBulletError]) -> bytes:
    name, beside = Path(uri), "keep it beside the .gltf"
    if found := re.match(r"([A-Za-z][A-Za-z0-9+.-]+):", uri):  # a scheme [RFC 3986, 3.1]; one letter is a drive
        raise error(
            f"{quote(uri)} is an address ({found[1]}:), and nothing is fetched", f"save it as a file, and {beside}"
        )
    if name.is_absolute() or ".." in name.parts:
        raise error(f"{quote(uri)} lies outside its folder", beside)
    check_regular(folder / name, beside)
    refuse_lfs_pointer(folder / name, error)
    return (folder / name).read_bytes()
