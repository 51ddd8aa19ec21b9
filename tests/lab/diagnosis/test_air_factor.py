"""The factor on what bodies radiate: told by decays where they can tell it, one where they cannot."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.diagnosis.evidence.air_factor import RADIATED_SD, air_factor

LAM = (2 * np.pi * np.geomspace(300, 9000, 20)) ** 2
RADIATED = 3 / (1 + (LAM / (2 * np.pi * 2000) ** 2) ** -2)


def test_decays_tell_the_factor() -> None:
    decay = 0.5 * (2.0 + 2e-9 * LAM) + 1.2 * RADIATED
    decay[4] *= 3  # no mode
    assert air_factor(LAM, decay, 0.002 * decay, RADIATED) == pytest.approx(1.2, abs=0.01)


def test_what_decays_do_not_tell_stays_as_computed() -> None:
    decay = 0.5 * (2.0 + 2e-9 * LAM) + 1.2e-6 * RADIATED
    assert air_factor(LAM, decay, 0.02 * decay, 1e-6 * RADIATED) == pytest.approx(1, abs=1e-3)
    most = air_factor(LAM, 9 * RADIATED, 1e-4 * RADIATED, RADIATED)
    assert most <= 1 + 3 * RADIATED_SD, "a body that loses nine times as much has another cause"
