"""Every effect that a preset can hold, in a film, a score and an environment: what each sounds is what `render` sounds
of the same motion with the same preset, which `test_presets_with_effects` holds against closed forms.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet import attach
from sonic_bullet.effects.presets_of_effects import KEPT_EFFECTS
from sonic_bullet.files import presets, read_audio, read_log
from sonic_bullet.simulators import direct_client, disconnect
from tests.apps.cli.test_commands import run
from tests.made.animations import Keys, box_mesh, keyframes
from tests.made.films import decoded

SR, FPS, STEPS = 24_000, 240, 72
BAR_M, FLOOR_M = (0.2, 0.012, 0.012), (1.0, 1.0, 0.1)
SCENE = """
SECONDS = 0.3
MICROPHONE = (0, -0.4, 0.3)


def build(client):
    client.setGravity(0, 0, -9.81)
    floor = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.5, 0.5, 0.05])
    client.createMultiBody(0, floor, basePosition=[0, 0, -0.05])
    bar = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.006, 0.006])
    turn = client.getQuaternionFromEuler([0.3, 0.2, 0])
    bar = client.createMultiBody(0.2, bar, basePosition=[0, 0, 0.06], baseOrientation=turn)
    client.changeDynamics(bar, -1, restitution=0.6, contactProcessingThreshold=0)
    return {bar: {"material": "d.json", "name": "bar", "to_hz": 9000}}
"""
TOTAL = {"loss_factor": None, "equal_at_hz": None, "alpha_per_s": 2.0, "beta_s": 1e-9, "includes_radiation": True}
ETA = 4e-3
METAL = {"youngs_pa": 2e11, "poisson": 0.29, "density_kg_m3": 7860.0}


EFFECTS = [*(kind.id for kind in KEPT_EFFECTS), "orthotropy"]


def groups(effect: str) -> dict[str, Any]:
    """Of a preset that holds this effect alone. The bar is square: its lowest mode is there twice."""
    stiffness = presets.load_material("steel").stiffness_pa.copy()
    stiffness[0, 0] *= 0.7
    tensor = {"youngs_pa": None, "poisson": None, "stiffness_pa": stiffness.tolist(), "source": "made"}
    if effect == "orthotropy":
        return {"elasticity": tensor}
    (pair,) = (float(body.model.freq_hz[0]) for body in read_log("plain.npz").bodies if body.model is not None)
    lines = {"freq_hz": [700.0, 1900.0], "decay_per_s": [6.0, 9.0], "amplitude": [1.0, 0.5], "spread_db": [0.0, 0.0]}
    each: dict[str, dict[str, Any]] = {
        "damping-law": {"law": "constant-loss", "eta": ETA},
        "thermoelastic": {**METAL, "expansion_per_k": 6e-4, "conductivity_w_m_k": 50.0, "heat_capacity_j_kg_k": 490.0},
        "mode-splitting": {"freq_hz": [pair], "split": [0.04], "turn_rad": [0.8]},
        "amplitude-pitch": {"bend": 6.0, "measure": "velocity"},
        "amplitude-damping": {"choke": 25.0, "measure": "velocity", "power": 1},
        "recorded-lines": lines,
    }
    return {"effects": [{"id": effect, **each[effect]}]}


def write_preset(name: str, effect: str | None) -> None:
    data = json.loads((presets.TABLES_FOLDER / "steel.json").read_text())
    for key, value in {"damping": TOTAL, **({} if effect is None else groups(effect))}.items():
        data[key] = {**data[key], **value} if isinstance(value, dict) else value
    Path(name).write_text(json.dumps(data))


@cache
def falling_bar() -> Keys:
    """Poses of the bar of SCENE."""
    client = direct_client()
    names: dict[str, Any] = {}
    try:
        exec(SCENE, names)
        (bar,) = names["build"](client)
        poses = [client.getBasePositionAndOrientation(bar)]
        for _ in range(STEPS):
            client.stepSimulation()
            poses.append(client.getBasePositionAndOrientation(bar))
    finally:
        disconnect(client)
    still, count = np.array([0, 0, -FLOOR_M[2] / 2]), len(poses)
    return Keys(
        float(FPS),
        {"floor": box_mesh(FLOOR_M), "bar": box_mesh(BAR_M)},
        {"floor": np.broadcast_to(still, (count, 3)), "bar": np.array([place for place, _ in poses])},
        {"floor": np.broadcast_to([0.0, 0, 0, 1], (count, 4)), "bar": np.array([turn for _, turn in poses])},
    )


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scene in plain steel, rendered, and the score of its motion in plain steel."""
    folder = tmp_path_factory.mktemp("effects")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_preset("plain.json", None)
        Path("scene.py").write_text(SCENE)
        Path("score.json").write_text(json.dumps(keyframes(falling_bar())))
        write_preset("d.json", None)
        assert run("render", "scene.py", "-o", "plain.wav", "--contacts", "plain.npz") == 0
        score_with("plain")
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def score_with(name: str) -> None:
    """The motion in a file's material -> s-NAME.wav and s-NAME.npz."""
    Path("table.json").write_text(json.dumps([{"name": "bar", "material": f"{name}.json"}]))
    more = ("--sr", SR, "--pascals", "--contacts", f"s-{name}.npz")
    assert run("score", "score.json", "--materials", "table.json", "-o", f"s-{name}.wav", *more) == 0


