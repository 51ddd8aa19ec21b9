"""The engine against the instrument on one page: -100 dB or better, energy of the difference over that of the sound.

Logs are made here by PyBullet in small worlds, with models by hand; residuals are off. Each test prints its figure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import ContactLog
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import ModalModel, TouchedSurface
from sonic_bullet.records.contacts import Contacts, Event, Step
from sonic_bullet.records.receivers import MicrophonePath
from tests.made.models import STEEL, WOOD, ball_body, box_model
from tests.made.worlds import ball, box, plate_model
from tests.reference.instrument import Instrument, NotOnThisPage

MOST_DB = -100.0
DT = 1 / 240
BOARD_M = (0.8, 0.6, 0.024)
ROUGH_STEEL, ROUGH_WOOD = replace(STEEL, roughness_m=2e-6), replace(WOOD, roughness_m=5e-6)
EAR = sb.Microphone((0.2, -0.6, 0.3))


def board_model() -> ModalModel:
    return box_model(BOARD_M, (90.0, 210.0, 480.0, 1100.0), WOOD)


def board(client: Any, listener: sb.Listener) -> int:
    """A wooden board of mass 0, top at z = 0."""
    shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[e / 2 for e in BOARD_M])
    body = client.createMultiBody(0, shape, basePosition=[0, 0, -BOARD_M[2] / 2])
    client.changeDynamics(body, -1, restitution=0.6, contactProcessingThreshold=0)
    listener.add(body, material=ROUGH_WOOD, model=board_model())
    return int(body)


def listened(
    client: Any, scene: Callable[[sb.Listener], None], seconds: float, *, microphone: Any = EAR, gravity: float = -9.81
) -> ContactLog:
    """What happens in a scene."""
    client.setGravity(0, 0, gravity)
    listener = sb.attach(client, microphone=microphone, seed=3)
    scene(listener)
    for _ in range(round(seconds / DT)):
        client.stepSimulation()
    log = replace(listener.contacts, residual=False)
    listener.detach()
    return log


def held_to_the_page(name: str, log: ContactLog) -> Instrument:
    """Play a log by both; print and check the difference."""
    page = Instrument(log, lambda model: radiation_of(model, log.air))
    meant, played = page.play(), render_log(log)
    assert meant.shape == played.shape and (meant**2).sum() > 0
    db = float(10 * np.log10(((played - meant) ** 2).sum() / (meant**2).sum()))
    print(f"{name}: {db:.1f} dB, {len(page.strikes)} strikes, {len(page.frictions)} frictions")
    assert db <= MOST_DB
    return page


def test_a_strike(client: Any) -> None:
    """A steel ball flies into a plate that floats."""

    def scene(listener: sb.Listener) -> None:
        plate = box(client, (0, 0, 0), turn=(0, 0, 0))
        listener.add(plate, material=STEEL, model=plate_model())
        small = ball(client, (0.063, 0.021, 0.04))
        client.resetBaseVelocity(small, (0.1, 0, -1.3))
        listener.add(small, material=STEEL, model=ball_body(0.02).model)

    page = held_to_the_page("a strike", listened(client, scene, 0.2, gravity=0.0))
    assert len(page.strikes) == 1 and page.source[0].any() and page.dipole[1].any()


def test_a_strike_that_is_handed_on(client: Any) -> None:
    """A steel ball strikes the first of two that touch: the second takes what the first cannot keep, a little later."""

    def scene(listener: sb.Listener) -> None:
        for x_m in (-0.0503, 0.0, 0.0399999):
            one = ball(client, (x_m, 0, 0))
            client.resetBaseVelocity(one, (1.5 if x_m < 0 else 0.0, 0, 0))
            listener.add(one, material=STEEL, model=ball_body(0.02).model)

    page = held_to_the_page("a strike that is handed on", listened(client, scene, 0.1, gravity=0.0))
    first, second = page.strikes
    assert second.budget < second.accepted and second.start_n > first.start_n


def test_a_bounce(client: Any) -> None:
    """A plate falls on a board, corner by corner, and bounces."""

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        listener.add(box(client, (0, 0, 0.12)), material=ROUGH_STEEL, model=plate_model())

    page = held_to_the_page("a bounce", listened(client, scene, 0.4))
    assert len(page.strikes) >= 4


def test_a_bounce_of_a_body_whose_elements_lean(client: Any) -> None:
    """A plate whose mesh bevels its rims: where it is curved the surface as given says."""
    given = plate_model()
    surface = TouchedSurface(given.vertex_m, given.face, given.curvature_per_m)
    bevelled = replace(given, vertex_m=given.vertex_m * np.where(given.vertex_m[:, 2:] > 0, 1.0, [0.8, 0.8, 1.0]))
    strikes = []
    for model in (bevelled, replace(bevelled, touched=surface)):

        def scene(listener: sb.Listener, model: ModalModel = model) -> None:
            board(client, listener)
            listener.add(box(client, (0, 0, 0.12)), material=ROUGH_STEEL, model=model)

        page = held_to_the_page("a body whose elements lean", listened(client, scene, 0.4))
        strikes.append([one.curvature for one in page.strikes])
    assert strikes[0] != strikes[1]


def test_a_slide(client: Any) -> None:
    """A wooden box slides to rest on a board."""
    edges = (0.08, 0.06, 0.04)

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        slider = box(client, (-0.1, 0, 0.0201), edges=edges, mass=0.13, turn=(0, 0, 0.2))
        client.resetBaseVelocity(slider, (0.9, 0.1, 0))
        listener.add(slider, material=ROUGH_WOOD, model=box_model(edges, (900.0, 2300.0, 4100.0, 7700.0), WOOD))

    page = held_to_the_page("a slide", listened(client, scene, 0.3))
    assert len(page.frictions) > 30


def test_a_roll(client: Any) -> None:
    """A steel ball rolls along a board."""

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        roller = ball(client, (-0.2, 0.02, 0.02), mass=0.26)
        client.resetBaseVelocity(roller, (1.0, 0, 0), (0, 50.0, 0))
        listener.add(roller, material=ROUGH_STEEL, model=ball_body(0.02).model)

    page = held_to_the_page("a roll", listened(client, scene, 0.3))
    assert len(page.frictions) > 30


def test_a_body_at_rest_on_another(client: Any) -> None:
    """A plate comes to rest on a board: other poles, and what passes on to the board."""

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        listener.add(box(client, (0, 0, 0.02), turn=(0.02, 0.01, 0.0)), material=ROUGH_STEEL, model=plate_model())

    log = listened(client, scene, 0.6)
    page = held_to_the_page("a body at rest on another", log)
    hung = Instrument(replace(log, supports=False), lambda model: radiation_of(model, log.air))
    hung.play()
    assert page.modes[1].passed and page.modes[1].passed[0].to == 0, "the board sounds with the plate"
    left, alone = ((np.abs(one.modes[1].z) ** 2).sum() for one in (page, hung))
    assert 0 < left < 0.5 * alone, "its support takes energy"


def test_two_bodies_of_one_model(client: Any) -> None:
    """Two plates of one model meet in the air, and fall on a board."""

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        model = plate_model()
        for side in (-1, 1):
            plate = box(client, (side * 0.12, 0.01 * side, 0.1), turn=(0.1, 0.3 * side, 0))
            client.resetBaseVelocity(plate, (-0.8 * side, 0, 0.5))
            listener.add(plate, material=ROUGH_STEEL, model=model)

    log = listened(client, scene, 0.4)
    assert log.bodies[1].model is log.bodies[2].model
    page = held_to_the_page("two bodies of one model", log)
    assert any(strike.pair.key == (1, 2) for strike in page.strikes)


def test_more_contacts_than_time_for_poles(client: Any) -> None:
    """Two plates and a ball fall on a board: who gets new poles, when not all can."""

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        for place in ((0, 0, 0.1), (0.02, 0.01, 0.2)):
            listener.add(box(client, place), material=ROUGH_STEEL, model=plate_model())
        roller = ball(client, (-0.2, 0.02, 0.05), mass=0.26)
        client.resetBaseVelocity(roller, (0.6, 0, 0), (0, 20, 0))
        listener.add(roller, material=ROUGH_STEEL, model=ball_body(0.02).model)

    page = held_to_the_page("more contacts than time for poles", listened(client, scene, 0.7))
    assert page.supports.credit_s < 0.001 and page.supports.stale.any()


PATH = MicrophonePath([0.0, 0.15, 0.4], [[0.3, -0.5, 0.2], [-0.3, -0.4, 0.4], [0, 1, 0.3]])
MOVED = {"a path": sb.Microphone(path=PATH), "a body": sb.Microphone((0.02, 0.0, 0.4), body_id=1)}


@pytest.mark.parametrize("name", MOVED)
def test_a_moved_microphone(client: Any, name: str) -> None:
    """A microphone flies past a plate that bounces, or with it."""

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        plate = box(client, (0, 0, 0.06))
        client.resetBaseVelocity(plate, (0.5, 0, 0))
        listener.add(plate, material=ROUGH_STEEL, model=plate_model())

    held_to_the_page(f"a microphone moved by {name}", listened(client, scene, 0.3, microphone=MOVED[name]))


def test_a_body_that_is_set_elsewhere(client: Any) -> None:
    """A plate that bounces on a board at 44.1 kHz is set elsewhere, and falls there."""
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=EAR, seed=3, sr=44_100)
    board(client, listener)
    plate = box(client, (0, 0, 0.05))
    listener.add(plate, material=ROUGH_STEEL, model=plate_model())
    for step in range(80):
        if step == 30:
            client.resetBasePositionAndOrientation(plate, (0.2, 0.1, 0.08), (0, 0, 0, 1))
        client.stepSimulation()
    log = replace(listener.contacts, residual=False)
    assert [event.kind for event in log.events] == ["moved"]
    held_to_the_page("a body that is set elsewhere", log)


def test_a_strike_in_the_first_step(client: Any) -> None:
    """A strike of bodies that overlap as the log begins lies before it as if a step of the first's length came there,
    whatever the lengths of later steps.
    """

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        plate = box(client, (0, 0, 0.0046), turn=(0, 0, 0))
        client.resetBaseVelocity(plate, (0, 0, -0.5))
        listener.add(plate, material=ROUGH_STEEL, model=plate_model())

    log = listened(client, scene, 0.1)
    later = [replace(one, dt_s=2 * DT) if t == 3 else one for t, one in enumerate(log.steps)]
    page = held_to_the_page("a strike in the first step", replace(log, steps=later))
    assert page.strikes[0].step == 0 and page.strikes[0].meets_s < 0


def test_what_the_page_leaves_out(client: Any) -> None:
    """Logs that need it are refused: a quench, a body that comes, modes that turn to a contact."""
    pairs = box_model((0.2, 0.1, 0.01), (740.0, 745.0, 1230.0, 2950.0), STEEL)

    def scene(listener: sb.Listener) -> None:
        board(client, listener)
        listener.add(box(client, (0, 0, 0.02), turn=(0.02, 0.01, 0.0)), material=ROUGH_STEEL, model=pairs)

    log = listened(client, scene, 0.2)
    first = log.steps[0]
    alone = Step(first.dt_s, first.position_m[:1], first.quaternion_xyzw[:1], first.teleported[:1], Contacts.none())
    for needs, reason in (
        (log, "nearly one frequency"),
        (replace(log, events=(Event("quench", 4),)), "quench"),
        (replace(log, steps=[alone, *list(log.steps)[1:]]), "come or go"),
    ):
        with pytest.raises(NotOnThisPage, match=reason):
            Instrument(needs, lambda model: radiation_of(model, log.air)).play()
