"""Steps written from plain arrays are the steps that a listener takes of the simulator they come from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import sonic_bullet as sb
from sonic_bullet.records import Shape
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.tables.array_world import ArrayWorld
from tests.made.models import STEEL, WOOD
from tests.made.worlds import EDGES_M, box, floor, plate_model

UP = (0, 0, 0, 1)


def arrays_of(client: Any, bodies: list[int]) -> dict[str, Any]:
    """What PyBullet says before a step of bodies that have one link."""
    pose = [client.getBasePositionAndOrientation(one) for one in bodies]
    speed = [client.getBaseVelocity(one) for one in bodies]
    return {
        "position_m": [one for one, _ in pose],
        "quaternion_xyzw": [one for _, one in pose],
        "velocity_m_s": [one for one, _ in speed],
        "spin_rad_s": [one for _, one in speed],
    }


def contacts_of(client: Any, dt: float) -> dict[str, Any]:
    rows = [one for one in client.getContactPoints() if one[9] or one[10] or one[12]]
    impulse = [dt * (np.multiply(r[9], r[7]) + np.multiply(r[10], r[11]) + np.multiply(r[12], r[13])) for r in rows]
    return {
        "pair": np.array([(r[1], r[2]) for r in rows]).reshape(-1, 2),
        "point_m": np.array([np.add(r[5], r[6]) / 2 for r in rows]).reshape(-1, 3),
        "normal": np.array([r[7] for r in rows]).reshape(-1, 3),
        "impulse_n_s": np.array(impulse).reshape(-1, 3),
        "gap_m": np.array([r[8] for r in rows]).reshape(-1),
    }


@pytest.mark.parametrize("speeds", [True, False])
def test_pybullets_arrays_make_pybullets_log(client: Any, speeds: bool) -> None:
    """Also without speeds: Bullet's integrator is semi-implicit."""
    shape = sb.Shape("box", EDGES_M)
    writer = sb.LogWriter(microphone=())
    assert writer.add("floor", sb.Shape("plane")) == floor(client)
    body = box(client, (0, 0, 0.2))
    moments = client.getDynamicsInfo(body, -1)[2]
    assert writer.add("box", shape, material=STEEL, model=plate_model(), mass_kg=0.4, inertia_kg_m2=moments) == body
    listener = sb.attach(client, microphone=())
    listener.add(body, material=STEEL, model=plate_model())
    dt = client.getPhysicsEngineParameters()["fixedTimeStep"]
    for _ in range(120):
        before = arrays_of(client, [0, body])
        client.stepSimulation()
        if not speeds:
            del before["velocity_m_s"], before["spin_rad_s"]
        gravity = listener.contacts.steps[-1].gravity_m_s2
        writer.step(dt, **before, **contacts_of(client, dt), gravity_m_s2=gravity)
    mine, theirs = writer.log, listener.contacts
    assert len(mine) == len(theirs) > 100
    assert [one.name for one in mine.bodies] == ["box", "floor"]
    for name in ("a", "b", "normal", "impulse_n_s", "gap_m"):
        assert np.allclose(getattr(mine.rows, name), getattr(theirs.rows, name), atol=1e-9), name
    # Bullet's two points are not quite a gap along the normal apart
    for name, off in (
        ("point_a_m", 5e-4),
        ("point_b_m", 5e-4),
        ("slip_m_s", 2e-3),
        ("approach_m_s", 2e-3),
        ("sweep_m_s", 2e-3),
    ):
        assert np.abs(getattr(mine.rows, name) - getattr(theirs.rows, name)).max() < off, name
    assert np.allclose(mine.bodies[0].inertia_kg_m2, theirs.bodies[0].inertia_kg_m2)


