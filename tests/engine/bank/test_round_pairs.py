"""Weights of the two modes of one frequency that a round body has: whichever two a mesh gives, in whichever order."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.records import Air, Array, Body, ModalModel
from tests.made.models import STEEL

AROUND, UP = 96, 6
WAVES = np.arange(2, 9)  # beyond, the near field of so coarse a drum makes the two of a pair differ


def drum() -> tuple[Array, Array]:
    """A cylinder of radius 0.06 m, closed: vertices and faces."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = [np.column_stack([0.06 * np.cos(angle), 0.06 * np.sin(angle), 0 * angle + z]) for z in 0.01 * np.arange(UP)]
    vertex = np.concatenate([*rings, [[0, 0, 0], [0, 0, 0.01 * (UP - 1)]]])
    one = np.arange(AROUND)
    other, bottom, top = (one + 1) % AROUND, len(vertex) - 2, len(vertex) - 1
    face = [np.column_stack([np.full(AROUND, bottom), other, one])]
    for up in AROUND * np.arange(UP - 1):
        face += [np.column_stack([up + one, up + other, up + other + AROUND])]
        face += [np.column_stack([up + one, up + other + AROUND, up + one + AROUND])]
    last = AROUND * (UP - 1)
    face.append(np.column_stack([np.full(AROUND, top), last + one, last + other]))
    return vertex, np.concatenate(face)


def body_of(mixed: Array) -> tuple[Body, Array]:
    """A body of pairs cos nθ, sin nθ, each mixed by an orthogonal (2, 2); and its shapes."""
    vertex, face = drum()
    angle, radius = np.arctan2(vertex[:, 1], vertex[:, 0]), np.hypot(vertex[:, 0], vertex[:, 1]) / 0.06
    both = np.stack([np.cos(angle[:, None] * WAVES + 0.3), np.sin(angle[:, None] * WAVES + 0.3)], axis=-1) @ mixed
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) * (radius * (vertex[:, 2] / 0.05) ** 2)[:, None]
    shape = (out[:, :, None] * both.reshape(len(vertex), 1, -1)).astype(np.float32)
    freq = np.repeat(300.0 * WAVES**2, 2)
    model = ModalModel(freq, 0 * freq + 2, shape, vertex, face, np.zeros(len(face)), 5e-4, 1.0, includes_radiation=True)
    return Body(0, -1, 0, "drum", 1.0, 1e-3 * np.eye(3), 5e-4, material=STEEL, model=model), shape


def heard(mixed: Array) -> Array:
    """Sum each pair's weights times its shapes: what a strike anywhere makes of it (v, 3, n)."""
    body, shape = body_of(mixed)
    weight = build_resonator(body, (), 192_000, Air()).weight[0]
    return (weight * shape).reshape(*shape.shape[:2], -1, 2).sum(axis=-1)


@pytest.mark.parametrize("mixed", [[[0, 1], [1, 0]], [[0.8, -0.6], [0.6, 0.8]], [[0.6, 0.8], [0.8, -0.6]]])
def test_another_two_of_the_plane_sound_the_same(mixed: list[list[float]]) -> None:
    alike = 0.1  # how much the two of a pair may differ in size and count as one of a round body
    usual, other = heard(np.eye(2)), heard(np.array(mixed))
    for n in range(len(WAVES)):
        assert np.abs(other[:, :, n] - usual[:, :, n]).max() < alike * np.abs(usual[:, :, n]).max(), WAVES[n]
