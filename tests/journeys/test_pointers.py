"""Files that git left as Git LFS pointers: whichever is given, one line names it and what fetches it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sonic_bullet.apps.cli import main

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:" + "4d7a" * 16 + "\nsize 12345\n"


@pytest.mark.parametrize(
    "name, words",
    [
        ("tap.wav", "features {}"),
        ("tap.flac", "features {} --json"),
        ("bowl.obj", "modes {} --material steel"),
        ("bowl.stl", "modes {} --material steel"),
        ("bowl.ply", "modes {} --material steel"),
        ("walk.glb", "score {} -o out.wav"),
        ("walk.gltf", "score {} -o out.wav"),
        ("log.npz", "render {} -o out.wav"),
        ("scene.py", "render {} -o out.wav"),
        ("preset.json", "modes cube.obj --material {}"),
        ("bowl.glb", "fit tap.wav --mesh {} --strike 0,0,0 --material steel -o out.json"),
    ],
)
def test_a_pointer_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(POINTER)
    if "cube.obj" in words:
        Path("cube.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    if "tap.wav" in words:
        write_tap(tmp_path / "tap.wav")
    _refused(words.format(name), name, capsys)


def test_a_pointer_beside_a_scene_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "walk.bin").write_text(POINTER)
    buffers = [{"uri": "walk.bin", "byteLength": 100}]
    (tmp_path / "walk.gltf").write_text(json.dumps({"asset": {"version": "2.0"}, "buffers": buffers}))
    _refused(f"score {tmp_path / 'walk.gltf'} -o {tmp_path / 'out.wav'}", "walk.bin", capsys)


def write_tap(path: Path) -> None:
    import numpy as np
    import soundfile

    time = np.arange(24_000) / 48_000
    soundfile.write(path, 0.3 * np.exp(-20 * time) * np.sin(2 * np.pi * 1000 * time), 48_000)


def _refused(words: str, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended, pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["sonic-bullet", *words.split()])
        main()
    said = capsys.readouterr().err.strip().splitlines()
    assert ended.value.code == 2, said
    assert len(said) == 1 and name in said[0] and "is a Git LFS pointer" in said[0] and "git lfs pull" in said[0], said
