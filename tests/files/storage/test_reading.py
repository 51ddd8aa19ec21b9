"""The boundary of all readers: one line of ours, the path in it, at most 200 characters of the file, never 1 kB."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet import files
from sonic_bullet.apps.bake.formats import read_baked
from sonic_bullet.apps.cli.scenes.receivers import read_path
from sonic_bullet.apps.soundtrack.score.scoring import read_animation
from sonic_bullet.files import presets
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.responses.sensor_responses import read_response
from sonic_bullet.files.sofa.heads import read_head
from sonic_bullet.files.storage.reading import MOST_LETTERS, reading_file
from sonic_bullet.files.uff.reader import read_uff
from sonic_bullet.modal import read_mesh
from sonic_bullet.records.errors import FileError, LogError, MaterialError, MeshError, SonicBulletError, excerpt
from sonic_bullet.session.gltf_in.scene_reader import read_rigid_scene

MESSAGE_BYTES = 990

LONG = "Q" * 185_000
WORDS = "Q QQ " * 40_000


def case(**changes: Any) -> bytes:
    known = {
        "format": "sonic-bullet-case/1",
        "objects": {"bar": {"mesh": "bar.obj", "material": "steel"}, "cup": {"mesh": "cup.obj"}},
        "recordings": [{"file": "a.wav", "object": "bar"}],
    }
    return json.dumps(known | changes).encode()


def preset(**changes: Any) -> bytes:
    known: dict[str, Any] = json.loads((presets.TABLES_FOLDER / "steel.json").read_text())
    return json.dumps(known | changes).encode()


CASES = [
    ("case.json", read_case, case(format=long))
    for long in (LONG, WORDS)
] + [
    ("case.json", read_case, case(objects={LONG: {"units": LONG}})),
    ("case.json", read_case, case(
        objects={LONG: {"mesh": "a"}, WORDS: {"mesh": "b"}}, recordings=[{"file": "a.wav", "object": WORDS + "x"}]
    )),
    ("case.json", read_case, case(recordings=[{"file": "a.wav", "object": "bar", "split": WORDS}])),
    ("case.json", read_case, case(recordings=[{"file": LONG, "object": "bar"}])),
    ("case.json", read_case, case(recordings=[{"file": "../" + LONG, "object": "bar"}])),
    ("case.json", read_case, case(objects={"bar": {"mesh": WORDS}})),
    ("p.json", presets.load_material, preset(**{LONG: 1})),
    ("p.json", presets.load_material, preset(format=WORDS)),
    ("p.json", presets.load_material, preset(effects=[{"id": LONG}])),
    ("p.json", presets.load_material, preset(elasticity={LONG: 1, "source": "x"})),
    ("a.obj", read_mesh, b"v 0 0 0\nf 1 1 " + LONG.encode()),
    ("a.obj", read_mesh, b"v 0 0 " + LONG.encode()),
    ("a.off", read_mesh, b"OFF\n" + WORDS.encode()),
    ("a.ply", read_mesh, b"ply\nformat " + WORDS.encode()),
    ("a.npz", files.read_log, b"PK\x03\x04" + LONG.encode()),
    ("a.wav", files.read_audio, b"RIFF" + LONG.encode()),
]  # fmt: skip


@pytest.mark.parametrize(("name", "read", "content"), CASES)
def test_texts_quote_at_most_200_characters_of_a_file(
    tmp_path: Path, name: str, read: Callable[[Path], object], content: bytes
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SonicBulletError) as caught:
        read(tmp_path / name)
    text = str(caught.value)
    assert text.count("Q") <= MOST_LETTERS == 200
    assert len(text.encode()) <= MESSAGE_BYTES < 1000
    assert str(tmp_path) in text
    assert "\n" not in text


def test_zip_names_are_quoted_short(tmp_path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("Q" * 60_000, b"x")
    with pytest.raises(LogError, match=r"a\.npz") as caught:
        files.read_log(tmp_path / "a.npz")
    assert str(caught.value).count("Q") <= MOST_LETTERS


@pytest.mark.parametrize(
    "what", ["x" * 10, "x" * 5000, "é" * 5000, "\U0001f514" * 5000, "a b " * 5000, "\ud800" * 5000]
)
@pytest.mark.parametrize("remedy", ["", "y" * 300, "é" * 5000])
def test_no_error_of_ours_is_longer_than_a_kilobyte(what: str, remedy: str) -> None:
    error = SonicBulletError(what, remedy)
    assert len(str(error).encode("utf-8", "replace")) <= MESSAGE_BYTES
    if len(what) + len(remedy) < 400:
        assert (error.what, error.remedy) == (what, remedy)
    assert error.what[:3] == what[:3] and error.remedy[-3:] == remedy[-3:]


def test_an_excerpt_keeps_both_ends() -> None:
    assert excerpt("short", 5) == "short"
    assert excerpt("0123456789" * 10, 30) == "01234567890123456789 … 3456789"
    assert len(excerpt("x" * 1000, 200)) in (199, 200)


@pytest.mark.parametrize(
    "error",
    [
        ValueError("x" * 500),
        RecursionError(),
        KeyError("k"),
        EOFError(),
        UnicodeDecodeError("utf-8", b"\xff", 0, 1, "x"),
    ],
)
def test_whatever_a_parser_throws_leaves_as_the_readers_own(error: Exception) -> None:
    with (
        pytest.raises(MeshError, match=r"^/a/b\.obj is cut or no mesh \(.*\); mend it$") as caught,
        reading_file("/a/b.obj", "mesh", MeshError, "mend it"),
    ):
        raise error
    assert caught.value.__cause__ is error


def test_the_system_s_own_and_lies_about_memory_pass_as_what_they_are() -> None:
    with pytest.raises(FileError, match="cannot read /a"), reading_file("/a", "mesh", MeshError, ""):
        raise PermissionError(13, "Permission denied")
    with pytest.raises(MemoryError), reading_file("/a", "mesh", MeshError, ""):
        raise MemoryError
    with pytest.raises(KeyboardInterrupt), reading_file("/a", "mesh", MeshError, ""):
        raise KeyboardInterrupt
    with pytest.raises(MaterialError, match="/a: short; remedy"), reading_file("/a", "preset", MaterialError, ""):
        raise LogError("short", "remedy")


READERS: dict[str, Callable[[Path], object]] = {
    "a.npz": files.read_log,
    "a.wav": files.read_audio,
    "a.json": presets.load_material,
    "a.obj": read_mesh,
    "a.glb": read_mesh,
    "case.json": read_case,
    "a.uff": read_uff,
    "a.gltf": read_rigid_scene,
    "b.glb": read_animation,
    "b.json": read_animation,
    "b.npz": read_animation,
    "c.json": read_baked,
    "c.glb": read_baked,
    "a.csv": read_response,
    "a.sofa": read_head,
    "b.csv": lambda path: read_path(str(path)),
}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.timeout(20)
def test_a_pipe_and_a_folder_are_no_files_to_any_reader(tmp_path: Path, name: str) -> None:
    """A pipe would be waited for for ever."""
    os.mkfifo(tmp_path / name)
    with pytest.raises(FileError, match="it is not a regular file"):
        READERS[name](tmp_path / name)
    (tmp_path / name).unlink()
    if name != "case.json":
        (tmp_path / name).mkdir()
        with pytest.raises((FileError, MaterialError), match="it is a folder"):
            READERS[name](tmp_path / name)


@pytest.mark.parametrize("read", [read_rigid_scene, read_animation, read_mesh])
@pytest.mark.timeout(20)
def test_a_pipe_beside_a_gltf_is_not_waited_for(tmp_path: Path, read: Callable[[Path], object]) -> None:
    tree = {"asset": {"version": "2.0"}, "buffers": [{"uri": "fifo", "byteLength": 36}]}
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(FileError, match="fifo: it is not a regular file"):
        read(tmp_path / "a.gltf")


@pytest.mark.parametrize("uri", ["http://example.org/a.bin", "https://example.org/a.bin", "file:///etc/hostname"])
def test_an_address_is_not_fetched_and_said_to_be_one(tmp_path: Path, uri: str) -> None:
    tree = {"asset": {"version": "2.0"}, "buffers": [{"uri": uri, "byteLength": 36}]}
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    with pytest.raises(SonicBulletError, match=r"is an address .*nothing is fetched.*beside the \.gltf"):
        read_animation(tmp_path / "a.gltf")
