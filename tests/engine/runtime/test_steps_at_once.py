"""However many steps one call of the driver takes in, whoever else plays beside it: the same bits."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sonic_bullet.engine.runtime.replay import Synthesizer, render_log
from sonic_bullet.engine.runtime.tables import StepScratch
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Body, Microphone, ModalSum, Vibrometer
from sonic_bullet.records.contacts import Contacts, Event, Step
from sonic_bullet.records.errors import AudioError
from tests.made.models import GLASS, STEEL, WOOD, ball_body, box_body, row, wall_body
from tests.made.residuals import modes, residual

SR = 44_100  # at 240 Hz no whole number of samples a step
STEPS = 130
TONES_HZ = (310.0, 820.0, 1900.0, 3300.0, 7100.0)
LATE = {4: 23, 5: 51}
"""Steps at which bodies come."""
QUENCHES = (1, 40, 41, 93)
CROWDED = 70
"""A step with many times the rows of any before."""


def cast(noisy: bool) -> tuple[Body, ...]:
    noise = residual(modes(TONES_HZ, 10.0), per_hz=1e-6, lines=((1200.0, 8.0, 0.3),))
    bodies = (
        wall_body(),
        box_body((0.2, 0.1, 0.02), TONES_HZ, body_id=1),
        box_body((0.1, 0.1, 0.05), TONES_HZ[1:], WOOD, body_id=2),
        ball_body(0.02, GLASS, body_id=3),
        box_body((0.3, 0.1, 0.01), TONES_HZ, replace(STEEL, residual=noise) if noisy else STEEL, body_id=4),
        ball_body(0.03, body_id=5),
    )
    return tuple(replace(body, since_step=LATE.get(i, 0)) for i, body in enumerate(bodies))


@cache
def busy_log(noisy: bool, seed: int = 0) -> ContactLog:
    """Pairs that strike, lie, slide and leave; bodies that come and that are moved by hand; quenches; another time
    step for a while.
    """
    rng = np.random.default_rng(seed)
    place, turn = rng.uniform(-0.3, 0.3, (6, 3)), rng.normal(size=(6, 4))
    lies: dict[tuple[int, int], int] = {}

    def rows(number: int, count: int) -> Iterator[Contacts]:
        for a in range(count):
            for b in range(a + 1, count):
                if (a, b) not in lies and rng.random() < 0.04:
                    lies[a, b] = number + int(rng.choice([1, 2, 3, 12, 30]))
                if lies.get((a, b), -1) <= number:
                    lies.pop((a, b), None)
                    continue
                for _ in range(20 if number == CROWDED else int(rng.integers(1, 4))):
                    normal = rng.normal(size=3)
                    normal /= np.linalg.norm(normal)
                    yield row(
                        *((a, b) if rng.random() < 0.5 else (b, a)), rng.uniform(1e-4, 5e-3) * normal, normal=normal,
                        point_a=rng.uniform(-0.02, 0.02, 3), point_b=rng.uniform(-0.02, 0.02, 3),
                        sweep=rng.uniform(0, 0.6, 2), approach=rng.uniform(-0.2, 1.0), gap=rng.uniform(-1e-3, 1e-3),
                    )  # fmt: skip

    def step(number: int) -> Step:
        count = 4 + sum(number >= come for come in LATE.values())
        moved = rng.random(count) < 0.02
        place[:count] += np.where(moved[:, None], 0.2, 0.001) * rng.normal(size=(count, 3))
        dt_s = 1 / 500 if 60 <= number < 75 else 1 / 240
        contacts = Contacts.join(list(rows(number, count)))
        return Step(dt_s, place[:count].copy(), turn[:count].copy(), moved, contacts, np.array([0, 0, -9.81]))

    sensors = (
        Microphone([0, -1, 0.5]), ModalSum(2.0), Microphone([0.4, 0.9, 0]), Vibrometer(2, [0.05, 0.05, 0], [1, 0, 0]),
    )  # fmt: skip
    events = tuple(Event("quench", number) for number in QUENCHES)
    return ContactLog(cast(noisy), tuple(step(i) for i in range(STEPS)), sensors, SR, 3, events=events)


def played(log: ContactLog, at_once: int, *, look: bool = False) -> Array:
    """The sound of the log by so many steps a call, fewer where a body comes or all is quenched. look: ask for the
    sound in between.
    """
    synth, first = Synthesizer(sr=log.sr, sensors=log.sensors, seed=log.seed, air=log.air), 0
    while first < STEPS:
        if first in QUENCHES:
            synth.quench()
        stop = first + 1
        while stop < min(first + at_once, STEPS) and stop not in (*QUENCHES, *LATE.values()):
            stop += 1
        synth.play(log.steps[first:stop], log.bodies)
        if look:
            synth.sound()
        first = stop
    return synth.sound()


@pytest.mark.parametrize("noisy", [False, True])
def test_any_number_of_steps_at_once_makes_the_same_bits(noisy: bool) -> None:
    log = busy_log(noisy)
    live = Synthesizer(sr=SR, sensors=log.sensors, seed=log.seed, air=log.air)
    frames = []
    for number, step in enumerate(log.steps):
        if number in QUENCHES:
            live.quench()
        frames.append(live.feed(step, log.bodies[: len(step.position_m)]))
    sound = live.sound()
    assert sound.shape[1] == sum(frame.shape[1] for frame in frames)
    assert (np.abs(sound).max(axis=1) > 1e-4).all()
    joined = np.concatenate(frames, axis=1)
    lag = sum(frame.shape[1] for frame in frames[:3]) + 1
    assert not joined[:, :lag].any()
    # where the time step changes, so does the lag
    before = sum(frame.shape[1] for frame in frames[:60])
    assert joined[:, lag:before].tobytes() == sound[:, : before - lag].tobytes()
    for at_once in (1, 3, 64):
        assert played(log, at_once).tobytes() == sound.tobytes(), at_once
    assert played(log, 7, look=True).tobytes() == sound.tobytes()
    assert render_log(log).tobytes() == sound.tobytes()


@pytest.mark.parametrize("noisy", [False, True])
def test_steps_shorter_than_a_sample_make_the_same_bits(noisy: bool) -> None:
    """Most steps have no sample at all, also those in which bodies come."""
    log = busy_log(noisy)
    log = replace(log, sr=8000, steps=tuple(replace(step, dt_s=1 / 20_000) for step in log.steps))
    sound = played(log, 1)
    assert sound.shape[1] == STEPS * 8000 // 20_000
    assert sound[1].any()
    for at_once in (3, 64):
        assert played(log, at_once).tobytes() == sound.tobytes(), at_once
    assert render_log(log).tobytes() == sound.tobytes()


def test_there_is_room_for_the_longest_step_of_all() -> None:
    """Steps that are no whole number of samples differ by one; a shorter one may bring more pairs."""
    room = StepScratch()
    for drives, samples in ((2, 184), (9, 183), (9, 184), (20, 0)):
        room.fit(drives, 16, samples, (1, 3))
        assert len(room.slot) >= drives and len(room.force) >= len(room.slot) * 184
        assert room.source.shape == (1, 3, 184)


def test_what_the_log_holds_is_heard() -> None:
    """Or the bits above would say little: residual, quenches, bodies that come late, moves by hand."""
    log = busy_log(True)
    sound = render_log(log)
    still = tuple(replace(step, teleported=np.zeros(len(step.teleported), bool)) for step in log.steps)
    silent = replace(log.bodies[4], model=None, material=None)
    others = (
        render_log(log, residual=False),
        render_log(replace(log, events=())),
        render_log(replace(log, steps=still)),
        render_log(replace(log, bodies=(*log.bodies[:4], silent, log.bodies[5]))),
    )
    for other in others:
        assert np.abs(other - sound).max() > 1e-6 * np.abs(sound).max()


def test_two_threads_make_the_bits_of_one() -> None:
    logs = [busy_log(False, seed) for seed in (0, 1, 2)] * 2
    alone = [render_log(log).tobytes() for log in logs]
    with ThreadPoolExecutor(2) as threads:
        assert [sound.tobytes() for sound in threads.map(render_log, logs)] == alone
    assert len(set(alone)) == 3


def test_a_body_too_far_to_be_heard_ends_the_sound_and_keeps_what_was() -> None:
    """The error comes again for each further step; nothing is made of half a step."""
    log = busy_log(False)
    synth = Synthesizer(sr=log.sr, sensors=log.sensors, seed=log.seed, air=log.air)
    for step in log.steps[:12]:
        synth.feed(step, log.bodies)
    before = synth.sound()
    far = replace(log.steps[12], position_m=log.steps[12].position_m + 3000.0)
    with pytest.raises(AudioError, match="m from a microphone"):
        for _ in range(8):
            synth.feed(far, log.bodies)
    kept = synth.sound()
    assert kept.any() and (kept == before[:, : kept.shape[1]])[:, :-800].all()
    with pytest.raises(AudioError, match="m from a microphone"):
        synth.feed(log.steps[12], log.bodies)
