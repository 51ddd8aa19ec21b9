"""From a log to a sound of a loudness: what other meters read of mix and stems, fades, and what is said of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from scipy.signal import resample_poly

from tests.apps.cli.test_commands import error_of, run
from tests.few_cases import parametrize_few
from tests.journeys.test_scene_log_film import SCENE


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("loud")
    (folder / "scene.py").write_text(SCENE.replace("SECONDS = 0.3", "SECONDS = 0.6"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("render", "scene.py", "-o", "mix.wav", "--contacts", "log.npz") == 0
    return folder


@pytest.fixture(autouse=True)
def inside(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)


def true_peak_dbtp(name: str | Path) -> float:
    """By scipy's own interpolation, at 8 times the rate."""
    samples, _ = soundfile.read(name)
    return float(20 * np.log10(np.abs(resample_poly(samples, 8, 1, axis=0)).max()))


def lufs(name: str | Path) -> float:
    import pyloudnorm

    samples, sr = soundfile.read(name)
    return float(pyloudnorm.Meter(sr).integrated_loudness(samples))


def rendered(*words: str) -> dict[str, Any]:
    assert run("render", "log.npz", "-o", "new.wav", "--json", "new.json", *words) == 0
    return dict(json.loads(Path("new.json").read_text()))


@parametrize_few(
    ("loudness", "peak"), [(-14.0, None), (-30.0, None), (-10.0, -0.5), (-16.0, -3.0), (-23.0, -12.0)], (0, 3)
)
def test_loudness_and_true_peak_hold_together(
    loudness: float, peak: float | None, capfd: pytest.CaptureFixture[str]
) -> None:
    """Both asked for: LUFS within 0.1 by pyloudnorm, no true peak above the one asked for, by scipy's interpolation."""
    told = rendered("--lufs", str(loudness), *(() if peak is None else ("--peak-dbfs", str(peak))))
    said = capfd.readouterr()
    assert abs(lufs("new.wav") - loudness) < 0.1
    assert true_peak_dbtp("new.wav") <= (-1.0 if peak is None else peak)
    assert told["loudness"]["integrated_lufs"] == pytest.approx(loudness, abs=0.05)
    assert told["loudness"]["true_peak_dbtp"] == pytest.approx(true_peak_dbtp("new.wav"), abs=0.1)
    assert f"loudness {loudness:.1f} LUFS" in said.out and "true peak" in said.out
    assert ("a limiter takes off up to" in said.err) == (told["scale"]["limited_db"] > 0)
    assert told["clipped"] == 0


def test_a_limited_mix_is_still_the_sum_of_its_stems() -> None:
    told = rendered("--lufs", "-12", "--stems", "stems", "--fade", "0.01,0.2")
    assert told["scale"]["limited_db"] > 1
    total = np.sum([soundfile.read(one)[0] for one in Path("stems").glob("*.wav")], axis=0)
    mix = soundfile.read("new.wav")[0]
    assert np.abs(total - mix).max() <= 4 * 2**-23
    assert all(stem["loudness"]["true_peak_dbtp"] < 0 for stem in told["stems"])


def test_each_stem_has_a_loudness_of_its_own() -> None:
    told = rendered("--material", "board=glass", "--stems", "own", "--stem-lufs", "-20", "--stem-peak-dbfs", "-2")
    assert len(told["stems"]) == 2
    for stem in told["stems"]:
        assert abs(lufs(stem["path"]) + 20) < 0.1 and true_peak_dbtp(stem["path"]) <= -2


def test_a_stem_that_cannot_be_so_loud_is_named(capfd: pytest.CaptureFixture[str]) -> None:
    """A board of plain wood is one click: no limiter makes it as loud as what rings."""
    rendered("--stems", "own", "--stem-lufs", "-20", "--stem-peak-dbfs", "-2")
    said = capfd.readouterr().out
    assert "00-board.wav: no -20 LUFS below that true peak, it is as loud as in the mix" in said
    assert "01-bar.wav: no" not in said


@parametrize_few("fade", [(0.0, 0.25), (0.05, 0.1), (0.02, 0.0)], (0, 1))
def test_a_fade_is_half_a_hann_window_at_the_ends(fade: tuple[float, float]) -> None:
    rendered("--pascals")
    plain = soundfile.read("new.wav")[0]
    rendered("--pascals", "--fade", f"{fade[0]},{fade[1]}" if fade[0] else str(fade[1]))
    faded, n = soundfile.read("new.wav")[0], len(plain)
    begin, end = round(fade[0] * 48_000), round(fade[1] * 48_000)
    window = np.ones(n)
    window[:begin] *= np.sin(np.pi / 2 * np.arange(begin) / max(begin, 1)) ** 2
    window[n - end :] *= np.sin(np.pi / 2 * np.arange(end)[::-1] / max(end, 1)) ** 2
    np.testing.assert_allclose(faded, plain * window, atol=2**-22 * np.abs(plain).max())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--lufs", "-14", "--pascals"), "--pascals"),
        (("--fade", "100"), "--fade takes longer than the sound"),
        (("--lufs", "6"), "cannot be reached"),
        (("--lufs", "-14", "--peak-dbfs", "3"), "--peak-dbfs"),
        (("--stem-lufs", "-14"), "--stems"),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    capfd.readouterr()
    assert said in error_of(capfd, "render", "log.npz", "-o", "no.wav", *words)
    assert not Path("no.wav").exists()


def test_a_film_is_limited_as_its_sound_is() -> None:
    pytest.importorskip("av")
    from tests.made.films import decoded

    rendered("--lufs", "-14")
    assert run("film", "log.npz", "-o", "a.mov", "--size", "64x48", "--fps", "25", "--lufs", "-14") == 0
    film, mix = decoded(Path("a.mov")), soundfile.read("new.wav")[0]
    assert np.abs(film.sound[: len(mix)] - mix).max() < 2**-22
