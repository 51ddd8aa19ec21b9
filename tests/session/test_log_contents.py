"""What a log holds beside steps: names, surfaces as the simulator has them, settings, versions, and what changed."""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.simulators import direct_client, disconnect, watch_settings
from tests.made.models import STEEL
from tests.made.worlds import ball, box, floor, plate_model

ARM = """<robot name="arm"><link name="trunk"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link><link
name="hand"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision>
<geometry><box size="0.1 0.1 0.1"/></geometry></collision></link><joint name="wrist" type="fixed"><parent
link="trunk"/><child link="hand"/><origin xyz="0 0 0.3"/></joint></robot>"""


@contextmanager
def world() -> Iterator[Any]:
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    yield client
    disconnect(client)


def sounding(listener: sb.Listener, *bodies: int, **how: Any) -> None:
    for body in bodies:
        listener.add(body, material=STEEL, model=plate_model(), **how)


def run(client: Any, steps: int) -> None:
    for _ in range(steps):
        client.stepSimulation()


def urdf(folder: Path, name: str = "cube") -> str:
    text = (
        f'<robot name="{name}"><link name="base"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"'
        ' ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.05 0.05 0.05"/></geometry></collision>'
        "</link></robot>"
    )
    (folder / f"{name}.urdf").write_text(text)
    return str(folder / f"{name}.urdf")


def test_names_are_numbered_in_order_of_appearance_whatever_the_ids(client: Any, tmp_path: Path) -> None:
    """All orders of loading three cubes and a plate give the same names to the same roles."""
    seen = []
    for order in itertools.permutations(range(4)):
        with world() as one:
            made = [-1] * 4
            for role in order:
                name = "plate" if role == 3 else "cube"
                made[role] = one.loadURDF(urdf(tmp_path, name), basePosition=[role, 0, 0.024])
            ground = floor(one)
            listener = sb.attach(one, microphone=())
            sounding(listener, made[2], made[3])
            run(one, 2)
            sounding(listener, made[0])
            bodies = listener.contacts.bodies
            seen.append([next(b.name for b in reversed(bodies) if b.body_id == x) for x in (*made, ground)])
            listener.detach()
    assert len(seen) == 24
    assert {(names[2], names[3], names[4]) for names in seen} == {("cube", "plate", "body 4")}
    assert {frozenset(names[:2]) for names in seen} == {frozenset({"cube 2", "cube 3"})}


def test_a_silent_partner_that_is_added_later_keeps_its_name(client: Any) -> None:
    ground, one = floor(client), box(client, (0, 0, 0.1))
    listener = sb.attach(client)
    sounding(listener, one, name="plate")
    run(client, 80)
    before = {body.body_id: body.name for body in listener.contacts.bodies}
    assert before == {one: "plate", ground: f"body {ground}"}
    sounding(listener, ground)
    run(client, 1)
    sounding(listener, one)
    assert [(b.name, b.body_id, b.until_step) for b in listener.contacts.bodies] == [
        ("plate", one, 81),
        (f"body {ground}", ground, 80),
        (f"body {ground}", ground, -1),
        ("plate", one, -1),
    ]
    assert listener.world.name_of(one) == f"plate (body {one})"


def test_a_name_is_one_living_links_alone(client: Any) -> None:
    first, second = box(client, (0, 0, 0.2)), box(client, (1, 0, 0.2))
    listener = sb.attach(client)
    how = {"material": STEEL, "model": plate_model()}
    sounding(listener, first, name="cup")
    with pytest.raises(SceneError, match=rf"the name 'cup' is that of body {first}; give another"):
        sounding(listener, second, name="cup")
    with pytest.raises(SceneError, match=rf"the name 'jug' is that of body {first}"):
        listener.add_all({first: {**how, "name": "jug"}, second: {**how, "name": "jug"}})
    assert [body.name for body in listener.contacts.bodies] == ["cup"], "all of them or none"
    client.removeBody(first)
    sounding(listener, second, name="cup")
    assert [(body.name, body.body_id) for body in listener.contacts.bodies] == [("cup", first), ("cup", second)]


