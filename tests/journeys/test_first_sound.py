"""The first sound: the README's block as it stands there, and a script of four lines, opened in any player."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.files import read_audio, read_audio_scale
from tests.apps.cli.test_commands import error_of, run

README = Path(__file__).resolve().parents[2] / "README.md"
SCRIPT = """
import pybullet as p
p.connect(p.DIRECT)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.1, 0.02]))
p.createMultiBody(0.2, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.08, 0.008, 0.004]), basePosition=[0, 0, 0.05])
p.setGravity(0, 0, -9.81)
for _ in range(36): p.stepSimulation()
"""
SR = 48_000


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the script was rendered as its user would."""
    folder = tmp_path_factory.mktemp("first")
    (folder / "four.py").write_text(SCRIPT)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert (
            run("render", "four.py", "-o", "a.wav", "--material", "steel", "--contacts", "a.npz", "--scale-json") == 0
        )
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def test_what_a_newcomer_opens_is_listenable_and_says_its_scale() -> None:
    file, sr = soundfile.read("a.wav")
    peak = np.abs(file).max()
    assert 20 * np.log10(peak) == pytest.approx(-1, abs=0.05) and sr == SR
    told, scale = json.loads(Path("a.wav.json").read_text()), read_audio_scale("a.wav")
    assert scale == told["full_scale"] and told["unit"] == "Pa"
    assert told["peak_db_spl"] == pytest.approx(20 * np.log10(peak * scale / 20e-6), abs=0.01)
    raw = Path("a.wav").read_bytes()
    assert b"iXML" in raw and b"bext" in raw and raw.count(f"0 dBFS = {scale:.3g} Pa".encode()) >= 2


def test_it_ends_far_below_its_peak() -> None:
    file = soundfile.read("a.wav")[0]
    assert len(file) > 36 / 240 * SR
    assert 20 * np.log10(np.abs(file[-SR // 50 :]).max() / np.abs(file).max()) < -60
    assert run("render", "a.npz", "-o", "none.wav", "--tail", "0") == 0
    assert soundfile.info("none.wav").frames == round(36 / 240 * SR)


def test_the_log_gives_the_same_bytes_with_equal_options(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("render", "a.npz", "-o", "b.wav") == 0
    assert Path("b.wav").read_bytes() == Path("a.wav").read_bytes()
    said = capfd.readouterr().err
    assert re.search(r"^sonic-bullet: 0 dBFS = \S+ Pa \(peak \d+ dB SPL\)$", said, re.M)


@pytest.mark.parametrize("extension", ["wav", "flac", "rf64", "aiff", "caf"])
def test_the_scale_is_undone_wherever_a_file_is_read(extension: str) -> None:
    assert run("render", "a.npz", "-o", f"c.{extension}") == 0
    assert run("render", "a.npz", "-o", "pa.wav", "--pascals") == 0
    pascals = read_audio("pa.wav")[0]
    assert read_audio_scale("pa.wav") == 1.0 and np.abs(soundfile.read("pa.wav")[0] - pascals).max() == 0
    assert np.abs(read_audio(f"c.{extension}")[0] - pascals).max() <= 2**-23 * np.abs(pascals).max()


def test_a_w64_which_cannot_say_its_scale_stays_in_pascals() -> None:
    assert run("render", "a.npz", "-o", "d.w64") == 0 and run("render", "a.npz", "-o", "pa.wav", "--pascals") == 0
    assert read_audio_scale("d.w64") is None
    np.testing.assert_array_equal(read_audio("d.w64")[0], read_audio("pa.wav")[0])


def test_a_silent_render_is_not_scaled(capfd: pytest.CaptureFixture[str]) -> None:
    Path("still.py").write_text(SCRIPT.replace("range(36)", "range(4)"))
    assert run("render", "still.py", "-o", "still.wav", "--material", "steel") == 0
    assert not soundfile.read("still.wav")[0].any() and soundfile.info("still.wav").frames == 800
    said = capfd.readouterr().err
    assert "silent" in said and "0 dBFS = 1 Pa" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--pascals", "--peak-dbfs", "-3"), "--pascals"),
        (("--pascals", "--lufs", "-23"), "--pascals"),
        (("--tail", "60"), "--tail is 60.0; give at most 0"),
        (("--tail", "nan"), "--tail is nan"),
    ],
)
def test_what_contradicts_itself_is_said_first(
    words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert said in error_of(capfd, "render", "a.npz", "-o", "no.wav", *words)
    assert not Path("no.wav").exists()


def test_the_readmes_first_block_runs_as_it_stands() -> None:
    block = re.search(r"```python\n(.*?)```", README.read_text(), re.S)
    assert block is not None
    exec(compile(block[1], "README", "exec"), {"__name__": "__main__"})
    sound, _ = read_audio("bar.wav")
    assert np.abs(sound).max() > 20e-6 and Path("bar.npz").is_file()
