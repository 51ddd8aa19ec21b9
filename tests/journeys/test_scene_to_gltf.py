"""Somebody has a PyBullet scene, or its contact log, and wants it in another engine: bodies, physics, motion, sound."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.apps import bake
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.files import read_log
from sonic_bullet.records import Air, Body
from sonic_bullet.records.rigid_scene import RigidBody, RigidScene
from sonic_bullet.session.gltf_in.own_words import without_mounting
from sonic_bullet.session.gltf_in.scene_reader import read_rigid_scene
from tests.apps.cli.called_here import call_here
from tests.made import baked as made
from tests.made.gltf_files import khronos_messages, schema_errors

REPO = Path(__file__).resolve().parents[2]
TEN = """
SECONDS = 0.25
SIZES = ([0.05, 0.01, 0.004], [0.06, 0.012, 0.006])


def build(client):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    client.changeDynamics(floor, -1, restitution=0.9, lateralFriction=0.7)
    cast = {}
    for i in range(9):
        shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=SIZES[i % 2])
        turn = client.getQuaternionFromEuler([0.2 * i, 0.1, 0.3 * i])
        body = client.createMultiBody(0.1, shape, basePosition=[0.15 * i, 0, 0.07], baseOrientation=turn)
        client.changeDynamics(body, -1, restitution=0.5, lateralFriction=0.4, linearDamping=0, angularDamping=0)
        client.resetBaseVelocity(body, [0, 0.1, -0.2], [1, 0, 2])
        cast[body] = {"material": ["steel", "glass"][i % 2], "name": f"bar{i}"}
    client.createConstraint(body, -1, -1, -1, client.JOINT_POINT2POINT, [0, 0, 0], [0, 0, 0.1], [0.15 * i, 0, 0.17])
    client.createConstraint(body - 1, -1, body - 2, -1, client.JOINT_FIXED, [0, 0, 0], [0.075, 0, 0], [-0.075, 0, 0])
    return cast
"""
BOWL = """
SECONDS = 0.3


def build(client):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.5, 0.5, 0.05]))
    bowl = client.createMultiBody(
        0.4, client.createCollisionShape(client.GEOM_MESH, fileName="bowl.obj"), basePosition=[0, 0, 0.2]
    )
    client.changeDynamics(bowl, -1, restitution=0.5)
    return {bowl: {"material": "steel", "name": "bowl", "to_hz": 9000}, floor: "concrete"}
"""


@pytest.fixture(scope="module")
def ten(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of ten bodies, and what `bake` and `render` make of it."""
    folder = tmp_path_factory.mktemp("ten")
    (folder / "ten.py").write_text(TEN)
    done = call_here(folder, "bake", "ten.py", "-o", "ten.glb", "--json", "ten.json")
    assert done.returncode == 0, done.stderr
    done = call_here(folder, "render", "ten.py", "--pascals", "-o", "ten.wav", "--contacts", "ten.npz")
    assert done.returncode == 0, done.stderr
    return folder


def body_of(one: RigidBody) -> Body:
    """What a file says of a body, as the run time takes it."""
    assert one.model is not None and one.material is not None
    return Body(
        0, -1, 0, one.name, one.mass_kg, np.diag(one.inertia_kg_m2), one.model.volume_m3,
        material=one.material, model=one.model, mounting=one.mounting,
    )  # fmt: skip


def check_same_sound(scene: RigidScene, log_of: Path, unstruck: str = "") -> None:
    """Frequencies and decays in doubles, shapes to float32, the strike within -90 dB, of every body that rings.

    unstruck: a body so even that rounding decides on which side of it a mode's pressure counts as positive.
    """
    ours = {body.name: body for body in read_log(log_of).bodies if body.model is not None and body.model.mode_count}
    theirs = {one.name: one for one in scene.bodies if one.model is not None}
    assert set(theirs) >= set(ours)  # a file has those that nothing touched, too
    for name, body in ours.items():
        baked = bake.bake_body(body)
        order = np.argsort(without_mounting(baked.freq_hz, baked.decay_per_s, body.mounting)[0], kind="stable")
        found = theirs[name].model
        assert found is not None
        if body.mounting == "free":
            np.testing.assert_array_equal(found.freq_hz, baked.freq_hz[order])
            np.testing.assert_array_equal(found.decay_per_s, baked.decay_per_s[order])
        ringing = [build_resonator(one, (), 384_000, Air()) for one in (body_of(theirs[name]), body)]
        for field in ("omega_rad_s", "decay_per_s"):
            # a mounting's loss, taken off and added again, may swap a pair of equal frequencies
            theirs_now, ours_now = (np.sort(getattr(one, field)) for one in ringing)
            np.testing.assert_allclose(theirs_now, ours_now, rtol=1e-12, err_msg=field)
        np.testing.assert_allclose(found.shape, baked.shape[:, :, order], rtol=1e-6, atol=1e-6 * found.shape.max())
        if name == unstruck:
            continue
        strike = bake.choose_strike(baked, impulse_n_s=0.02, contact_s=2e-4)
        again = made.bank_strike(body_of(theirs[name]), strike, 1.0)
        assert made.error_db(again, made.bank_strike(body, strike, 1.0)) < -90, name


