"""From a log to a folder that an editor opens: every item begins and ends on its sample, in OTIO and in Reaper."""

from __future__ import annotations

import os
import shlex
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import error_of, run
from tests.few_cases import parametrize_few
from tests.journeys.test_scene_log_film import SCENE
from tests.made.disks import full_disk

NAMED = SCENE.replace('"name": "bar"', '"name": "bar \\"one\\""')


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("session")
    (folder / "scene.py").write_text(NAMED)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("render", "scene.py", "-o", "mix.wav", "--contacts", "log.npz") == 0
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def reaper(text: str) -> tuple[str, list[list[str]], list[Any]]:
    """Name, lines and blocks of the first block of a Reaper project, each block again so."""
    stack: list[tuple[str, list[list[str]], list[Any]]] = [("", [], [])]
    for line in text.splitlines():
        one = line.strip()
        if one == ">":
            block = stack.pop()
            stack[-1][2].append(block)
        elif one.startswith("<"):
            stack.append((one[1:].split()[0], [one[1:].split()], []))
        else:
            lexer = shlex.shlex(one, posix=True)
            lexer.quotes, lexer.whitespace_split, lexer.escape, lexer.commenters = "\"'`", True, "", ""
            stack[-1][1].append(list(lexer))
    assert len(stack) == 1
    return stack[0][2][0]


def value(block: Any, name: str) -> list[str]:
    (found,) = (line[1:] for line in block[1] if line[0] == name)
    return found


@parametrize_few("words", [(), ("--sr", "44100"), ("--seconds", "0.1", "--tail", "0"), ("--sr", "22050")], (1,))
def test_every_item_begins_and_ends_on_its_sample(words: tuple[str, ...]) -> None:
    otio = pytest.importorskip("opentimelineio")
    assert run("render", "log.npz", "--session", "s", "--json", "s.json", *words) == 0
    folder = Path("s")
    mix = soundfile.info(folder / "mix.wav")
    names = {"mix": "mix.wav", "board": "00-board.wav", 'bar "one"': "01-bar_one.wav"}
    project = reaper((folder / "session.rpp").read_text())
    assert project[0] == "REAPER_PROJECT" and value(project, "SAMPLERATE")[0] == str(mix.samplerate)
    tracks = [block for block in project[2] if block[0] == "TRACK"]
    assert [value(one, "NAME")[0] for one in tracks] == list(names)
    for track, (name, file) in zip(tracks, names.items(), strict=True):
        (item,) = track[2]
        begin, length = (float(value(item, key)[0]) * mix.samplerate for key in ("POSITION", "LENGTH"))
        assert begin == 0 and abs(length - soundfile.info(folder / file).frames) < 1e-6
        assert value(item[2][0], "FILE") == [file] and item[2][0][0] == "SOURCE"
        assert value(track, "MUTESOLO")[0] == str(int(name == "mix"))
    timeline = otio.adapters.read_from_file(str(folder / "session.otio"))
    assert [track.name for track in timeline.tracks] == list(names)
    for track in timeline.tracks:
        (clip,) = track
        where = clip.range_in_parent()
        assert (where.start_time.value, where.duration.value, where.duration.rate) == (0, mix.frames, mix.samplerate)
        assert clip.media_reference.target_url == names[track.name]
    starts = {round(float(line[2]) * mix.samplerate) for line in project[1] if line[0] == "MARKER" and line[3]}
    marked = {int(one.marked_range.start_time.value) for one in timeline.tracks.markers}
    assert starts == marked and marked and max(marked) < mix.frames


def test_the_mix_is_the_sum_of_the_stems_and_the_render_itself() -> None:
    assert run("render", "log.npz", "-o", "own.wav", "--session", "t", "--cues", "--lufs", "-16") == 0
    mix = soundfile.read("t/mix.wav")[0]
    assert np.array_equal(soundfile.read("own.wav")[0], mix)
    total = np.sum([soundfile.read(one)[0] for one in Path("t").glob("0*.wav")], axis=0)
    assert np.abs(total - mix).max() <= 4 * 2**-23


@parametrize_few("fps", ["30000/1001", "25", "24"], 1)
def test_a_film_stands_beside_the_sounds(fps: str) -> None:
    pytest.importorskip("av")
    otio = pytest.importorskip("opentimelineio")
    assert run("render", "log.npz", "--session", "f", "--film", fps, "--film-size", "64x48", "--tail", "0") == 0
    (video,) = otio.adapters.read_from_file("f/session.otio").video_tracks()
    (clip,) = video
    rate = Fraction(fps)
    from tests.made.films import decoded

    film, mix = decoded(Path("f/film.mov")), soundfile.read("f/mix.wav")[0]
    assert clip.source_range.duration.value == len(film.picture_s)
    assert clip.source_range.duration.rate == pytest.approx(float(rate), rel=1e-12)
    assert len(mix) <= len(film.picture_s) / rate * 48_000 < len(mix) + 48_000 / rate
    track = reaper(Path("f/session.rpp").read_text())[2][0]
    (item,) = track[2]
    assert float(value(item, "LENGTH")[0]) == pytest.approx(float(len(film.picture_s) / rate), abs=1e-12)
    assert value(track, "VOLPAN")[0] == "0" and item[2][0][1][0] == ["SOURCE", "VIDEO"]


def test_without_otio_the_reaper_project_is_there_and_says_so(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sonic_bullet.apps.soundtrack.editing.otio_timeline.is_installed", lambda: False)
    assert run("render", "log.npz", "--session", "r") == 0
    assert Path("r/session.rpp").is_file() and not Path("r/session.otio").exists()
    assert "sonic_bullet[session]" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--session", "s", "--stems", "x"), "--stems"),
        (("-o", "a.wav", "--film", "25"), "--session"),
        (("--session", "log.npz"), "log.npz"),
        (("--session", "u", "--film", "many"), "many"),
        ((), "-o NAME.wav"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    capfd.readouterr()
    assert said in error_of(capfd, "render", "log.npz", *words)


def test_a_full_disk_leaves_what_is_finished(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk is full at the second stem: one line; the mix and the first are whole, no project names what is not."""
    from sonic_bullet.apps.soundtrack import stems

    written = stems.write_at_level

    def last_one_fails(path: Path, *rest: Any, **options: Any) -> Any:
        with full_disk(1000 if path.name.startswith("01") else 1 << 30):
            return written(path, *rest, **options)

    monkeypatch.setattr(stems, "write_at_level", last_one_fails)
    capfd.readouterr()
    assert "cannot write" in error_of(capfd, "render", "log.npz", "--session", "d", "--tail", "0")
    mix, first = (soundfile.info(Path("d", name)) for name in ("mix.wav", "00-board.wav"))
    assert mix.frames == first.frames > 0 and not {"01-bar_one.wav", "session.rpp"} & set(os.listdir("d"))
