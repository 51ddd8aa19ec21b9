"""Steps of any numbers at the engine's door: what cannot be played is refused, and nothing is read that is not there.

With the sanitizers' build (`make test-all`) every index is checked, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.engine.runtime.synthesizer import Synthesizer
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import SonicBulletError
from tests.made.logs import log

ODD = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, 1e-300, 1e300, -1e300, 1e17, np.pi])


def spoilt(step: Step, rng: np.random.Generator) -> Step:
    """A step some of whose contacts' numbers, or poses, are any others."""
    row = step.contacts.row.copy()
    numbers = row.view(np.float64).reshape(len(row), row.itemsize // 8)[:, 1:]  # behind the indices, which stay
    change(numbers, rng)
    position, quaternion = step.position_m.copy(), step.quaternion_xyzw.copy()
    if rng.random() < 0.3:
        change(position, rng)
        change(quaternion, rng)
    row.setflags(write=False)
    return Step.of_trusted(
        step.dt_s, position, quaternion, step.teleported, Contacts.of_trusted(row), step.gravity_m_s2, step.body
    )


def change(values: Array, rng: np.random.Generator) -> None:
    """Replace some of the values in place."""
    flat = values.reshape(-1)
    for i in np.flatnonzero(rng.random(flat.size) < 0.1):
        flat[i] = ODD[rng.integers(len(ODD))] if rng.random() < 0.7 else rng.normal() * 10.0 ** rng.integers(-9, 10)


@pytest.mark.parametrize("seed", range(40))
def test_any_numbers_end_in_sound_or_in_an_error_of_our_own(seed: int) -> None:
    rng, made = np.random.default_rng(seed), log(seed, steps=10)
    synth = Synthesizer(sr=8000, sensors=made.sensors, seed=0, air=made.air)
    try:
        for step in made.steps:
            with np.errstate(all="ignore"):
                frame = synth.feed(spoilt(step, rng) if seed else step, made.bodies)
            assert np.isfinite(frame).all()
    except SonicBulletError:
        pass
    except ValueError as error:
        assert "not in" in str(error)


def test_a_body_that_is_not_there_is_refused() -> None:
    made = log(1, steps=10)
    number = next(i for i, step in enumerate(made.steps) if len(step.contacts.row))
    row = made.steps[number].contacts.row.copy()
    row["b"][0] = 1_000
    synth = Synthesizer(sr=8000, sensors=made.sensors, seed=0, air=made.air)
    for step in made.steps[:number]:
        synth.feed(step, made.bodies)
    with pytest.raises((ValueError, SonicBulletError)):
        synth.feed(replace(made.steps[number], contacts=Contacts.of_trusted(row)), made.bodies)
