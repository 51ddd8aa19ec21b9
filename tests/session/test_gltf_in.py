"""glTF scenes read by value: frames, scale, surfaces, pairs; and what is wrong in them is one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sonic_bullet.files.gltf.gltf_writer import GltfBuffer, write_gltf
from sonic_bullet.records import Microphone
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.records.rigid_scene import PhysicsMaterial, RigidBody
from sonic_bullet.records.roughness import OCTAVES, WAVE_M, finish_octaves, track_octaves
from sonic_bullet.scene import render_scene
from sonic_bullet.session.gltf_in.acoustics import scaled_modes
from sonic_bullet.session.gltf_in.scene_reader import read_rigid_scene
from sonic_bullet.simulators.pybullet.rigid.rigid_world import combined_friction, pair_factors
from tests.made.gltf_scenes import CORNER_M, HALF_M, MATERIAL, gltf_scene, write_scene

Change = Callable[[dict[str, Any], GltfBuffer], None]


def test_frames_stand_upright(tmp_path: Path) -> None:
    floor, box = read_rigid_scene(write_scene(tmp_path / "a.gltf", drop_m=0.25)).bodies
    np.testing.assert_allclose(box.position_m, [0, 0, 0.255], atol=1e-12)
    np.testing.assert_allclose(floor.position_m, [0, 0, -0.05], atol=1e-12)
    np.testing.assert_allclose(box.shapes[0].size_m, 2 * HALF_M)
    assert box.model is not None
    np.testing.assert_allclose(np.abs(box.model.vertex_m), np.abs(CORNER_M), atol=1e-9)
    assert box.model.volume_m3 == pytest.approx(8 * HALF_M.prod(), rel=1e-6)
    assert abs(box.spin_rad_s[2]) < 1e-12, "z of glTF's world is no axis up"


def test_a_centre_of_mass_off_the_node_moves_frame_shapes_and_points_together(tmp_path: Path) -> None:
    buffer = GltfBuffer()
    tree = gltf_scene(buffer, scale=2.0)
    plain = tmp_path / "plain.gltf"
    write_gltf(plain, tree, buffer)
    off = np.array([0.01, 0.0, -0.004])
    motion = tree["nodes"][1]["extensions"]["KHR_physics_rigid_bodies"]["motion"]
    motion |= {"centerOfMass": off.tolist(), "inertiaOrientation": [0.5, 0.5, 0.5, 0.5]}
    moved = tmp_path / "moved.gltf"
    write_gltf(moved, tree, buffer)
    a, b = (read_rigid_scene(path).bodies[1] for path in (plain, moved))
    assert a.model is not None and b.model is not None
    worlds = [x.position_m + x.model.vertex_m @ Rotation.from_quat(x.quaternion_xyzw).as_matrix().T for x in (a, b)]
    np.testing.assert_allclose(worlds[0], worlds[1], atol=1e-12)
    turned = [
        np.einsum("xy,vym->vxm", Rotation.from_quat(x.quaternion_xyzw).as_matrix(), x.model.shape) for x in (a, b)
    ]
    np.testing.assert_allclose(turned[0], turned[1], atol=1e-5)
    np.testing.assert_allclose(b.shapes[0].position_m @ b.shapes[0].position_m, 4 * off @ off, rtol=1e-9)


def test_scale_detunes_a_model_by_the_laws_of_elasticity(tmp_path: Path) -> None:
    one, two = (read_rigid_scene(write_scene(tmp_path / f"{s}.gltf", scale=s)).bodies[1].model for s in (1.0, 2.0))
    assert one is not None and two is not None
    np.testing.assert_allclose(two.omega0_squared_per_s2, one.omega0_squared_per_s2 / 4, rtol=1e-6)
    law = (MATERIAL["alpha"] + MATERIAL["beta"] * two.omega0_squared_per_s2) / 2  # type: ignore[operator]
    np.testing.assert_allclose(two.decay_per_s, law, rtol=1e-9)
    np.testing.assert_allclose(two.shape, one.shape * 2**-1.5, rtol=1e-6)
    freq, decay = scaled_modes(np.array([500.0]), np.array([3.0]), 0.5, {})
    assert decay[0] == 3.0 and freq[0] == pytest.approx(1000.0, rel=1e-5)


def test_octaves_hold_the_variance_and_slope_of_a_finish() -> None:
    found = finish_octaves(3e-6, 1e-2, -2.4, 1e-4)
    assert (found**2).sum() == pytest.approx(9e-12, rel=0.1), "all of the band is within the octaves"
    fine = (WAVE_M < 6e-3) & (WAVE_M > 2e-4)
    assert np.polyfit(np.log(WAVE_M[fine]), 2 * np.log(found[fine]), 1)[0] == pytest.approx(1.4, abs=0.01)
    coarse = WAVE_M > 2e-2
    assert np.polyfit(np.log(WAVE_M[coarse]), 2 * np.log(found[coarse]), 1)[0] == pytest.approx(-1, abs=1e-6)
    assert found.shape == (OCTAVES,) and (found[WAVE_M < 5e-5] == 0).all()
    x = np.arange(4096) * 1e-5
    track = track_octaves(2e-6 * np.sqrt(2) * np.sin(2 * np.pi * x * 100 / x.size * 1e5), 1e-5)
    assert (track > 1e-9).sum() == 1 and track.max() == pytest.approx(2e-6, rel=1e-6)


def _body(name: str, mass_kg: float, physics: PhysicsMaterial) -> RigidBody:
    from sonic_bullet.records import Shape

    ball, zero = Shape("sphere", np.array([0.1, 0, 0])), np.zeros(3)
    return RigidBody(name, (ball,), mass_kg, zero, zero, np.array([0, 0, 0, 1.0]), zero, zero, physics)


def test_products_of_factors_are_the_pairs_that_the_rules_ask_for() -> None:
    floor, a, b = PhysicsMaterial(0.0), PhysicsMaterial(0.4), PhysicsMaterial(0.9, friction_rule="maximum")
    factors, notes = pair_factors([_body("floor", 0, floor), _body("a", 1, a)], combined_friction)
    assert factors.prod() == pytest.approx(0.2) and not notes
    bodies = [_body("floor", 0, floor), _body("a", 1, a), _body("b", 1, b), _body("a too", 1, a)]
    factors, notes = pair_factors(bodies, combined_friction)
    assert factors[1] == factors[3]
    assert len(notes) >= 1 and all("PyBullet multiplies" in note for note in notes)
    assert combined_friction(a, b) == 0.9 and combined_friction(a, floor) == pytest.approx(0.2)


def _accessor(key: str, **changes: Any) -> Change:
    def change(tree: dict[str, Any], buffer: GltfBuffer) -> None:
        buffer.accessors[tree["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0][key]].update(changes)

    return change


def _set(*path: Any) -> Change:
    def change(tree: dict[str, Any], buffer: GltfBuffer) -> None:
        at: Any = tree
        for key in path[:-2]:
            at = at[key]
        at[path[-2]] = path[-1]

    return change


def _values(key: str, values: Any) -> Change:
    def change(tree: dict[str, Any], buffer: GltfBuffer) -> None:
        tree["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0][key] = buffer.append(np.array(values))

    return change


BODY = ("nodes", 1, "extensions", "KHR_physics_rigid_bodies")
BAD: dict[str, tuple[Change, str]] = {
    "length": (_accessor("shapes", count=23), "shapes"),
    "type": (_accessor("positions", type="SCALAR"), "positions"),
    "component": (_accessor("decayRates", componentType=5125), "decayRates"),
    "beyond": (_accessor("shapes", byteOffset=40000), "bytes"),
    "nan": (_values("frequencies", [100.0, np.nan, 300.0]), "frequencies"),
    "zero frequency": (_values("frequencies", [100.0, 0.0, 300.0]), "frequency"),
    "negative decay": (_values("decayRates", [1.0, -1.0, 1.0]), "decay"),
    "scale of 0": (_set("nodes", 1, "scale", [0.0, 0.0, 0.0]), "scale"),
    "negative scale": (_set("nodes", 1, "scale", [-1.0, 1.0, 1.0]), "scale"),
    "uneven scale": (_set("nodes", 1, "scale", [1.0, 2.0, 1.0]), "unevenly"),
    "no such shape": (_set(*BODY, "collider", {"geometry": {"shape": 7}}), "shape"),
    "no such model": (_set("nodes", 1, "extensions", "KHR_audio_rigid_bodies", {"modalModel": 3}), "modalModel"),
    "unknown kind": (
        _set("extensions", "KHR_implicit_shapes", "shapes", 1, {"type": "torus", "torus": {}}), "torus",
    ),
    "mass": (_set(*BODY, "motion", "mass", -1.0), "mass"),
    "words": (_set(*BODY, "motion", "mass", "heavy"), "mass"),
    "restitution": (
        _set("extensions", "KHR_physics_rigid_bodies", "physicsMaterials", 0, "restitution", 3.0), "restitution",
    ),
    "rule": (
        _set("extensions", "KHR_physics_rigid_bodies", "physicsMaterials", 0, "frictionCombine", "blend"), "rule",
    ),
    "roughness": (_set("extensions", "KHR_audio_rigid_bodies", "acousticSurfaces", 0, "roughness", 0.0), "roughness"),
    "waviness": (_set("extensions", "KHR_audio_rigid_bodies", "acousticSurfaces", 0, "waviness", -1e-6), "waviness_m"),
    "waves of 0 m": (
        _set("extensions", "KHR_audio_rigid_bodies", "acousticSurfaces", 0, "wavinessLength", 0), "waviness_length_m",
    ),
    "poisson": (_set("extensions", "KHR_audio_rigid_bodies", "acousticMaterials", 0, "poissonRatio", 0.5), "Poisson"),
    "cycle": (_set("nodes", 1, "children", [1]), "hang on themselves"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_what_is_wrong_is_one_line(what: str, tmp_path: Path) -> None:
    change, named = BAD[what]
    buffer = GltfBuffer()
    tree = gltf_scene(buffer)
    change(tree, buffer)
    path = tmp_path / "bad.gltf"
    write_gltf(path, tree, buffer)
    with pytest.raises(SonicBulletError) as caught:
        read_rigid_scene(path)
    assert named in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_a_gigabyte_claimed_is_not_made(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "a.gltf")
    tree = json.loads(path.read_text())
    tree["buffers"][0]["byteLength"] = 1 << 30
    path.write_text(json.dumps(tree))
    with pytest.raises(SonicBulletError, match="shorter than it claims"):
        read_rigid_scene(path)
    tree["buffers"][0]["byteLength"] = 100
    tree["accessors"][0]["count"] = 1 << 28
    path.write_text(json.dumps(tree))
    with pytest.raises(SonicBulletError, match="more bytes than its buffer"):
        read_rigid_scene(path)


def test_a_model_without_indices_is_touched_on_its_hull(tmp_path: Path) -> None:
    buffer = GltfBuffer()
    tree = gltf_scene(buffer)
    del tree["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0]["indices"]
    path = tmp_path / "bare.gltf"
    write_gltf(path, tree, buffer)
    scene = read_rigid_scene(path)
    model = scene.bodies[1].model
    assert model is not None and model.volume_m3 == pytest.approx(8 * HALF_M.prod(), rel=1e-6)
    assert any("no indices" in note for note in scene.notes)


def test_a_body_without_a_model_is_solved_where_no_body_has_one(tmp_path: Path) -> None:
    buffer = GltfBuffer()
    tree = gltf_scene(buffer)
    del tree["extensions"]["KHR_audio_rigid_bodies"]["modalModels"]
    del tree["nodes"][1]["extensions"]["KHR_audio_rigid_bodies"]["modalModel"]
    path = tmp_path / "unsolved.gltf"
    write_gltf(path, tree, buffer)
    floor, box = read_rigid_scene(path).bodies
    assert box.solved and box.model is None and not floor.solved


@pytest.mark.shared
def test_all_sample_scenes_load(shared_path: Path) -> None:
    """Each of the draft's own scenes is read, and every body that has a model brings it."""
    scenes = sorted((shared_path / "gltf-audio").rglob("*.gltf"))
    assert len(scenes) == 52
    for path in scenes:
        found = read_rigid_scene(path)
        said = json.loads(path.read_text())
        modelled = sum("modalModel" in str(node.get("extensions", {})) for node in said["nodes"])
        assert sum(body.model is not None for body in found.bodies) == modelled, path.name
        assert not any("not simulated" in note and "joint" in note for note in found.notes), path.name


