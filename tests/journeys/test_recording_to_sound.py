"""Recordings -> case -> fit -> diagnose -> preset -> modes, scene, score, replay -> sound: by the command line, in a
folder of its own, and the last sound decays as the first was diagnosed.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

import sonic_bullet
from sonic_bullet import modal
from sonic_bullet.effects.amplitude_damping import AmplitudeDamping
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.room import Room
from sonic_bullet.records import Material
from sonic_bullet.records.errors import MaterialError
from sonic_bullet.session.arguments import as_material
from tests.apps.cli.test_commands import run
from tests.made.case import SR, sound, write_box
from tests.made.lines import line_at

SIZE_M, ETA = (0.16, 0.03, 0.008), 3e-3
PLACES = ((0.0475, 0.0075), (-0.06, 0.012), (0.075, -0.01), (-0.025, -0.0125))
SCENE = """
import pybullet as p
import sonic_bullet as sb

SECONDS = 0.4
MICROPHONE = (0.0, -0.5, 0.5)


def build(client):
    bar = client.createMultiBody(0.3, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.08, 0.015, 0.004]))
    ball = client.createMultiBody(
        0.002, client.createCollisionShape(p.GEOM_SPHERE, radius=0.004), basePosition=[0.07, 0.01, 0.0085]
    )
    client.resetBaseVelocity(ball, [0, 0, -1.0])
    for body in (bar, ball):
        client.changeDynamics(body, -1, restitution=0.6, linearDamping=0, angularDamping=0)
    sb.keep_restitution(client)
    return {bar: {"material": "d.json", "name": "bar"}}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def record(folder: Path) -> list[dict[str, Any]]:
    """WAVs of a bar of brass whose loss factor is constant, as a vibrometer at its corner reads them; their strikes."""
    brass = Material.isotropic("brass", youngs_pa=1.05e11, poisson=0.33, density_kg_m3=8500.0)
    write_box(folder / "bar.obj", SIZE_M)
    model = modal.analyse((modal.read_mesh(folder / "bar.obj"),), brass, to_hz=12_000)
    decay = ETA * np.pi * model.freq_hz
    rng, up = np.random.default_rng(2), np.array([0, 0, 1.0])
    top = np.flatnonzero(model.vertex_m[:, 2] > SIZE_M[2] / 2 - 1e-9)
    corner = int(top[np.argmax(model.vertex_m[top] @ (1.0, 1.0, 0))])
    strikes = []
    for i, place in enumerate(PLACES):
        at = int(top[np.argmin(((model.vertex_m[top, :2] - place) ** 2).sum(axis=1))])
        impulse = 0.004 * (1 + i)
        made = 5 * sound(model, decay, (at, corner), (-up, up), impulse, int(0.2 * SR))
        soundfile.write(folder / f"s{i}.wav", made + 1e-5 * rng.standard_normal(len(made)), SR, subtype="FLOAT")
        strikes.append({"position": model.vertex_m[at].tolist(), "direction": [0, 0, -1], "impulse": impulse})
    return strikes


