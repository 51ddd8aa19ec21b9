"""Bodies in place, in the run time: live as replayed, what is held, what takes new poles, what passes on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet._engine import STOPPED_TURN, limit_poles
from sonic_bullet.engine.bank.transmission import PHASE
from sonic_bullet.engine.runtime import synthesis_state
from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.pole_tables import PoleTables, pole_tables
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import ContactLog, read_log
from sonic_bullet.records import Array, Material
from sonic_bullet.records.contacts import Contacts
from tests.made.models import STEEL, WOOD, box_body, box_model, row, step
from tests.made.residuals import modes, residual
from tests.made.worlds import EDGES_M, TONES_HZ, box, plate_model

DT = 1 / 240


def board(client: Any) -> int:
    """A wooden table-top of mass 0, top at z = 0."""
    shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.4, 0.3, 0.012])
    body = client.createMultiBody(0, shape, basePosition=[0, 0, -0.012])
    client.changeDynamics(body, -1, restitution=0.5, contactProcessingThreshold=0)
    return int(body)


def landed(
    client: Any,
    seconds: float = 1.0,
    turn: Any = (0.02, 0.01, 0.0),
    material: Material = STEEL,
    friction: float = 0.5,
    **options: Any,
) -> sb.Listener:
    """A steel plate that falls flat on a wooden board."""
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, seed=2, **options)
    listener.add(board(client), material=WOOD, model=box_model((0.8, 0.6, 0.024), (90.0, 210.0, 480.0), WOOD))
    plate = box(client, (0, 0, 0.03), turn=turn)
    client.changeDynamics(plate, -1, lateralFriction=friction)
    listener.add(plate, material=material, model=plate_model())
    for _ in range(round(seconds / DT)):
        client.stepSimulation()
    return listener


def test_live_is_replayed_to_the_bit_whatever_stands_on_what(client: Any, tmp_path: Any) -> None:
    """Live a step at a time, replayed 64 at a time, from memory and from the file; without supports another sound."""
    listener = landed(client)
    sound = listener.sound()
    listener.contacts.save(tmp_path / "log.npz")
    log = read_log(tmp_path / "log.npz")
    assert log.supports
    assert np.array_equal(render_log(log), sound)
    hung = render_log(replace(log, supports=False))
    late = slice(-9600, None)
    assert np.mean(sound[:, late] ** 2) < 0.5 * np.mean(hung[:, late] ** 2), "it rings as if it hung in the air"


def test_without_friction_nothing_is_held_sideways(client: Any) -> None:
    """A plate that stands: its normal spring is the same, sideways a billionth of it is left, as μ is a product."""
    client.setGravity(0, 0, -9.81)
    springs = {}
    for friction in (0.0, 0.5):
        log = landed(client, seconds=0.4, friction=friction).contacts
        held: list[complex] = []

        def look(state: Any, *_: Any, found: list[complex] = held) -> None:
            if state.support_state["points"].any():
                found[:] = state.engine().couple_body(1, state.window.quaternion_xyzw[0])[1].tolist()

        for _ in render_per_body(log, observer=look):
            pass
        springs[friction] = held
        client.resetSimulation()
        client.setGravity(0, 0, -9.81)
    assert springs[0.0] and len(springs[0.0]) == len(springs[0.5])
    loose, gripped = (np.abs(np.reshape(springs[one], (-1, 3))[:, 1:].T / springs[one][::3]) for one in (0.0, 0.5))
    assert loose.max() < 1e-8 and gripped.min() > 0.7  # 2(1 - ν)/(2 - ν)


def test_who_does_not_ask_for_supports_hears_bodies_that_hang(client: Any) -> None:
    listener = landed(client, supports=False)
    assert not listener.contacts.supports and not listener.lifted
    assert np.array_equal(render_log(listener.contacts), listener.sound())


def test_the_held_points_carry_the_weight_while_the_simulators_flicker(client: Any) -> None:
    """Smoothed load and its moment: m g within 2 %, its centre under the body's within 2 % of its length."""
    listener = landed(client, seconds=2.0)
    state = listener._synth._state
    (slot,) = state.pairs.active[: state.pairs.count[0]]
    held = state.pairs.patch[slot]
    load, point = held["load_n"][: held["count"]], held["point_m"][: held["count"], 1]
    assert load.sum() == pytest.approx(0.4 * 9.81, rel=0.02)
    centre = load @ point / load.sum()
    assert np.abs(centre[:2]).max() < 0.02 * EDGES_M[0]
    assert 3 <= held["count"] <= 4


