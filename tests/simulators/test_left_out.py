"""One body whose numbers break, or a soft one, takes nothing from the sound of the others: it is named once and left
out.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
import pytest

from sonic_bullet.records.contacts import ROW_FIELDS, Step
from sonic_bullet.records.errors import SceneError, SceneWarning
from sonic_bullet.simulators import diagnose_world, direct_client, disconnect, links_with_shapes, open_world
from tests.made.scenes import floor, listen, thing

NAN_SPEED = [math.nan, 0, 0]


def two_balls(client: Any) -> tuple[int, int]:
    """One about to land, one in the air: what touches a body that is no number becomes none too, for Bullet's solver
    hands it on.
    """
    floor(client)
    return thing(client, "sphere", [0, 0, 0.06]), thing(client, "sphere", [1, 0, 3])


def rows_on(steps: list[Step], index: int) -> list[np.ndarray]:
    return [row for s in steps for row in np.flatnonzero((s.contacts.a == index) | (s.contacts.b == index))]


def test_a_body_that_is_no_number_is_named_once_and_the_others_go_on(client: Any) -> None:
    """To the bit as in a world where it is simply taken away."""
    observed = []
    for taken_away in (False, True):
        world_client = direct_client()
        world_client.setGravity(0, 0, -9.81)
        good, bad = two_balls(world_client)
        world, steps = listen(world_client)
        for _ in range(10):
            world_client.stepSimulation()
        if taken_away:
            world_client.removeBody(bad)
        else:
            world_client.resetBaseVelocity(bad, NAN_SPEED)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            for _ in range(60):
                world_client.stepSimulation()
        assert len(steps) == 70
        assert [w.category for w in said] == ([] if taken_away else [SceneWarning])
        assert len(world.left_out.notes) == len(said)
        observed.append((steps, world.index_of(good), world.bodies))
        disconnect(world_client)
    broken, plain = observed
    assert len(rows_on(broken[0][10:], broken[1])) > 10
    for one, other in zip(broken[0], plain[0], strict=True):
        for name in ROW_FIELDS:
            np.testing.assert_array_equal(getattr(one.contacts, name), getattr(other.contacts, name))
            assert np.isfinite(getattr(one.contacts, name)).all()
        assert np.isfinite(one.position_m).all() and np.isfinite(one.quaternion_xyzw).all()


@pytest.mark.parametrize("hooked", [True, False])
def test_its_record_ends_and_the_note_names_it(client: Any, hooked: bool) -> None:
    good, bad = two_balls(client)
    world = open_world(client if hooked else client._client)
    record = world.add(bad)
    if hooked:
        world.hook(world.before_step, world.after_step)

    def step() -> None:
        client.stepSimulation()
        if not hooked:
            world.after_step()

    step()
    client.resetBaseVelocity(bad, NAN_SPEED)
    with pytest.warns(
        SceneWarning, match=rf"body {bad} has a pose or speed that is not a number, or beyond 1e9: it is mute"
    ) as said:
        for _ in range(30):
            step()
    assert len(said) == 1
    assert "\n" not in str(said[0].message)
    assert world.bodies[0].body_id == record.body_id and world.bodies[0].until_step == 1
    assert world.index_of(bad) == -1
    assert world.index_of(good) >= 0


def test_it_stays_mute_until_added_anew_or_removed(client: Any) -> None:
    _, bad = two_balls(client)
    world, _ = listen(client)
    client.stepSimulation()
    saved = client.saveState()
    client.resetBaseVelocity(bad, NAN_SPEED)
    with pytest.warns(SceneWarning):
        client.stepSimulation()
    with pytest.raises(SceneError, match=f"body {bad} has a pose or speed that is not a number"):
        world.add(bad)
    client.restoreState(saved)
    client.resetBasePositionAndOrientation(bad, [1, 0, 0.06], [0, 0, 0, 1])
    for _ in range(30):
        client.stepSimulation()
    assert any(bad in raw[1:3] for raw in client.getContactPoints()), "it touches, and is mute all the same"
    assert world.index_of(bad) == -1
    world.add(bad)
    client.stepSimulation()
    assert world.index_of(bad) >= 0
    client.resetBasePositionAndOrientation(bad, [1, 0, 3], [0, 0, 0, 1])
    client.resetBaseVelocity(bad, NAN_SPEED)
    with pytest.warns(SceneWarning):
        client.stepSimulation()
    client.removeBody(bad)
    again = thing(client, "sphere", [1, 0, 0.06])
    for _ in range(30):
        client.stepSimulation()
    assert world.index_of(again) >= 0


@pytest.mark.parametrize("hooked", [True, False])
def test_a_partner_of_absurd_mass_is_muted(client: Any, hooked: bool) -> None:
    """Nobody added it, so nobody refused it: found when it first touches."""
    client.setGravity(0, 0, 0)
    good, _ = two_balls(client)
    bad = client.createMultiBody(
        2e12, client.createCollisionShape(p.GEOM_SPHERE, radius=0.05), basePosition=[2, 0, 0.05001]
    )
    client.resetBaseVelocity(good, [0, 0, -1])
    client.resetBaseVelocity(bad, [0, 0, -1e-4])
    world = open_world(client if hooked else client._client)
    if hooked:
        world.hook(world.before_step, world.after_step)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for _ in range(60):
            client.stepSimulation()
            if not hooked:
                world.after_step()
    assert [w.category for w in said if f"body {bad} has a mass or inertia" in str(w.message)] == [SceneWarning], [
        str(w.message) for w in said
    ]
    assert world.step_count == 60
    assert world.index_of(good) >= 0


def test_bodies_that_break_each_other_are_all_named(client: Any) -> None:
    """A ball without a number touches the floor: the solver makes none of the floor either, and the rows between them
    are none.
    """
    good, bad = two_balls(client)
    world, steps = listen(client)
    for _ in range(20):
        client.stepSimulation()
    assert world.index_of(good) >= 0
    client.resetBasePositionAndOrientation(bad, [1, 0, 0.0499], [0, 0, 0, 1])
    client.resetBaseVelocity(bad, NAN_SPEED)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        for _ in range(20):
            client.stepSimulation()
    assert len(steps) == 40
    assert world.left_out.muted == {0, bad}
    assert len(world.left_out.notes) == 2
    assert all(np.isfinite(getattr(one.contacts, name)).all() for one in steps for name in ROW_FIELDS)


def test_a_link_of_a_robot_mutes_the_robot(client: Any) -> None:
    floor(client)
    good = thing(client, "sphere", [3, 0, 0.06])
    robot = client.loadURDF(pybullet_data.getDataPath() + "/cartpole.urdf")
    world, steps = listen(client)
    client.stepSimulation()
    client.resetJointState(robot, 0, math.nan)
    with pytest.warns(SceneWarning, match=f"body {robot}"):
        for _ in range(40):
            client.stepSimulation()
    assert len(steps) == 41
    assert world.index_of(good) >= 0


def test_a_polled_world_survives_an_id_given_to_a_body_with_fewer_links() -> None:
    """Asking PyBullet for a link that is not there would end the process (in a process of its own, therefore)."""
    import subprocess
    import sys

    script = """