def test_from_recordings_to_a_scene_that_sounds_as_diagnosed(folder: Path) -> None:
    strikes = record(folder)
    corner = ",".join(str(0.5 * x) for x in SIZE_M)
    new = ["case", "new", "bar", "--recordings", *(f"s{i}.wav" for i in range(len(strikes))), "--mesh", "bar.obj"]
    new += ["--material", "brass", "--sensor", "velocity", "--sensor-at", corner, "--sensor-direction", "0,0,1"]
    assert run(*new, "--medium", "none") == 0
    case = json.loads(Path("bar/case.json").read_text())
    for entry, strike in zip(case["recordings"], strikes, strict=True):
        entry["strike"] = strike
    case["band_hz"], case["onset"] = [20, 12_000], "the impulse arrives at sample 0 of every file"
    Path("bar/case.json").write_text(json.dumps(case))
    assert run("fit", "bar", "-o", "fit.json") == 0
    assert run("diagnose", "bar", "-o", "d.json", "--json", "verdict.json") == 0

    verdict, preset = (json.loads(Path(name).read_text()) for name in ("verdict.json", "d.json"))
    assert verdict["verdict"] == preset["provenance"]["verdict"] == "explained"
    assert [one["id"] for one in verdict["effects"]] == [one["id"] for one in preset["effects"]] == ["damping-law"]
    assert preset["effects"][0]["eta"] == pytest.approx(ETA, rel=0.02)

    assert run("modes", "bar.obj", "--material", "d.json", "--to-hz", 9000, "--json", "m.json") == 0
    modes = json.loads(Path("m.json").read_text())["modes"]
    for one in modes:
        assert one["decay_per_s"] == pytest.approx(ETA * np.pi * one["freq_hz"], rel=0.02)

    Path("scene.py").write_text(SCENE)
    assert run("render", "scene.py", "-o", "a.wav", "--contacts", "a.npz") == 0
    assert decays("a.wav", [one["freq_hz"] for one in modes])
    assert run("render", "a.npz", "-o", "b.wav") == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()
    shutil.copy("scene.py", "again.py")
    assert run("compare", "scene.py", "again.py") == 0
    Path("again.py").write_text(SCENE.replace("d.json", "fit.json"))
    assert run("compare", "scene.py", "again.py") == 1  # the law is heard


def decays(file: str, freq_hz: list[float]) -> int:
    """How many of the loudest lines decay by the law, all of them within 2 %."""
    samples, sr = soundfile.read(file, dtype="float64")
    start = np.argmax(np.abs(samples) > 0.02 * np.abs(samples).max()) / sr
    checked = 0
    hz = np.array(freq_hz)
    for f in hz[:2]:
        if np.sort(np.abs(hz - f))[1] < 200:
            continue
        _, decay, _ = line_at(samples, sr, f, start + 0.03, start + 0.03 + 1.5 / (ETA * np.pi * f))
        assert decay == pytest.approx(ETA * np.pi * f, rel=0.02), f
        checked += 1
    return checked


def test_a_preset_with_effects_is_a_material_wherever_one_is_asked_for(client: Any) -> None:
    """`listener.add` raised TypeError of it."""
    preset = json.loads((sonic_bullet.files.presets.TABLES_FOLDER / "steel.json").read_text())
    preset["effects"] = [{"id": "damping-law", "law": "constant-loss", "eta": 2e-3}]
    Path("d.json").write_text(json.dumps(preset))
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.08, 0.015, 0.004])
    first, second = (client.createMultiBody(0.3, shape, basePosition=[0, 0, z]) for z in (0.5, 1.0))
    listener = sonic_bullet.attach(client)
    listener.add(first, material="d.json")
    listener.add_all({second: sonic_bullet.load_material("d.json")})
    for body in listener.world.bodies:
        if body.model is not None:
            assert body.model.decay_per_s == pytest.approx(2e-3 * np.pi * body.model.freq_hz, rel=1e-3)


@pytest.mark.parametrize(
    ("effect", "says"),
    [
        (DampingLaw("constant-loss", 1e-3), ""),
        (AmplitudeDamping(2.0), ""),
        (DampingLaw, "give effects"),
        ("damping-law", "give effects"),
        (ContactTime(1e-4, 0.01), "belongs to a strike or a recording"),
        (Room, "give effects"),
    ],
    ids=str,
)
def test_effects_that_no_scene_plays_are_named(effect: Any, says: str) -> None:
    steel = sonic_bullet.load_material("steel")
    made = Material("odd", 7850.0, steel.stiffness_pa, 1.0, 1e-9, effects=(effect,))
    if not says:
        assert as_material(made) is made
        return
    with pytest.raises(MaterialError, match=says):
        as_material(made)
