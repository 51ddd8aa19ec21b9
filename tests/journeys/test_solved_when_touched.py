"""Modes are solved for what sounds: who is touched by nobody, or only rests, costs nothing and is named."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonic_bullet.files import read_audio, read_log
from sonic_bullet.session import Listener, attach
from sonic_bullet.simulators import direct_client, disconnect
from tests.apps.cli.test_commands import run

SCENE = """
import pybullet as p
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
box = lambda *half: p.createCollisionShape(p.GEOM_BOX, halfExtents=half)
p.createMultiBody(0, box(0.15, 0.1, 0.005))
p.createMultiBody(0.1, box(0.06, 0.008, 0.004), basePosition=[0, 0, 0.05])
p.createMultiBody(0, box(0.2, 0.2, 0.005), basePosition=[2, 0, 0])
p.createMultiBody(0.3, box(0.05, 0.05, 0.004), basePosition=[2, 0, 0.009])
p.createMultiBody(0, box(0.1, 0.1, 0.01), basePosition=[-2, 0, 0])
for _ in range(60): p.stepSimulation()
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the scene was rendered."""
    folder = tmp_path_factory.mktemp("touched")
    (folder / "scene.py").write_text(SCENE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        command = ["render", "scene.py", "-o", "a.wav", "--material", "steel", "--contacts", "a.npz"]
        assert run(*command, "--sr", "24000", "--json", "a.json") == 0
    return folder


def test_what_nobody_struck_is_named_and_not_solved(place: Path) -> None:
    told = json.loads((place / "a.json").read_text())
    modes = {body["body"]: body["modes"] for body in told["bodies"]}
    assert modes[0] and modes[1]
    assert modes[2] is None and modes[3] is None and modes[4] is None
    notes = "\n".join(told["notes"])
    assert "touched by nobody, so silent: body 4" in notes
    assert "no blow and no slide that could be heard, so its modes were not solved: body 2, body 3" in notes


def test_the_log_gives_the_same_bits(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    assert run("render", "a.npz", "-o", "b.wav") == 0
    assert (place / "a.wav").read_bytes() == (place / "b.wav").read_bytes()
    models = [body.model for body in read_log("a.npz").bodies]
    assert [model is not None and model.unsolved for model in models] == [False, False, True, True, True]
    assert all(model is not None and len(model.face) for model in models)  # a film draws them


def build(client: Any, **how: Any) -> tuple[Listener, list[int]]:
    """A bar that falls on a board, another that falls on it later, and one that nothing touches."""
    client.setGravity(0, 0, -9.81)
    listener = attach(client, sr=16_000, **how)

    def box(half: list[float], mass: float, place: list[float]) -> int:
        made: int = client.createMultiBody(
            mass, client.createCollisionShape(client.GEOM_BOX, halfExtents=half), -1, place
        )
        return made

    bodies = [
        box([0.15, 0.1, 0.005], 0, [0, 0, 0]),
        box([0.05, 0.02, 0.002], 0.1, [1, 0, 0]),
        box([0.06, 0.008, 0.004], 0.1, [0, 0.05, 0.03]),
        box([0.06, 0.009, 0.003], 0.1, [0, -0.05, 0.12]),
    ]
    listener.add_all(dict.fromkeys(bodies, "steel"))
    return listener, bodies


def heard(how: str, **options: Any) -> tuple[np.ndarray, list[bool]]:
    client = direct_client()
    listener, _ = build(client, **options)
    if how == "all at once":
        listener.solve_all()
    frames = []
    for number in range(80):
        client.stepSimulation()
        if how == "frame by frame" or (how == "now and then" and number % 25 == 20):
            frames.append(listener.frame)
        if number == 30:
            listener.quench()
    sound = listener.sound() if options.get("keep_sound", True) else np.concatenate(frames, axis=1)
    solved = (
        [body.model is not None and not body.model.unsolved for body in listener.contacts.bodies]
        if options.get("keep_log", True)
        else []
    )
    disconnect(client)
    return sound, solved


def test_modes_that_come_at_the_first_touch_give_the_bits_of_modes_that_were_there() -> None:
    reference, everyone = heard("all at once")
    assert all(everyone) and np.abs(reference).max() > 1e-3
    for how in ("at the end", "frame by frame", "now and then"):
        sound, solved = heard(how)
        assert solved == [True, False, True, True], how
        assert np.array_equal(sound, reference), how


def test_without_a_log_the_first_touch_waits_too() -> None:
    reference, _ = heard("frame by frame", keep_log=False)
    other, _ = heard("frame by frame")
    assert np.array_equal(reference, other)


def test_a_model_that_is_read_is_solved() -> None:
    client = direct_client()
    listener, bodies = build(client)
    (model,) = listener.add(bodies[1], material="glass")
    assert model.mode_count > 0 and not model.unsolved
    disconnect(client)


def test_a_draft_says_so_and_sounds_alike(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    how = ["--material", "steel", "--sr", "24000", "--pascals"]
    assert run("render", "scene.py", "-o", "full.wav", *how) == 0
    assert run("render", "scene.py", "-o", "draft.wav", *how, "--draft", "--json", "d.json", "--contacts", "d.npz") == 0
    told = json.loads((place / "d.json").read_text())
    assert any(note.startswith("a draft: the modes of 2 bodies are few") for note in told["notes"])
    assert {body.model.solution for body in read_log("d.npz").bodies if body.model is not None} == {"draft", "none"}
    assert run("render", "d.npz", "-o", "again.wav", "--pascals") == 0
    assert Path("again.wav").read_bytes() == Path("draft.wav").read_bytes()
    level = [octaves_db(name) for name in ("full.wav", "draft.wav")]
    assert np.abs(level[1] - level[0]).max() < 6


def octaves_db(name: str) -> np.ndarray:
    """Level in the octaves of 250 Hz to 8 kHz."""
    (sound,), sr = read_audio(name)
    power, freq = np.abs(np.fft.rfft(sound)) ** 2, np.fft.rfftfreq(len(sound), 1 / sr)
    edges = 250 * 2.0 ** np.arange(-0.5, 6)
    return np.array([10 * np.log10(power[(freq >= a) & (freq < b)].sum()) for a, b in pairwise(edges)])


def test_the_loudest_is_solved_first(monkeypatch: pytest.MonkeyPatch) -> None:
    from sonic_bullet.session import body_requests

    solved: list[float] = []
    analysed = body_requests._analyse_shapes

    def told(shapes: Any, one: Any) -> Any:
        solved.append(round(float(shapes[0].size_m[1]), 3))
        return analysed(shapes, one)

    monkeypatch.setattr(body_requests, "_analyse_shapes", told)
    monkeypatch.setattr(body_requests, "_prepare", lambda *_: {})
    client = direct_client()
    listener, _ = build(client)
    for _ in range(80):
        client.stepSimulation()
    listener.sound()
    disconnect(client)
    assert sorted(solved) == [0.016, 0.018, 0.2]
    assert solved.index(0.018) < solved.index(0.016)  # it falls from higher
