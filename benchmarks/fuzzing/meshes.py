"""Small meshes of every format, and changes that keep a GLB's lengths right."""

from __future__ import annotations

import json
import random
import struct

import numpy as np
import trimesh

from benchmarks.fuzzing.mutations import changed, flipped, json_changed, overwritten, reworded

KINDS = ("obj", "stl", "stl_ascii", "ply", "ply_ascii", "off", "glb", "gltf")
INDICES = (0, -1, -8, -9, 1, 8, 9, 10**6, 2**31 - 1, 2**31, -(2**31), 2**32, 2**63)


def seed(kind: str) -> bytes:
    """A box of 12 triangles."""
    box = trimesh.creation.box((0.1, 0.08, 0.05))
    if kind == "obj":
        rows = [f"v {x:g} {y:g} {z:g}" for x, y, z in box.vertices]
        quads = ["f 1 2 4 3", "f -4 -2 -1 -3", *(f"f {a + 1}/1/1 {b + 1}//2 {c + 1}" for a, b, c in box.faces[4:])]
        return "\n".join(["# box", "o one", *rows, "vn 0 0 1", "g two", "usemtl m", *quads, ""]).encode()
    if kind == "ply_ascii":
        return bytes(box.export(file_type="ply", encoding="ascii"))
    if kind == "gltf":
        whole = seed("glb")
        size = struct.unpack("<I", whole[12:16])[0]
        tree = json.loads(whole[20 : 20 + size])
        import base64

        tree["buffers"][0]["uri"] = (
            "data:application/octet-stream;base64," + base64.b64encode(whole[28 + size :]).decode()
        )
        return json.dumps(tree).encode()
    made = box.export(file_type=kind)
    return made.encode() if isinstance(made, str) else bytes(made)


def mesh_changed(kind: str, data: bytes, draw: random.Random) -> bytes:
    """A mesh with an index, a count, a number, a word or its bytes changed."""
    if draw.random() < 0.15:
        return changed(data, draw)
    if kind == "gltf":
        return json_changed(json.loads(data), draw)
    if kind == "stl":
        return draw.choice((flipped, overwritten))(data, draw, draw.choice((0, 80, 84)))
    return {"glb": _glb_changed, "ply": _ply_changed}.get(kind, _text_changed)(data, draw)


def _ply_changed(data: bytes, draw: random.Random) -> bytes:
    """Header, an index, or any byte of a binary PLY of 12 faces, 13 bytes each, at its end."""
    start = data.index(b"end_header\n") + 11
    if draw.random() < 0.4:
        return reworded(data[:start], draw) + data[start:]
    if draw.random() < 0.5:
        field = struct.pack("<i", draw.choice([i for i in INDICES if -(2**31) <= i < 2**31]))
        at = len(data) - 12 * 13 + 13 * draw.randrange(12) + draw.choice((1, 5, 9))
        return data[:at] + field + data[at + 4 :]
    return draw.choice((flipped, overwritten))(data, draw, start)


def _text_changed(data: bytes, draw: random.Random) -> bytes:
    """One corner of one face, or any word of a text."""
    lines = data.split(b"\n")
    rows = [i for i, line in enumerate(lines) if line.startswith((b"f ", b"3 ", b"facet")) and i > 2]
    if not rows or draw.random() < 0.6:
        return reworded(data, draw)
    row = draw.choice(rows)
    words = lines[row].split(b" ")
    words[draw.randrange(1, len(words))] = str(draw.choice(INDICES)).encode()
    lines[row] = b" ".join(words)
    return b"\n".join(lines)


def _glb_changed(data: bytes, draw: random.Random) -> bytes:
    """JSON or binary chunk of a GLB changed, all lengths right."""
    size = struct.unpack("<I", data[12:16])[0]
    text, binary = data[20 : 20 + size], data[28 + size :]
    if draw.random() < 0.1:  # numbers that no buffer holds
        tree = json.loads(text)
        accessor = draw.choice(tree["accessors"])
        accessor["count"] = draw.choice((1, 10**4, 10**7, 2**31, 2**40))
        del accessor["bufferView"]
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
    elif draw.random() < 0.65:
        text = json_changed(json.loads(text), draw)
        text += b" " * (-len(text) % 4)
    elif draw.random() < 0.5:
        numbers = np.frombuffer(binary, np.uint8).copy()
        at = draw.randrange(len(numbers) - 4)
        numbers[at : at + 4] = np.frombuffer(
            struct.pack("<I", draw.choice([i for i in INDICES if 0 <= i < 2**32])), np.uint8
        )
        binary = numbers.tobytes()
    else:
        binary = changed(binary, draw)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
