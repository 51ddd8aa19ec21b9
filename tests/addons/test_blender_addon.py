"""The Blender add-on: what needs no Blender here, and three falling bodies in a real one where its Python is named.

SONIC_BULLET_BPY, or .venv/bpy/bin/python, is a Python with the wheel `bpy`; `make test-all` makes the latter.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import stat
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from sonic_bullet.files.presets import table_names

REPO = Path(__file__).resolve().parents[2]
ADDON = REPO / "addons" / "blender" / "sonic_bullet_blender"
QUARTER = 0.25  # of a frame, within which onsets are
POSIX = pytest.mark.skipif(os.name != "posix", reason="shell scripts stand in for the command")


def background() -> ModuleType:
    """The part that knows no bpy."""
    spec = importlib.util.spec_from_file_location("sonic_bullet_background", ADDON / "background.py")
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = made
    spec.loader.exec_module(made)
    return made


BACKGROUND = background()


def command(folder: Path, text: str, name: str = "sonic-bullet") -> Path:
    """A shell script in place of the command."""
    place = folder / name
    place.write_text("#!/bin/sh\n" + text)
    place.chmod(place.stat().st_mode | stat.S_IXUSR)
    return place


def job(tmp_path: Path, text: str) -> Any:
    folder = tmp_path / "job"
    folder.mkdir()
    (folder / "poses.npz").write_bytes(b"")
    return BACKGROUND.BakeJob([str(command(tmp_path, text))], folder, tmp_path / "out" / "sound.wav", (1.0, -2.0, 0.5))


def wait(made: Any) -> None:
    end = time.monotonic() + 20
    while made.running:
        assert time.monotonic() < end
        time.sleep(0.02)


def test_the_manifest_is_of_an_extension() -> None:
    found = tomllib.loads((ADDON / "blender_manifest.toml").read_text())
    assert (found["schema_version"], found["id"], found["type"]) == ("1.0.0", ADDON.name, "add-on")
    assert found["blender_version_min"] == "4.2.0" and found["license"] == ["SPDX:GPL-3.0-or-later"]
    assert len(found["tagline"]) <= 64 and not found["tagline"].endswith(".")
    assert "wheels" not in found  # no dependency comes with it
    for file in ADDON.glob("*.py"):
        assert "SPDX-License-Identifier: GPL-3.0-or-later" in file.read_text().split('"""')[0], file
        assert not re.search(r"^\s*(from|import) sonic_bullet\b", file.read_text(), re.M), file


def test_operators_are_named_as_blender_takes_them() -> None:
    tree = ast.parse((ADDON / "__init__.py").read_text())
    named = {
        one.value.value
        for thing in tree.body
        if isinstance(thing, ast.ClassDef) and any(ast.unparse(base) == "bpy.types.Operator" for base in thing.bases)
        for one in thing.body
        if isinstance(one, ast.Assign) and ast.unparse(one.targets[0]) == "bl_idname"
        and isinstance(one.value, ast.Constant)
    }  # fmt: skip
    assert named == {"sonic_bullet.bake", "sonic_bullet.cancel"}  # one dot each


def test_its_materials_are_the_package_s() -> None:
    text = (ADDON / "__init__.py").read_text()
    listed = re.search(r"MATERIALS = \((.*?)\)", text, re.S)
    assert listed is not None
    assert set(re.findall(r'"(\w+)"', listed[1])) == set(table_names())


@POSIX
def test_the_command_is_found_or_said_to_be_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert BACKGROUND.find_command() is None
    assert BACKGROUND.find_command(str(tmp_path / "nowhere")) is None
    assert "pip install" in BACKGROUND.HOW_TO_INSTALL
    place = command(tmp_path, "exit 0\n")
    assert BACKGROUND.find_command() == [str(place)]
    python = command(tmp_path, "exit 0\n", "python3.11")
    assert BACKGROUND.find_command(str(python)) == [str(python), "-m", "sonic_bullet"]