def test_a_body_that_is_lifted_has_its_own_poles_again(client: Any) -> None:
    listener = landed(client)
    state, bank = listener._synth._state, listener._synth._state.bank
    lanes = slice(int(bank.body["start"][1]), int(bank.body["start"][1]) + len(TONES_HZ))
    assert (state.ringing.law[0, lanes] < bank.law[0, lanes]).all(), "what touches takes energy"
    client.resetBasePositionAndOrientation(1, (0, 0, 2.0), (0, 0, 0, 1))
    client.setGravity(0, 0, 0)
    client.resetBaseVelocity(1, (0, 0, 0), (0, 0, 0))
    for _ in range(30):
        client.stepSimulation()
    assert np.array_equal(listener._synth._state.ringing.law[:3, lanes], bank.law[:3, lanes])


def test_a_line_of_a_residual_loses_what_the_mode_that_it_follows_loses(client: Any) -> None:
    lines = ((TONES_HZ[0] + 40.0, 3.0, 0.3), (TONES_HZ[2] - 30.0, 5.0, 0.5))
    source = modes(TONES_HZ, 10.0)
    listener = landed(client, material=replace(STEEL, residual=residual(source, lines=lines)))
    state = listener._synth._state
    voice, row = state.voices[1], state.bank.body[1]
    assert voice is not None
    assert len(voice.follows) == len(lines)
    lanes = slice(int(row["start"]), int(row["start"] + row["columns"]))
    more = state.ringing.law[:2, lanes] - state.bank.law[:2, lanes]
    assert (more[0] < 0).all()
    assert more[:, len(TONES_HZ) :] == pytest.approx(more[:, voice.follows], rel=1e-9)


def test_what_is_quenched_is_silent_on_both_sides(client: Any) -> None:
    listener = landed(client, seconds=0.4)
    listener.quench()
    client.stepSimulation()
    for _ in range(60):
        client.stepSimulation()
    at = int(0.4 * 48_000)
    tail = listener.sound()[:, at + 8 :]
    assert np.abs(tail).max() < 1e-3 * np.abs(listener.sound()).max()


def test_a_body_that_slides_takes_the_place_where_it_lies_now(client: Any) -> None:
    """The lower number keeps its own corners; poles are of where they are on the other."""
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, seed=2)
    sliding = box(client, (-0.25, 0, 0.006), turn=(0, 0, 0))
    listener.add(sliding, material=STEEL, model=plate_model())
    under = board(client)
    listener.add(under, material=WOOD, model=box_model((0.8, 0.6, 0.024), (90.0, 210.0, 480.0), WOOD))
    client.changeDynamics(sliding, -1, lateralFriction=0.05)
    client.resetBaseVelocity(sliding, (0.7, 0, 0))
    for _ in range(100):
        client.stepSimulation()
    state = listener._synth._state
    (slot,) = state.pairs.active[: state.pairs.count[0]]
    held = state.pairs.patch[slot]
    assert client.getBasePositionAndOrientation(sliding)[0][0] > -0.1
    off = np.linalg.norm((held["used_m"] - held["point_m"])[: held["count"]], axis=2)
    assert off.max() < 0.25 * max(EDGES_M)