def test_ten_bodies_go_out_and_come_back(ten: Path) -> None:
    scene = read_rigid_scene(ten / "ten.glb")
    check_same_sound(scene, ten / "ten.npz")
    log = read_log(ten / "ten.npz")
    assert len(scene.bodies) == 10
    np.testing.assert_array_equal(scene.gravity_m_s2, [0, 0, -9.81])
    first = log.steps[0]
    for one in scene.bodies:
        index = next(i for i, body in enumerate(log.bodies) if body.name == one.name)
        body = log.bodies[index]
        if body.material is None:
            assert one.mass_kg == 0 and one.material is None and [x.kind for x in one.shapes] == ["plane"]
            assert one.physics.friction == 0.7 and one.physics.friction_rule == "multiply"
            continue
        np.testing.assert_allclose(one.position_m, first.position_m[index], atol=1e-12)
        assert abs(abs(one.quaternion_xyzw @ first.quaternion_xyzw[index]) - 1) < 1e-12
        np.testing.assert_allclose(one.velocity_m_s, [0, 0.1, -0.2], atol=1e-12)
        np.testing.assert_allclose(one.spin_rad_s, [1, 0, 2], atol=1e-12)
        assert one.mass_kg == body.mass_kg and (one.physics.friction, one.physics.restitution) == (0.4, 0.5)
        np.testing.assert_allclose(np.diag(body.inertia_kg_m2), one.inertia_kg_m2, rtol=1e-12)
        known = ("name", "density_kg_m3", "youngs_pa", "poisson", "roughness_m", "hurst", "restitution", "alpha_per_s")
        for field in known:
            theirs, ours = getattr(one.material, field), getattr(body.material, field)
            assert theirs == ours or theirs == pytest.approx(ours, rel=1e-12), field
    assert sorted(joint.kind for joint in scene.joints) == ["fixed", "point"]
    np.testing.assert_allclose(next(x for x in scene.joints if x.kind == "point").position_m[0], 1.2, atol=0.11)


def test_the_recorded_motion_is_its_animation(ten: Path) -> None:
    scene, log = read_rigid_scene(ten / "ten.glb"), read_log(ten / "ten.npz")
    assert len(scene.paths) == 9
    for path in scene.paths:
        index = next(i for i, body in enumerate(log.bodies) if body.name == scene.bodies[path.body].name)
        place = np.array([step.position_m[index] for step in log.steps])
        start = log.start_s.astype(np.float32)
        known = np.isin(start, path.time_s.astype(np.float32))
        assert known.sum() == len(path.time_s)
        np.testing.assert_allclose(path.position_m, place[known], atol=1e-7)


def test_the_file_is_played_here_as_the_scene_was(ten: Path) -> None:
    done = call_here(ten, "render", "ten.glb", "--seconds", "0.25", "--pascals", "-o", "back.wav")
    assert done.returncode == 0, done.stderr
    ours, theirs = (sb.read_audio(ten / name)[0] for name in ("ten.wav", "back.wav"))
    level = [10 * np.log10((x[:, : ours.shape[1]] ** 2).sum()) for x in (ours, theirs)]
    assert level[1] == pytest.approx(level[0], abs=1.5)


@pytest.mark.slow
def test_its_animation_is_scored(ten: Path) -> None:
    """Where physics are not to be simulated again, the recorded motion alone gives contacts and sound."""
    done = call_here(ten, "score", "ten.glb", "--material", "steel", "--pascals", "-o", "scored.wav")
    assert done.returncode == 0, done.stderr
    sound = sb.read_audio(ten / "scored.wav")[0]
    assert np.isfinite(sound).all() and np.abs(sound).max() > 0.1