def test_a_name_by_hand_goes_before_a_number_whatever_the_order(client: Any) -> None:
    bodies = [box(client, (x, 0, 0.2)) for x in range(3)]
    listener = sb.attach(client)
    how = {"material": STEEL, "model": plate_model()}
    listener.add_all({bodies[0]: how, bodies[1]: how, bodies[2]: {**how, "name": "body 0"}})
    assert [body.name for body in listener.contacts.bodies] == ["body 0 #2", "body 1", "body 0"]


@pytest.mark.parametrize("name", ["", "  ", "a\nb", 3, b"x"])
def test_what_is_no_name_is_one_line(client: Any, name: Any) -> None:
    body = box(client, (0, 0, 0.2))
    with pytest.raises(SceneError, match=r"name is .*; give a text of one line") as caught:
        sounding(sb.attach(client), body, name=name)
    assert "\n" not in str(caught.value)


def test_links_have_their_own_names_behind_their_bodys(client: Any, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    arms = [client.loadURDF(str(tmp_path / "arm.urdf"), basePosition=[x, 0, 1]) for x in range(3)]
    listener = sb.attach(client, microphone=())
    how = {"material": STEEL, "model": plate_model()}
    listener.add(arms[0], "all", **how)
    listener.add(arms[1], "all", name="left", **how)
    listener.add(arms[2], "hand", name="right hand", **how)
    listener.add(arms[2], "trunk", **how)
    names = [body.name for body in listener.contacts.bodies]
    assert names == ["arm", "arm/hand", "left", "left/hand", "right hand", "arm 2"]


def test_what_add_was_asked_is_in_the_record(client: Any) -> None:
    one, other = ball(client, (0, 0, 1)), box(client, (1, 0, 1))
    listener = sb.attach(client, microphone=())
    listener.add(one, material="glass", count=2, fixed=[(0, 0, 0.02, 0.001)])
    sounding(listener, other)
    asked, given = listener.contacts.bodies
    assert asked.options == ModalOptions(count=2, fixed=[(0, 0, 0.02, 0.001)]) and asked.mounting == "free"
    assert given.options is None, "its model was given"


def test_surfaces_are_as_the_simulator_has_them(client: Any) -> None:
    """Friction and the like by PyBullet's own answer; damping, which it does not say, where it was seen being set."""
    listener = sb.attach(client)
    one, other = box(client, (0, 0, 1)), box(client, (1, 0, 1))
    client.changeDynamics(one, -1, 0.7, 0.31, rollingFriction=0.02, spinningFriction=0.03)
    client.changeDynamics(one, -1, contactDamping=7.0, contactStiffness=1e5)
    sounding(listener, one, other)
    dynamics = listener.contacts.bodies[0].dynamics
    expected = {
        "mass": 0.7,
        "lateralFriction": 0.31,
        "rollingFriction": 0.02,
        "spinningFriction": 0.03,
        "restitution": 0.6,
        "contactStiffness": 1e5,
        "contactDamping": 7.0,
        "linearDamping": 0.0,
        "angularDamping": 0.0,
        "contactProcessingThreshold": 0.0,
    }
    assert {name: dynamics[name] for name in expected} == expected
    inertia = client.getDynamicsInfo(one, -1)[2]
    assert tuple(dynamics[f"localInertiaDiagonal{axis}"] for axis in "XYZ") == inertia
    assert listener.contacts.bodies[1].dynamics["contactStiffness"] == -1, "as PyBullet says that none was set"


def test_what_nobody_said_is_not_known(client: Any) -> None:
    one = box(client, (0, 0, 1))  # set before anybody listens
    listener = sb.attach(client)
    sounding(listener, one)
    log = listener.contacts
    assert "linearDamping" not in log.bodies[0].dynamics and "restitution" in log.bodies[0].dynamics
    assert not log.engine, "there was no step yet"
    run(client, 1)
    asked = {"fixedTimeStep", "numSubSteps", "numSolverIterations", "numNonContactInnerIterations"}
    assert set(listener.contacts.engine) == asked | {"useRealTimeSimulation"}


def test_arguments_by_place_mean_what_pybullet_takes_them_for() -> None:
    speeds, said = [], []
    for args, kwargs in (((0.4, 0.5, 0, 0, 0, 0.3, 0.2), {}), ((), {"linearDamping": 0.3, "angularDamping": 0.2})):
        with world() as client:
            listener = sb.attach(client)
            body = box(client, (0, 0, 1))
            client.changeDynamics(body, -1, *args, **kwargs)
            client.resetBaseVelocity(body, [1, 0, 0], [0, 1, 0])
            sounding(listener, body)
            run(client, 50)
            speeds.append(client.getBaseVelocity(body))
            dynamics = listener.contacts.bodies[0].dynamics
            said.append((dynamics["linearDamping"], dynamics["angularDamping"]))
    assert said == [(0.3, 0.2)] * 2 and speeds[0] == speeds[1] and speeds[0][0][0] < 0.99


@pytest.mark.parametrize("link", [-1, 0])
def test_damping_of_one_link_is_that_of_its_body(tmp_path: Path, link: int) -> None:
    """It slows the body as much whichever link it is set on, so every link has it."""
    (tmp_path / "arm.urdf").write_text(ARM)
    speeds = []
    for one in (-1, link):
        with world() as client:
            listener = sb.attach(client)
            arm = client.loadURDF(str(tmp_path / "arm.urdf"))
            client.changeDynamics(arm, one, linearDamping=0.5, contactProcessingThreshold=0.01)
            listener.add(arm, "all", material=STEEL, model=plate_model())
            client.resetBaseVelocity(arm, [1, 0, 0])
            run(client, 240)
            speeds.append(client.getBaseVelocity(arm)[0][0])
            bodies = listener.contacts.bodies
    assert speeds[0] == speeds[1] < 0.6
    assert [body.dynamics["linearDamping"] for body in bodies] == [0.5, 0.5]
    assert [body.link for body in bodies if "contactProcessingThreshold" in body.dynamics] == [link]


def test_what_is_set_otherwise_is_a_change_before_its_step(client: Any) -> None:
    ground, one = floor(client), box(client, (0, 0, 0.06))
    listener = sb.attach(client)
    sounding(listener, one)
    run(client, 40)
    client.changeDynamics(one, -1, lateralFriction=0.9)
    client.changeDynamics(one, -1, lateralFriction=0.8, mass=0.5)
    client.changeDynamics(one, -1, lateralFriction=0.8)
    run(client, 2)
    client.setPhysicsEngineParameter(numSolverIterations=7, erp=0.3)
    client.changeDynamics(ground, -1, linearDamping=0.1)
    run(client, 1)
    client.changeDynamics(ground, -1, linearDamping=0.1)
    changes = listener.contacts.changes
    assert [(change.step, change.body) for change in changes] == [(40, 0), (42, None), (42, 1)]
    assert changes[0].values["lateralFriction"] == 0.8 and changes[0].values["mass"] == 0.5
    assert set(changes[0].values) - {"lateralFriction", "mass"} <= {f"localInertiaDiagonal{axis}" for axis in "XYZ"}
    assert changes[1].values == {"numSolverIterations": 7.0, "erp": 0.3}
    assert changes[2].values == {"linearDamping": 0.1}
    log = listener.contacts
    assert log.dynamics(0, 39)["mass"] == 0.4 and log.dynamics(0, 40)["mass"] == 0.5
    assert log.settings(41)["numSolverIterations"] == 50 and "erp" not in log.settings(41)
    client.resetSimulation()
    last = listener.contacts.changes[-1]
    assert (last.step, last.body) == (43, None) and last.values == {"numSolverIterations": 50.0, "erp": None}


def test_settings_made_before_anybody_listens_are_seen_where_they_are_watched() -> None:
    with world() as client:
        watch_settings(client)
        client.setPhysicsEngineParameter(contactERP=0.11, numSolverIterations=20)
        client.setPhysicsEngineParameter(erp=0.2, physicsClientId=client._client)
        client.setDefaultContactERP(0.12, physicsClientId=client._client)
        client.setDefaultContactERP(defaultContactERP=0.13)
        gone = box(client, (0, 0, 1))
        client.removeBody(gone)
        body = box(client, (0, 0, 1))
        listener = sb.attach(client)
        sounding(listener, body)
        run(client, 1)
        log = listener.contacts
        assert log.bodies[0].dynamics["linearDamping"] == 0
        assert {"contactERP": 0.13, "erp": 0.2, "numSolverIterations": 20}.items() <= log.engine.items()
        assert not any("Client" in name for name in log.engine)
        listener.detach()
        assert not {"stepSimulation", "changeDynamics", "setPhysicsEngineParameter"} & set(vars(client))


def test_versions_are_those_of_what_made_the_numbers(client: Any) -> None:
    versions = sb.attach(client).contacts.versions
    packages = {name: importlib.import_module(name).__version__ for name in ("sonic_bullet", "numpy")}
    (name,) = {"pybullet", "pybullet-arm64"} & {one.name for one in metadata.distributions()}
    said = metadata.version(name) + ("" if name == "pybullet" else f" ({name})")
    assert versions == {**packages, "pybullet": said}


def test_equal_runs_give_equal_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        with world() as client:
            listener = sb.attach(client)
            floor(client)
            sounding(listener, box(client, (0, 0, 0.1)), name="plate")
            run(client, 30)
            client.changeDynamics(1, -1, restitution=0.1)
            run(client, 30)
            listener.contacts.save(tmp_path / f"{name}.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    log = sb.read_log(tmp_path / "a.npz")
    assert log.changes[0].values == {"restitution": 0.1} and log.bodies[0].name == "plate"


def test_a_raw_client_says_what_it_says_when_asked() -> None:
    with world() as client:
        p.setPhysicsEngineParameter(numSolverIterations=30, erp=0.2, physicsClientId=client._client)
        body = box(client, (0, 0, 1))
        listener = sb.attach(client._client)
        sounding(listener, body, name="plate")
        for _ in range(2):
            client.stepSimulation()
            listener.step()
        log = listener.contacts
        assert log.engine["numSolverIterations"] == 30 and "erp" not in log.engine
        assert log.bodies[0].name == "plate" and log.bodies[0].dynamics["restitution"] == 0.6


def test_reset_names_and_knows_as_a_fresh_listener_does(tmp_path: Path) -> None:
    """Bodies that have gone leave no number, names given by hand stay, what was set stays known."""
    for name, fresh in (("a", False), ("b", True)):
        with world() as client:
            watch_settings(client)
            floor(client)
            gone, plate, other = (box(client, (x, 0, 0.1)) for x in range(3))
            listener = None if fresh else sb.attach(client)
            if listener is not None:
                sounding(listener, gone, other)
                sounding(listener, plate, name="plate")
                sounding(listener, other)
                run(client, 1)
            client.setPhysicsEngineParameter(erp=0.25)
            client.changeDynamics(other, -1, restitution=0.1)
            client.removeBody(gone)
            for x, body in enumerate((plate, other), start=1):
                client.resetBasePositionAndOrientation(body, [x, 0, 0.1], [0, 0, 0, 1])
                client.resetBaseVelocity(body, [0, 0, 0], [0, 0, 0])
            if listener is None:
                listener = sb.attach(client)
                sounding(listener, plate, name="plate")
                sounding(listener, other)
            else:
                listener.reset()
            run(client, 60)
            listener.contacts.save(tmp_path / f"{name}.npz")
    assert [body.name for body in sb.read_log(tmp_path / "a.npz").bodies] == ["plate", "body 3", "body 0"]
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_where_no_log_is_kept_changes_are_not_either(client: Any) -> None:
    floor(client)
    listener = sb.attach(client)
    sounding(listener, box(client, (0, 0, 1)))
    listener.world.logged = False
    run(client, 2)
    client.changeDynamics(1, -1, restitution=0.2)
    client.setPhysicsEngineParameter(numSolverIterations=9)
    run(client, 1)
    assert listener.world.simulator.changes == ()