@POSIX
def test_both_commands_run_and_the_sound_is_put_in_place(tmp_path: Path) -> None:
    said = 'echo "$@" >> ../words\necho "[1 s] 40 %"\necho sound > sound.wav\necho \'{"sounding": []}\' > events.json\n'
    made = job(tmp_path, said)
    made.start()
    wait(made)
    assert (made.error, made.fraction, made.said) == ("", 1.0, "done")
    assert made.sound.read_text() == "sound\n" and [one.name for one in made.sound.parent.iterdir()] == ["sound.wav"]
    first, second = (tmp_path / "words").read_text().splitlines()
    assert first == "score poses.npz -o draft.wav --contacts contacts.npz --microphone 1,-2,0.5"
    assert second == "render contacts.npz -o sound.wav --events events.json"
    assert made.events() == []


@POSIX
def test_cancelled_it_leaves_nothing(tmp_path: Path) -> None:
    made = job(tmp_path, "echo started\nsleep 60\n")
    made.start()
    end = time.monotonic() + 20
    while made.said != "started":
        assert time.monotonic() < end
        time.sleep(0.02)
    began = time.monotonic()
    made.cancel()
    assert time.monotonic() - began < 10
    assert not made.running and made.process.poll() is not None
    assert not made.folder.exists() and not made.sound.exists() and made.error == ""


@POSIX
def test_an_error_is_a_line(tmp_path: Path) -> None:
    made = job(tmp_path, "echo 'sonic-bullet: no body moves; give one a rigid body'\nexit 1\n")
    made.start()
    wait(made)
    assert made.error == "no body moves; give one a rigid body" and not made.sound.exists()


def bpy_python() -> str | None:
    """A Python that has bpy."""
    for place in (os.environ.get("SONIC_BULLET_BPY"), str(REPO / ".venv" / "bpy" / "bin" / "python")):
        if place and Path(place).is_file() and not subprocess.run([place, "-c", "import bpy"], check=False).returncode:
            return place
    return None


def in_blender(folder: Path, *words: str) -> Any:
    """What the script of three falling bodies prints last."""
    python = bpy_python()
    if python is None:
        pytest.skip("no bpy: name a Python with it in SONIC_BULLET_BPY")
    beside = Path(sys.executable).with_name("sonic-bullet")
    script = Path(__file__).with_name("falling_in_blender.py")
    done = subprocess.run(
        [python, str(script), str(ADDON.parent), str(beside), str(folder), *words],
        check=False, capture_output=True, text=True, timeout=280,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.strip().splitlines()[-1])


@pytest.mark.slow
@pytest.mark.parametrize("fps", [24, 60, 120])
def test_three_bodies_fall_in_blender(tmp_path: Path, fps: int) -> None:
    found = in_blender(tmp_path, str(fps))
    assert len(found["touches"]) == 3
    for name, touch_s in found["touches"].items():
        of = [e for e in found["events"] if e["kind"] == "impact" and name in (e["name_a"], e["name_b"])]
        assert abs(min(e["start_s"] for e in of) - touch_s) * fps <= QUARTER, (name, touch_s, of[0])
    if found["strip"] is None:
        assert found["version"].startswith("4.2")
    else:
        assert found["strip"]["type"] == "SOUND" and found["strip"]["start"] == 1
        assert found["strip"]["end"] - found["strip"]["start"] >= 0.7 * fps
    assert [name for name, _ in found["markers"]] and len(found["markers"]) == len(found["events"])
    first = min(found["events"], key=lambda e: e["start_s"])
    assert min(frame for _, frame in found["markers"]) == 1 + round(first["start_s"] * fps)
    assert "pip install" in found["missing"] and not found["left"]
    assert found["started_s"] < 0.1  # Blender does not wait


@pytest.mark.slow
def test_a_bake_cancelled_in_blender_leaves_nothing(tmp_path: Path) -> None:
    assert in_blender(tmp_path, "24", "cancel") == {"folder": False, "sound": False, "alive": False}
