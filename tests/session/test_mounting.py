"""How a body is held: what its place takes of its modes, in the record, the log, a reset and a replay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import read_log
from sonic_bullet.records import Air, Body
from sonic_bullet.records.errors import RecordError, SceneError
from tests.made.models import STEEL
from tests.made.worlds import box, floor, plate_model

IN_PLACE = 0.03

MODEL = plate_model()


def held(mounting: Any) -> Body:
    return Body(0, -1, 0, "board", 0.0, np.zeros((3, 3)), material=STEEL, model=MODEL, mounting=mounting)


@pytest.mark.parametrize(("mounting", "eta"), [("free", 0.0), ("placed", IN_PLACE), (0.0, 0.0), (0.2, 0.2)])
def test_a_place_takes_eta_omega_over_two_of_every_mode(mounting: Any, eta: float) -> None:
    """T60 = 2.2/(η f) where nothing else takes anything: d = ηω0/2 more, and ω0 stays."""
    free, here = (build_resonator(held(how), (), 96_000, Air()) for how in ("free", mounting))
    undamped = np.hypot(free.omega_rad_s, free.decay_per_s)
    assert here.decay_per_s - free.decay_per_s == pytest.approx(eta * undamped / 2, rel=1e-9, abs=1e-12)
    assert np.hypot(here.omega_rad_s, here.decay_per_s) == pytest.approx(undamped, rel=1e-12)
    assert np.array_equal(here.weight, free.weight), "both sides radiate"


def test_on_the_floor_one_side_radiates() -> None:
    """Half the power, and half of what radiating costs."""
    placed, floored = (build_resonator(held(how), (), 96_000, Air()) for how in ("placed", "on floor"))
    power = np.abs(floored.weight[0]) ** 2 / np.abs(placed.weight[0]) ** 2
    assert power == pytest.approx(0.5)
    radiated = 2 * np.pi * np.abs(placed.weight[0]) ** 2 / (1.2 * 343.0)
    assert placed.decay_per_s - floored.decay_per_s == pytest.approx(radiated / 2, rel=1e-6, abs=1e-9)


def test_who_never_moves_is_placed_unless_said_otherwise(client: Any, tmp_path: Path) -> None:
    """In the record, in the file, and after a reset; a replay is what was heard."""
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, seed=1)
    bodies = [floor(client), box(client, (0, 0, 0.1)), box(client, (1, 0, 0.1)), floor(client)]
    for body, how in zip(bodies, ({}, {}, {"mounting": 0.2}, {"mounting": "on floor"}), strict=True):
        listener.add(body, material=STEEL, model=MODEL, **how)

    def heard() -> tuple[list[Any], Any]:
        for _ in range(60):
            client.stepSimulation()
        return [body.mounting for body in listener.world.bodies], listener.sound()

    mountings, sound = heard()
    assert mountings == ["placed", "free", 0.2, "on floor"]
    listener.contacts.save(tmp_path / "log.npz")
    log = read_log(tmp_path / "log.npz")
    assert [body.mounting for body in log.bodies] == mountings
    assert np.abs(sound).max() > 0
    assert np.array_equal(render_log(log), sound)
    free = replace(log, bodies=tuple(replace(body, mounting="free") for body in log.bodies))
    assert not np.array_equal(render_log(free), sound), "a place is heard"
    listener.reset()
    assert heard()[0] == mountings


@pytest.mark.parametrize("wrong", ["glued", -0.1, 1.5, True, float("nan"), []])
def test_what_is_no_mounting_is_refused_by_name(client: Any, wrong: Any) -> None:
    body = floor(client)
    listener = sb.attach(client)
    with pytest.raises(SceneError, match=r"mounting is .*'placed', 'on floor' or a loss factor"):
        listener.add(body, material=STEEL, model=MODEL, mounting=wrong)
    with pytest.raises(RecordError, match="mounting is"):
        held(wrong)
