"""A glTF scene that is wrong, rendered by the command line: one line that names what, exit 2, and no file written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonic_bullet.files import read_audio
from sonic_bullet.files.gltf.gltf_writer import GltfBuffer, write_gltf
from tests.apps.cli.called_here import call_here
from tests.made.gltf_scenes import gltf_scene
from tests.session.test_gltf_in import BAD

AUDIO, PHYSICS = "KHR_audio_rigid_bodies", "KHR_physics_rigid_bodies"
Change = Callable[[dict[str, Any], GltfBuffer], None]


def written(path: Path, change: Change | None = None) -> Path:
    buffer = GltfBuffer()
    tree = gltf_scene(buffer, drop_m=0.01)
    if change is not None:
        change(tree, buffer)
    write_gltf(path, tree, buffer)
    return path


def animated(keys: Any, values: Any, **sampler: Any) -> Change:
    """A kinematic box with an animation of its place."""

    def change(tree: dict[str, Any], buffer: GltfBuffer) -> None:
        tree["nodes"][1]["extensions"][PHYSICS]["motion"] = {"isKinematic": True}
        numbers = {"input": buffer.append(np.array(keys)), "output": buffer.append(np.array(values))} | sampler
        channel = {"sampler": 0, "target": {"node": 1, "path": "translation"}}
        tree["animations"] = [{"channels": [channel], "samplers": [numbers]}]

    return change


def jointed(**entry: Any) -> Change:
    def change(tree: dict[str, Any], buffer: GltfBuffer) -> None:
        tree["extensions"][PHYSICS]["physicsJoints"] = [{"limits": [{"linearAxes": [0, 1, 2], "min": 0, "max": 0}]}]
        tree["nodes"][1]["extensions"][PHYSICS]["joint"] = {"connectedNode": 0, "joint": 0} | entry

    return change


MOVED = [[0.0, 0.1, 0.0], [0.0, 0.2, 0.0]]
MORE: dict[str, tuple[Change, str]] = {
    "keys that fall": (animated([1.0, 0.0], MOVED), "order"),
    "values too few": (animated([0.0, 0.5, 1.0], MOVED), "one value a key"),
    "a place that is none": (animated([0.0, 1.0], [[0.0, np.nan, 0.0], MOVED[1]]), "none"),
    "a place of one number": (animated([0.0, 1.0], [1.0, 2.0]), "translation"),
    "a sampler that is none": (animated([0.0, 1.0], MOVED, input=999), "bad.gltf"),
    "a joint that is none": (jointed(joint=4), "joint"),
    "a partner that is none": (jointed(connectedNode=77), "connectedNode"),
}
EVERY = {**BAD, **MORE}


@pytest.mark.parametrize("what", EVERY)
def test_what_is_wrong_is_one_line_and_exit_2(what: str, tmp_path: Path) -> None:
    change, named = EVERY[what]
    written(tmp_path / "bad.gltf", change)
    done = call_here(tmp_path, "render", "bad.gltf", "-o", "bad.wav", "--seconds", "0.05")
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1 and len(done.stderr) < 400, done.stderr
    assert named in done.stderr
    assert [one.name for one in tmp_path.iterdir()] == ["bad.gltf"]


def claimed(whole: dict[str, Any]) -> bytes:
    whole["buffers"][0]["byteLength"] = 1 << 30
    return json.dumps(whole).encode()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.gltf", claimed, "shorter than it claims"),
        ("a.gltf", lambda _: b"", "a.gltf"),
        ("a.gltf", lambda _: b"{]", "a.gltf"),
        ("a.gltf", lambda _: b"[1, 2]", "version 2"),
        ("a.gltf", lambda _: b'{"asset": {"version": "2.0"}}', "no rigid body"),
        ("a.glb", lambda _: b"glTF" + (2).to_bytes(4, "little") + (1 << 30).to_bytes(4, "little") + bytes(1000), "GLB"),
        ("a.glb", lambda _: b"glTF\2\0", "a.glb"),
    ],
)
def test_a_file_that_is_none_is_one_line(name: str, content: Any, said: str, tmp_path: Path) -> None:
    whole = json.loads(written(tmp_path / "good.gltf").read_text())
    (tmp_path / name).write_bytes(content(whole))
    done = call_here(tmp_path, "render", name, "-o", "bad.wav")
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1 and said in done.stderr, done.stderr
    assert not (tmp_path / "bad.wav").exists()


def test_what_is_left_out_is_named_and_the_rest_sounds(tmp_path: Path) -> None:
    def change(tree: dict[str, Any], buffer: GltfBuffer) -> None:
        jointed()(tree, buffer)
        tree["extensions"][PHYSICS]["physicsJoints"] = [{"limits": [{"linearAxes": [0], "min": 0, "max": 0}]}]
        entry = tree["extensions"][AUDIO]["modalModels"][0]
        entry["frequencies"] = buffer.append(np.array([2400.0, 900.0, 52_000.0]))
        del entry["indices"]

    written(tmp_path / "odd.gltf", change)
    done = call_here(tmp_path, "render", "odd.gltf", "-o", "odd.wav", "--seconds", "0.1")
    assert done.returncode == 0, done.stderr
    for words in ("joint", "at or above 24000 Hz", "no indices"):
        assert words in done.stderr, words


def test_a_glb_sounds_as_its_gltf_does(tmp_path: Path) -> None:
    for end in ("gltf", "glb"):
        written(tmp_path / f"box.{end}")
        done = call_here(tmp_path, "render", f"box.{end}", "-o", f"{end}.wav", "--seconds", "0.2", "--pascals")
        assert done.returncode == 0, done.stderr
    sounds = [read_audio(tmp_path / f"{end}.wav")[0] for end in ("gltf", "glb")]
    np.testing.assert_array_equal(*sounds)
    assert np.abs(sounds[0]).max() > 1e-3
