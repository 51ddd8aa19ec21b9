"""`film`, and what `render` writes besides the mix: from the command line, with what a user gets wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.apps.soundtrack.film_writer import samples_of
from sonic_bullet.files import read_audio, read_log, write_log
from tests.apps.cli.test_commands import error_of, run
from tests.made.films import decoded
from tests.made.soundtracks import table_log

MAIN = "from sonic_bullet.apps.cli import main; main()"
WAITING = """
import pathlib, signal, time
from sonic_bullet.apps.soundtrack.film_writer import FilmWriter
signal.signal(signal.SIGINT, signal.default_int_handler)
write = FilmWriter.write
def write_eight(self, picture):
    write(self, picture)
    if self.pictures == 8:
        pathlib.Path("eight").touch()
        time.sleep(60)
FilmWriter.write = write_eight
"""
SCENE = """
SECONDS = 0.3
MICROPHONE = (0, -0.5, 0.3)
def build(client):
    client.setGravity(0, 0, -9.81)
    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    ball = client.createMultiBody(0.1, client.createCollisionShape(client.GEOM_SPHERE, radius=0.02), \
basePosition=[0, 0, 0.1])
    return {ball: "glass"}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("soundtracks")
    (folder / "scene.py").write_text(SCENE)
    write_log(folder / "log.npz", table_log())
    return folder


