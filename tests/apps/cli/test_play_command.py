"""`sonic-bullet play`: scene and log on the null card, what it says at the end, and how it ends."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonic_bullet.engine.runtime.replay import log_frames, render_log
from sonic_bullet.files import read_log, write_log
from sonic_bullet.records import Ambisonics, Array
from sonic_bullet.scene import render_scene, run_scene
from sonic_bullet.session import Listener
from sonic_bullet.session.live import playback
from tests.apps.cli.test_commands import error_of, run
from tests.few_cases import parametrize_few
from tests.made import heads
from tests.made.sound_cards import StandInLibrary

SCRIPT = """
import pybullet as p
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.02), basePosition=[0, 0, 0.05])
while True:
    p.stepSimulation()
"""
OWN = """
import pybullet as p, sonic_bullet as sb
from pybullet_utils.bullet_client import BulletClient
client = BulletClient(p.DIRECT)
listener = sb.attach(client, sr=16000)
while True:
    client.stepSimulation()
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scripts and the contact log of one: a ball that strikes a floor, 0.3 s."""
    folder = tmp_path_factory.mktemp("played")
    (folder / "script.py").write_text(SCRIPT)
    (folder / "own.py").write_text(OWN)
    write_log(folder / "log.npz", render_scene(folder / "script.py", seconds=0.3, sr=16_000).log)
    return folder


@pytest.fixture
def place(made: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(made)
    return made


def test_a_logs_frames_are_its_sound_so_much_later(made: Path) -> None:
    log = read_log(made / "log.npz")
    frames, lag = list(log_frames(log)), 201  # three steps of 1/240 s at 16 kHz, uneven in samples: one more
    late, sound = np.concatenate(frames, axis=1), render_log(log)
    assert np.abs(sound).max() > 0
    assert len(frames) == len(log.steps)
    assert not late[:, :lag].any()
    np.testing.assert_array_equal(late[:, lag:], sound[:, : late.shape[1] - lag])


@parametrize_few(
    ("words", "seconds"),
    [
        (("script.py", "--seconds", 0.25), 0.25),
        (
            ("script.py", "--seconds", 0.25, "--microphone", "0,1,0", "--microphone", "0,-1,0", "--material", "wood"),
            0.25,
        ),
        (("own.py", "--seconds", 0.25), 0.25),
        (("log.npz",), 0.3),
        (("log.npz", "--seconds", 0.1, "--sr", 48000, "--seed", 3, "--microphone", "0,1,0"), 0.1),
    ],
    2,
)
def test_what_was_played_is_said(
    place: Path, capfd: pytest.CaptureFixture[str], words: tuple[object, ...], seconds: float
) -> None:
    begin = time.perf_counter()
    assert run("play", *words, "--device", "null") == 0
    assert time.perf_counter() - begin >= seconds
    line = capfd.readouterr().out
    assert re.fullmatch(
        rf"{seconds:.2f} s played on null, latency \d+\.\d ms \(worst \d+\.\d\), \d+ underruns?( \(.* s silent\))?\n",
        line,
    ), line


def test_scene_and_log_are_played_to_other_microphones(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Heads, ambisonics, paths, live and from a log; what a scene's listener has instead is what is played."""
    pytest.importorskip("sofar")
    heads.write_sofa(place / "head.sofa", heads.head(44_100, heads.directions(30), taps=100))
    Path("walk.csv").write_text("0,0.3,-0.5,0.3\n0.3,-0.3,-0.5,0.3\n")
    for source, seconds in (("log.npz", ()), ("script.py", ("--seconds", "0.1", "--sr", "16000"))):
        words = ("--head", "head.sofa", "--facing", "0,0,0", "--device", "null")
        assert run("play", source, *seconds, *words, "--microphone", "0,-0.5,0.3") == 0
        assert "head.sofa is resampled from 44100 Hz to 16000 Hz" in capfd.readouterr().err
        assert run("play", source, *seconds, "--microphone-path", "walk.csv", "--ambisonics", "1", *words[4:]) == 0
    frames: list[Array] = []

    def begin(listener: Listener) -> None:
        frames.append(listener.frame)

    field = lambda sensors: tuple(Ambisonics(one.position_m, order=1) for one in sensors)  # noqa: E731
    run_scene("script.py", begin, seconds=0.02, sr=16_000, receive=field)
    assert frames[0].shape[0] == 4


