"""From a log to sound in space: ambisonics, a head, microphones that move, and what cannot be, by the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import error_of, run
from tests.journeys.test_scene_log_film import SCENE
from tests.made import heads

FLAT = ("--pascals", "--tail", "0")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("sofar")
    folder = tmp_path_factory.mktemp("space")
    (folder / "scene.py").write_text(SCENE.replace("SECONDS = 0.3", "SECONDS = 0.15"))
    heads.write_sofa(folder / "head.sofa", heads.head(44_100, heads.directions(30), taps=100))
    rows = [f"{t:.3f},{0.5 - t:.3f},-0.6,0.3" for t in np.arange(0, 0.3, 0.01)]
    (folder / "walk.csv").write_text("time_s,x,y,z\n" + "\n".join(rows) + "\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("render", "scene.py", "-o", "mix.wav", "--contacts", "log.npz", *FLAT) == 0
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


@pytest.mark.parametrize(
    ("words", "channels"),
    [
        (("--ambisonics", "3", "--facing", "0,0,0"), 16),
        (("--head", "head.sofa", "--facing", "0,0,0"), 2),
        (("--microphone-path", "walk.csv"), 1),
        (("--microphone-on", "bar=0,0,0.1", "--ambisonics", "1"), 4),
        (("--directivity",), 1),
        (("--directivity", "--ambisonics", "1", "--microphone-path", "walk.csv"), 4),
    ],
)
def test_a_render_in_space_comes_again_from_its_own_log(
    words: tuple[str, ...], channels: int, capfd: pytest.CaptureFixture[str]
) -> None:
    """A log keeps sensors, heads and paths: it renders to the same bytes without them."""
    assert run("render", "log.npz", "-o", "a.wav", "--contacts", "a.npz", *words, *FLAT) == 0
    said = capfd.readouterr().err
    sound, sr = soundfile.read("a.wav")
    assert sound.shape == (round(0.15 * sr),) + ((channels,) if channels > 1 else ()) and np.abs(sound).max() > 1e-3
    assert ("head.sofa is resampled from 44100 Hz to 48000 Hz" in said) == ("--head" in words)
    assert run("render", "a.npz", "-o", "b.wav", *FLAT) == 0
    assert Path("a.wav").read_bytes() == Path("b.wav").read_bytes()
    plain, _ = soundfile.read("mix.wav")
    if channels == 16:
        assert np.array_equal(sound[:, 0], plain)
        toward = sound[:, [3, 1, 2]].T @ plain / (plain @ plain)
        assert np.degrees(np.arccos(toward[0] / np.linalg.norm(toward))) < 10  # all happens where it faces


def test_stems_in_space_add_up() -> None:
    assert run("render", "log.npz", "-o", "c.wav", "--stems", "stems", "--ambisonics", "2", *FLAT) == 0
    stems = [soundfile.read(one)[0] for one in Path("stems").glob("*.wav")]
    mix = soundfile.read("c.wav")[0]
    assert mix.shape[1] == 9 and np.abs(np.sum(stems, axis=0) - mix).max() < 4 * 2**-23 * np.abs(mix).max()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--ambisonics", "2", "--head", "head.sofa"), "give one of both"),
        (("--ambisonics", "4"), "--ambisonics"),
        (("--head", "none.sofa"), "no such file"),
        (("--head", "walk.csv"), "no SOFA file"),
        (("--head", "room.sofa"), "no head's impulse responses"),
        (("--microphone-path", "none.csv"), "cannot read none.csv"),
        (("--microphone-path", "bad.csv"), "bad.csv:2"),
        (("--microphone-on", "cup"), "is called that"),
        (("--microphone-on", "bar=0,0,0"), "lies within bar"),
        (("--microphone", "0,0,0"), "lies within board"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    import sofar

    Path("bad.csv").write_text("0,0,0,0\n1,2,there,0\n")
    sofar.write_sofa("room.sofa", sofar.Sofa("SimpleFreeFieldHRTF"))
    capfd.readouterr()
    assert said in error_of(capfd, "render", "log.npz", "-o", "no.wav", *words)
    assert not Path("no.wav").exists()
