"""From a log to sound in a room: echoes and a tail, stems that add up, and what cannot be, by the command line."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import error_of, run
from tests.engine.path.room.test_measured_room import hall
from tests.journeys.test_scene_log_film import SCENE

FLAT = ("--pascals", "--tail", "0")
ROOM = ("--room", "3x2.5x2.4", "--absorption", "0.4")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("pyroomacoustics")
    folder = tmp_path_factory.mktemp("room")
    (folder / "scene.py").write_text(SCENE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("render", "scene.py", "-o", "dry.wav", "--contacts", "log.npz", *FLAT) == 0
        assert run("render", "log.npz", "-o", "wet.wav", *ROOM, *FLAT) == 0
    soundfile.write(folder / "church.wav", hall(0.4, 44_100), 44_100, "FLOAT")
    for name, samples in (("nan", [1.0, np.nan]), ("mute", [0.0, 0.0]), ("two", np.ones((9, 2)))):
        soundfile.write(folder / f"{name}.wav", np.array(samples), 48_000, "FLOAT")
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def test_a_room_adds_to_the_dry_sound_and_says_what_it_is(capfd: pytest.CaptureFixture[str]) -> None:
    """Until the first echo the sound is the dry one, to -120 dB; a tail lasts as long as the room's."""
    hall = ("--room", "9x9x8", "--room-corner", "-4.5,-4.5,-4", "--absorption", "0.1")
    assert run("render", "log.npz", "-o", "hall.wav", *hall, *FLAT) == 0
    dry, wet = (soundfile.read(name)[0] for name in ("dry.wav", "hall.wav"))
    echo = int(np.flatnonzero(dry)[0]) + round(0.02 * 48_000)  # the nearest wall is 4 m away, and as far back
    assert np.abs(wet - dry)[:echo].max() < 1e-6 * np.abs(dry).max() < 1e-2 * np.abs(wet - dry).max()
    wet = soundfile.read("wet.wav")[0]
    capfd.readouterr()
    assert run("render", "log.npz", "-o", "long.wav", *ROOM, "--pascals", "--tail", "-60") == 0
    assert "room of 3 x 2.5 x 2.4 m from -1.5, -1.5, -0.02: T60 0.14 s" in capfd.readouterr().err
    long = soundfile.read("long.wav")[0]
    assert len(long) > len(wet) and np.abs(long[: len(wet)] - wet).max() < 1e-6 * np.abs(wet).max()


def test_a_measured_room_follows_the_direct_sound(capfd: pytest.CaptureFixture[str]) -> None:
    """Up to 2.4 ms after the first sound it is the dry one; T60 and the other rate are said; it rings on."""
    assert (
        run("render", "log.npz", "-o", "church-wet.wav", "--response", "church.wav", "--pascals", "--tail", "-60") == 0
    )
    assert "church.wav: T60 0.40 s, resampled from 44100 Hz to 48000 Hz" in capfd.readouterr().err
    dry, wet = (soundfile.read(name)[0] for name in ("dry.wav", "church-wet.wav"))
    echo = int(np.flatnonzero(dry)[0]) + round(0.0024 * 48_000)
    more = np.abs(wet[: len(dry)] - dry)
    assert more[:echo].max() < 1e-6 * np.abs(dry).max() < 1e-2 * more.max()
    assert len(wet) > len(dry) + 0.1 * 48_000


@pytest.mark.parametrize("room", [ROOM, ("--response", "church.wav")])
def test_stems_in_a_room_add_up(room: tuple[str, ...]) -> None:
    assert run("render", "log.npz", "-o", "mix.wav", "--stems", "stems", *room, "--tail", "-40", "--pascals") == 0
    stems = [soundfile.read(one)[0] for one in Path("stems").glob("*.wav")]
    mix = soundfile.read("mix.wav")[0]
    assert len(stems) == 2 and np.abs(np.sum(stems, axis=0) - mix).max() < 4 * 2**-23 * np.abs(mix).max()


@pytest.mark.parametrize("words", [("--ambisonics", "1"), ("--absorption", "0.1,0.2,0.4,0.5")])
def test_a_scene_and_its_log_give_the_same_bytes(words: tuple[str, ...]) -> None:
    for source, output in (("scene.py", "a.wav"), ("log.npz", "b.wav")):
        assert run("render", source, "-o", output, "--room", "3x2.5x2.4", *words, *FLAT) == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--room", "6x4"), "has 2 sides"),
        (("--room", "6x4xhigh"), "not made of numbers"),
        (("--room", "6x4x0"), "no room's"),
        (("--room", "nanx4x3"), "size_m"),
        (("--room", "6x4x3", "--absorption", "0"), "absorption is not above 0"),
        (("--room", "6x4x3", "--absorption", "1.1"), "absorption is not above 0"),
        (("--room", "6x4x3", "--absorption", "0.1,x"), "not made of numbers"),
        (("--absorption", "0.1"), "none is asked for"),
        (("--room", "0.5x0.5x0.5"), "outside the room"),
        (("--room", "6x4x3", "--room-corner", "0,0,0"), "board (body 0) is up to 0.1"),
        (("--room", "6x4x3", "--microphone", "0,-9,0.3"), "outside the room"),
        (("--room", "6x4x3", "--microphone-on", "bar=0,0,0.1"), "no image in a wall"),
        (("--response", "none.wav"), "no such file"),
        (("--response", "log.npz"), "cannot read log.npz"),
        (("--response", "nan.wav"), "nan.wav: room response: response holds NaN"),
        (("--response", "mute.wav"), "response is silent"),
        (("--response", "two.wav"), "two.wav has 2 channels, and the render 1"),
        (("--response", "church.wav", "--room", "6x4x3"), "give one of both"),
        (("--response", "church.wav", "--absorption", "0.1"), "none is asked for"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert said in error_of(capfd, "render", "log.npz", "-o", "no.wav", *words)
    assert not Path("no.wav").exists()


def test_a_missing_library_names_its_extra(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "pyroomacoustics", None)
    assert "sonic_bullet[room]" in error_of(capfd, "render", "log.npz", "-o", "no.wav", *ROOM)


def test_a_film_has_the_rooms_sound(capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("av")
    from tests.made.films import decoded

    small = ("--fps", "10", "--size", "64x48")
    assert run("render", "log.npz", "-o", "film.wav", *ROOM) == 0
    assert run("film", "log.npz", "-o", "film.mov", *small, *ROOM) == 0
    mix, film = soundfile.read("film.wav")[0], decoded(Path("film.mov"))
    assert np.abs(film.sound[: len(mix)] - mix).max() < 2**-22
    capfd.readouterr()
    assert "one channel or two" in error_of(capfd, "film", "log.npz", "-o", "no.mov", "--ambisonics", "2", *small)
