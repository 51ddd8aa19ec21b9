"""Whatever changes the sound is in the log: quench, at its very sample, live, in files and at other rates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.apps.cli import cli
from sonic_bullet.engine.runtime.replay import Synthesizer
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records.contacts import Event
from sonic_bullet.records.errors import LogError
from tests.few_cases import parametrize_few
from tests.made.models import STEEL, ball_body, box_body, row, step, wall_body
from tests.made.worlds import EDGES_M, TONES_HZ, ball, floor, plate_model, sounding_box
from tests.session.test_session_robust import steps

STEP = 200
"""Samples of a step of 1/240 s at 48 kHz."""


def ringing(client: Any, **how: Any) -> sb.Listener:
    floor(client)
    listener = sb.attach(client, **{"microphone": sb.ModalSum(), **how})
    sounding_box(client, listener, (0, 0, 0.06))
    steps(client, 60)
    return listener


def test_a_quench_is_in_the_log_and_its_replay_is_the_same_bits(client: Any, tmp_path: Path) -> None:
    listener = ringing(client)
    listener.quench()
    steps(client, 30)
    sound, log = listener.sound(), listener.contacts
    assert log.events == (Event("quench", 60),)
    np.testing.assert_array_equal(sb.render_log(log), sound)
    log.save(tmp_path / "log.npz")
    read = sb.read_log(str(tmp_path / "log.npz"))
    assert read.events == log.events
    np.testing.assert_array_equal(sb.render_log(read), sound)
    listener.write(tmp_path / "live.wav")
    words = ["render", str(tmp_path / "log.npz"), "-o", str(tmp_path / "replay.wav"), "--pascals", "--tail", "0"]
    cli.main(words, standalone_mode=False)
    assert (tmp_path / "live.wav").read_bytes() == (tmp_path / "replay.wav").read_bytes()
    without = np.abs(sb.render_log(replace(log, events=())) - sound).max()
    print(f"without its event the replay is {without:.3g} off")
    assert without > 0.1 * np.abs(sound).max()


def test_a_quench_acts_at_its_sample_and_takes_what_was_struck_just_before(client: Any) -> None:
    """The last steps before it are known but not yet sounded: a strike among them is not to ring on after the hand has
    come.
    """
    floor(client)
    listener = sb.attach(client, microphone=sb.ModalSum())
    body = ball(client, (0, 0, 0.021))
    listener.add(body, material=STEEL, model=plate_model())
    client.resetBaseVelocity(body, [0, 0, -1])
    while not len(listener.contacts):
        client.stepSimulation()
    at = listener.sound().shape[1]
    before = listener.sound()
    listener.quench()
    np.testing.assert_array_equal(listener.sound(), before)
    client.removeBody(body)
    steps(client, 10)
    sound = listener.sound()
    assert np.abs(sound[:, :at]).max() > 1e-3
    assert not sound[:, at:].any()


def test_what_strikes_in_the_step_after_a_quench_sounds() -> None:
    """A strike whose bodies overlap as its step starts is dated back into the step before: not before a quench, or it
    would be lost.
    """
    bodies = (box_body(EDGES_M, TONES_HZ), wall_body(body_id=1))
    hit = row(0, 1, [0, 0, 0.2], approach=1.0, gap=-1e-3)
    observed = []
    for quench in (False, True):
        synth = Synthesizer(sr=48_000, sensors=(sb.ModalSum(),), seed=0, air=sb.Air())
        for number in range(20):
            if quench and number == 10:
                synth.quench()
            synth.feed(step([[0, 0, 0], [0, 0, -1]], hit if number == 10 else None), bodies)
        observed.append(synth.sound()[0])
    assert np.flatnonzero(observed[0])[0] < 10 * STEP, "without a quench it is dated back: the test tests something"
    assert not observed[1][: 10 * STEP].any()
    assert np.abs(observed[1]).max() == pytest.approx(np.abs(observed[0]).max(), rel=0.2)


def test_a_live_quench_is_heard_after_the_lag(client: Any) -> None:
    listener = ringing(client)
    frames = [listener.read()]
    listener.quench()
    steps(client, 30)
    frames.append(listener.read())
    joined, lag = np.concatenate(frames, axis=1), listener.latency_steps * STEP
    np.testing.assert_array_equal(joined[:, lag:], listener.sound()[:, :-lag])


@parametrize_few("sr", [22_050, 44_100, 96_000], (1,))
def test_at_another_rate_it_acts_at_the_same_time(client: Any, sr: int) -> None:
    listener = ringing(client)
    listener.quench()
    client.resetSimulation()
    steps(client, 12)
    assert np.abs(listener.sound()[:, 58 * STEP : 60 * STEP]).max() > 1e-4
    other = sb.render_log(listener.contacts, sr=sr)
    quiet = np.flatnonzero(other.any(axis=0))[-1] + 1
    assert quiet == int(60 / 240 * sr)


def test_seconds_cut_a_log_before_or_after_its_quench(client: Any, tmp_path: Path) -> None:
    listener = ringing(client)
    listener.quench()
    steps(client, 40)
    listener.contacts.save(tmp_path / "log.npz")
    whole = listener.sound().astype(np.float32)
    for seconds, events in ((0.2, 0), (0.25, 1), (0.3, 1)):
        said = [
            "render",
            str(tmp_path / "log.npz"),
            "-o",
            str(tmp_path / "a.wav"),
            "--contacts",
            str(tmp_path / "cut.npz"),
            "--seconds",
            str(seconds),
            "--pascals",
            "--tail",
            "0",
        ]
        cli.main(said, standalone_mode=False)
        cut = sb.read_log(str(tmp_path / "cut.npz"))
        assert len(cut.events) == events
        samples = sb.read_audio(str(tmp_path / "a.wav"))[0]
        safe = samples.shape[1] - 3 * STEP
        np.testing.assert_array_equal(samples[:, :safe], whole[:, :safe])
        np.testing.assert_array_equal(samples, sb.render_log(cut).astype(np.float32))


def test_several_quenches_and_those_before_and_after_all_steps(client: Any) -> None:
    floor(client)
    listener = sb.attach(client, microphone=[sb.Microphone(np.array([0, 0, 0.4])), sb.ModalSum()])
    listener.quench()
    sounding_box(client, listener, (0, 0, 0.06))
    for _ in range(4):
        steps(client, 20)
        listener.quench()
        listener.quench()
    assert [event.step for event in listener.contacts.events] == [0, 20, 20, 40, 40, 60, 60, 80, 80]
    np.testing.assert_array_equal(sb.render_log(listener.contacts), listener.sound())


def test_what_rolls_goes_on_through_a_quench(client: Any) -> None:
    ground = floor(client)
    listener = sb.attach(client, microphone=sb.ModalSum())
    body = ball(client, (0, 0, 0.02))
    listener.add(body, material=replace(STEEL, roughness_m=5e-6), model=plate_model())
    listener.add(ground, material=STEEL, model=ball_body(0.02).model)
    client.resetBaseVelocity(body, [1, 0, 0], [0, 50, 0])
    steps(client, 60)
    listener.quench()
    steps(client, 60)
    sound = listener.sound()[0]
    before, after = (
        float(np.sqrt((part**2).mean())) for part in (sound[40 * STEP : 60 * STEP], sound[80 * STEP : 100 * STEP])
    )
    assert before > 0
    assert after == pytest.approx(before, rel=0.9)


def test_a_log_of_an_earlier_version_replays_as_before() -> None:
    """A box and a ball fall, the ball is removed: tests/data/falling.npz, with the sound that it had when it was made.

    The air beside them is solved in single precision, whose last bits are a processor's: to 1e-7. The microphone's row
    was made anew when the phase at which a mode radiates ceased to hang on one direction, and both when the fourth of
    its five strikes, found a step late, was no longer set on the step's edge. Both again, by 0.5 % and 3e-6 of their
    peaks, when the air was solved at each mode's own pitch; when strikes below 20 µs were no longer lengthened; and, by
    0.1 % of the microphone's peak, when a pulse's nodes came to lie on the grid of samples. And both, by 0.3
    and 0.4 % of their peaks, when a floor that was not added came to be as rough as any. The microphone's again, by
    23 % of its peak, when modes ceased to send what lasts; the contact microphone's is as it was, to 2e-5 of its peak,
    which is how sliding begins.
    """
    folder = Path(__file__).parents[1] / "data"
    log = sb.read_log(str(folder / "falling.npz"))
    assert log.events == ()
    sound = np.load(folder / "falling-sound.npy")
    np.testing.assert_allclose(sb.render_log(log), sound, rtol=0, atol=1e-7 * np.abs(sound).max())


@pytest.mark.parametrize(("kind", "number", "body"), [("gong", 0, None), ("quench", -1, None), ("quench", 0, 3)])
def test_events_that_are_none_are_refused(kind: str, number: int, body: int | None) -> None:
    with pytest.raises(LogError):
        Event(kind, number, body)
    with pytest.raises(LogError, match="order"):
        ContactLog((), (), (), 48_000, 0, events=(Event("quench", 3), Event("quench", 1)))
