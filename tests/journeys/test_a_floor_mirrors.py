"""A thing that falls on a floor: the floor mirrors it, in the scene as in its log, and in a room it counts once."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import run

SCENE = """
SECONDS = 0.4
MICROPHONE = (0.4, 0, 0.03)
def build(client):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    half = [0.08, 0.008, 0.004]
    bar = client.createMultiBody(
        0.16, client.createCollisionShape(client.GEOM_BOX, halfExtents=half), basePosition=[0, 0, 0.05])
    client.changeDynamics(floor, -1, restitution=0.6)
    client.changeDynamics(bar, -1, restitution=0.6)
    return {bar: {"material": "steel", "name": "bar", "count": 6}}
"""
FLAT = ("--pascals", "--tail", "0")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("floor")
    (folder / "scene.py").write_text(SCENE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert (
            run("render", "scene.py", "-o", "on.wav", "--contacts", "log.npz", "--json", "on.json", "--image", *FLAT)
            == 0
        )
        assert run("render", "scene.py", "-o", "off.wav", *FLAT) == 0
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def test_a_floor_that_was_not_even_added_doubles_the_pressure_near_it() -> None:
    on, off = (soundfile.read(name)[0] for name in ("on.wav", "off.wav"))
    assert json.loads(Path("on.json").read_text())["image"] is True
    spectrum = [np.abs(np.fft.rfft(one)) ** 2 for one in (on, off)]
    hertz = np.fft.rfftfreq(len(on), 1 / 48_000)
    band = (hertz > 500) & (hertz < 2500)  # microphone and bar are 3 cm and less above it: 5 mm from way to way
    louder = 10 * np.log10(spectrum[0][band].sum() / spectrum[1][band].sum())
    assert 5.7 < louder < 6.03


def test_its_log_sounds_alike_with_images_and_without() -> None:
    assert run("render", "log.npz", "-o", "a.wav", *FLAT) == 0
    assert run("render", "log.npz", "-o", "b.wav", "--no-image", *FLAT) == 0
    assert Path("a.wav").read_bytes() == Path("on.wav").read_bytes()
    assert Path("b.wav").read_bytes() == Path("off.wav").read_bytes()


def test_in_a_room_the_floor_counts_once() -> None:
    pytest.importorskip("pyroomacoustics")
    room = ("--room", "3x2.5x2.4", "--room-corner", "-1.5,-1.2,-0.05", "--absorption", "0.4")
    assert run("render", "log.npz", "-o", "c.wav", *room, *FLAT) == 0
    assert run("render", "log.npz", "-o", "d.wav", "--no-image", *room, *FLAT) == 0
    assert np.array_equal(*(soundfile.read(name)[0] for name in ("c.wav", "d.wav")))
