"""A mesh file is the mesh it says or none: a face that names no vertex is refused with its file and line, by both rooms
that read meshes.
"""

from __future__ import annotations

import json
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import read_mesh
from sonic_bullet.records.errors import FileError, MeshError
from sonic_bullet.simulators.pybullet import urdf_meshes

READERS = (read_mesh, lambda path: urdf_meshes.join_surfaces(urdf_meshes.read_surfaces(path)))
CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"


def box() -> trimesh.Trimesh:
    return trimesh.creation.box((1, 2, 3))


def obj(folder: Path, index: int) -> Path:
    (folder / "a.obj").write_text(f"{CORNERS}f 1 2 3\nf 1 2 {index}\n")
    return folder / "a.obj"


def ply(folder: Path, index: int, encoding: str = "binary") -> Path:
    data = bytes(box().export(file_type="ply", encoding=encoding))
    if encoding == "ascii":
        lines = data.decode().splitlines()
        lines[-1] = " ".join([*lines[-1].split()[:-1], str(index)])
        data = "\n".join([*lines, ""]).encode()
    else:
        data = data[:-4] + struct.pack("<i", index)
    (folder / "a.ply").write_bytes(data)
    return folder / "a.ply"


def off(folder: Path, index: int) -> Path:
    lines = box().export(file_type="off").splitlines()
    lines[-1] = " ".join([*lines[-1].split()[:3], str(index)])
    (folder / "a.off").write_text("\n".join(lines))
    return folder / "a.off"


def glb(folder: Path, index: int) -> Path:
    data = box().export(file_type="glb")
    size = struct.unpack("<I", data[12:16])[0]
    tree = json.loads(data[20 : 20 + size])
    start = (
        28
        + size
        + tree["bufferViews"][tree["accessors"][tree["meshes"][0]["primitives"][0]["indices"]]["bufferView"]].get(
            "byteOffset", 0
        )
    )
    assert struct.unpack("<I", data[start : start + 4])[0] < 8
    (folder / "a.glb").write_bytes(data[:start] + struct.pack("<I", index & 0xFFFFFFFF) + data[start + 4 :])
    return folder / "a.glb"


@pytest.mark.parametrize(
    ("make", "index", "words"),
    [
        (obj, 0, "line 6"),
        (obj, -5, "line 6"),
        (obj, 5, "line 6"),
        (obj, 10**9, "line 6"),
        (ply, -1, "triangle 12 names vertex -1"),
        (ply, 8, "triangle 12 names vertex 8"),
        (lambda folder, i: ply(folder, i, "ascii"), -1, "triangle 12"),
        (lambda folder, i: ply(folder, i, "ascii"), 8, "triangle 12"),
        (off, -1, "line 22: a face names vertex -1"),
        (off, 8, "line 22: a face names vertex 8"),
        (glb, 8, "triangle 1 "),
        (glb, -1, "triangle 1 "),
    ],
)
@pytest.mark.parametrize("read", READERS)
def test_a_face_of_no_vertex_is_refused_by_file_and_place(
    tmp_path: Path, make: Callable[[Path, int], Path], index: int, words: str, read: Callable
) -> None:  # type: ignore[type-arg]
    path = make(tmp_path, index)
    with pytest.raises(MeshError, match=words) as caught:
        read(path)
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("make", [obj, ply, off, glb])
def test_the_same_files_are_read_where_the_vertex_is_there(tmp_path: Path, make: Callable[[Path, int], Path]) -> None:
    for read in READERS:
        read(make(tmp_path, 4))


def test_obj_counts_backwards_from_the_vertices_so_far(tmp_path: Path) -> None:
    """-1 is the last vertex so far, whatever follows [Wavefront, appendix B1]; a face may name a vertex that comes
    later by its number.
    """
    (tmp_path / "plain.obj").write_text(f"{CORNERS}f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    (tmp_path / "back.obj").write_text(
        "f 1 3 2\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf -4 -3 -1\nf -3/7/1 -2//2 -1\nf 1 4 \\\n3\nv 9 9 9\n"
    )
    plain, back = (read_mesh(tmp_path / name) for name in ("plain.obj", "back.obj"))
    assert sorted(map(tuple, plain.vertex_m[plain.face].reshape(-1, 9))) == sorted(
        map(tuple, back.vertex_m[back.face].reshape(-1, 9))
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("v 0 0\nf 1 1 1\n", "line 1"),
        ("v 0 0 0x1\n", "line 1"),
        ("v 1_0 0 0\n", "three numbers"),
        (CORNERS + "f 1 2 1_0\n", "by their numbers"),
        (CORNERS + "f 1 2 x" + "y" * 5000 + "\n", "line 5"),
        ("", "no triangle"),
        ("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "NaN"),
    ],
)
def test_a_broken_obj_is_refused_by_its_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(MeshError, match=words) as caught:
        read_mesh(tmp_path / "a.obj")
    assert len(str(caught.value)) < 500


def test_obj_of_triangles_is_what_trimesh_reads() -> None:
    for name in ("bowl", "plate", "tumbler"):
        path = Path(__file__).parents[2] / "assets" / f"{name}.obj"
        by_trimesh = trimesh.load(path, process=False, maintain_order=True)
        found = read_mesh(path)
        np.testing.assert_array_equal(found.vertex_m[found.face], np.asarray(by_trimesh.vertices)[by_trimesh.faces])


def test_counts_that_a_file_does_not_hold_take_no_memory(tmp_path: Path) -> None:
    data = box().export(file_type="glb")
    size = struct.unpack("<I", data[12:16])[0]
    tree = json.loads(data[20 : 20 + size])
    for accessor in tree["accessors"]:
        accessor.pop("bufferView")
        accessor["count"] = 2**40
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + size :]
    (tmp_path / "a.glb").write_bytes(
        struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON") + text + rest
    )
    (tmp_path / "b.glb").write_bytes(data[:12] + struct.pack("<I", 2**32 - 4) + data[16:])
    head = (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n"
        b"property float z\nend_header\n"
    )
    (tmp_path / "a.ply").write_bytes(head + bytes(120))
    (tmp_path / "a.stl").write_bytes(bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50))
    tracemalloc.start()
    for name in ("a.glb", "b.glb", "a.ply", "a.stl"):
        for read in READERS:
            with pytest.raises(MeshError, match=name):
                read(tmp_path / name)
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


def test_archives_are_not_opened_and_nothing_is_no_mesh(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(b"PK\x03\x04")
    with pytest.raises(MeshError, match="format 'zip' is not known"):
        read_mesh(tmp_path / "a.zip")
    for path in (tmp_path, tmp_path / "none.obj", tmp_path / ("x" * 5000 + ".obj")):
        with pytest.raises(FileError):
            read_mesh(path)
