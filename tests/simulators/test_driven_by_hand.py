"""What is driven by hand: poses that are set step after step slide with their own speed, at any speed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.scene import render_scene
from tests.made.models import STEEL
from tests.made.worlds import box, floor, plate_model

DT_S = 1 / 240
HALF_M = 0.005  # of the plate's thickness


def logged(client: Any, place: Callable[[int], list[float]], steps: int = 120, mass: float = 0.4) -> ContactLog:
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=(0, -1, 0.5))
    listener.add(floor(client), material="concrete")
    plate = box(client, place(0), mass=mass, turn=(0, 0, 0))
    listener.add(plate, material=STEEL, model=plate_model())
    for number in range(steps):
        client.resetBasePositionAndOrientation(plate, place(number), [0, 0, 0, 1])
        client.stepSimulation()
    log: ContactLog = listener.contacts
    log_sound = listener.sound()
    assert np.isfinite(log_sound).all()
    return log


@pytest.mark.parametrize("speed_m_s", [0.02, 0.2, 2.0])
def test_a_tool_that_is_set_step_after_step_slides_with_the_speed_of_its_poses(client: Any, speed_m_s: float) -> None:
    log = logged(client, lambda n: [-0.1 + speed_m_s * DT_S * n, 0, HALF_M - 2e-4])
    slip = np.linalg.norm(log.rows.slip_m_s, axis=1)
    assert len(set(log.step.tolist())) >= 115 and log.step.min() <= 3  # from its second or third pose on
    np.testing.assert_allclose(slip, speed_m_s, rtol=1e-6)
    assert log.rows.sweep_m_s.max(axis=1) == pytest.approx(speed_m_s, rel=1e-6)
    assert not any(step.teleported.any() for step in log.steps[3:])


def test_a_tool_that_turns_by_hand_slides_too(client: Any) -> None:
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=())
    listener.add(floor(client), material="concrete")
    plate = box(client, (0, 0, HALF_M - 2e-4), turn=(0, 0, 0))
    listener.add(plate, material=STEEL, model=plate_model())
    for number in range(60):
        turn = p.getQuaternionFromEuler([0, 0, 1.5 * DT_S * number])
        client.resetBasePositionAndOrientation(plate, [0, 0, HALF_M - 2e-4], turn)
        client.stepSimulation()
    rows, step = listener.contacts.rows, listener.contacts.step
    late = step > 4
    radius = np.linalg.norm(rows.point_b_m[late][:, :2], axis=1)
    np.testing.assert_allclose(np.linalg.norm(rows.slip_m_s[late], axis=1), 1.5 * radius, rtol=0.02)


def test_a_conveyor_whose_joint_is_set_passes_under_what_lies_on_it(client: Any) -> None:
    """Its link moves by the joint alone, at 0.2 m/s: it slides, and does not jump."""
    client.setGravity(0, 0, -9.81)
    table = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5, 0.2, 0.02])
    belt = client.createMultiBody(
        0, -1, linkMasses=[1.0], linkCollisionShapeIndices=[table], linkVisualShapeIndices=[-1],
        linkPositions=[[0, 0, 0]], linkOrientations=[[0, 0, 0, 1]], linkInertialFramePositions=[[0, 0, 0]],
        linkInertialFrameOrientations=[[0, 0, 0, 1]], linkParentIndices=[0], linkJointTypes=[p.JOINT_PRISMATIC],
        linkJointAxis=[[1, 0, 0]],
    )  # fmt: skip
    client.changeDynamics(belt, 0, lateralFriction=0)
    listener = sb.attach(client, microphone=())
    listener.add(box(client, (0, 0, 0.02 + HALF_M), turn=(0, 0, 0)), material=STEEL, model=plate_model())
    for number in range(60):
        client.resetJointState(belt, 0, 0.2 * DT_S * number)
        client.stepSimulation()
    log = listener.contacts
    late = log.step > 4
    assert late.sum() > 100
    np.testing.assert_allclose(np.linalg.norm(log.rows.slip_m_s[late], axis=1), 0.2, rtol=1e-3)


def test_what_is_set_somewhere_else_each_time_jumps(client: Any) -> None:
    rng = np.random.default_rng(1)
    places = [[*rng.uniform(-0.2, 0.2, 2), HALF_M - 2e-4] for _ in range(120)]
    log = logged(client, lambda n: places[n])
    assert np.mean([step.teleported.any() for step in log.steps[1:]]) > 0.9
    assert len(set(log.step.tolist())) < 12


def test_what_is_set_now_and_then_jumps_as_before(client: Any) -> None:
    log = logged(client, lambda n: [-0.1 + 0.01 * (n % 2), 0, HALF_M - 2e-4], steps=1)
    assert len(log.steps) == 1 and not len(log)  # created, and set


def test_fast_motion_on_its_way_is_no_jump(client: Any) -> None:
    """Twice as fast as anything is taken to be driven that starts at once."""
    log = logged(client, lambda n: [-8 + 0.5 * 40.0 * (n * DT_S) ** 2, 0, HALF_M - 2e-4], steps=150)
    slip = np.linalg.norm(log.rows.slip_m_s, axis=1)
    assert slip.max() > 20
    assert not any(step.teleported.any() for step in log.steps[3:])


PLAIN = """
import pybullet as p
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
tool = p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.02), basePosition=[0, 0, 0.0199])
for n in range(120):
    p.resetBasePositionAndOrientation(tool, [0.2 / 240 * n, 0, 0.0199], [0, 0, 0, 1])
    p.stepSimulation()
"""


def test_a_plain_script_drives_by_hand_too(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(PLAIN)
    log = render_scene(tmp_path / "a.py", sr=8000, microphones=()).log
    late = log.step > 4
    assert late.sum() > 100
    np.testing.assert_allclose(np.linalg.norm(log.rows.slip_m_s[late], axis=1), 0.2, rtol=1e-3)
