"""The boundary of all readers: one line of ours, the path in it, at most 200 characters of the file, never 1 kB."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet import files
from sonic_bullet.files import presets
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.storage.reading import LETTERS, reading
from sonic_bullet.modal import read_mesh
from sonic_bullet.records.errors import FileError, LogError, MaterialError, MeshError, SonicBulletError, excerpt

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
    known: dict[str, Any] = json.loads((presets.FOLDERS.tables / "steel.json").read_text())
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
    assert text.count("Q") <= LETTERS.whole == 200
    assert len(text.encode()) <= MESSAGE_BYTES < 1000
    assert str(tmp_path) in text
    assert "\n" not in text


def test_zip_names_are_quoted_short(tmp_path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("Q" * 60_000, b"x")
    with pytest.raises(LogError, match=r"a\.npz") as caught:
        files.read_log(tmp_path / "a.npz")
    assert str(caught.value).count("Q") <= LETTERS.whole


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
        reading("/a/b.obj", "mesh", MeshError, "mend it"),
    ):
        raise error
    assert caught.value.__cause__ is error


def test_the_system_s_own_and_lies_about_memory_pass_as_what_they_are() -> None:
    with pytest.raises(FileError, match="cannot read /a"), reading("/a", "mesh", MeshError, ""):
        raise PermissionError(13, "Permission denied")
    with pytest.raises(MemoryError), reading("/a", "mesh", MeshError, ""):
        raise MemoryError
    with pytest.raises(KeyboardInterrupt), reading("/a", "mesh", MeshError, ""):
        raise KeyboardInterrupt
    with pytest.raises(MaterialError, match="/a: short; remedy"), reading("/a", "preset", MaterialError, ""):
        raise LogError("short", "remedy")
