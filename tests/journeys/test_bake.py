"""A mesh's modal sound goes out for another engine, comes back, and sounds as ours does."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.apps import bake
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.files import ContactLog, write_log
from sonic_bullet.records import Air, Array, Body, Microphone
from sonic_bullet.records.contacts import ROW_FIELDS, Contacts, Step
from tests.apps.cli.called_here import call_here
from tests.few_cases import parametrize_few
from tests.made import baked as made
from tests.made.case import write_box
from tests.made.models import UPRIGHT, box_body

REPO = Path(__file__).resolve().parents[2]
TO_HZ, SECONDS = 9000.0, 2.0
BODIES: dict[str, tuple[str, float]] = {"bowl": ("steel", 1.0), "bar": ("glass", 1.0), "tile": ("ceramic-mug", 1e-3)}
"""Name of a mesh -> its material, and metres per unit of its file."""


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("meshes")
    shutil.copy(REPO / "assets" / "bowl.obj", folder)
    write_box(folder / "bar.obj", (0.2, 0.02, 0.006))
    write_box(folder / "tile.obj", (90.0, 60.0, 7.0))
    return folder


def bake_here(folder: Path, name: str, output: str, *words: str) -> Any:
    material, scale = BODIES[name]
    done = call_here(
        folder, "bake", f"{name}.obj", "--material", material, "--scale", str(scale), "--to-hz", str(TO_HZ),
        "-o", output, *words,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done


def own_body(folder: Path, name: str) -> Body:
    material, scale = BODIES[name]
    return made.solved_body(folder / f"{name}.obj", material, scale, to_hz=TO_HZ)


def strike_at_vertex(folder: Path, name: str, vertex: int) -> tuple[bake.BakedStrike, Array]:
    place = made.own_vertices(folder / f"{name}.obj")[vertex] * BODIES[name][1]
    impulse = np.array([0.004, -0.006, 0.008])
    return bake.BakedStrike(place, impulse, 3e-4), impulse


@parametrize_few(
    ("name", "end"), [("bowl", "glb"), ("bar", "json"), ("tile", "gltf"), ("tile", "glb"), ("bowl", "json")], 3
)
def test_a_body_goes_out_and_comes_back(meshes: Path, name: str, end: str) -> None:
    bake_here(meshes, name, f"{name}.{end}")
    (model,) = sb.read_baked(meshes / f"{name}.{end}")
    body = own_body(meshes, name)
    ours = build_resonator(body, (), 384_000, Air())
    order = np.argsort(model.freq_hz, kind="stable")
    np.testing.assert_array_equal(model.freq_hz[order], np.sort(ours.omega_rad_s / (2 * np.pi)))
    own = made.own_vertices(meshes / f"{name}.obj") * BODIES[name][1]
    np.testing.assert_allclose(model.point_m, own, rtol=2**-24, atol=1e-9)
    shape = made.shapes_at(body.model, ours.shape, ours.index, own)
    for mode in order:  # equal frequencies: any order of the two is right
        near = np.flatnonzero(np.abs(ours.omega_rad_s / (2 * np.pi) - model.freq_hz[mode]) < 1e-9)
        right = [
            ours.decay_per_s[k] == model.decay_per_s[mode]
            and np.allclose(shape[:, :, k], model.shape[:, :, mode], rtol=1e-6, atol=1e-6 * np.abs(shape).max())
            for k in near
        ]
        assert any(right), mode
    strike, _ = strike_at_vertex(meshes, name, 3)
    assert (
        made.error_db(bake.render_strike(model, strike, seconds=SECONDS), made.bank_strike(body, strike, SECONDS)) < -90
    )
    assert (model.decay_per_s >= np.interp(model.freq_hz, body.model.freq_hz, body.model.decay_per_s) * 0.999).all()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on PATH")
@parametrize_few(("name", "contact_s"), [("bar", 3e-4), ("bowl", 2e-3), ("tile", 0.0)], 1)
def test_the_c_bank_plays_our_strike(meshes: Path, name: str, contact_s: float) -> None:
    bake_here(meshes, name, f"{name}.h", "--points", "40")
    bake_here(meshes, name, f"{name}.json", "--points", "40")
    (model,) = sb.read_baked(meshes / f"{name}.json")
    impulse, point = np.array([0.004, -0.006, 0.008]), 7
    played = made.played_by_c(meshes / f"{name}.h", point, impulse, contact_s, 48_000)
    strike = bake.BakedStrike(model.point_m[point], impulse, contact_s)
    assert made.error_db(played, made.bank_strike(own_body(meshes, name), strike, 1.0)) < -80
    lines = (meshes / f"{name}.h").read_text().splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith("/* Silence"))
    assert len(lines) - begin < 100


@pytest.mark.skipif(shutil.which("faust") is None, reason="no faust on PATH")
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on PATH")
@parametrize_few(("name", "contact_s"), [("bar", 1e-4), ("tile", 2e-4), ("bowl", 5e-5)], 1)
def test_faust_plays_our_strike(meshes: Path, name: str, contact_s: float) -> None:
    bake_here(meshes, name, f"{name}.dsp", "--points", "30")
    bake_here(meshes, name, f"{name}.json", "--points", "30")
    (model,) = sb.read_baked(meshes / f"{name}.json")
    point = 5
    strike = bake.choose_strike(model, point_m=model.point_m[point], impulse_n_s=0.02, contact_s=contact_s)
    played = made.played_by_faust(meshes / f"{name}.dsp", point, 0.02, contact_s, 48_000)
    ours = made.bank_strike(own_body(meshes, name), strike, 1.0)
    gap = made.third_octave_db(played) - made.third_octave_db(ours)
    assert np.isfinite(gap).sum() >= 3
    assert np.nanmax(np.abs(gap)) < 1


def test_one_strike_as_a_wav(meshes: Path) -> None:
    bake_here(meshes, "bar", "tap.wav", "--strike", "0.1,0.01,0.003", "--impulse", "0.02", "--contact", "0.2")
    sound, sr = sb.read_audio(meshes / "tap.wav")
    strike = bake.BakedStrike(np.array([0.1, 0.01, 0.003]), np.array([0, 0, 0.02]), 2e-4)
    bake_here(meshes, "bar", "bar.json")
    chosen = bake.choose_strike(sb.read_baked(meshes / "bar.json")[0], point_m=strike.point_m, impulse_n_s=0.02)
    ours = made.bank_strike(own_body(meshes, "bar"), bake.BakedStrike(strike.point_m, chosen.impulse_n_s, 2e-4), 1.0)
    count = min(len(ours), sound.shape[1])
    assert sr == made.SR
    assert made.error_db(sound[0, :count], ours[:count]) < -90


def test_fewer_modes_and_points_are_the_important_ones(meshes: Path) -> None:
    bake_here(meshes, "bowl", "all.json")
    done = bake_here(meshes, "bowl", "few.json", "--modes", "8", "--points", "50", "--json")
    (everything,), (few,) = sb.read_baked(meshes / "all.json"), sb.read_baked(meshes / "few.json")
    np.testing.assert_array_equal(few.freq_hz, everything.freq_hz[:8])
    assert len(few.point_m) == 50
    assert len(few.face) > 50
    said = json.loads(done.stdout)["bodies"][0]
    assert [len(said["modes"]), said["points"], said["name"]] == [8, 50, "bowl"]
    own = {tuple(row) for row in everything.point_m}
    assert all(tuple(row) in own for row in few.point_m)


def log_of_bodies(path: Path, count: int) -> tuple[Body, ...]:
    """A contact log of bodies that stand apart, one of them silent for want of a material."""
    bodies = [box_body([0.1 + 0.01 * i, 0.05, 0.01], (300.0 + 40 * i, 1500.0, 4100.0), body_id=i) for i in range(count)]
    bodies.append(replace(box_body([1, 1, 0.1], (), body_id=count, mass_kg=0), material=None, model=None))
    place = np.arange(3.0 * len(bodies)).reshape(-1, 3)
    step = Step(
        1 / 240,
        place,
        np.tile(UPRIGHT, (len(bodies), 1)),
        np.zeros(len(bodies), bool),
        Contacts(**{name: np.zeros((0, *tail), kind) for name, (kind, tail) in ROW_FIELDS.items()}),
    )
    write_log(path, ContactLog(tuple(bodies), (step,), (Microphone([0, 0, 1]),), made.SR, 0))
    return tuple(bodies[:count])


def test_ten_bodies_of_a_log_go_out_and_come_back(tmp_path: Path) -> None:
    bodies = log_of_bodies(tmp_path / "ten.npz", 10)
    assert call_here(tmp_path, "bake", "ten.npz", "-o", "ten.glb").returncode == 0
    found = sb.read_baked(tmp_path / "ten.glb")
    assert [one.name for one in found] == [body.name for body in bodies]
    for model, body in zip(found, bodies, strict=True):
        ours = build_resonator(body, (), 384_000, Air())
        order = np.argsort(model.freq_hz)
        np.testing.assert_array_equal(model.freq_hz[order], ours.omega_rad_s / (2 * np.pi))
        np.testing.assert_array_equal(model.decay_per_s[order], ours.decay_per_s)
        np.testing.assert_allclose(model.shape[:, :, order], ours.shape, rtol=1e-6)
        strike = bake.choose_strike(model)
        again = bake.render_strike(model, strike, seconds=1.0)
        assert made.error_db(again, made.bank_strike(body, strike, 1.0)) < -90
    one = call_here(tmp_path, "bake", "ten.npz", "--body", "box4", "-o", "one.h")
    assert one.returncode == 0, one.stderr
    assert "box4_strike" in (tmp_path / "one.h").read_text()


@pytest.mark.slow
def test_the_bodies_of_a_scene(tmp_path: Path) -> None:
    (tmp_path / "scene.py").write_text(
        "def build(client):\n"
        "    table = client.createMultiBody(0, client.createCollisionShape(3, halfExtents=[0.3, 0.2, 0.01]))\n"
        "    bar = client.createMultiBody(0.19, client.createCollisionShape(3, halfExtents=[0.12, 0.01, 0.005]), "
        "basePosition=[0, 0, 0.3])\n"
        "    return {bar: 'steel'}\n"
    )
    done = call_here(tmp_path, "bake", "scene.py", "-o", "bodies.json", "--points", "60")
    assert done.returncode == 0, done.stderr
    (model,) = sb.read_baked(tmp_path / "bodies.json")
    assert model.material.name == "steel"
    assert model.freq_hz.min() == pytest.approx(911, rel=0.03)  # 22.373/2πL² √(EI/ρA)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("bar.obj", "-o", "bar.xml"), ".xml"),
        (("bar.obj", "-o", "nowhere/bar.glb"), "no folder"),
        (("none.obj", "-o", "bar.glb"), "none.obj"),
        (("bar.obj", "-o", "bar.glb", "--scale", "0"), "scale"),
        (("bar.obj", "-o", "bar.glb", "--scale", "-1"), "scale"),
        (("bar.obj", "-o", "bar.glb", "--modes", "0"), "--modes"),
        (("bar.obj", "-o", "bar.glb", "--points", "2"), "--points"),
        (("bar.obj", "-o", "bar.glb", "--below", "0"), "--below"),
        (("bar.obj", "-o", "bar.glb", "--strike", "0,0,0"), "--strike"),
        (("bar.obj", "-o", "bar.glb", "--material", "cheese"), "cheese"),
        (("bar.obj", "-o", "bar.glb", "--material", "a=steel"), "--material"),
        (("bar.obj", "-o", "bar.glb", "--body", "bar"), "--body"),
        (("bar.obj", "-o", "tap.wav", "--direction", "0,0,0"), "direction"),
        (("bar.obj", "-o", "bar.glb", "--to-hz", "20"), "no modes"),
        (("two.npz", "-o", "two.h"), "--body"),
        (("two.npz", "-o", "two.json", "--body", "boz0"), "box0"),
        (("two.npz", "-o", "two.json", "--to-hz", "4000"), "--to-hz"),
    ],
)
def test_what_cannot_be_is_one_line(meshes: Path, words: tuple[str, ...], said: str) -> None:
    if words[0] == "two.npz":
        log_of_bodies(meshes / "two.npz", 2)
    before = set(meshes.iterdir())
    done = call_here(meshes, "bake", *words)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert said in done.stderr
    assert set(meshes.iterdir()) == before
