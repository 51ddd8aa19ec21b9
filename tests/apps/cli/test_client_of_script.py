"""--client is one option of every command that runs a script: two worlds, of which the second is the one to hear."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.apps.cli.called_here import call_here

TWO = """
import pybullet as p
for size in ({first}, {second}):
    client = p.connect(p.DIRECT)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    ball = p.createCollisionShape(p.GEOM_SPHERE, radius=size, physicsClientId=client)
    p.createMultiBody(0.01, ball, basePosition=[0, 0, 0.05], physicsClientId=client)
p.setPhysicsEngineParameter(numSubSteps=4, physicsClientId=1)
for _ in range(40):
    for client in (0, 1):
        p.stepSimulation(physicsClientId=client)
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a script of two worlds, and another whose first world alone differs."""
    folder = tmp_path_factory.mktemp("clients")
    (folder / "a.py").write_text(TWO.format(first=0.009, second=0.04))
    (folder / "b.py").write_text(TWO.format(first=0.008, second=0.04))
    return folder


def test_doctor_examines_the_client_asked_for(place: Path) -> None:
    first, second = (call_here(place, "doctor", "a.py", *more) for more in ((), ("--client", "1")))
    assert "sub-steps" not in first.stdout and "sub-steps" in second.stdout


def test_compare_and_baseline_hear_the_client_asked_for(place: Path) -> None:
    assert call_here(place, "compare", "a.py", "b.py").returncode == 1
    assert call_here(place, "compare", "a.py", "b.py", "--client", "1").returncode == 0
    assert call_here(place, "baseline", "a.py", "-o", ".", "--client", "1").returncode == 0
    assert call_here(place, "compare", "a.json", "b.py").returncode == 0
    told = call_here(place, "compare", "a.json", "b.py", "--client", "0")
    assert told.returncode == 2 and "--client" in told.stderr


def test_play_film_and_bake_hear_the_client_asked_for(place: Path) -> None:
    def noted(*words: str) -> str:
        return call_here(place, *words, "--client", "1").stderr

    assert "client 0 of the script steps too and is not heard: client 1 is" in noted("play", "a.py", "--device", "null")
    assert "client 1 is" in noted("film", "a.py", "-o", "a.mp4", "--fps", "12", "--size", "64x64")
    assert call_here(place, "bake", "a.py", "-o", "a.glb", "--client", "1").returncode == 0
    radii = [
        shape["sphere"]["radius"]
        for shape in json.loads(_json_chunk(place / "a.glb"))["extensions"]["KHR_implicit_shapes"]["shapes"]
        if shape["type"] == "sphere"
    ]
    assert radii == pytest.approx([0.04])


def _json_chunk(path: Path) -> bytes:
    """The JSON of a binary glTF: after 12 bytes of header, a chunk's length, its kind, its bytes."""
    data = path.read_bytes()
    return data[20 : 20 + int.from_bytes(data[12:16], "little")]
