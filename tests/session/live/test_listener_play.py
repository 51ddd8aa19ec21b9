"""A listener plays what it hears, in a user's own loop, and hears the same as one that does not play."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.records.errors import AudioError, PlaybackWarning
from sonic_bullet.session.live import playback
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import box_model
from tests.made.sound_cards import StandInLibrary

SR, DT_S = 48_000, 1 / 240


def falling(microphone: Any = (0.0, -1.0, 0.5)) -> tuple[Any, sb.Listener]:
    """A box of two modes over a floor, and its listener."""
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.05, 0.025, 0.005])
    box = client.createMultiBody(0.1, shape, basePosition=[0, 0, 0.05], baseOrientation=[0.1, 0.05, 0, 0.99])
    listener = sb.attach(client, sr=SR, microphone=microphone)
    listener.add(box, material="steel", model=box_model((0.1, 0.05, 0.01), (900.0, 2100.0)))
    return client, listener


@pytest.fixture
def world() -> Iterator[tuple[Any, sb.Listener]]:
    client, listener = falling()
    yield client, listener
    listener.detach()
    disconnect(client)


WATCH = """
import sys, time
worst, end = 0.0, time.perf_counter() + 4
while time.perf_counter() < end:
    begin = time.perf_counter()
    time.sleep(0.002)
    worst = max(worst, time.perf_counter() - begin - 0.002)
print(worst)
"""
BUSY_S = 0.004
"""A process that does nothing but sleep wakes that much too late: the machine has more to do than it has cores."""


def test_three_seconds_on_the_null_card(world: tuple[Any, sb.Listener]) -> None:
    """The whole path in real time. Another process says whether this machine kept time for anybody."""
    client, listener = world
    watch = subprocess.Popen([sys.executable, "-c", WATCH], stdout=subprocess.PIPE, text=True)
    begin = time.perf_counter()
    with listener.play("null") as sound:
        for _ in range(3 * 240):
            client.stepSimulation()
    spent_s, report = time.perf_counter() - begin, sound.report
    busy_s = float(watch.communicate()[0])
    print(report, f"; another process woke up to {busy_s * 1e3:.1f} ms too late")
    assert report.seconds == 3.0
    assert spent_s >= 3.0 + report.silent_s
    assert listener.latency_steps * DT_S <= report.latency_median_s <= 0.050
    assert report.clipped == 0
    assert busy_s > BUSY_S or (report.underruns == 0 and report.latency_worst_s <= 0.050)


def test_the_card_gets_the_frames_and_the_log_is_the_same(
    world: tuple[Any, sb.Listener], monkeypatch: pytest.MonkeyPatch
) -> None:
    library = StandInLibrary()
    monkeypatch.setitem(sys.modules, "sounddevice", library)  # type: ignore[arg-type]
    client, listener = world
    with listener.play(full_scale_pa=5.0):
        frames = []
        for _ in range(150):
            client.stepSimulation()
            frames.append(listener.frame)
    sent = (np.concatenate(frames, axis=1)[0] / 5.0).astype(np.float32)
    taken = np.concatenate(library.streams[0].taken)[:, 0]
    assert np.abs(sent).max() > 0
    np.testing.assert_array_equal(taken[taken != 0], sent[sent != 0])
    quiet, other = falling()
    for _ in range(150):
        quiet.stepSimulation()
    np.testing.assert_array_equal(other.sound(), listener.sound())
    assert len(other.contacts) == len(listener.contacts)
    disconnect(quiet)


@pytest.mark.parametrize("said", [True, False])
def test_a_card_pulled_in_mid_stream_loses_nothing(
    world: tuple[Any, sb.Listener], monkeypatch: pytest.MonkeyPatch, said: bool
) -> None:
    library = StandInLibrary()
    monkeypatch.setitem(sys.modules, "sounddevice", library)  # type: ignore[arg-type]
    client, listener = world
    listener.play()
    for _ in range(30):
        client.stepSimulation()
    monkeypatch.setattr(playback, "STALLED_S", 0.1)  # not before: a busy machine may take as long for a block
    library.streams[0].pull(said=said)
    with pytest.warns(PlaybackWarning, match="card 0 takes no more sound") as caught:
        for _ in range(90):
            client.stepSimulation()
    assert len(caught) == 1
    assert len(listener.contacts.steps) == 120
    assert listener.sound().shape == (1, 120 * SR // 240)
    assert listener.play("null").failure is None


def test_it_plays_once_at_a_time(world: tuple[Any, sb.Listener]) -> None:
    _, listener = world
    first = listener.play("null")
    with pytest.raises(AudioError, match="the listener plays already; close what its play"):
        listener.play("null")
    first.close()
    listener.play("null").close()


def test_detaching_ends_it(world: tuple[Any, sb.Listener]) -> None:
    _, listener = world
    sound = listener.play("null")
    listener.detach()
    assert sound.closed
    with pytest.raises(AudioError, match="the listener is detached"):
        listener.play("null")


def test_nobody_hears_nothing() -> None:
    client, listener = falling(microphone=())
    with pytest.raises(AudioError, match="there is no microphone, so there is no sound to play"):
        listener.play("null")
    listener.detach()
    disconnect(client)


def test_a_script_that_sleeps_is_paced_by_the_card_alone(tmp_path: Path) -> None:
    """`sonic_bullet.scene` makes time.sleep return at once; waiting for the card must not."""
    from sonic_bullet.scene import run_scene

    (tmp_path / "script.py").write_text(
        "import time, pybullet as p\np.connect(p.GUI)\nwhile True:\n    p.stepSimulation()\n    time.sleep(1)\n"
    )
    begin: list[float] = []

    def play(listener: sb.Listener) -> None:
        begin.append(time.perf_counter())
        listener.play("null")

    run_scene(tmp_path / "script.py", play, seconds=0.5)
    assert 0.5 <= time.perf_counter() - begin[0] < 20
