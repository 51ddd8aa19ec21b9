"""What files of poses say: one scene by three ways, closed forms of samplers and solids, and files that are wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sonic_bullet.apps.soundtrack.frame_rates import nearest_rate, rate_of_keys
from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.export import Export, ExportedObject, Rule, assemble_animation
from sonic_bullet.apps.soundtrack.score.flight import driven_bodies, fall_m_s2, hidden_n_s, pose_noise_m
from sonic_bullet.apps.soundtrack.score.keyframes import read_rules
from sonic_bullet.apps.soundtrack.score.scoring import read_animation
from sonic_bullet.files.gltf.gltf_animation import Sampler
from sonic_bullet.records.errors import AnimationError, SonicBulletError
from tests.made.animations import (
    EDGES_M,
    RADIUS_M,
    ball_animation,
    bounce_m,
    box_mesh,
    dropped,
    keyframes,
    write_glb,
    write_tree,
)

ANIMATION_FORMAT = "sonic-bullet-animation/1"


def test_three_files_of_one_scene_are_one_animation(tmp_path: Path) -> None:
    keys = dropped()
    write_glb(tmp_path / "a.glb", keys)
    text = keyframes(keys)
    (tmp_path / "a.json").write_text(json.dumps(text))
    place = np.stack([keys.position_m[one] for one in keys.mesh], axis=1)
    turn = np.stack([keys.quaternion_xyzw[one] for one in keys.mesh], axis=1)
    bare = [{key: one[key] for key in ("name", "mesh")} for one in text["bodies"]]
    header = json.dumps(
        {"format": ANIMATION_FORMAT, "fps": 240, "bodies": bare}
    ).encode()  # as export_from_blender.py writes it
    np.savez(tmp_path / "a.npz", header=np.frombuffer(header, np.uint8), position=place, quaternion_xyzw=turn)
    made = [
        assemble_animation(read_animation(tmp_path / f"a.{end}"), (), "plastic")[0] for end in ("json", "npz", "glb")
    ]
    for one, within in zip(made[1:], (1e-12, 1e-6), strict=True):
        assert [x.name for x in one.bodies] == ["floor", "box"]
        assert one.fps == 240
        assert np.abs(one.position_m - made[0].position_m).max() < within
        assert np.sort(one.bodies[1].inertia_kg_m2) == pytest.approx(np.sort(made[0].bodies[1].inertia_kg_m2), rel=1e-5)


def test_lengths_in_centimetres_are_those_in_metres(tmp_path: Path) -> None:
    write_glb(tmp_path / "m.glb", dropped())
    write_glb(tmp_path / "cm.glb", dropped(), length=0.01)
    metres, scaled = read_animation(tmp_path / "m.glb"), read_animation(tmp_path / "cm.glb", scale=0.01)
    for one, other in zip(metres.objects, scaled.objects, strict=True):
        assert np.abs(one.position_m - other.position_m).max() < 1e-6
        assert one.mesh is not None and other.mesh is not None
        assert np.abs(one.mesh[0] - other.mesh[0]).max() < 1e-6


def test_a_cubic_spline_holds_a_cubic() -> None:
    """[glTF 2.0, C.5] with the derivatives as tangents: x = t³ - 2t² + t exactly."""
    key = np.array([0.0, 0.7, 1.0])
    value, slope = key**3 - 2 * key**2 + key, 3 * key**2 - 4 * key + 1
    knots = np.stack([slope, value, slope], axis=1).reshape(-1, 1)
    at = np.linspace(0, 1, 33)
    found = Sampler(key, knots, "CUBICSPLINE", False).at(at)[:, 0]
    assert found == pytest.approx(at**3 - 2 * at**2 + at, abs=1e-12)


def test_a_turn_goes_at_one_speed_by_the_shorter_arc() -> None:
    ends = Rotation.from_rotvec(np.radians([[0, 0, 10], [0, 0, 70]])).as_quat()
    ends[1] *= -1  # the same orientation
    found = Sampler(np.array([0.0, 1.0]), ends, "LINEAR", True).at(np.linspace(0, 1, 7))
    assert Rotation.from_quat(found).as_euler("zyx", degrees=True)[:, 0] == pytest.approx(np.linspace(10, 70, 7))


def test_a_step_holds_until_the_next_key() -> None:
    step = Sampler(np.array([0.0, 1.0, 2.0]), np.array([[1.0], [2.0], [3.0]]), "STEP", False)
    assert step.at(np.array([-1, 0, 0.9, 1.0, 1.9, 2.0, 9.0]))[:, 0].tolist() == [1, 1, 1, 2, 2, 3, 3]


def test_a_solid_has_the_moments_of_its_closed_form() -> None:
    """A box off its origin and turned in its mesh: ρ V, (y² + z²) m/12, its centre moved along."""
    shift, about = np.array([0.3, -0.1, 0.2]), Rotation.from_euler("xyz", [20, 30, 40], degrees=True)
    vertex, face = box_mesh(EDGES_M)
    time = np.arange(5)
    place = np.stack([0.1 * time, 0 * time, 0 * time], axis=1)
    turn = Rotation.from_rotvec(np.outer(time, [0, 0, 0.3])).as_quat()
    one = ExportedObject("box", place, turn, (about.apply(vertex) + shift, face))
    made = assemble_animation(Export(24, (one,), np.zeros(3)), (Rule("*", "steel"),))[0]
    from sonic_bullet.files.presets import load_material

    body, mass = made.bodies[0], load_material("steel").density_kg_m3 * float(np.prod(EDGES_M))
    x, y, z = np.square(EDGES_M)
    assert body.mass_kg == pytest.approx(mass)
    assert np.sort(body.inertia_kg_m2) == pytest.approx(np.sort(mass / 12 * np.array([y + z, x + z, x + y])))
    assert made.position_m[:, 0] == pytest.approx(place + Rotation.from_quat(turn).apply(shift))


def test_what_is_stated_comes_before_rules_and_the_first_rule_before_others(tmp_path: Path) -> None:
    (tmp_path / "t.json").write_text(
        json.dumps([{"name": "b?x", "material": "steel"}, {"name": "*", "material": "wood", "restitution": 0.3}])
    )
    keys = replace(dropped(), extras={"box": {"restitution": 0.9, "mass_kg": 2.0}})
    write_glb(tmp_path / "a.glb", keys)
    made, notes = assemble_animation(read_animation(tmp_path / "a.glb"), read_rules(tmp_path / "t.json"))
    assert dict(made.materials) == {"floor": "wood", "box": "steel"}
    floor, box = made.bodies
    assert (floor.restitution, box.restitution, box.mass_kg) == (0.3, 0.9, 2.0)
    assert notes == ()


def test_a_fall_tells_gravity_and_the_noise_of_its_poses() -> None:
    time_s, rng = np.arange(400) / 240, np.random.default_rng(5)
    noise_m = 2e-6
    still = ball_animation(20 - 9.81 * time_s**2 / 2, 240.0)
    assert fall_m_s2(still) == pytest.approx(9.81, rel=1e-6)
    place = still.position_m.copy()
    place[:, 1] += noise_m * rng.standard_normal((400, 3))
    noisy = replace(still, position_m=place)
    found = pose_noise_m(noisy, np.ones((400, 2), bool))
    assert found == pytest.approx(noise_m, rel=0.25)
    assert hidden_n_s(0.1, noise_m, 240) == pytest.approx(5 * np.sqrt(6) * 0.1 * noise_m * 240)


@pytest.mark.parametrize("seed", range(4))
def test_what_rests_tells_noise_and_what_rattles_tells_none(seed: int) -> None:
    """Nobody flies; a rattle of the same size dies away, and somebody who is quieter than that knows better."""
    rng, noise_m = np.random.default_rng(seed), 3e-4
    still = ball_animation(RADIUS_M + 1e-3 * np.arange(40), 24.0)
    jitter, nowhere = noise_m * rng.standard_normal((40, 3)), np.zeros((40, 2), bool)

    def told(away_m: np.ndarray) -> float | None:
        place = still.position_m.copy()
        place[:, 1] = np.array([0, 0, RADIUS_M]) + away_m
        return pose_noise_m(replace(still, position_m=place), nowhere)

    assert told(jitter) == pytest.approx(noise_m, rel=0.6)
    rattle = told(jitter * np.exp(-np.arange(40) / 6)[:, None])
    assert rattle is None or rattle < 0.1 * noise_m


@pytest.mark.parametrize(("rounded_m", "fps"), [(1e-4, 240.0), (1e-4, 60.0), (1e-3, 240.0), (0.0, 240.0)])
def test_who_falls_is_free_however_its_poses_are_rounded(rounded_m: float, fps: float) -> None:
    """Rounded to 0.1 mm, accelerations from frame to frame are off by half of gravity at 240; over a flight they are
    not. A hand that carries something about is still a hand.
    """
    time_s = np.arange(int(0.45 * fps)) / fps

    def seen(height_m: np.ndarray) -> tuple[bool, float | None]:
        if rounded_m:
            height_m = np.round(height_m / rounded_m) * rounded_m
        made = ball_animation(height_m, fps)
        apart = np.broadcast_to(height_m[:, None] > RADIUS_M + 5e-3, (len(height_m), 2))
        noise_m = pose_noise_m(made, apart)
        return bool(driven_bodies(made, apart, noise_m)[1]), fall_m_s2(made, noise_m)

    driven, fall = seen(bounce_m(time_s, 0.3, 0.7))
    assert not driven
    assert fall == pytest.approx(9.81, rel=0.1)
    assert seen(1 + 0.1 * np.sin(6 * time_s))[0]


def test_an_animation_needs_motion() -> None:
    with pytest.raises(AnimationError, match="nothing moves"):
        ball_animation(np.full(9, 0.02), 24.0)


@pytest.mark.parametrize(
    ("name", "body", "said"),
    [
        ("a.glb", b"", "no glTF"),
        ("a.glb", b"glTF" + b"\2\0\0\0" + b"\xff" * 12, "GLB"),
        ("a.gltf", b'{"asset": {"version": "1.0"}}', "version 2"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "nodes": [{"children": [0]}]}', "no node animation"),
        ("a.gltf", b"[" * 100_000, "a.gltf"),
        ("a.json", b"{}", "a.json"),
        ("a.json", b'{"format": "sonic-bullet-animation/1", "fps": "1/0", "bodies": []}', "fps"),
        ("a.json", b'{"format": "sonic-bullet-animation/1", "fps": 24, "bodies": [], "x": 1}', "x"),
        ("a.json", b'{"format": "sonic-bullet-animation/1", "fps": "1e99999999", "bodies": []}', "fps"),
        ("a.npz", b"PK", "a.npz"),
        ("a.abc", b"", ".glb"),
    ],
)
def test_a_file_that_is_none_is_one_line(tmp_path: Path, name: str, body: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(body)
    with pytest.raises(SonicBulletError, match=said) as caught:
        assemble_animation(read_animation(tmp_path / name))
    assert "\n" not in str(caught.value)


def test_what_a_glb_claims_is_checked(tmp_path: Path) -> None:
    keys = dropped()
    write_glb(tmp_path / "a.glb", keys)
    raw = (tmp_path / "a.glb").read_bytes()
    size = int.from_bytes(raw[12:16], "little")
    tree, data = json.loads(raw[20 : 20 + size]), raw[28 + size :]
    wrong = {
        "claims more bytes": lambda t: t["accessors"][1].update(count=10**9),
        "shorter than it claims": lambda t: t["buffers"][0].update(byteLength=10**9),
        "outside": lambda t: t["buffers"][0].update(uri="../../etc/passwd"),
        "names no vertex": lambda t: t["accessors"][2].update(bufferView=1, componentType=5125, count=18),
        "compressed": lambda t: t.update(extensionsRequired=["KHR_draco_mesh_compression"]),
        "cut or no": lambda t: t["nodes"][0].update(mesh=77),
        "a scale of zero": lambda t: t["animations"][0]["channels"].append(
            {"sampler": 0, "target": {"node": 1, "path": "scale"}}
        ),
    }
    for said, change in wrong.items():
        one = json.loads(json.dumps(tree))
        change(one)
        write_tree(tmp_path / "b.glb", one, data)
        with pytest.raises(SonicBulletError, match=said):
            assemble_animation(read_animation(tmp_path / "b.glb"))


def test_any_bytes_of_a_glb_may_be_wrong(tmp_path: Path) -> None:
    """Whatever is overwritten or cut, there is an animation or one of our errors."""
    write_glb(tmp_path / "a.glb", dropped(24))
    raw, rng = (tmp_path / "a.glb").read_bytes(), np.random.default_rng(2)
    refused = 0
    for _ in range(150):
        one = bytearray(raw)
        for at in rng.integers(0, len(one), rng.integers(1, 30)):
            one[at] = rng.integers(0, 256)
        (tmp_path / "b.glb").write_bytes(one[: rng.integers(1, len(one)) if rng.random() < 0.2 else len(one)])
        try:
            made = assemble_animation(read_animation(tmp_path / "b.glb"))[0]
            assert isinstance(made, Animation)
        except SonicBulletError:
            refused += 1
    assert refused > 30


def changed(path: Path, change: Callable[[dict[str, Any], bytearray], None]) -> None:
    """A GLB, its tree and bytes changed in place."""
    raw = path.read_bytes()
    size = int.from_bytes(raw[12:16], "little")
    tree, data = json.loads(raw[20 : 20 + size]), bytearray(raw[28 + size :])
    change(tree, data)
    write_tree(path, tree, bytes(data))


def times(tree: dict[str, Any], data: bytearray) -> np.ndarray:
    """The times of the keys of `write_glb`, to be written to."""
    view = tree["bufferViews"][0]
    return np.frombuffer(data, "<f4", view["byteLength"] // 4, view["byteOffset"])


def test_a_late_first_key_is_said(tmp_path: Path) -> None:
    """The sound begins with the first key, where a player holds it from 0 on."""
    write_glb(tmp_path / "a.glb", dropped(60))
    assert not read_animation(tmp_path / "a.glb").notes
    changed(tmp_path / "a.glb", lambda tree, data: np.add(t := times(tree, data), 2, out=t))
    late = read_animation(tmp_path / "a.glb")
    assert len(late.objects[0].position_m) == len(dropped(60).position_m["box"])
    assert any("first key is at 2.000 s" in note for note in late.notes)


@pytest.mark.parametrize(
    ("rate", "seconds"),
    [(240.0, 90), (24000 / 1001, 600), (30000 / 1001, 30), (60000 / 1001, 2), (25.0, 3600), (12.5, 60), (59.9, 60)],
)
def test_the_rate_of_baked_keys_is_that_of_all_of_them(rate: float, seconds: float) -> None:
    """Distances of float32 times are off by ten millionths of their time: 8 µs of 4 ms after 90 s."""
    key = (np.arange(round(seconds * rate)) / rate).astype(np.float32).astype(float)
    found = rate_of_keys([key[:5], key])
    assert abs(found / rate - 1) * seconds * rate < 0.05  # of a frame, at the end
    assert found == rate or not rate.is_integer()
    assert nearest_rate(29.96) == 29.96


def test_a_small_file_does_not_take_all_memory(tmp_path: Path) -> None:
    """One key that is late is thousands of frames; what they are is said, and not tried."""
    write_glb(tmp_path / "a.glb", dropped(240))
    changed(tmp_path / "a.glb", lambda tree, data: times(tree, data).__setitem__(-1, 8000.0))
    with pytest.raises(AnimationError, match=r"frames of 2 nodes.*--fps"):
        read_animation(tmp_path / "a.glb")
