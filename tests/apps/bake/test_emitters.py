"""A scene's clips in KHR_audio_emitter: valid, in step with the animation, as loud at a metre as the scene is."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from tests.apps.cli.called_here import call_here
from tests.made.baked import third_octave_db
from tests.made.gltf_files import khronos_messages

REPO = Path(__file__).resolve().parents[3]
EXTENSION = "KHR_audio_emitter"
FAR_M, SECONDS = 40.0, 0.4
FAR = ",".join([f"{FAR_M / 3**0.5:.6f}"] * 3)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("emitters")
    scene, seconds = str(REPO / "scenes" / "bar.py"), str(SECONDS)
    for words in (
        ("bake", scene, "--seconds", seconds, "--emitters", "-o", "bar.glb"),
        ("render", scene, "--seconds", seconds, "--microphone", FAR, "--no-image", "-o", "far.wav",
         "--pascals", "--stems", "far", "--events", "far.json", "--tail", "0"),
    ):  # fmt: skip
        done = call_here(folder, *words)
        assert done.returncode == 0, done.stderr
    return folder


def opened(path: Path) -> tuple[Any, bytes]:
    """Tree and binary part of a .glb."""
    data = path.read_bytes()
    (length,) = struct.unpack("<I", data[12:16])
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def clip_of(path: Path, number: int) -> tuple[np.ndarray, int]:
    """A clip in pascals, and its rate."""
    tree, binary = opened(path)
    part = tree["extensions"][EXTENSION]
    view = tree["bufferViews"][part["audio"][number]["bufferView"]]
    begin = view.get("byteOffset", 0)
    x, sr = soundfile.read(io.BytesIO(binary[begin : begin + view["byteLength"]]))
    source = part["sources"][number]
    return x * source["gain"] * source["extras"]["sonic_bullet"]["full_scale_pa"], sr


def test_the_draft_s_rules_hold(made: Path) -> None:
    tree, _ = opened(made / "bar.glb")
    part = tree["extensions"][EXTENSION]
    assert EXTENSION in tree["extensionsUsed"] and "extensionsRequired" not in tree
    assert set(part) == {"audio", "sources", "emitters"}
    placed = [node["extensions"][EXTENSION] for node in tree["nodes"] if EXTENSION in node.get("extensions", {})]
    assert [one["emitter"] for one in placed] == list(range(len(part["emitters"]))) and len(placed) == 2
    assert all(one["emitters"] == [one["emitter"]] for one in placed)
    for audio, source, emitter in zip(part["audio"], part["sources"], part["emitters"], strict=True):
        assert audio["mimeType"] == "audio/wav" and "uri" not in audio
        assert 0 < source["gain"] <= 1 and source["autoPlay"] is True
        assert emitter["type"] == "positional" and emitter["positional"]["distanceModel"] == "inverse"
        assert emitter["positional"]["refDistance"] > 0
        assert part["audio"][source["audio"]] is audio and [part["sources"][i] for i in emitter["sources"]] == [source]
    moved = {channel["target"]["node"] for channel in tree["animations"][0]["channels"]}
    assert {i for i, node in enumerate(tree["nodes"]) if EXTENSION in node.get("extensions", {})} & moved


def test_the_khronos_validator_finds_no_error(made: Path) -> None:
    assert [one for one in khronos_messages(made / "bar.glb") if one["severity"] == 0] == []


def test_a_clip_is_the_body_at_a_metre(made: Path) -> None:
    clip, sr = clip_of(made / "bar.glb", 0)
    far, rate = soundfile.read(next((made / "far").glob("*-bar.wav")))
    assert sr == rate
    first_s = min(one["start_s"] for one in json.loads((made / "far.json").read_text())["sounding"])
    onset_s = float(np.flatnonzero(np.abs(clip) > 0.05 * np.abs(clip).max())[0]) / sr
    assert first_s - 0.5 / sr <= onset_s < first_s + 0.003  # what is sent beside modes is a mean about each sample
    late = round(FAR_M / 343.0 * sr)
    both = min(len(clip), len(far) - late)
    near = far[late : late + both] * FAR_M
    level_db = 10 * np.log10((near @ near) / (clip[:both] @ clip[:both]))
    assert abs(level_db) < 0.5
    level_db = third_octave_db(near, sr)
    # what is fainter is a skirt of what rings beside it, and the bar falls, which turns high modes' phases
    rings = level_db > np.nanmax(level_db) - 40
    gap = level_db - third_octave_db(clip[:both], sr)
    assert rings.sum() >= 3
    assert np.abs(gap[rings]).max() < 0.5


def test_only_a_whole_scene_has_emitters(tmp_path: Path) -> None:
    done = call_here(tmp_path, "bake", str(REPO / "assets" / "bowl.obj"), "--emitters", "-o", "bowl.glb")
    assert done.returncode != 0 and "--emitters is of a scene" in done.stderr
