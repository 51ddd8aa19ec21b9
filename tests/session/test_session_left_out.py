"""What is left out of a world is left out of its sound alone: the others are heard, logged and written; nothing that is
no number gets in.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
import pytest

import sonic_bullet as sb
from sonic_bullet.records.contacts import ROW_FIELDS
from sonic_bullet.records.errors import SceneWarning
from sonic_bullet.simulators import direct_client, disconnect
from tests.apps.cli.called_here import call_here
from tests.made.worlds import box, floor, sounding_box
from tests.session.test_session_robust import steps

NAN_SPEED = [float("nan"), 0, 0]


def test_the_others_sound_as_if_it_had_been_taken_away(tmp_path: Path) -> None:
    observed = []
    for taken_away in (True, False):
        client = direct_client()
        client.setGravity(0, 0, -9.81)
        floor(client)
        listener = sb.attach(client, microphone=[sb.Microphone(np.array([0, 0, 0.5])), sb.ModalSum()])
        sounding_box(client, listener, (0, 0, 0.06))
        bad = sounding_box(client, listener, (1, 0, 3))
        steps(client, 10)
        if taken_away:
            client.removeBody(bad)
        else:
            client.resetBaseVelocity(bad, NAN_SPEED)
        with warnings.catch_warnings():
            warnings.simplefilter("error" if taken_away else "ignore", SceneWarning)
            steps(client, 60)
        observed.append(listener.sound())
        log = listener.contacts
        assert all(np.isfinite(getattr(one.contacts, name)).all() for one in log.steps for name in ROW_FIELDS)
        log.save(tmp_path / "log.npz")
        np.testing.assert_array_equal(sb.render_log(sb.read_log(str(tmp_path / "log.npz"))), observed[-1])
        assert len(listener.left_out) == (0 if taken_away else 1)
        disconnect(client)
    assert np.abs(observed[0]).max() > 1e-3
    assert observed[0].shape == (2, 70 * 200)
    np.testing.assert_array_equal(observed[0], observed[1])


SCENE = """
MICROPHONE = (0, 0, 0.5)
SECONDS = 0.5
def build(client):
    client.setGravity(0, 0, -9.81)
    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    ball = client.createCollisionShape(client.GEOM_SPHERE, radius=0.02)
    return {{client.createMultiBody(0.1, ball, basePosition=place): "steel" for place in ([0, 0, 0.1], [1, 0, 3])}}
def act(client, time_s):
    if 0.1 < time_s < 0.11:
        {act}
"""


def test_a_render_says_it_and_writes_the_others(tmp_path: Path) -> None:
    """Exit 0, one note, and the same samples as without the broken body."""
    said = []
    for name, act in (("broken", "client.resetBaseVelocity(2, [float('nan'), 0, 0])"), ("plain", "pass")):
        (tmp_path / f"{name}.py").write_text(SCENE.format(act=act))
        words = ["render", f"{name}.py", "-o", f"{name}.wav", "--contacts", f"{name}.npz", "--json", f"{name}.json"]
        words += ["--pascals", "--tail", "0"]
        said.append(call_here(tmp_path, *words))
    broken, plain = said
    assert (broken.returncode, plain.returncode) == (0, 0), broken.stderr
    notes = [line for line in broken.stderr.splitlines() if "not a number" in line]
    assert len(notes) == 1 and "note: body 2" in notes[0]
    assert "Traceback" not in broken.stderr and "SceneWarning" not in broken.stderr
    assert "not a number" not in plain.stderr
    assert sum("not a number" in note for note in json.loads((tmp_path / "broken.json").read_text())["notes"]) == 1
    samples = sb.read_audio(str(tmp_path / "broken.wav"))[0]
    assert np.isfinite(samples).all()
    assert np.abs(samples).max() > 1e-3
    np.testing.assert_array_equal(samples, sb.read_audio(str(tmp_path / "plain.wav"))[0])
    np.testing.assert_array_equal(sb.render_log(sb.read_log(str(tmp_path / "broken.npz"))).astype(np.float32), samples)


@pytest.mark.slow
def test_what_falls_on_cloth_overflows_nowhere(client: Any) -> None:
    """`RuntimeWarning: overflow encountered in divide` before: a soft body's mass is memory that nobody wrote."""
    client.resetSimulation(p.RESET_USE_DEFORMABLE_WORLD)
    client.setGravity(0, 0, -9.81)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    floor(client)
    cloth = client.loadSoftBody(
        "cloth_z_up.obj",
        basePosition=[0, 0, 0.3],
        mass=1.0,
        useMassSpring=1,
        springElasticStiffness=40,
        useFaceContact=1,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.warns(SceneWarning, match=f"body {cloth}.*soft"):
            listener = sb.attach(client, microphone=[sb.Microphone(np.array([0, 0, 0.5])), sb.ModalSum()])
        sounding_box(client, listener, (0, 0, 0.6))
        box(client, (0.3, 0, 0.6))
        touched = 0
        for _ in range(130):
            client.stepSimulation()
            touched += any(cloth in raw[1:3] for raw in client.getContactPoints())
        sound = listener.sound()
    assert touched > 10
    assert np.isfinite(sound).all()
    np.testing.assert_array_equal(sb.render_log(listener.contacts), sound)
    assert len(listener.left_out) == 1
