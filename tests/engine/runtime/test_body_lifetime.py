"""Bodies that are gone leave the synthesizer's tables, and no bit of the sound hangs on when they do."""

from __future__ import annotations

import gc
from dataclasses import replace
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.engine.bank.resonator import _compute_played
from sonic_bullet.engine.runtime import synthesizer
from sonic_bullet.engine.runtime.replay import Synthesizer, render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Microphone, ModalSum
from sonic_bullet.records.contacts import Contacts, Step, first_bodies
from sonic_bullet.records.errors import LogError
from tests.made.models import WOOD, box_model
from tests.made.residuals import modes, residual
from tests.made.worlds import EDGES_M, TONES_HZ, floor
from tests.session.test_session_robust import steps

SOURCE = modes(TONES_HZ, 60.0)
SOUNDING = replace(
    WOOD, alpha_per_s=120.0, residual=residual(SOURCE, decay_per_s=60.0, last_s=0.1, lines=((1500.0, 60.0, 0.3),))
)
"""Dies away within a fraction of a second, and hisses."""


def churn(client: Any, count: int, *, every: int = 10, new_models: bool = False, **options: Any) -> sb.Listener:
    """A floor, and boxes that come one after another, sound, and are removed again; some are set elsewhere by hand."""
    ground = floor(client)
    listener = sb.attach(
        client, microphone=[Microphone([0, 0, 1]), Microphone([1, 0, 0.5]), ModalSum()], seed=3, **options
    )
    listener.add(ground, material=WOOD, model=box_model((1, 1, 0.1), (200.0, 410.0), WOOD))
    shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[e / 2 for e in EDGES_M])
    model, rng, boxes = box_model(EDGES_M, TONES_HZ, SOUNDING), np.random.default_rng(0), []
    for step in range(count):
        if step % every == 0:
            place, turn = [*rng.uniform(-1, 1, 2), 0.08], p.getQuaternionFromEuler(rng.uniform(-1, 1, 3))
            boxes.append(client.createMultiBody(0.4, shape, basePosition=place, baseOrientation=turn))
            client.changeDynamics(boxes[-1], -1, contactProcessingThreshold=0, lateralFriction=0.1)
            own = box_model(EDGES_M, TONES_HZ, SOUNDING) if new_models else model
            listener.add(boxes[-1], material=SOUNDING, model=own)
        if len(boxes) > 4:
            client.removeBody(boxes.pop(0))
        if step % 37 == 36:
            client.resetBasePositionAndOrientation(boxes[-1], [0, 0, 0.1], [0, 0, 0, 1])
        client.stepSimulation()
    return listener


@pytest.fixture(scope="module")
def heard() -> tuple[ContactLog, np.ndarray, int]:
    """Log and sound of boxes that came and went, and how many bodies the live tables hold at the end."""
    from sonic_bullet.simulators import direct_client, disconnect

    client = direct_client()
    client.setGravity(0, 0, -9.81)
    listener = churn(client, 300)
    kept = len(listener._synth._state.body)
    found = listener.contacts, listener.sound(), kept
    disconnect(client)
    return found


@pytest.mark.slow
def test_what_is_gone_leaves_and_no_bit_hangs_on_when(
    heard: tuple[ContactLog, np.ndarray, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    log, sound, kept = heard
    assert len(log.bodies) == 31
    assert kept < 20, "the tables hold who is there, who still rings, and what went since the last look"
    assert (np.abs(sound) > 0).any(axis=1).all()
    tables = []
    for every in (1, 7, 64, 10**9):
        monkeypatch.setattr(synthesizer, "LOOK_EVERY", every)
        assert render_log(log).tobytes() == sound.tobytes(), every
        synth = Synthesizer(sr=log.sr, sensors=log.sensors, seed=log.seed, air=log.air)
        for step in log.steps:
            synth.feed(step, log.bodies)
        assert synth.sound().tobytes() == sound.tobytes(), every
        tables.append(len(synth._state.body))
    assert tables == sorted(tables)
    assert tables[0] < tables[-1] == len(log.bodies)


def test_a_log_whose_bodies_never_leave_sounds_the_same(heard: tuple[ContactLog, np.ndarray, int]) -> None:
    """As older logs have it: who is gone stays where it was last, in every later step."""
    log, sound, _ = heard
    position, quaternion = np.zeros((31, 3)), np.tile([0, 0, 0, 1.0], (31, 1))
    later, known = [], 0
    for step in log.steps:
        known = max(known, int(step.body[-1]) + 1)
        teleported = np.zeros(known, bool)
        position[step.body], quaternion[step.body] = step.position_m, step.quaternion_xyzw
        teleported[step.body] = step.teleported
        poses = position[:known], quaternion[:known]
        later.append(Step(step.dt_s, *poses, teleported, step.contacts, step.gravity_m_s2))
    old = replace(log, steps=tuple(later))
    assert all(step.body is first_bodies(len(step.body)) for step in old.steps)
    assert render_log(old).tobytes() == sound.tobytes()


def test_a_body_that_comes_again_is_refused(heard: tuple[ContactLog, np.ndarray, int]) -> None:
    log = heard[0]
    gone = next(i for i, step in enumerate(log.steps) if len(step.body) and step.body[-1] != len(step.body) - 1)
    turned_back = (*log.steps[: gone + 1], log.steps[gone - 1])
    with pytest.raises(LogError, match="comes again, or after body"):
        render_log(replace(log, steps=turned_back))
    with pytest.raises(LogError, match="do not ascend"):
        Step(1 / 240, np.zeros((2, 3)), np.zeros((2, 4)), np.zeros(2, bool), Contacts.none(), body=[1, 0])


@pytest.mark.slow
def test_nothing_holds_a_model_whose_bodies_are_gone(client: Any) -> None:
    """What was computed of it goes with it: tables, resonators, and what functions remember."""
    gc.collect()  # what other tests left
    before = len(_compute_played)
    listener = churn(client, 200, every=4, new_models=True, keep_log=False, keep_sound=False)
    faces = len(listener.world.bodies[-1].model.face)  # type: ignore[union-attr]
    client.resetSimulation()
    steps(client, 600)  # it rings out
    state = listener._synth._state
    assert len(state.resonators) == 0
    assert len(state.table.faces) <= faces
    gc.collect()
    assert len(_compute_played) == before
