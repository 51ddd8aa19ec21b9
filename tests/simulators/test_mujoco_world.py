"""MuJoCo worlds: impulses balance momentum, shapes weigh what MuJoCo's bodies weigh, every step is seen."""

from __future__ import annotations

import gc
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.geometry import solid_of
from sonic_bullet.records.errors import MeshError, SceneError
from tests.few_cases import parametrize_few
from tests.made.models import STEEL
from tests.made.mujoco_models import DROPPED, MASS_KG, PAIR, made, stepped
from tests.made.worlds import plate_model

mujoco = pytest.importorskip("mujoco")
GRAVITY = np.array([0, 0, -9.81])
FREE = "<body><freejoint/><geom size='.1' {}/></body>"


@pytest.fixture(autouse=True)
def no_listener_of_before() -> None:
    """A listener without a name is watching until it is collected."""
    gc.collect()


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
@parametrize_few("kind", ["ball", "box", "slider"], (0, 2))
def test_impulses_balance_momentum(kind: str, integrator: str) -> None:
    """Over all of a run, and over its first impact, by what the simulator itself says of its speeds."""
    model, data = made(DROPPED[kind], integrator)
    with sb.attach((model, data), microphone=()) as listener:
        speed = [data.qvel[:3].copy()]
        for _ in range(500):
            mujoco.mj_step(model, data)
            speed.append(data.qvel[:3].copy())
        log = listener.contacts
    impulse = np.zeros((500, 3))
    np.add.at(impulse, log.step[log.rows_on(1)], log.impulse_on(1))
    owed = np.cumsum(MASS_KG * (np.diff(speed, axis=0) - GRAVITY * model.opt.timestep) - impulse, axis=0)
    largest = np.abs(np.cumsum(impulse, axis=0)).max()
    assert largest > 0.1
    assert np.abs(owed[-1]).max() < 1e-6 * largest
    if kind != "slider":
        struck = log.step[log.rows.approach_m_s == log.rows.approach_m_s.max()].max()
        assert np.abs(owed[struck]).max() < 1e-6 * largest, "the impact is given out whole"


def test_an_impact_is_one_strike_of_the_speed_it_had() -> None:
    """By default it lasts 30 steps; 3 % of its load are still to come when it is given out."""
    model, data = made(DROPPED["ball"])
    with sb.attach((model, data), microphone=()) as listener:
        stepped(model, data, 200)
        rows = listener.contacts.rows
    strike = np.argmax(np.linalg.norm(rows.impulse_n_s, axis=1))
    assert rows.approach_m_s[strike] == pytest.approx(rows.approach_m_s.max())
    gone = MASS_KG * rows.approach_m_s[strike]
    assert gone < rows.impulse_n_s[strike, 2] < 1.2 * gone
    others = np.delete(rows.impulse_n_s[:, 2], strike)
    assert others.max() < 2 * MASS_KG * 9.81 * model.opt.timestep


def test_shapes_weigh_what_mujocos_bodies_weigh() -> None:
    """All kinds of geom, turned and placed: mass, centre and principal inertia are MuJoCo's own."""
    model, data = made(
        "<body name='all' pos='0 0 1'><freejoint/>"
        "<geom type='sphere' size='.02' pos='.1 0 0'/><geom type='box' size='.02 .03 .04' euler='10 20 30'/>"
        "<geom type='capsule' size='.01 .05' pos='0 .1 0' euler='0 40 0'/>"
        "<geom type='cylinder' size='.02 .03' pos='0 -.1 .1' euler='70 0 0'/>"
        "<geom type='ellipsoid' size='.02 .03 .05' pos='-.1 0 0' euler='0 0 50'/>"
        "<geom type='mesh' mesh='wedge' pos='.1 .1 0' euler='5 6 7'/>"
        "<geom type='sphere' size='.5' contype='0' conaffinity='0' mass='0'/></body>"
    )
    world = sb.attach((model, data), microphone=()).world
    shapes = world.shapes_of(*_called(world, "all"))
    volume, centre, moment = solid_of(shapes)
    record = world.describe(1, -1)
    assert [shape.kind for shape in shapes] == ["sphere", "box", "capsule", "cylinder", "mesh", "mesh"]
    assert 1000 * volume == pytest.approx(record.mass_kg, rel=2e-3)
    assert np.abs(centre).max() < 1e-4
    assert np.abs(1000 * moment - record.inertia_kg_m2).max() < 5e-3 * np.abs(record.inertia_kg_m2).max()