def differ(one: np.ndarray, other: np.ndarray) -> float:
    """The largest difference, over the largest sample."""
    most = min(len(one), len(other))
    return float(np.abs(one[:most] - other[:most]).max() / np.abs(other).max())


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_film_sounds_as_the_render_with_it(effect: str) -> None:
    pytest.importorskip("av")
    write_preset("d.json", effect)
    assert run("render", "scene.py", "-o", "a.wav") == 0
    assert run("film", "scene.py", "-o", "a.mov", "--size", "64x48", "--fps", "10") == 0
    sound, film = soundfile.read("a.wav")[0], decoded(Path("a.mov")).sound
    assert differ(film, sound) < 2**-20 and differ(read_audio("plain.wav")[0][0], read_audio("a.wav")[0][0]) > 0.01
    # and of the log in plain steel, its bar made of the preset
    assert run("film", "plain.npz", "-o", "b.mov", "--size", "64x48", "--fps", "10", "--material", "bar=d.json") == 0
    assert differ(decoded(Path("b.mov")).sound, sound) < 2**-20


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_score_sounds_as_the_log_of_its_motion_with_it(effect: str) -> None:
    write_preset("d.json", effect)
    score_with("d")
    assert run("render", "s-plain.npz", "-o", "r.wav", "--material", "bar=d.json", "--pascals") == 0
    score, log, plain = (soundfile.read(name)[0] for name in ("s-d.wav", "r.wav", "s-plain.wav"))
    assert differ(score, log) < 1e-6 and differ(plain, score) > 0.01
    if effect == "damping-law":
        (model,) = (body.model for body in read_log("s-d.npz").bodies if body.model is not None)
        np.testing.assert_allclose(model.decay_per_s, 0.5 * ETA * np.sqrt(model.omega0_squared_per_s2), rtol=1e-4)


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_agent_hears_what_a_listener_hears_with_it(effect: str) -> None:
    pytest.importorskip("gymnasium")
    from sonic_bullet.apps.environments import SoundObservation
    from tests.made.environments import FallingBox

    write_preset("d.json", effect)
    where = (0.0, -0.4, 0.3)

    class FallingBar(FallingBox):
        def build(self) -> None:
            names: dict[str, Any] = {}
            exec(SCENE, names)
            self.physics.setTimeStep(self.dt_s)
            (self.body,) = names["build"](self.physics)

    def heard(preset: str) -> np.ndarray:
        how = {1: {"material": preset, "to_hz": 9000.0}}
        environment = SoundObservation(FallingBar(), SR, microphones=where, materials=how)
        try:
            environment.reset(seed=1)
            made = []
            for _ in range(STEPS // 4):
                observation, *_, info = environment.step(np.zeros(3, np.float32))
                made.append(observation["audio"][0, -info["audio_count"] :])
            return np.concatenate(made)
        finally:
            environment.close()

    inner = FallingBar()
    try:
        inner.reset(seed=1)
        listener = attach(inner.physics, microphone=where, sr=SR)
        listener.add(1, material="d.json", to_hz=9000.0)
        for _ in range(STEPS // 4):
            inner.step(np.zeros(3, np.float32))
        want = listener.read()[0]
        listener.detach()
    finally:
        inner.close()
    sound = heard("d.json")
    assert differ(sound, want) < 1e-6 and differ(heard("plain.json"), want) > 0.01
