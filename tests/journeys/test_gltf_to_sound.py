"""Somebody has a glTF scene with physics and sound from another engine, and hears it: by the command line alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.files import read_audio, read_log
from sonic_bullet.files.gltf.gltf_writer import GltfBuffer, write_gltf
from tests.apps.cli.called_here import call_here
from tests.made.gltf_scenes import DECAY_PER_S, FREQ_HZ, MASS_KG, gltf_scene, write_scene


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("gltf") / "box.gltf")


def test_a_scene_sounds_and_its_log_is_the_same_sound(scene: Path) -> None:
    out, log = scene.with_name("box.wav"), scene.with_name("box.npz")
    asked = ["render", "box.gltf", "--seconds", "0.6", "--pascals", "-o", "box.wav", "--contacts", "box.npz"]
    assert call_here(scene.parent, *asked, "--json", "box.json").returncode == 0
    sound = read_audio(out)[0]
    assert np.isfinite(sound).all() and np.abs(sound).max() > 1e-3
    kept = read_log(log)
    box = next(body for body in kept.bodies if body.name == "box")
    assert box.model is not None and box.material is not None
    np.testing.assert_array_equal(box.model.freq_hz, np.sort(FREQ_HZ))
    np.testing.assert_array_equal(box.model.decay_per_s, DECAY_PER_S[np.argsort(FREQ_HZ)])
    assert box.mass_kg == pytest.approx(MASS_KG) and box.material.octave_rms_m is not None
    assert box.material.form is not None and box.material.form.waviness_m == 2e-6, "the draft's machined waves"
    floor = next(body for body in kept.bodies if body.name == "floor")
    assert floor.model is None and floor.material is not None, "a floor without a model touches and does not ring"
    assert call_here(scene.parent, "render", "box.npz", "--pascals", "-o", "again.wav").returncode == 0
    np.testing.assert_array_equal(read_audio(scene.with_name("again.wav"))[0], sound)
    told = json.loads(scene.with_name("box.json").read_text())
    assert any("finer" in note for note in told["notes"])
    compared = call_here(scene.parent, "compare", "box.gltf", "box.gltf", "--seconds", "0.1")
    assert compared.returncode == 0 and "all samples are equal" in compared.stdout


def test_what_is_not_read_is_named(scene: Path) -> None:
    buffer = GltfBuffer()
    tree = gltf_scene(buffer, drop_m=0.01)
    tree["extensionsUsed"].append("KHR_audio_emitter")
    own = tree["nodes"][1]["extensions"]["KHR_physics_rigid_bodies"]
    own["joint"] = {"connectedNode": 0, "joint": 0}
    own["collider"]["collisionFilter"] = 0
    tree["extensions"]["KHR_physics_rigid_bodies"]["physicsJoints"] = [{"limits": [{"linearAxes": [0], "min": 0}]}]
    tree["nodes"][1]["extensions"]["KHR_audio_rigid_bodies"]["gain"] = 0.5
    path = scene.with_name("more.gltf")
    write_gltf(path, tree, buffer)
    done = call_here(scene.parent, "render", path.name, "--seconds", "0.1", "-o", "more.wav")
    assert done.returncode == 0
    said = done.stderr
    for words in ("KHR_audio_emitter", "joint", "collisionFilter"):
        assert words in said, words


def test_a_gain_is_applied(scene: Path) -> None:
    peaks = []
    for gain in (1.0, 0.25):
        buffer = GltfBuffer()
        tree = gltf_scene(buffer, drop_m=0.01)
        tree["nodes"][1]["extensions"]["KHR_audio_rigid_bodies"]["gain"] = gain
        path = scene.with_name(f"gain{gain}.gltf")
        write_gltf(path, tree, buffer)
        out = path.with_suffix(".wav")
        words = ("render", path.name, "--seconds", "0.2", "--pascals", "-o", out.name)
        assert call_here(scene.parent, *words).returncode == 0
        peaks.append(np.abs(read_audio(out)[0]).max())
    assert peaks[1] == pytest.approx(0.25 * peaks[0], rel=1e-4)