import pybullet as p, pybullet_data
from sonic_bullet.simulators import direct_client, open_world
client = direct_client()
client.setGravity(0, 0, -9.81)
client.loadURDF(pybullet_data.getDataPath() + "/plane.urdf")
arm = client.loadURDF(pybullet_data.getDataPath() + "/cartpole.urdf")
world = open_world(client._client)
client.removeBody(arm)
ball = client.createMultiBody(1, client.createCollisionShape(p.GEOM_SPHERE, radius=0.1), basePosition=[0, 0, 0.1])
assert ball == arm, "the id is given anew: the test tests something"
for _ in range(10):
    client.stepSimulation()
    world.after_step()
print("steps", world.step_count, "index", world.index_of(ball) >= 0)
"""
    said = subprocess.run([sys.executable, "-c", script], check=False, timeout=200, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr[-500:]
    assert "steps 10 index True" in said.stdout


# --- soft bodies


def cloth_world(client: Any) -> tuple[int, int]:
    client.resetSimulation(p.RESET_USE_DEFORMABLE_WORLD)
    client.setGravity(0, 0, -9.81)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    floor(client)
    how = {
        "useMassSpring": 1,
        "useBendingSprings": 1,
        "springElasticStiffness": 40,
        "springDampingStiffness": 0.1,
        "frictionCoeff": 0.5,
        "useFaceContact": 1,
    }
    cloth = client.loadSoftBody("cloth_z_up.obj", basePosition=[0, 0, 0.3], mass=1.0, **how)
    return cloth, thing(client, "box", [0, 0, 0.6])


@pytest.mark.parametrize("hooked", [True, False])
def test_a_soft_body_is_left_out_and_named_once(client: Any, hooked: bool) -> None:
    cloth, body = cloth_world(client)
    far = thing(client, "sphere", [3, 0, 0.06])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        world = open_world(client if hooked else client._client)
        steps: list[Step] = []
        if hooked:
            world.hook(world.before_step, lambda: steps.append(world.after_step()))
        touched = 0
        for _ in range(200):
            client.stepSimulation()
            touched += any(cloth in raw[1:3] for raw in client.getContactPoints())
            if not hooked:
                steps.append(world.after_step())
    assert [w.category for w in said] == [SceneWarning], [str(w.message) for w in said]
    assert f"cloth_z_up (body {cloth}) is soft" in str(said[0].message)
    assert touched > 10, "something lay on the cloth: the test tests something"
    assert {record.body_id for record in world.bodies} <= {0, body, far}
    assert world.index_of(far) >= 0
    assert len(steps) == 200
    assert (cloth, -1) not in links_with_shapes(world.client_id)
    with pytest.raises(SceneError, match=f"body {cloth}.*soft"):
        world.add(cloth)
    assert "nan" not in {finding.id for finding in diagnose_world(client)}