@pytest.fixture
def place(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("scene.py", "log.npz"):
        os.link(made / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def left(place: Path) -> set[str]:
    return {one.name for one in place.iterdir()} - {"scene.py", "log.npz", "__pycache__"}


@pytest.mark.slow
def test_a_render_writes_stems_events_and_cues(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    wavinfo = pytest.importorskip("wavinfo")
    assert run(
        "render", "log.npz", "-o", "mix.wav", "--stems", "stems", "--events", "events.csv", "--cues",
        "--time-reference", "3600", "--peak-dbfs", "-1", "--json", "told.json",
    ) == 0  # fmt: skip
    told = json.loads(Path("told.json").read_text())
    names = sorted(one.name for one in Path("stems").iterdir())
    assert len(names) == 5 and "01-a_b.wav" in names
    assert [Path(one["path"]).name for one in told["stems"]] == names
    mix, sr = read_audio("mix.wav")
    total = sum(read_audio(one["path"])[0] for one in told["stems"])
    assert np.abs(total - mix).max() <= 2**-23 * 5 * max(1.0, float(np.abs(mix).max()))
    marks = wavinfo.WavInfoReader("mix.wav")
    assert marks.bext.time_reference == 3600 * sr
    lines = Path("events.csv").read_text().splitlines()
    assert 0 < len(list(marks.cues.each_cue())) <= len(lines) - 1 == sum(told["sounding"].values())
    own = wavinfo.WavInfoReader(str(Path("stems") / "01-a_b.wav"))
    assert 0 < len(list(own.cues.each_cue())) < len(lines) - 1
    said = capfd.readouterr().out
    assert "5 stems" in said and "impact" in said


def test_without_them_a_render_is_as_it_was(place: Path) -> None:
    assert run("render", "log.npz", "-o", "a.wav") == 0
    assert b"cue " not in Path("a.wav").read_bytes()
    assert run("render", "log.npz", "-o", "b.wav", "--events", "b.json") == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()


def test_stems_of_another_render_are_named_and_the_mix_is_none(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Files that were there stay; their sum with the new ones would not be the mix."""
    Path("s").mkdir()
    Path("s/12-gone.wav").write_bytes(b"old")
    assert "of its own" in error_of(capfd, "render", "log.npz", "-o", "s/01-a_b.wav", "--stems", "s")
    assert run("render", "log.npz", "-o", "s/mix.wav", "--stems", "s") == 0
    assert "12-gone.wav there is of another render" in capfd.readouterr().out
    assert Path("s/12-gone.wav").read_bytes() == b"old"


def test_each_stem_to_its_own_peak(place: Path) -> None:
    assert run("render", "log.npz", "-o", "a.wav", "--stems", "s", "--stem-peak-dbfs", "-3") == 0
    peaks = [float(np.abs(soundfile.read(one)[0]).max()) for one in Path("s").iterdir()]
    assert peaks == pytest.approx([10 ** (-3 / 20)] * 5, rel=1e-6)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--events", "x.txt"), ".json or .csv"),
        (("--events", "no/x.csv"), "no"),
        (("--stems", "scene.py"), "scene.py"),
        (("--time-reference", "3"), "--cues"),
        *((("--cues", "--time-reference", text), "--time-reference") for text in ("1e300", "5e14", "inf", "nan")),
        (("--stem-peak-dbfs", "-3"), "--stems"),
        (("--events", "x.json", "--json", "x.json"), "one name"),
    ],
)
def test_what_cannot_be_written_is_said_first(
    place: Path, capfd: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    assert said in error_of(capfd, "render", "log.npz", "-o", "x.wav", *words)
    assert left(place) == set()


def test_cues_need_a_wav(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert ".wav" in error_of(capfd, "render", "log.npz", "-o", "x.flac", "--cues")


def test_a_scene_is_filmed_with_its_floor(place: Path) -> None:
    words = ["--size", "96x64", "--fps", "29.97", "--tail", "0", "--overlay", "--json", "t.json"]
    assert run("film", "scene.py", "-o", "x.mp4", *words) == 0
    told = json.loads(Path("t.json").read_text())
    assert (told["fps"], told["pictures"], told["codec"]) == ("30000/1001", 9, "aac")
    film = decoded(Path("x.mp4"))
    assert len(film.picture_s) == 9
    assert film.brightness.min() < 250
    assert not any("not drawn" in note for note in told["notes"])
    assert np.abs(film.sound).max() > 0


def test_a_log_is_filmed_without_its_scene(place: Path) -> None:
    words = [
        "--size",
        "96x64",
        "--seconds",
        "0.5",
        "--fps",
        "24",
        "--audio",
        "opus",
        "--peak-dbfs",
        "-3",
        "--tail",
        "0",
    ]
    camera = ["--camera", "0,-1,0.5", "--look-at", "0,0,0"]
    assert run("film", "log.npz", "-o", "x.mkv", *words, *camera) == 0
    film = decoded(Path("x.mkv"))
    assert len(film.picture_s) == 12
    assert len(film.sound) == 2 * samples_of(12, Fraction(24), 48_000)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("log.npz", "-o", "x.avi"), ".mp4"),
        (("log.npz", "-o", "x.mp4", "--fps", "0"), "fps"),
        (("log.npz", "-o", "x.mp4", "--size", "big"), "1280x720"),
        (("log.npz", "-o", "x.mp4", "--size", "33x20"), "even"),
        (("log.npz", "-o", "x.mp4", "--seconds", "9"), "shorter than 9"),
        (("log.npz", "-o", "x.mp4", "--follow", "marbel"), "marble"),
        (("log.npz", "-o", "x.mp4", "--sr", "12345"), "--sr"),
        (("log.npz", "-o", "x.mp4", "--camera", "0,0,0", "--look-at", "0,0,0"), "looks at itself"),
        (("none.npz", "-o", "x.mp4"), "no such file"),
        (("log.npz", "-o", "no/such/x.mp4"), "x.mp4"),
    ],
)
def test_what_cannot_be_filmed_is_one_line(
    place: Path, capfd: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    assert said in error_of(capfd, "film", *words)
    assert left(place) == set()


def test_a_film_longer_than_its_script_ran_is_refused(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Path("short.py").write_text(
        "import pybullet as p\np.connect(p.DIRECT)\np.setGravity(0, 0, -9.81)\n"
        "p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))\n"
        "p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.02), basePosition=[0, 0, 0.03])\n"
        "for _ in range(24):\n    p.stepSimulation()\n"
    )
    said = error_of(capfd, "film", "short.py", "-o", "x.mp4", "--seconds", "2", "--size", "32x32")
    assert "longer than its sound, 0.100 s" in said
    assert left(place) == {"short.py"}


def test_without_the_library_the_extra_is_named(
    place: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    assert "sonic_bullet[film]" in error_of(capfd, "film", "log.npz", "-o", "x.mp4")


@pytest.mark.slow
def test_a_film_that_is_interrupted_is_named_and_valid(place: Path) -> None:
    words = ["film", "log.npz", "-o", "x.mkv", "--size", "96x64", "--fps", "240"]
    running = subprocess.Popen([sys.executable, "-c", WAITING + MAIN, *words], stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while running.poll() is None and not Path("eight").exists() and time.monotonic() < end:
        time.sleep(0.05)
    Path("eight").unlink()
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130, said
    assert "s are in" in said and "x.partial.mkv" in said
    assert left(place) == {"x.partial.mkv"}
    film = decoded(place / "x.partial.mkv")
    assert len(film.picture_s) == 8
    assert read_log(place / "log.npz").duration_s == pytest.approx(0.9)