def test_json_holds_the_report(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("play", "log.npz", "--device", "null", "--full-scale", "1e-6", "--json") == 0
    told = json.loads(capfd.readouterr().out)
    assert (told["card"], told["seconds"]) == ("null", 0.3)
    assert told["clipped"] > 10
    assert told["latency_median_s"] > 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("none.py",), "cannot read none.py: no such file"),
        (("out.wav",), "cannot play out.wav: neither a scene nor a contact log"),
        (("log.npz", "--material", "nobody=wood"), "no body of log.npz is called 'nobody'"),
        (("log.npz", "--seconds", "-1"), "'--seconds': -1.0"),
        (("script.py", "--seconds", "0"), "'--seconds': 0.0"),
        (("script.py", "--full-scale", "-2"), "full_scale_pa is -2"),
        (("log.npz", "--ahead", "9"), "ahead_s is 9"),
        (("own.py", "--microphone", "0,0,1"), "scene 'own.py' has microphones of its own; leave yours out"),
        (("own.py", "--ambisonics", "1"), "scene 'own.py' has microphones of its own; leave yours out"),
        (("script.py", "--microphone-on", "ball"), "--microphone-on names a body"),
        (("script.py", "--vibrometer", "ball"), "--vibrometer names a body"),
        (("log.npz", "--microphone-on", "cup"), "nothing that sounds in log.npz is called that"),
        (("log.npz", "--head", "none.sofa"), "no such file"),
    ],
)
def test_what_cannot_be_played_is_one_line(
    place: Path, capfd: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    (place / "out.wav").write_bytes(b"")
    assert said in error_of(capfd, "play", *words, "--device", "null")


@parametrize_few("what", ["log.npz", "script.py"], (1,))
def test_no_sound_card_is_one_line(
    place: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    monkeypatch.setitem(sys.modules, "sounddevice", StandInLibrary(channels=()))  # type: ignore[arg-type]
    assert "this machine has no sound card; connect one, or play to 'null'" in error_of(capfd, "play", what)


@parametrize_few("what", ["log.npz", "script.py"], (1,))
def test_a_card_that_is_pulled_ends_it_with_what_was_played(
    place: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    library = StandInLibrary(sr=16_000)
    monkeypatch.setitem(sys.modules, "sounddevice", library)  # type: ignore[arg-type]
    pulled: list[bool] = []
    real = playback.Playback.push

    def push(self: Any, frame: Any, returned_s: float) -> None:
        if self.report.seconds > 0.1 and not pulled:
            pulled.append(True)
            monkeypatch.setattr(playback, "STALLED_S", 0.1)  # not before: a busy machine may take as long for a block
            library.streams[0].pull(said=False)
        real(self, frame, returned_s)

    monkeypatch.setattr(playback.Playback, "push", push)
    line = error_of(capfd, "play", what, "--sr", 16000, "--device", "0")
    assert "card 0 takes no more sound; connect it again and play anew; 0.1" in line
    assert library.streams[0].closed


@pytest.mark.slow
@parametrize_few(("word", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], 1)
def test_an_interrupt_says_what_was_played(place: Path, word: signal.Signals, code: int) -> None:
    (place / "long.py").write_text(SCRIPT.replace("    p.step", "    open('stepping', 'w').close(); p.step"))
    # a shell's background jobs are started deaf to SIGINT
    awake = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    words = ["play", "long.py", "--device", "null", "--seconds", "1000"]
    running = subprocess.Popen(
        [sys.executable, "-c", awake + "from sonic_bullet.apps.cli import main; main()", *words],
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        end = time.monotonic() + 100
        while not (place / "stepping").exists() and running.poll() is None and time.monotonic() < end:
            time.sleep(0.05)
        time.sleep(1)
        os.kill(running.pid, word)
        said = running.communicate(timeout=100)[1]
    finally:
        running.kill()
        (place / "stepping").unlink()
    assert running.returncode == code, said
    assert re.fullmatch(
        r"sonic-bullet: (stopped|terminated); \d+\.\d\d s played on null, (latency .*, )?\d+ underruns?.*\n", said
    )
