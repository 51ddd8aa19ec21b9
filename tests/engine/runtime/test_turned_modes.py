"""Pairs of one frequency turn to the contacts' axes: which two a mesh has does not count, and nothing is lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet._engine import TURN, turn_modal_impulse
from sonic_bullet.engine.runtime.replay import Synthesizer
from sonic_bullet.records import Array, ModalModel
from tests.made.models import STEEL, WOOD, box_model

PAIRED_HZ = (700.0, 700.0, 1900.0, 1900.0, 2600.0, 4100.0, 4100.0)
FIRST = np.array([0, 2, 5])
EDGES_M = (0.1, 0.08, 0.03)


def turned_model(angle_rad: float) -> ModalModel:
    """A box of three pairs whose free modes are turned by an angle within each."""
    model = box_model(EDGES_M, PAIRED_HZ, STEEL, seed=3)
    shape, (c, s) = model.shape.astype(float).copy(), (np.cos(angle_rad), np.sin(angle_rad))
    one, other = shape[:, :, FIRST].copy(), shape[:, :, FIRST + 1].copy()
    shape[:, :, FIRST], shape[:, :, FIRST + 1] = c * one + s * other, c * other - s * one
    decay = np.full(len(PAIRED_HZ), 0.5)  # with that of radiation, of which a real pair's two have as much
    return replace(model, shape=shape.astype(np.float32), decay_per_s=decay, includes_radiation=True)


def fallen(client: Any, angle_rad: float) -> sb.Listener:
    """A box falls onto a board, tilted, and comes to rest."""
    client.resetSimulation()
    client.setGravity(0, 0, -9.81)
    board = client.createMultiBody(
        0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.4, 0.4, 0.01]), basePosition=[0, 0, -0.01]
    )
    box = client.createMultiBody(
        7850 * np.prod(EDGES_M), client.createCollisionShape(p.GEOM_BOX, halfExtents=np.array(EDGES_M) / 2),
        basePosition=[0, 0, 0.06], baseOrientation=client.getQuaternionFromEuler([0.3, 0.2, 0]),
    )  # fmt: skip
    listener = sb.attach(client, microphone=sb.Vibrometer(box, (0.05, 0.04, 0.015), (0.3, 0.5, 0.8)))
    listener.add(board, material=WOOD, model=box_model((0.8, 0.8, 0.02), (150, 420, 900), WOOD, seed=1))
    listener.add(box, material=STEEL, model=turned_model(angle_rad))
    for _ in range(240):
        client.stepSimulation()
    return listener


def level_db(sound: Array) -> Array:
    """Level of each 50 ms."""
    return 10 * np.log10((sound[0, : len(sound[0]) // 2400 * 2400].reshape(-1, 2400) ** 2).mean(axis=1) + 1e-30)


def test_what_rings_at_rest_does_not_hang_on_which_two_modes_a_mesh_has(client: Any) -> None:
    sounds = [fallen(client, angle).sound() for angle in (0.0, np.pi / 4, 1.0)]
    levels = np.array([level_db(one) for one in sounds])
    loud = levels[0] > levels[0].max() - 60
    assert loud.sum() > 5
    assert np.ptp(levels[:, loud], axis=0).max() < 0.1


def turn_of(table: Any, b: int) -> Array:
    """The turn (m, m) of a body's modes from its free ones."""
    row = table.bodies[b]
    turn = np.eye(int(row["modes"]))
    for one in table.turns[int(row["turn_at"]) :][: int(row["turns"])]:
        both = slice(int(one["mode"]), int(one["mode"]) + 2)
        turn[both, both] = one["by"]
    return turn


def test_a_turn_keeps_energy_and_sound_and_comes_back(client: Any) -> None:
    """To any angles and back by None: z, weights and shapes are what they were, and Σ w z and |z|² all the while."""
    listener = fallen(client, 0.3)
    log = listener.contacts
    synth = Synthesizer(sr=log.sr, sensors=log.sensors, seed=0, air=log.air, keep=False)
    for one in log.steps[:40]:
        synth.play([one], log.bodies)
    state = synth._state
    b = next(i for i, one in enumerate(state.resonators) if one.mode_count == len(PAIRED_HZ))
    none = np.zeros(0, TURN)
    state.engine().turn_modes(b, none, True)
    lanes = slice(int(state.bank.body["start"][b]), int(state.bank.body["start"][b]) + len(PAIRED_HZ))

    def heard() -> tuple[Array, Array, Array]:
        z, weight = state.ringing.z.reshape(2, -1)[:, lanes], state.bank.weight.reshape(-1, 2, state.bank.law.shape[1])
        row = state.table.bodies[b]
        shape = state.table.shapes[row["shape_at"] :][: 24 * row["columns"]].reshape(24, -1)[:, : len(PAIRED_HZ)]
        return z @ weight[1, 0, lanes], (z**2).sum(axis=1), shape @ turn_of(state.table, b) @ z.T

    first = heard()
    assert first[1].min() > 0
    for angles in ((0.4, -1.0, 2.0), (1.5, 0.2, -0.3), None):
        turn, rows = np.eye(len(PAIRED_HZ)), none if angles is None else np.zeros(len(FIRST), TURN)
        for row, k, angle in zip(rows, FIRST, angles or (), strict=False):
            row["mode"], row["by"] = k, [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            turn[k : k + 2, k : k + 2] = row["by"]
        assert state.engine().turn_modes(b, rows, angles is None)
        assert np.array_equal(turn_of(state.table, b), turn)
        modal_impulse = (free := np.arange(1.0, 1 + state.table.bodies["columns"][b])).copy()
        turn_modal_impulse(state.table.bodies, b, state.table.turns, modal_impulse)
        assert modal_impulse[: len(turn)] == pytest.approx(turn.T @ free[: len(turn)], rel=1e-12)
        assert (modal_impulse[len(turn) :] == free[len(turn) :]).all()
        for was, now in zip(first, heard(), strict=True):
            assert now == pytest.approx(was, rel=1e-5, abs=1e-6 * np.abs(was).max())