def _with_camera(path: Path, parent: int | None) -> Path:
    """A camera 2 m along glTF's z and 1 m up, looking along its x; a child of the box where parent is its node."""
    buffer = GltfBuffer()
    tree = gltf_scene(buffer)
    turn = [0.0, float(-np.sqrt(0.5)), 0.0, float(np.sqrt(0.5))]
    tree["nodes"].append({"name": "eye", "camera": 0, "translation": [0.0, 1.0, 2.0], "rotation": turn})
    tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.01}}]
    number = len(tree["nodes"]) - 1
    if parent is None:
        tree["scenes"][0]["nodes"].append(number)
    else:
        tree["nodes"][parent].setdefault("children", []).append(number)
    write_gltf(path, tree, buffer)
    return path


def test_a_scene_without_a_listener_is_heard_from_its_camera(tmp_path: Path) -> None:
    path = _with_camera(tmp_path / "a.gltf", None)
    found = render_scene(path, seconds=0.3, sr=8000)
    (heard,) = found.log.sensors
    assert isinstance(heard, Microphone) and heard.body_id is None
    np.testing.assert_allclose(heard.position_m, [0, -2, 1], atol=1e-12)
    ahead, left, up = Rotation.from_quat(heard.quaternion_xyzw).as_matrix().T
    np.testing.assert_allclose([ahead, up], [[1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(left, [0, 1, 0], atol=1e-12)
    assert "it is heard from its camera eye, at (0, -2, 1) m" in found.notes
    there = render_scene(path, seconds=0.3, sr=8000, microphones=(0, -2, 1))
    assert np.array_equal(found.samples, there.samples) and abs(there.samples).max() > 1e-4
    assert not any("camera" in note for note in there.notes)


def test_a_camera_on_a_body_is_a_microphone_on_it(tmp_path: Path) -> None:
    found = render_scene(_with_camera(tmp_path / "a.gltf", 1), seconds=0.05, sr=8000)
    (heard,) = found.log.sensors
    assert isinstance(heard, Microphone)
    assert next(body.name for body in found.log.bodies if body.body_id == heard.body_id) == "box"
    begin = found.log.steps[0]
    row = next(i for i, body in enumerate(found.log.bodies) if body.name == "box")
    turn = Rotation.from_quat(begin.quaternion_xyzw[row]).as_matrix()
    box = read_rigid_scene(tmp_path / "a.gltf").bodies[1]
    np.testing.assert_allclose(turn @ heard.position_m + begin.position_m[row], _eye(box), atol=1e-3)


def _eye(box: RigidBody) -> np.ndarray:
    """Where the camera is in the world that hangs on the box's node, z up."""
    half = 0.4  # the node turns by that about y, which is z here
    local = np.array([0.0, -2.0, 1.0])
    return np.asarray(Rotation.from_euler("z", half).apply(local) + box.position_m)
