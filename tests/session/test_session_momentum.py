"""The user's own audit: `contacts.impulse_on` against what the velocities say. (All shapes and steps:
tests/simulators/test_momentum.py.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from tests.made.worlds import ball, box, floor

MASS_KG = 0.3


@pytest.mark.parametrize("floor_first", [True, False])
@pytest.mark.parametrize("make", [ball, box])
def test_impulse_on_is_all_the_momentum(client: Any, make: Any, floor_first: bool) -> None:
    if floor_first:
        floor(client)
    body = make(client, (0, 0, 0.15), mass=MASS_KG)
    if not floor_first:
        floor(client)
    client.resetBaseVelocity(body, [0.6, 0.1, -0.5], [3, 1, 2])
    listener = sb.attach(client)
    start = np.array(client.getBaseVelocity(body)[0])
    for _ in range(240):
        client.stepSimulation()
    change = MASS_KG * (np.array(client.getBaseVelocity(body)[0]) - start - np.array([0, 0, -9.81]))
    impulse = listener.contacts.impulse_on(body)
    error = np.abs(impulse.sum(axis=0) - change).max() / np.abs(impulse).sum()
    print(f"{make.__name__}, floor first {floor_first}: {error:.1e}")
    assert error < 1e-12
    assert np.linalg.norm(impulse[:, :2].sum(axis=0)) > 0.01  # friction is in it
    assert impulse.shape == (len(listener.contacts.rows_on(body)), 3)
    per_step = np.zeros((240, 3))
    np.add.at(per_step, listener.contacts.step[listener.contacts.rows_on(body)], impulse)
    assert (per_step[:, 2] >= 0).all()
