"""A steel bar, modes by finite elements, struck in a PyBullet world: which modes ring is symmetry's to say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.records import ModalModel
from tests.made.models import STEEL, ball_body

LENGTH_M, SIDE_M = 0.24, 0.01
NODE_OF_FIRST = 0.2242  # of the free bar's length [Blevins 1979, table 8-1]


def struck_bar(client: Any, at_m: float) -> tuple[sb.Listener, ModalModel]:
    client.setGravity(0, 0, 0)
    bar = client.createMultiBody(
        7850 * LENGTH_M * SIDE_M**2,
        client.createCollisionShape(p.GEOM_BOX, halfExtents=[LENGTH_M / 2, SIDE_M / 2, SIDE_M / 2]),
    )
    hammer = client.createMultiBody(
        0.004, client.createCollisionShape(p.GEOM_SPHERE, radius=0.005), basePosition=[at_m, 0, 0.012]
    )
    for body in (bar, hammer):
        client.changeDynamics(
            body, -1, restitution=0.9, contactProcessingThreshold=0, linearDamping=0, angularDamping=0
        )
    client.resetBaseVelocity(hammer, [0, 0, -1.0])
    ear = sb.Vibrometer(bar, [0.93 * LENGTH_M / 2, 0.0, SIDE_M / 2], [0, 0, 1])
    listener = sb.attach(client, microphone=[sb.Microphone([0, -0.4, 0.3]), ear, sb.ModalSum()])
    (model,) = listener.add(bar, material="steel", to_hz=12_000)
    listener.add(hammer, material=STEEL, model=ball_body(0.005).model)
    for _ in range(240):
        client.stepSimulation()
    return listener, model


def bending_pairs(model: ModalModel) -> list[list[int]]:
    """Bending modes in order, each with its twin across: those in which the end section moves sideways as a whole
    (torsion's mean is 0).
    """
    end = np.flatnonzero(model.vertex_m[:, 0] > 0.4999 * LENGTH_M)
    corners = end[np.argsort(-np.abs(model.vertex_m[end, 1:]).sum(axis=1))[:4]]
    mean = np.abs(model.shape[corners].astype(float).mean(axis=0))  # (3, m)
    bends = [m for m in range(model.mode_count) if mean[1:, m].max() > 1.0 and mean[0, m] < 0.3 * mean[1:, m].max()]
    pairs: list[list[int]] = []
    for m in bends:
        if pairs and model.freq_hz[m] < 1.01 * model.freq_hz[pairs[-1][0]]:
            pairs[-1].append(m)
        else:
            pairs.append([m])
    return pairs


def bending_levels_db(listener: sb.Listener, model: ModalModel, channel: int) -> np.ndarray:
    """Level of each bending pair in 0.7 s of the ringing, relative to the loudest."""
    sound = listener.sound()[channel, -33_600:]
    windowed = np.blackman(len(sound)) * sound
    time = np.arange(len(sound)) / listener.sr
    level = [
        max(abs(np.sum(windowed * np.exp(-2j * np.pi * model.freq_hz[m] * time))) for m in pair)
        for pair in bending_pairs(model)
    ]
    return 20 * np.log10(np.array(level) / max(level))


def test_struck_in_the_middle_odd_modes_ring_and_even_ones_stay_silent(client: Any) -> None:
    listener, model = struck_bar(client, 0.0)
    pairs = bending_pairs(model)
    assert [len(pair) for pair in pairs[:4]] == [2] * 4
    freq = np.array([model.freq_hz[pair[0]] for pair in pairs])
    assert freq[1] / freq[0] == pytest.approx(61.673 / 22.373, rel=0.03)  # Timoshenko lowers it
    for channel, name in enumerate(("microphone", "vibrometer", "modal sum")):
        level = bending_levels_db(listener, model, channel)
        odd, even = level[0::2], level[1::2]
        print(f"middle, {name}: {freq.round()} Hz, {level.round(1)} dB")
        if channel == 0:  # short waves radiate far better: each even mode is set against the odd one above it
            assert (even[: len(odd) - 1] < odd[1:] - 40).all()
        else:
            assert (even < odd.min() - 40).all()


def test_a_strike_at_the_node_of_the_first_mode_leaves_it_out(client: Any) -> None:
    listener, model = struck_bar(client, LENGTH_M * (NODE_OF_FIRST - 0.5))
    for channel, name in enumerate(("microphone", "vibrometer", "modal sum")):
        level = bending_levels_db(listener, model, channel)
        print(f"node, {name}: {level.round(1)} dB")
        assert level[0] < -40
        assert level[1] > -30
