"""Of a crowd of poles those are picked that take most of the recordings one after another."""

from __future__ import annotations

import numpy as np

from sonic_bullet.estimator.lines import joint_lines
from sonic_bullet.estimator.picked import picked
from sonic_bullet.records import Array

SR, N = 44_100, 44_100
TRUE = np.array([300.0, 900.0, 2500.0, 7000.0, 7040.0])
DECAY = np.array([9.0, 15.0, 26.0, 60.0, 40.0])
SIZE = np.array([[0.01, 0.02, 0.05, 1.0, 0.5], [0.02, 0.01, 0.03, 0.4, 1.0]])


def rings(freq_hz: Array, decay_per_s: Array, size: Array) -> Array:
    t = np.arange(N) / SR
    return size @ (np.exp(-decay_per_s[:, None] * t) * np.cos(2 * np.pi * freq_hz[:, None] * t))


def test_what_is_there_is_picked_from_a_crowd_about_the_loudest() -> None:
    """Hundreds of poles a few hertz from two loud lines, which three quiet ones 26 to 40 dB below must not yield to."""
    rng = np.random.default_rng(0)
    near = np.concatenate([7000 + rng.normal(0, 60, 300), TRUE])
    fast = np.concatenate([rng.uniform(20, 400, 300), DECAY])
    pole = -fast + 2j * np.pi * near
    found = picked(rings(TRUE, DECAY, SIZE), np.full(2, 1e-6), pole, SR, 12)
    assert {300, 301, 302} <= set(found.tolist())
    assert len(set(found.tolist())) == 12


def test_each_takes_of_what_is_left_and_the_true_ones_leave_nothing() -> None:
    pole = -DECAY + 2j * np.pi * TRUE
    order = picked(rings(TRUE, DECAY, SIZE), np.ones(2), pole, SR, 5)
    assert sorted(order.tolist()) == [0, 1, 2, 3, 4]
    doubled = np.concatenate([pole, pole])
    assert len(picked(rings(TRUE, DECAY, SIZE), np.ones(2), doubled, SR, 10)) == 5  # the same again says nothing


def test_low_lines_of_a_reverberant_recording_are_still_lines() -> None:
    """Forty modes in a room of 0.6 s: hundreds of starting poles, of which too few had been low ones' (none below 3 kHz in a case like this)."""
    rng = np.random.default_rng(1)
    freq = np.geomspace(300, 16_000, 40)
    decay = 8 + 3e-3 * freq
    dry = rings(freq, decay, rng.choice([-1, 1], (3, 40)) * rng.uniform(0.3, 1, (3, 40)))
    t = np.arange(int(0.5 * SR)) / SR
    room = 0.02 * rng.standard_normal(len(t)) * np.exp(-6.91 / 0.6 * t)
    room[0] = 1.0
    wet = np.stack([np.fft.irfft(np.fft.rfft(x, 2 * N) * np.fft.rfft(room, 2 * N))[:N] for x in dry])
    found = joint_lines(wet + 1e-4 * rng.standard_normal(wet.shape), SR).freq_hz
    low = freq[freq < 4000]
    near = np.abs(found[None, :] / low[:, None] - 1).min(axis=1)
    assert (near < 0.003).mean() > 0.9, low[near >= 0.003]