def test_a_log_goes_out_too(ten: Path) -> None:
    done = call_here(ten, "bake", "ten.npz", "-o", "log.gltf", "--seconds", "0.1")
    assert done.returncode == 0, done.stderr
    assert "shape" in done.stderr and "joints" in done.stderr, "what a log lacks is named"
    scene = read_rigid_scene(ten / "log.gltf")
    check_same_sound(scene, ten / "ten.npz")
    assert len(scene.bodies) == 9 and scene.paths[0].time_s[-1] < 0.1
    bar = next(one for one in scene.bodies if one.name == "bar2")
    np.testing.assert_allclose(bar.velocity_m_s, [0, 0.1, -0.2], atol=1e-9)
    np.testing.assert_allclose(bar.spin_rad_s, [1, 0, 2], atol=0.02)


def test_the_extension_s_schemas_hold(ten: Path, shared_path: Path) -> None:
    assert schema_errors(ten / "ten.glb", shared_path / "gltf-audio" / "schema") == []


def test_the_khronos_validator_finds_no_error(ten: Path) -> None:
    assert khronos_messages(ten / "ten.glb") == []


@pytest.mark.slow
def test_a_bowl_goes_out_and_comes_back(tmp_path: Path) -> None:
    shutil.copy(REPO / "assets" / "bowl.obj", tmp_path)
    (tmp_path / "scene.py").write_text(BOWL)
    for words in (("bake", "scene.py", "-o", "bowl.glb"), ("render", "scene.py", "-o", "a.wav", "--contacts", "a.npz")):
        done = call_here(tmp_path, *words)
        assert done.returncode == 0, done.stderr
    scene = read_rigid_scene(tmp_path / "bowl.glb")
    check_same_sound(scene, tmp_path / "a.npz", unstruck=scene.bodies[0].name)
    assert [one.shapes[0].kind for one in scene.bodies] == ["box", "mesh"]
    assert khronos_messages(tmp_path / "bowl.glb") == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("ten.py", "-o", "a.glb", "--seconds", "0"), "--seconds"),
        (("ten.py", "-o", "a.json", "--seconds", "1"), "--seconds"),
        (("ten.py", "-o", "a.glb", "--body", "bar1", "--seconds", "1"), "--seconds"),
        (("ten.npz", "-o", "a.glb", "--seconds", "9"), "shorter"),
        (("none.py", "-o", "a.glb"), "none.py"),
        (("ten.py", "-o", "nowhere/a.glb"), "no folder"),
        (("broken.py", "-o", "a.glb"), "build"),
        (("empty.py", "-o", "a.glb"), "shape"),
        (("ten.py", "-o", "a.glb", "--material", "bra1=steel", "--seconds", "0.01"), "bar1"),
    ],
)
def test_what_cannot_be_is_one_line(ten: Path, words: tuple[str, ...], said: str) -> None:
    (ten / "broken.py").write_text("def build(client):\n    return 3\n")
    (ten / "empty.py").write_text("SECONDS = 0.02\n\n\ndef build(client):\n    return {}\n")
    before = set(ten.iterdir())
    done = call_here(ten, "bake", *words)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert said in done.stderr
    assert set(ten.iterdir()) == before


def test_what_a_file_says_in_words(ten: Path) -> None:
    told = json.loads((ten / "ten.json").read_text())
    assert len(told["bodies"]) == 9 and isinstance(told["notes"], list)


def test_who_moved_and_is_in_no_record_is_named(tmp_path: Path) -> None:
    (tmp_path / "scene.py").write_text(
        "SECONDS = 0.05\n\n\ndef build(client):\n"
        "    client.setGravity(0, 0, -9.81)\n"
        "    box = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.05, 0.01, 0.004])\n"
        "    bar, _ = (client.createMultiBody(0.1, box, basePosition=[0, 0, height]) for height in (1, 2))\n"
        "    return {bar: {'material': 'steel', 'name': 'bar'}}\n"
    )
    done = call_here(tmp_path, "bake", "scene.py", "-o", "scene.glb")
    assert done.returncode == 0 and "motion of body 1 is not in the file" in done.stderr, done.stderr
    assert [len(read_rigid_scene(tmp_path / "scene.glb").paths), done.stderr.count("motion of")] == [1, 1]
