"""Films: what is seen and what is heard begin, go on and end together; what fails leaves no half of one."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.film_writer import (
    CODECS,
    FilmWriter,
    as_fps,
    check_film_output,
    check_size,
    pictures_of,
    samples_of,
)
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records.errors import AudioError, FileError
from tests.made.disks import full_disk
from tests.made.films import SIDE, SR, click_film, click_pictures, click_sound, decoded, write_film

RATES = (24, 25, Fraction(30000, 1001), 30, 60, 240)
FORMATS = (("mp4", "aac"), ("mov", "pcm"), ("mkv", "flac"), ("mkv", "opus"), ("mp4", "mp3"))


@pytest.mark.parametrize(("ending", "codec"), FORMATS)
def test_a_click_is_heard_in_its_picture_at_every_rate(tmp_path: Path, ending: str, codec: str) -> None:
    for fps in map(Fraction, RATES):
        count, at = int(fps * 2) + 1, 3
        path = tmp_path / f"click.{ending}"
        click_film(path, fps, count, at, codec)
        film = decoded(path)
        assert abs(film.click() - samples_of(at, fps, SR)) <= 1
        assert np.flatnonzero(film.brightness > 128).tolist() == [at]
        # mkv tells times in whole milliseconds
        assert max(abs(time - k / fps) for k, time in enumerate(film.picture_s)) <= Fraction(
            1 if ending == "mkv" else 0, 2000
        )
        assert len(film.picture_s) == count
        assert len(film.sound) == samples_of(count, fps, SR)
        if ending != "mkv":  # which says it of the whole file, in milliseconds
            assert film.ends_s is not None
            assert max(abs(end - count / fps) for end in film.ends_s) <= Fraction(1, SR)


def test_sound_that_is_short_is_padded_and_sound_that_is_long_is_cut(tmp_path: Path) -> None:
    fps = Fraction(25)
    for frames in (0, 1000, SR, 3 * SR):
        sound = KeptSound.of(0.5 * np.ones((1, frames)))
        write_film(tmp_path / "x.mov", click_pictures(25, 0), sound, SR, fps=fps, size=(SIDE, SIDE))
        found = decoded(tmp_path / "x.mov").sound
        assert len(found) == SR
        assert np.allclose(found[: min(frames, SR)], 0.5, atol=2**-22)
        assert not found[frames:].any()


@pytest.mark.parametrize("fps", RATES)
def test_no_rounding_adds_up(fps: Fraction) -> None:
    for count in (1, 7, 10 * 60 * 240 + 1, 10**7):
        exact = Fraction(count) * SR / fps
        assert abs(samples_of(count, Fraction(fps), SR) - exact) <= Fraction(1, 2)


@pytest.mark.parametrize(
    ("text", "fps"),
    [("24", 24), ("30000/1001", Fraction(30000, 1001)), ("29.97", Fraction(30000, 1001)), (60, 60), ("12.5", 12.5),
     ("23.976", Fraction(24000, 1001)), ("23.98", Fraction(24000, 1001)), ("59.94", Fraction(60000, 1001))],
)  # fmt: skip
def test_rates_are_fractions(text: object, fps: object) -> None:
    assert as_fps(text) == fps


@pytest.mark.parametrize(
    "text", ["", "0", "-24", "1/0", "nan", "1e9", "many", "24/0.5", None, "1/3", "1e400", "1e30000000", "9" * 30]
)
def test_what_is_no_rate_is_said(text: object) -> None:
    with pytest.raises(FileError, match="fps"):
        as_fps(text)


def test_one_film_twice_is_the_same_bytes(tmp_path: Path) -> None:
    for ending, codec in FORMATS:
        for name in "ab":
            click_film(tmp_path / f"{name}.{ending}", Fraction(30), 20, 3, codec)
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_what_is_beyond_full_scale_is_clipped_and_counted(tmp_path: Path) -> None:
    sound = KeptSound.of(np.array([[0.1] * 100 + [3.0] * 7 + [0.0] * 1000]))
    film = write_film(tmp_path / "x.mov", click_pictures(2, 0), sound, SR, fps=Fraction(30), size=(SIDE, SIDE))
    assert film.clipped == 7


@pytest.mark.parametrize(
    ("name", "codec", "sr", "channels", "said"),
    [
        ("x.avi", None, SR, 1, ".mp4 .mov .mkv"),
        ("x.mp4", "flac", SR, 1, "aac"),
        ("x.mkv", "opus", 44_100, 1, "--sr 48000"),
        ("x.mp4", None, 192_000, 1, "--sr 96000"),
        ("x.mp4", None, SR, 3, "one or two microphones"),
        ("no/such/folder/x.mp4", None, SR, 1, "check the path|no folder|missing"),
    ],
)
def test_what_cannot_be_written_is_said_before_anything_is_drawn(
    tmp_path: Path, name: str, codec: str | None, sr: int, channels: int, said: str
) -> None:
    with pytest.raises((FileError, AudioError), match=said):
        check_film_output(tmp_path / name, sr, channels, codec)
    assert list(tmp_path.iterdir()) == []


def test_odd_sizes_are_refused() -> None:
    assert check_size((1280, 720)) == (1280, 720)
    for size in ((1281, 720), (0, 0), (-2, 10), (10_000, 16)):
        with pytest.raises(FileError, match="even"):
            check_size(size)


def test_without_the_library_one_line_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(FileError, match=r"PyAV.*sonic_bullet\[film\]"):
        check_film_output(tmp_path / "x.mp4", SR, 1)


def test_a_full_disk_is_one_line_and_leaves_the_old_film(tmp_path: Path) -> None:
    path = tmp_path / "x.mov"
    path.write_bytes(b"old")
    rng = np.random.default_rng(0)
    noise = KeptSound.of(rng.uniform(-1, 1, (1, 2 * SR)))
    pictures = (rng.integers(0, 255, (64, 64, 3), dtype=np.uint8) for _ in range(60))
    with full_disk(100_000), pytest.raises(FileError, match=r"cannot write .*x\.mov"):
        write_film(path, pictures, noise, SR, fps=Fraction(30), size=(64, 64))
    assert path.read_bytes() == b"old"
    assert [one.name for one in tmp_path.iterdir()] == ["x.mov"]


@pytest.mark.parametrize("ending", ["mp4", "mkv"])
def test_a_film_that_is_stopped_is_a_film_of_what_was_finished(tmp_path: Path, ending: str) -> None:
    fps, path = Fraction(30), tmp_path / f"x.{ending}"
    sound = KeptSound.of(click_sound(SR, samples_of(5, fps, SR)))

    def stop() -> None:
        with FilmWriter(path, sound, SR, fps=fps, size=(SIDE, SIDE)) as film:
            for picture in click_pictures(12, 5):
                film.write(picture)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=rf"0.400 s are in .*x\.partial\.{ending}"):
        stop()
    assert [one.name for one in tmp_path.iterdir()] == [f"x.partial.{ending}"]
    film = decoded(tmp_path / f"x.partial.{ending}")
    assert len(film.picture_s) == 12
    assert abs(film.click() - samples_of(5, fps, SR)) <= 1


def test_a_film_that_is_stopped_before_its_first_picture_says_so(tmp_path: Path) -> None:
    def stop() -> None:
        with FilmWriter(tmp_path / "x.mp4", KeptSound.of(np.zeros((1, 99))), SR, fps=Fraction(30), size=(SIDE, SIDE)):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="stopped; no picture was drawn yet"):
        stop()
    assert list(tmp_path.iterdir()) == []


def test_every_codec_is_tried() -> None:
    assert {codec for _, codec in FORMATS} == set(CODECS)


@pytest.mark.parametrize("fps", ["24", "25", "30000/1001", "30", "60", "240"])
def test_as_many_pictures_as_their_samples_last(fps: str) -> None:
    rate = Fraction(fps)
    for count in (*range(1, 60), 17_988, 35_999, 144_007):
        assert pictures_of(samples_of(count, rate, SR), rate, SR) == count
        assert pictures_of(samples_of(count, rate, SR) + 1, rate, SR) == count + 1