def _called(world: Any, body: object, link: object = -1) -> tuple[int, int]:
    number, links = world.links_called(body, link)
    return number, links[0]


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_motion_is_mujocos_own(integrator: str) -> None:
    """Poses and speeds at the start of each step, of links of a swinging arm, by mj_objectVelocity."""
    model, data = made(PAIR, integrator)
    arm, hand = (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in ("arm", "hand"))
    copy, twist = mujoco.MjData(model), np.zeros(6)
    world = sb.attach((model, data), microphone=()).world
    for _ in range(50):
        copy.qpos[:], copy.qvel[:] = data.qpos, data.qvel
        mujoco.mj_forward(model, copy)
        mujoco.mj_step(model, data)
        for body in (arm, hand):
            row = world._past.row[world.links.row(body, -1)]
            mujoco.mj_objectVelocity(model, copy, mujoco.mjtObj.mjOBJ_BODY, body, twist, 0)
            assert np.allclose(row["position_m"], copy.xipos[body], atol=1e-12)
            assert np.allclose(row["spin_rad_s"], twist[:3], atol=1e-12)
            assert np.allclose(row["velocity_m_s"], twist[3:], atol=1e-12)
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, row["quaternion_xyzw"][[3, 0, 1, 2]])
            assert np.allclose(turn, copy.ximat[body], atol=1e-12)


def test_every_step_of_a_call_is_seen_and_of_no_other_world() -> None:
    model, data = made(DROPPED["ball"])
    other, real, thrown = mujoco.MjData(model), mujoco.mj_step, data.qvel.copy()
    with sb.attach((model, data), microphone=()) as one, sb.attach((model, data), microphone=()) as two:
        mujoco.mj_step(model, data, 5)
        mujoco.mj_step(model, data, nstep=3)
        mujoco.mj_step(model, other)
        mujoco.mj_step1(model, data)
        mujoco.mj_step2(model, data)
        assert len(one.contacts.steps) == len(two.contacts.steps) == 9
        assert one.step().shape == (0, 0)
    assert mujoco.mj_step is real
    plain = mujoco.MjData(model)
    plain.qvel[:] = thrown
    mujoco.mj_step(model, plain, 9)
    assert np.array_equal(plain.qpos, data.qpos), "watched or not, the bits are the same"


def test_steps_by_an_imported_name_are_read_one_by_one() -> None:
    model, data = made(DROPPED["ball"])
    step = mujoco.mj_step
    listener = sb.attach((model, data), microphone=())
    for _ in range(60):
        step(model, data)
        listener.step()
    with sb.attach(made(DROPPED["ball"]), microphone=()) as watched:
        stepped(watched.world.model, watched.world.data, 60)
        assert watched.contacts.rows.row.tobytes() == listener.contacts.rows.row.tobytes()
    step(model, data, 2)
    with pytest.raises(
        SceneError, match=r"2 MuJoCo steps were made and one is seen; call mujoco.mj_step by its module"
    ):
        listener.step()
    staged = made(DROPPED["ball"], "RK4")
    unseen = sb.attach(staged, microphone=())
    step(*staged)
    with pytest.raises(SceneError, match="RK4 was made that was not seen from its start"):
        unseen.step()


