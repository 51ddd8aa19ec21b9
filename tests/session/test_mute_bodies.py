"""A body that nothing touches, and one without a mode in the band, are silent and named, once: by the listener, by a
render and by the replay of its log."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import sonic_bullet as sb
from sonic_bullet.apps.cli import cli
from sonic_bullet.scene import render_scene
from tests.few_cases import parametrize_few
from tests.made.models import STEEL, box_model
from tests.made.worlds import EDGES_M, ball, box, floor, plate_model

HEAD = """
import sonic_bullet as sb
from tests.made.models import STEEL, box_model
from tests.made.worlds import EDGES_M, ball, box, floor, plate_model

PLATE = {"material": STEEL, "model": plate_model()}
HIGH = {"material": STEEL, "model": box_model(EDGES_M, (30_000.0, 40_000.0), STEEL)}
NONE = {"material": STEEL, "model": box_model(EDGES_M, (), STEEL)}
SECONDS = 0.4

def build(client):
    client.setGravity(0, 0, -9.81)
    floor(client)
"""
SCENES = {
    "alone": (
        "    return {box(client, (0, 0, 0.05)): PLATE | {'name': 'bell'},\n"
        "            box(client, (5, 0, 90)): PLATE | {'name': 'far'}}\n",
        ["touched by nobody, so silent: far"],
    ),
    "two alone": (
        "    return {box(client, (0, 0, 0.05)): PLATE | {'name': 'bell'},\n"
        "            box(client, (5, 0, 90)): PLATE | {'name': 'far'},\n"
        "            box(client, (9, 0, 90)): PLATE | {'name': 'off'}}\n",
        ["touched by nobody, so silent: far", "off"],
    ),
    "too high": (
        "    return {box(client, (0, 0, 0.05)): PLATE | {'name': 'bell'},\n"
        "            box(client, (1, 0, 0.05)): HIGH | {'name': 'crumb'}}\n",
        ["no mode below", "crumb", "click but do not ring"],
    ),
    "none at all": (
        "    still = box(client, (1, 0, 0), mass=0, turn=(0, 0, 0))\n    ball(client, (1, 0, 0.06))\n"
        "    return {box(client, (0, 0, 0.05)): PLATE | {'name': 'bell'}, still: NONE | {'name': 'block'}}\n",
        ["no mode below", "block", "they do not move either, so they are silent"],
    ),
    "read where nothing was added": (
        "    ball(client, (1, 0, 0.1))\n    return {box(client, (0, 0, 0.05)): PLATE | {'name': 'bell'}}\n\n"
        "MICROPHONE = [sb.Microphone((0, -1, 0.5)), sb.Vibrometer(1, (0, 0, 0), (0, 0, 1))]\n",
        ["the vibrometer is on body 1, which was not added, so it reads nothing; add it"],
    ),
}


@parametrize_few("name", SCENES, 2)
def test_a_mute_body_is_named_once(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, wanted = SCENES[name]
    (tmp_path / "scene.py").write_text(HEAD + text)
    result = render_scene(tmp_path / "scene.py", sr=8000)
    (note,) = result.notes
    assert all(word in note for word in wanted) and "bell" not in note
    sb.files.write_log(tmp_path / "log.npz", result.log)
    cli.main(["render", str(tmp_path / "log.npz"), "-o", str(tmp_path / "a.wav")], standalone_mode=False)
    said = capsys.readouterr().err
    assert len(re.findall(re.escape(wanted[0]), said)) == 1


def test_a_vibrometer_reads_what_is_added_as_its_note_says(tmp_path: Path) -> None:
    text, _ = SCENES["read where nothing was added"]
    (tmp_path / "scene.py").write_text(HEAD + text)
    assert not render_scene(tmp_path / "scene.py", sr=8000).samples[1].any()
    (tmp_path / "scene.py").write_text(
        HEAD
        + text.replace("ball(client, (1, 0, 0.1))", "read = box(client, (1, 0, 0.1))").replace(
            "{box", "{read: PLATE, box"
        )
    )
    result = render_scene(tmp_path / "scene.py", sr=8000)
    assert result.samples[1].any() and result.notes == ()


def test_the_listener_names_them_too() -> None:
    import pybullet as p
    from pybullet_utils.bullet_client import BulletClient

    client = BulletClient(p.DIRECT)
    client.setGravity(0, 0, -9.81)
    with sb.attach(client, sr=8000) as listener:
        floor(client)
        ball(client, (3, 0, 0.1))
        listener.add(box(client, (0, 0, 0.05)), material=STEEL, model=plate_model(), name="bell")
        listener.add(box(client, (5, 0, 90)), material=STEEL, model=plate_model(), name="far")
        listener.add(box(client, (1, 0, 0.05)), material=STEEL, model=box_model(EDGES_M, (), STEEL), name="crumb")
        assert not [note for note in listener.notes if "touched" in note]  # no step yet
        for _ in range(100):
            client.stepSimulation()
        notes = listener.notes
    assert len(notes) == 2 and "far" in notes[0] and "crumb" in notes[1]
    assert not any("bell" in note for note in notes)


def test_ground_that_nobody_reaches_is_not_missed(tmp_path: Path) -> None:
    """It is a silent partner in any case, and named as ground, once."""
    (tmp_path / "script.py").write_text("""
import pybullet as p, pybullet_data
p.connect(p.DIRECT)
p.setAdditionalSearchPath(pybullet_data.getDataPath())
p.setGravity(0, 0, -9.81)
p.loadURDF("plane.urdf", [0, 0, -9])
for z in (0, 0.055):
    p.loadURDF("cube_small.urdf", [0, 0, z])
p.resetBaseVelocity(2, [0, 0, -1])
for _ in range(24):
    p.stepSimulation()
""")
    notes = render_scene(tmp_path / "script.py", sr=8000).notes
    assert [note for note in notes if "plane" in note] == [note for note in notes if "is ground" in note]
    assert not any("touched by nobody" in note for note in notes)
