"""A step in one compiled call: what it says of a contact is the contact's own kinematics, and the same as where every
step goes through Python.
"""

from __future__ import annotations

import gc
from typing import Any

import numpy as np
import pybullet as p
import pytest

from sonic_bullet._engine import TRACE, sort_pairs
from sonic_bullet.records.contacts import CONTACT, Step
from sonic_bullet.simulators import direct_client, disconnect, open_world
from sonic_bullet.simulators.frames import encode
from sonic_bullet.simulators.pybullet.pybullet_world import PyBulletWorld
from tests.made.scenes import floor, listen, thing, turned

DT_S = 1 / 240


def steps_of_a_busy_world(hooked: bool) -> tuple[list[Step], int]:
    """Falling, rolling and resting things, a driven paddle, a throw by hand, a removal and a newcomer; how many steps
    there were in all.
    """
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    floor(client)
    bodies = [thing(client, "box", [0.1 * (i % 3), 0.0, 0.031 + 0.0601 * (i // 3)]) for i in range(6)]
    client.resetBaseVelocity(thing(client, "sphere", [-0.3, 0, 0.05]), [1.5, 0, 0])
    thing(client, "capsule", [0.5, 0, 0.12], orientation=turned(0.3, 0.1, 0.2))
    paddle = client.createMultiBody(0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3))
    world, steps = listen(client) if hooked else (open_world(client._client), [])
    for k in range(160):
        client.resetBasePositionAndOrientation(paddle, [-0.5 + 0.003 * k, 0.2, 0.05], turned(0, 0, 0.01 * k))
        if k == 60:
            client.resetBasePositionAndOrientation(bodies[1], [0.2, 0.5, 0.2], [0, 0, 0, 1])
        if k == 90:
            client.removeBody(bodies[0])
            if not hooked:
                world.forget(bodies[0])
        if k == 110:
            thing(client, "sphere", [0.1, 0, 0.4])
        client.stepSimulation()
        if not hooked:
            steps.append(world.after_step())
    disconnect(client)
    return steps, 160


@pytest.mark.parametrize("hooked", [True, False])
def test_one_call_and_many_are_the_same_to_the_bit(monkeypatch: pytest.MonkeyPatch, hooked: bool) -> None:
    usual, in_one = PyBulletWorld._usual, []

    def counted(self: PyBulletWorld, *args: Any) -> bool:
        in_one.append(usual(self, *args))
        return in_one[-1]

    monkeypatch.setattr(PyBulletWorld, "_usual", counted)
    quick, count = steps_of_a_busy_world(hooked)
    assert sum(in_one) > 0.9 * count
    monkeypatch.setattr(PyBulletWorld, "_usual", lambda *_: False)
    slow, _ = steps_of_a_busy_world(hooked)
    assert sum(len(step.contacts) for step in slow) > 1000
    assert len(quick) == len(slow) == count
    for one, other in zip(quick, slow, strict=True):
        assert one.contacts.row.tobytes() == other.contacts.row.tobytes()
        for name in ("position_m", "quaternion_xyzw", "teleported", "gravity_m_s2"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes()
            assert not getattr(one, name).flags.writeable
        assert one.dt_s == other.dt_s and not one.contacts.row.flags.writeable


def test_a_row_is_the_kinematics_of_its_contact(client: Any) -> None:
    """p' = Rᵀ(p - x); v = V + ω × (p - x); approach and slip: its parts along the normal and across; J = dt Σ f."""
    floor(client)
    bodies = [thing(client, "box", [0, 0.1 * i, 0.1], orientation=turned(0.3, 0.2 * i, 0.1)) for i in range(3)]
    world, steps = listen(client)
    checked = 0
    for _ in range(120):
        before = {
            body: (*client.getBasePositionAndOrientation(body), *client.getBaseVelocity(body)) for body in [0, *bodies]
        }
        client.stepSimulation()
        rows = steps[-1].contacts
        found = [raw for raw in client.getContactPoints() if raw[9] or raw[10] or raw[12]]
        if not len(rows) or len(rows) != len(found):
            continue
        for i, raw in enumerate(found):
            velocity = []
            for body, place, local in ((raw[1], raw[5], rows.point_a_m[i]), (raw[2], raw[6], rows.point_b_m[i])):
                x, q, v, w = before[body]
                arm = np.subtract(place, x)
                turn = np.array(p.getMatrixFromQuaternion(q)).reshape(3, 3)
                np.testing.assert_allclose(local, turn.T @ arm, atol=1e-12)
                velocity.append(np.add(v, np.cross(w, arm)))
            normal, relative = np.array(raw[7]), velocity[0] - velocity[1]
            assert rows.approach_m_s[i] == pytest.approx(-relative @ normal, abs=1e-12)
            np.testing.assert_allclose(rows.slip_m_s[i], relative - (relative @ normal) * normal, atol=1e-12)
            force = raw[9] * normal + raw[10] * np.array(raw[11]) + raw[12] * np.array(raw[13])
            np.testing.assert_allclose(rows.impulse_n_s[i], DT_S * force, rtol=1e-12, atol=1e-18)
            assert rows.gap_m[i] == raw[8]
            assert (rows.a[i], rows.b[i]) == (world.index_of(raw[1]), world.index_of(raw[2]))
            checked += 1
    assert checked > 200


@pytest.mark.parametrize("count", [0, 1, 2, 7, 64, 301])
def test_pairs_are_ordered_and_equal_ones_stay_as_they_came(count: int) -> None:
    rng = np.random.default_rng(count)
    row, trace = np.zeros(count, CONTACT), np.zeros(count, TRACE)
    row["a"], row["b"] = rng.integers(0, 5, count), rng.integers(0, 5, count)
    sort_pairs(row, trace, np.zeros((3, count), np.int64))
    pair = row["a"].astype(np.int64) << 32 | row["b"]
    np.testing.assert_array_equal(trace["order"], np.argsort(pair, kind="stable"))
    np.testing.assert_array_equal(trace["pair"], np.sort(pair))


@pytest.mark.parametrize("on", [True, False])
def test_the_garbage_collector_is_left_as_it_was(client: Any, on: bool) -> None:
    floor(client)
    thing(client, "box", [0, 0, 0.03])
    world, _ = listen(client)
    was_on = gc.isenabled()
    try:
        gc.enable() if on else gc.disable()
        for _ in range(3):
            client.stepSimulation()
            assert gc.isenabled() == on
        disconnect(client)
        with pytest.raises(Exception, match=r"does not answer|not connected"):
            world.before_step()
        assert gc.isenabled() == on
    finally:
        gc.enable() if was_on else gc.disable()


@pytest.mark.parametrize("boxes", [1, 40])
def test_memory_of_contacts_grows_with_them(client: Any, boxes: int) -> None:
    """Rows of a step hang on nothing but the world: who began with few contacts has the same as who began with many."""
    floor(client)
    early = listen(client)
    client.stepSimulation()
    for i in range(boxes):
        thing(client, "box", [0.2 * i, 0, 0.0299])
    late = listen(client)
    for _ in range(20):
        client.stepSimulation()
    for one, other in zip(early[1][-15:], late[1][-15:], strict=True):
        assert len(one.contacts) >= boxes
        for name in ("impulse_n_s", "point_b_m", "slip_m_s", "approach_m_s"):
            np.testing.assert_array_equal(getattr(one.contacts, name), getattr(other.contacts, name))


def test_a_body_of_no_mass_is_seen_to_move_by_the_client_and_by_the_module(client: Any) -> None:
    """A call of the client is seen at once; one past the hooks within a turn of all such bodies, later ones at once."""
    floor(client)
    still = [client.createMultiBody(0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3)) for _ in "abc"]
    world, _ = listen(client)
    for body in still:
        world.add(body)
    place = [0.0, 0.0, 1.0]

    def x_m(body: int) -> float:
        client.stepSimulation()
        motion = world._past
        return float(motion.position_m[motion.roster.code == encode(body, -1)][0, 0])

    assert all(x_m(still[2]) == 0 for _ in range(6))
    client.resetBasePositionAndOrientation(still[2], [0.1, *place[1:]], [0, 0, 0, 1])
    assert x_m(still[2]) == 0.1
    p.resetBasePositionAndOrientation(still[2], [0.2, *place[1:]], [0, 0, 0, 1], physicsClientId=client._client)
    found = [x_m(still[2]) for _ in range(4)]  # the floor and three boxes
    assert found[-1] == 0.2
    for k in range(3, 9):
        p.resetBasePositionAndOrientation(still[2], [0.1 * k, *place[1:]], [0, 0, 0, 1], physicsClientId=client._client)
        assert x_m(still[2]) == 0.1 * k
