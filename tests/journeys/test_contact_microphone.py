"""From a robot that touches to what it feels: a contact microphone on a finger, by the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import error_of, run

FLAT = ("--pascals", "--tail", "0")
FINGER = "panda/panda_rightfinger"
SCENE = """
import pybullet as p
import pybullet_data

SECONDS = 0.5
ANGLES = [0.0, 0.52, 0.0, -2.2, 0.0, 2.72, 0.785]


def build(client):
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    client.setGravity(0, 0, -9.81)
    arm = client.loadURDF("franka_panda/panda.urdf", useFixedBase=True)
    for joint, angle in enumerate(ANGLES):
        client.resetJointState(arm, joint, angle)
    x, y, z = client.getLinkState(arm, 11, computeForwardKinematics=True)[0]
    box = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.3, 0.3, 0.02])
    client.createMultiBody(0, box, basePosition=[x, y, z - 0.06])
    return {(arm, 10): "steel"}


def act(client, time_s):
    for joint, angle in enumerate(ANGLES):
        lower = 0.25 * min(time_s, 0.4) if joint == 1 else 0.0
        client.setJointMotorControl2(0, joint, p.POSITION_CONTROL, angle + lower, force=200)
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("touch")
    (folder / "press.py").write_text(SCENE)
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def test_a_finger_that_presses_a_table_is_heard_and_replayed(capfd: pytest.CaptureFixture[str]) -> None:
    """It has no mode in the band: what is heard is its rigid motion, with the arm behind it."""
    sensors = ("--contact-microphone", f"{FINGER}=0,0,0,1,0,0", "--vibrometer", FINGER)
    assert run("render", "press.py", "-o", "a.wav", "--contacts", "a.npz", "--json", "a.json", *sensors, *FLAT) == 0
    sound, sr = soundfile.read("a.wav")
    assert sound.shape == (sr // 2, 2) and (np.abs(sound).max(axis=0) > (0.01, 1e-6)).all()
    assert "silent" not in capfd.readouterr().err
    assert json.loads(Path("a.json").read_text())["channels"] == 2
    assert run("render", "a.npz", "-o", "b.wav", *FLAT) == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()
    # another place, from the log alone
    assert run("render", "a.npz", "-o", "c.wav", "--contact-microphone", f"{FINGER}=0,0,0.03", *FLAT) == 0
    other, _ = soundfile.read("c.wav")
    assert other.shape == (sr // 2,) and np.abs(other).max() > 0.01


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--contact-microphone", "panda/panda_rightfingr"), "did you mean panda/panda_rightfinger?"),
        (("--vibrometer", f"{FINGER}=0,0"), "X,Y,Z"),
        (("--contact-microphone", f"{FINGER}=0,0,0,0,0,0"), "direction is zero"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert said in error_of(capfd, "render", "a.npz", "-o", "d.wav", *words)