def test_links_go_by_name_number_or_all() -> None:
    model, data = made(PAIR)
    listener = sb.attach((model, data), microphone=())
    world = listener.world
    arm = world.links_called("arm", -1)[0]
    assert _called(world, "hand") == (arm + 1, -1) == (_called(world, arm + 1))
    assert world.links_called("arm", "all") == (arm, (-1, 0))
    assert _called(world, "arm", "hand") == (arm, 0)
    assert world.name_of(arm, 0) == f"hand (body {arm + 1})"
    assert _called(world, "shelf")[0] == _called(world, 0, "shelf")[0] == 0
    listener.add("arm", "all", material=STEEL, model=plate_model(), name="robot")
    assert [one.name for one in listener.contacts.bodies] == ["robot", "robot/hand"]
    listener.add("hand", material=STEEL, model=plate_model(), name="robot/hand")
    assert [(one.name, one.until_step) for one in world.living] == [("robot", -1), ("robot/hand", -1)]
    floor = listener.add("floor", material="concrete")[0]
    assert floor.mode_count == 0


@pytest.mark.parametrize(
    ("body", "link", "said"),
    [
        ("hnad", -1, "no body is called 'hnad'; did you mean hand"),
        ("shelf", 3, "a geom of the world is one thing"),
        (99, -1, "body is 99"),
        (0, -1, "the world has several geoms; give the name"),
        (0, 99, "the world has no geom 99"),
        ("arm", 7, "has no link 7"),
        ("arm", "floor", "link is 'floor', and body 1 has none of that name"),
        (1.5, -1, "body is 1.5"),
    ],
)
def test_what_is_not_there_is_one_line(body: Any, link: Any, said: str) -> None:
    listener = sb.attach(made(PAIR), microphone=())
    with pytest.raises(SceneError, match=said):
        listener.add(body, link, material=STEEL)


def test_a_height_field_is_no_shape() -> None:
    ground = "<geom name='hills' type='hfield' hfield='hills'/>"
    listener = sb.attach(made(ground + DROPPED["ball"]), microphone=())
    with pytest.raises(MeshError, match="hills is a height field"):
        listener.add("hills", material=STEEL)


@pytest.mark.parametrize(
    ("body", "option", "said"),
    [
        (FREE.format("contype='0' conaffinity='0'"), "", "the MuJoCo model has no contacts"),
        (FREE.format(""), "<flag contact='disable'/>", "has its contacts disabled; remove"),
        ("<geom size='.1' pos='0 0 1'/>", "", "the MuJoCo model has no contacts"),
    ],
)
def test_a_model_without_contacts_is_refused(body: str, option: str, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        sb.attach(made(body, flags=option))


@pytest.mark.parametrize("client", [(1, 2), (None, None)])
def test_another_pair_is_no_client(client: Any) -> None:
    with pytest.raises(SceneError, match="client is"):
        sb.attach(client)
    model, data = made(DROPPED["ball"])
    with pytest.raises(SceneError, match="client is"):
        sb.attach((data, model))


def test_a_time_step_that_changes_is_in_the_log() -> None:
    model, data = made(DROPPED["ball"])
    with sb.attach((model, data)) as listener:
        stepped(model, data, 3)
        model.opt.timestep = 0.001
        stepped(model, data, 3)
        log = listener.contacts
        assert [step.dt_s for step in log.steps] == [0.002] * 3 + [0.001] * 3
        assert [(one.step, dict(one.values)) for one in log.changes] == [(3, {"timestep": 0.001})]
        assert listener.sound().shape[1] == 432
        model.opt.timestep = 2.0
        with pytest.raises(SceneError, match=r"MuJoCo's timestep is 2.0; set model.opt.timestep"):
            mujoco.mj_step(model, data)


def test_a_reset_moves_all_and_a_listeners_reset_repeats_its_bytes() -> None:
    model, data = made(DROPPED["box"])
    start = data.qvel.copy()
    with sb.attach((model, data)) as listener:
        listener.add("thing", material=STEEL, model=plate_model())
        sounds = []
        for _ in range(2):
            stepped(model, data, 100)
            sounds.append(listener.sound())
            mujoco.mj_resetData(model, data)
            data.qvel[:] = start
            listener.reset()
        assert np.abs(sounds[0]).max() > 0
        assert np.array_equal(*sounds)
        stepped(model, data, 60)
        mujoco.mj_resetData(model, data)
        stepped(model, data, 1)
        assert {one.kind for one in listener.contacts.events} == {"moved"}