def test_poses_may_be_of_any_frame(client: Any) -> None:
    """A mesh away from its centre of mass, with poses of its origin, is the same body as one about it."""
    made = []
    for shift in (np.zeros(3), np.array([0.3, -0.2, 0.1])):
        world = ArrayWorld()
        number = world.define("box", [Shape("box", EDGES_M, position_m=shift)], mass_kg=0.4)
        wall = world.define("wall", [Shape("plane")], mass_kg=0)
        listener = sb.attach(world, microphone=())
        turn = np.array([0.1, 0.5, -0.3, 0.8]) / np.linalg.norm([0.1, 0.5, -0.3, 0.8])
        rotation = Rotation.from_quat(turn).as_matrix()
        world.advance(
            0.01, [-rotation @ shift, (0, 0, 0)], [turn, (0, 0, 0, 1)], pair=[(number, wall)],
            point_m=[(0, 0, -0.05)], normal=[(0, 0, 1)], impulse_n_s=[(0, 0, 1)],
            velocity_m_s=[(0, 0, -1), (0, 0, 0)], spin_rad_s=[(1, 2, 3), (0, 0, 0)],
        )  # fmt: skip
        made.append(listener.contacts)
    one, two = made
    for name in ("point_a_m", "impulse_n_s", "slip_m_s", "approach_m_s"):
        assert np.allclose(getattr(one.rows, name), getattr(two.rows, name), atol=1e-12), name
    assert np.allclose(one.bodies[0].inertia_kg_m2, two.bodies[0].inertia_kg_m2, rtol=1e-12)


def test_what_rests_still_is_a_contact_and_what_is_moved_is_none() -> None:
    writer = sb.LogWriter(microphone=())
    writer.add("ball", Shape("sphere", (0.02, 0, 0)), mass_kg=0.1)
    writer.add("floor", Shape("plane"))
    contact = {"pair": [(0, 1)], "point_m": [(0, 0, 0)], "normal": [(0, 0, 1)], "impulse_n_s": [(0, 0, 0.001)]}
    for x, moved in ((0, ()), (0, ()), (1, [0]), (1, ())):
        writer.step(0.01, [(x, 0, 0.02), (0, 0, 0)], [(0, 0, 0, 1)] * 2, moved=moved, **contact)
    log = writer.log
    assert log.step.tolist() == [0, 1, 3]
    assert [one.kind for one in log.events] == ["moved"]


@pytest.mark.parametrize(
    ("said", "call"),
    [
        ("the name 'ball' is another body's already", lambda w: w.add("ball", Shape("plane"))),
        ("has neither mass nor material", lambda w: w.add("cup", Shape("sphere", (1, 0, 0)))),
        ("moves and encloses no volume", lambda w: w.add("cup", Shape("plane"), mass_kg=1)),
        ("a body without material has no option 'count'", lambda w: w.add("cup", Shape("plane"), count=3)),
        ("add has no option 'cuont'; did you mean count", lambda w: w.add("cup", Shape("plane"), cuont=3)),
        ("step has no option 'force'", lambda w: w.step(0.1, [[0] * 3], [[0, 0, 0, 1]], force=3)),
        ("only one of velocity_m_s, spin_rad_s", lambda w: w.step(0.1, [[0] * 3], [UP], velocity_m_s=[[0] * 3])),
        ("no body is called 'bal'; did you mean ball", lambda w: w.mass_kg("bal")),
    ],
)  # fmt: skip
def test_a_wrong_writer_is_one_line(said: str, call: Any) -> None:
    writer = sb.LogWriter()
    writer.add("ball", Shape("sphere", (0.02, 0, 0)), mass_kg=0.1)
    with pytest.raises(sb.SonicBulletError, match=said):
        call(writer)


def test_bodies_come_before_steps_and_a_body_that_fails_leaves_nothing() -> None:
    writer = sb.LogWriter()
    open_surface = Shape("mesh", vertex_m=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], face=[[0, 1, 2]])
    with pytest.raises(sb.SonicBulletError):
        writer.add("sheet", open_surface, material=WOOD, mass_kg=0, fixed=[(9, 9, 9, 1e-9)])
    assert writer.add("ball", Shape("sphere", (0.02, 0, 0)), mass_kg=0.1) == 0
    writer.step(0.01, [[0, 0, 1]], [[0, 0, 0, 1]])
    with pytest.raises(SceneError, match="'late' comes after a step; add all bodies before"):
        writer.add("late", Shape("plane"))
