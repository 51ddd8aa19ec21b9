"""A measured room against its own response: its T60, its sound after the direct one, and the direct one as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.engine.path.room.measured_room import decay_time_s, late_part
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.records import Ambisonics, Array, Microphone, RoomResponse
from sonic_bullet.records.errors import SceneError
from tests.engine.path.room.test_room import SR, struck, t60_s

EAR = Microphone([0.5, 0.6, 0.4])


def hall(
    t60: float, sr: int, *, seed: int = 0, level: float = 0.02, noise: float = 0.0, early_s: float = 0.01
) -> Array:
    """Direct sound, then noise that decays, in noise of the recording: (n,)."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(1.5 * t60 * sr)) / sr
    made = 0.02 * rng.standard_normal(len(t)) * 10 ** (-3 * t / t60)
    made[: round(0.004 * sr)] = 0.0
    made[0] = 1.0
    made = np.concatenate([np.zeros(round(early_s * sr)), made])
    return np.asarray(made + noise * rng.standard_normal(len(made)))


@pytest.mark.parametrize(("t60", "sr"), [(0.3, 44_100), (0.9, 48_000), (0.6, 96_000)])
def test_a_render_dies_as_the_response_does(t60: float, sr: int) -> None:
    """T60 of what the room adds within 5 % of the response's own, at its rate or another."""
    response = hall(t60, sr)
    log = struck((EAR,), np.zeros(3), steps=round((1.5 * t60 + 0.1) * 240))
    echo = render_log(log, room=RoomResponse(response[None], sr)) - render_log(log)
    own = decay_time_s(response[None], sr)[0]
    assert own == pytest.approx(t60, rel=0.05)
    assert t60_s(echo[0]) == pytest.approx(own, rel=0.05)


def test_noise_of_the_recording_leaves_t60_alone() -> None:
    assert decay_time_s(hall(0.5, SR, noise=1e-4)[None], SR)[0] == pytest.approx(0.5, rel=0.05)


def test_it_is_the_convolution_with_what_follows_the_direct_sound() -> None:
    """Any scale and sign of the response, any silence ahead of it, and the direct sound as it was, to -120 dB."""
    log = struck((EAR,), np.zeros(3), steps=60)
    dry = render_log(log)[0]
    wet = render_log(log, room=RoomResponse(hall(0.4, SR)[None], SR))[0]
    want = np.convolve(dry, late_part(hall(0.4, SR), SR))[: len(dry)]
    assert np.abs(wet - dry - want).max() < 1e-12 * np.abs(want).max()
    first = int(np.flatnonzero(dry)[0])
    assert np.abs(wet - dry)[: first + round(0.0024 * SR)].max() < 1e-6 * np.abs(dry).max()
    for other in (-7 * hall(0.4, SR), hall(0.4, SR, early_s=0.3)):
        again = render_log(log, room=RoomResponse(other[None], SR))[0]
        np.testing.assert_allclose(again, wet, atol=1e-12 * np.abs(wet).max())


def test_each_channel_hears_its_own_response() -> None:
    """One a microphone, or one for all; directions need one for all."""
    log = struck((EAR, Microphone([-0.4, 0.3, 0.5])), np.zeros(3), steps=60)
    both = np.stack([hall(0.4, SR), hall(0.4, SR, seed=1)])
    wet = render_log(log, room=RoomResponse(both, SR))
    for c in range(2):
        alone = replace(log, sensors=log.sensors[c : c + 1])
        one = render_log(alone, room=RoomResponse(both[c : c + 1], SR))
        np.testing.assert_allclose(wet[c], one[0], atol=1e-12 * np.abs(one).max())
    with pytest.raises(SceneError, match="3 channels, and the render 2"):
        render_log(log, room=RoomResponse(np.ones((3, 100)), SR))
    field = replace(log, sensors=(Ambisonics([0.5, 0.6, 0.4], order=1),))
    with pytest.raises(SceneError, match="one channel"):
        render_log(field, room=RoomResponse(np.ones((4, 100)), SR))
    heard = render_log(field, room=RoomResponse(both[:1], SR))
    np.testing.assert_allclose(heard[0], render_log(replace(log, sensors=(EAR,)), room=RoomResponse(both[:1], SR))[0])
