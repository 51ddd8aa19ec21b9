"""Patterns of modes against the map, the mean over directions, and what a microphone on each side hears."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.replay import log_frames, render_log
from sonic_bullet.radiation.far_field import SurfaceTerms, spread_directions, surface_pressure, surface_terms
from sonic_bullet.radiation.pattern import interpolate_pattern, radiation_pattern, toward
from sonic_bullet.records import Air, Array, Microphone, ModalModel, Sensor
from tests.engine.path.space.test_receivers import struck
from tests.made.models import STEEL, box_model

AIR = Air()
EVERY = np.concatenate([spread_directions(100)[0], -spread_directions(100)[0]])


@pytest.fixture(scope="module")
def plate() -> ModalModel:
    return box_model((0.2, 0.1, 0.01), (700.0, 1500.0, 3100.0), STEEL)


def test_the_mean_square_over_directions_is_one(plate: ModalModel) -> None:
    """Today's average is what is left of a pattern: within 0.1 dB, by another rule than it was scaled by."""
    grid = radiation_pattern(plate, AIR)
    assert grid is not None
    unit = np.random.default_rng(0).normal(size=(20_000, 3))
    mean = (np.abs(interpolate_pattern(grid, unit)) ** 2).mean(axis=0)
    np.testing.assert_allclose(10 * np.log10(mean), 0, atol=0.1)


def test_a_pattern_is_the_map(plate: ModalModel) -> None:
    """Between its points it is within 4 % of the map's mean where the body is up to a wavelength long."""
    grid, terms = radiation_pattern(plate, AIR), surface_terms(plate, AIR)
    assert grid is not None and isinstance(terms, SurfaceTerms)
    pressure, reach = surface_pressure(terms, AIR, EVERY[:100] @ terms.turn.T, np.arange(3))
    want = pressure * np.exp(-1j * terms.k[:, None] * reach)
    want = want / np.sqrt((np.abs(want) ** 2).mean(axis=1, keepdims=True))
    found = interpolate_pattern(grid, EVERY).T
    error = np.sqrt((np.abs(found - want) ** 2).mean(axis=1))
    assert (error[:2] < 0.04).all() and error[2] < 0.1
    for unit, one in zip(EVERY[:20], found.T, strict=False):
        np.testing.assert_allclose(toward(grid, unit), one, atol=1e-12)


def sensors(place: Array, directivity: bool) -> tuple[Sensor, ...]:
    return tuple(Microphone(one, directivity=directivity) for one in place)


def test_microphones_all_around_receive_the_energy_of_the_mean() -> None:
    """Within 0.1 dB together, and apart by over 10 dB."""
    log = struck((), np.zeros(3), steps=12, tones=2)
    energy = [(render_log(replace(log, sensors=sensors(3 * EVERY, one))) ** 2).sum(axis=1) for one in (False, True)]
    assert abs(10 * np.log10(energy[1].mean() / energy[0].mean())) < 0.1
    assert 10 * np.log10(energy[1].max() / energy[1].min()) > 10


def test_a_body_that_spins_sweeps_its_pattern_without_clicks() -> None:
    """At 12 rad/s its level rises and falls; over 6 kHz nothing is above -70 dB; live and by bodies it is the same."""
    steps, spin = 240, 12.0
    log = struck((Microphone([0.6, 0, 0], directivity=True), Microphone([0.6, 0, 0])), np.zeros(3), steps=steps)
    turned = Rotation.from_rotvec(np.outer(np.arange(steps) * spin / 240, [0, 1, 0])).as_quat()
    made = []
    for one, quaternion in zip(log.steps, turned, strict=True):
        both = one.quaternion_xyzw.copy()
        both[0] = quaternion
        made.append(replace(one, quaternion_xyzw=both))
    log = replace(log, steps=tuple(made))
    sound = render_log(log)
    inner = slice(6000, -3000)
    level = np.abs(sound[0, inner]).reshape(-1, 300).max(axis=1)
    assert level.max() / level.min() > 3
    high = sosfiltfilt(butter(8, 6000, "high", fs=48_000, output="sos"), sound[0])[inner]
    assert 20 * np.log10(np.abs(high).max() / np.abs(sound[0]).max()) < -70
    frames = np.concatenate(list(log_frames(log)), axis=1)
    np.testing.assert_array_equal(frames[:, 600:], sound[:, :-600])
    apart = np.concatenate([block.sum(axis=0) for _, block in render_per_body(log)], axis=1)
    np.testing.assert_allclose(apart, sound, atol=1e-12 * np.abs(sound).max())