@pytest.mark.parametrize("material", [STEEL, None])
def test_contacts_that_press_from_both_sides_have_a_direction(material: Material | None) -> None:
    """A ring on a peg: the loads' normals cancel. And where nobody says what touches, there is no spring."""
    bodies = [replace(box_body(EDGES_M, TONES_HZ, STEEL, body_id=i), material=material) for i in range(2)]
    steps = []
    for k in range(120):
        sides = [
            row(0, 1, (0, 0, sign * (0.3 if k == 5 else 0.01)), normal=(0, 0, sign), point_a=(x, y, sign * 0.006),
                point_b=(x, y, sign * 0.006), approach=0.5 if k == 5 else 0.0)
            for sign in (1, -1) for x, y in ((0.02, 0.01), (-0.02, 0.01), (0, -0.01))
        ]  # fmt: skip
        touching = Contacts.join(sides) if k >= 5 else Contacts.none()
        steps.append(step([[0, 0, 0], [0, 0, 0]], touching, gravity=(0, 0, -9.81)))
    microphone = sb.Microphone(np.array([0.0, -1.0, 0.5]))
    sound = render_log(ContactLog(tuple(bodies), tuple(steps), (microphone,), 48_000, 0))
    assert np.isfinite(sound).all() and sound.any()


def test_what_a_touch_stops_is_not_set_free() -> None:
    """A mode that its own material stops within samples stays so, whatever the touch makes of it."""
    free, made = np.array([-0.5 + 0.2j, -1e-4 + 0.2j]), np.array([-3.0 + 0.1j, -3.0 + 0.1j])
    limit_poles(made, free)
    assert (made.real <= np.array([-0.5, -STOPPED_TURN])).all()


def test_a_partner_is_heard_for_one_mode_alone(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a fork: all but its highest mode hardly sound, the highest is 75 dB louder, and the board's part of one of
    the others makes it heard. What a partner's mode sounds goes with the frequency at which it is moved, a quarter of a
    turn from what the plate sends: whatever signs maps have, on the mean over directions powers add.
    """
    state = landed(client)._synth._state
    board, plate = state.resonators
    turned = state.window.quaternion_xyzw[0]

    def heard(loudness: float) -> tuple[bool, Array]:
        """Whether the board is, and with which weights (m,)."""

        def changed(*given: Any) -> PoleTables:
            found = pole_tables(*given)
            weight = np.concatenate([np.full(board.mode_count, loudness + 0j), np.full(plate.mode_count, 0.0043)])
            weight[-1] = 25.4
            return found._replace(weight=weight)

        monkeypatch.setattr(synthesis_state, "pole_tables", changed)
        state._poles = None
        state.mark_changed()
        state.ringing.transmissions["phase"] = PHASE.off
        state.engine().update_poles(1, turned, float(state.bank.sr))
        lanes, half = slice(int(state.bank.body["start"][1]), None), state.bank.law.shape[1]
        real, imaginary = state.ringing.transmission_weight[0].reshape(2, half)[:, lanes][:, : plate.mode_count]
        return bool((state.ringing.transmissions["phase"][1] != PHASE.off).any()), real + 1j * imaginary

    is_heard, weight = heard(1.0)
    assert is_heard
    _, _, omega, _, _, motion, moved = state.engine().couple_body(1, turned)
    velocity = (moved[0] + 1j * moved[1]) @ motion
    assert weight == pytest.approx(1j * np.abs((1 / board.omega_rad_s) @ velocity * omega), rel=1e-9)
    assert np.abs(weight[-1]) < 0.3 * 25.4, "its loudest mode is not why"
    just = 1e-3 * 25.4 / np.abs(weight[:-1]).max()
    assert heard(1.01 * just)[0] and not heard(0.99 * just)[0]


def test_a_plate_on_a_board_makes_it_sound(client: Any) -> None:
    """In the run time too: late, when the board's own ringing is over, what the plate passes on is heard from it."""
    listener = landed(client, seconds=0.6)
    assert (listener._synth._state.ringing.transmissions["phase"][1] == PHASE.steady).any()
