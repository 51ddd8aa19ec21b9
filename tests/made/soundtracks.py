"""A log with several bodies in contact: falling, sliding, resting, with a residual, one that comes late and one that
goes.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import sonic_bullet as sb
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import GLASS, STEEL, WOOD, ball_body, box_model
from tests.made.residuals import modes, residual
from tests.made.worlds import EDGES_M, TONES_HZ, ball, box, floor, plate_model

MICROPHONES = (sb.Microphone([0, -1, 0.5]), sb.Microphone([0.7, 0.2, 0.4]))
RATTLING = dataclasses.replace(STEEL, name="rattling", residual=residual(modes(TONES_HZ, 20.0)))


@cache
def table_log() -> ContactLog:
    """0.9 s at 240 Hz: floor, a rattling box, a ball that slides and rolls, a late glass plate, a ball that is removed
    while it rings, and a silent partner.
    """
    client = direct_client()
    try:
        client.setGravity(0, 0, -9.81)
        ground = floor(client)
        listener = sb.attach(client, microphone=MICROPHONES, seed=3)
        listener.add(ground, material=WOOD, model=box_model((1, 1, 0.1), (90.0, 240.0), WOOD, seed=5))
        first = box(client, (0, 0, 0.1))
        listener.add(first, material=RATTLING, model=plate_model(), name="../a/b:")
        rolls = ball(client, (0.3, 0, 0.02))
        listener.add(rolls, material=GLASS, model=ball_body(0.02, GLASS).model, name="marble")
        client.resetBaseVelocity(rolls, [0.8, 0, 0])
        goes = ball(client, (-0.4, 0, 0.06))
        listener.add(goes, material=STEEL, model=box_model((0.04,) * 3, (3100.0,), STEEL, seed=9))
        box(client, (-0.8, 0, 0.02), turn=(0, 0, 0))
        for number in range(216):
            if number == 60:
                late = box(client, (0, 0, 0.3))
                listener.add(late, material=GLASS, model=box_model(EDGES_M, (1010.0, 2222.0), GLASS, seed=7))
            if number == 90:
                client.removeBody(goes)
            client.stepSimulation()
        return listener.contacts
    finally:
        disconnect(client)
