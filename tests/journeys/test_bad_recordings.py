"""What is no recording of an impact gets one line with its name and a remedy, or a result that says so."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet.records import Array
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few

SR = 48_000
MODES = ((1680.0, 8.0, 0.3), (2900.0, 12.0, 0.2), (3360.0, 25.0, 0.2))
REMEDIES = ("record an impact", "give a recording of an impact", "export it again", "sound is in channel")


def draw(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def tap(sr: int = SR) -> Array:
    """Σ a e^{−du} sin 2πfu from 0.1 s on, over a noise of −100 dBFS."""
    time = np.arange(sr // 2) / sr
    u = np.maximum(time - 0.1, 0)
    sound = sum(a * np.exp(-d * u) * np.sin(2 * np.pi * f * u) for f, d, a in MODES)
    return np.asarray(sound + 1e-5 * draw(1).standard_normal(len(time)))


def speech(pitch_hz: float, seed: int) -> Array:
    """Harmonics that glide, in syllables."""
    time = np.arange(SR) / SR
    turn = 2 * np.pi * np.cumsum(pitch_hz * (1 + 0.25 * np.sin(2 * np.pi * 1.3 * time + seed))) / SR
    voiced = sum(np.sin(k * turn) / k * np.exp(-(((k * pitch_hz - 700) / 600) ** 2)) for k in range(1, 30))
    syllables = np.maximum(0, np.sin(2 * np.pi * 2.7 * time + seed)) ** 1.5
    return np.asarray(0.3 * syllables * voiced + 1e-4 * draw(seed).standard_normal(len(time)))


def music(*notes_hz: float) -> Array:
    """Notes that overlap, each with an attack of 0.12 s."""
    time, sound = np.arange(SR) / SR, np.zeros(SR)
    for i, note in enumerate(notes_hz):
        u = np.maximum(time - 0.2 * i, 0)
        swell = 0.1 * (1 - np.exp(-u / 0.12)) * np.exp(-u / 1.2)
        sound += swell * sum(np.sin(2 * np.pi * note * k * u) / k for k in (1, 2, 3))
    return sound + 1e-4 * draw(2).standard_normal(len(time))


def rain(drops: int, seed: int) -> Array:
    """Drops at random, each a ping of a few milliseconds, and hiss."""
    made, sound = draw(seed), np.zeros(SR)
    k = np.arange(300)
    for at in made.integers(0, SR - 300, drops):
        ping = np.exp(-k / made.uniform(5, 40)) * np.sin(2 * np.pi * made.uniform(0.02, 0.3) * k)
        sound[at : at + 300] += made.exponential(0.05) * ping
    return sound + 2e-3 * made.standard_normal(SR)


def pair(*channels: Array) -> Array:
    return np.stack(channels, axis=1)


def walk(sound: Array, capfd: pytest.CaptureFixture[str], *words: str, sr: int = SR) -> tuple[int, str, Any]:
    """The exit status, stderr and JSON of `features`."""
    soundfile.write("x.wav", sound, sr, subtype="FLOAT")
    capfd.readouterr()
    status = run("features", "x.wav", "--json", "found.json", *words)
    found = json.loads(Path("found.json").read_text()) if status == 0 else None
    return status, capfd.readouterr().err, found


def check_fit(capfd: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """The exit status of `fit` on a case of x.wav, and all that it says."""
    assert run("case", "new", "mine", "--material", "steel", "x.wav") == 0
    capfd.readouterr()
    status = run("fit", "mine", "-o", "fit.json", *words)
    said = capfd.readouterr()
    assert "Traceback" not in said.err and "SONIC_BULLET_DEBUG" not in said.err
    return status, said.out + said.err


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SONIC_BULLET_PROGRESS", "0")


@pytest.mark.parametrize(
    ("sound", "said"),
    [
        (np.zeros(SR), "x.wav is silent"),
        (np.full(SR, 0.3), "x.wav is silent"),
        (2e-5 * np.round(draw(3).uniform(-1, 1, SR)), "x.wav is silent"),
        (np.zeros(0), "x.wav holds 0 samples"),
        (tap()[4800:4810], "x.wav holds 10 samples"),
        (np.where(np.arange(SR // 2) == 5000, np.nan, tap()), "x.wav holds NaN or infinite samples"),
        (np.where(np.arange(SR // 2) == 5000, np.inf, tap()), "x.wav holds NaN or infinite samples"),
        (pair(np.zeros(SR), np.zeros(SR)), "x.wav is silent"),
    ],
    ids=["silence", "offset", "last bit", "empty", "ten samples", "NaN", "infinite", "two dead channels"],
)
def test_what_holds_no_sound_is_one_line_in_each_command(
    sound: Array, said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert walk(sound, capfd)[0] == 2
    for words in (
        ("features", "x.wav"),
        ("case", "new", "mine", "x.wav"),
        ("case", "new", "mine", "x.wav", "--split"),
        ("residual", "x.wav", "--material", "steel", "-o", "p.json"),
    ):
        assert run(*words) == 2
        line = capfd.readouterr().err.strip().splitlines()
        assert len(line) == 1 and said in line[0] and any(remedy in line[0] for remedy in REMEDIES), (words, line)
        assert not Path("mine").exists()


def test_what_went_bad_in_a_case_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    for sound in (tap()[4800:4810], np.zeros(SR)):
        soundfile.write("x.wav", tap(), SR, subtype="FLOAT")
        run("case", "new", "mine", "--material", "steel", "x.wav")
        soundfile.write("mine/x.wav", sound, SR, subtype="FLOAT")
        for words in (("case", "check", "mine"), ("fit", "mine", "-o", "f.json"), ("diagnose", "mine", "-o", "d.json")):
            capfd.readouterr()
            assert run(*words) == 2
            line = capfd.readouterr().err.strip().splitlines()
            assert len(line) == 1 and "x.wav" in line[0] and ";" in line[0]
        Path("mine/case.json").unlink()
        Path("mine/x.wav").unlink()


@parametrize_few("dead", [np.zeros(SR // 2), np.full(SR // 2, 0.01), 1e-5 * draw(4).standard_normal(SR // 2)], 1)
def test_a_dead_channel_is_named_and_the_live_one_used(dead: Array, capfd: pytest.CaptureFixture[str]) -> None:
    status, err, found = walk(pair(dead, tap()), capfd)
    assert status == 0 and "2 channels: channel 0 is dead, channel 1 is used, counted from 0" in err
    assert sorted(row["freq_hz"] for row in found["features"]) == pytest.approx([f for f, _, _ in MODES], rel=1e-5)
    status, said = check_fit(capfd)
    assert status == 0 and "channel 0 is dead, channel 1 is used" in said and "3 observed lines" in said


def test_a_dead_channel_that_is_asked_for_is_refused(capfd: pytest.CaptureFixture[str]) -> None:
    status, err, _ = walk(pair(np.zeros(SR // 2), tap()), capfd, "--channel", "0")
    assert status == 2 and "channel 0 of x.wav is silent; sound is in channel 1" in err
    status, err, _ = walk(pair(tap(), np.zeros(SR // 2)), capfd)
    assert status == 0 and "2 channels: the first is used, channel 0" in err


@parametrize_few(
    "sound",
    [speech(120, 1), speech(210, 2), speech(95, 3), rain(700, 5), rain(2000, 6), 0.1 * draw(7).standard_normal(SR)],
    (0, 3),
    ids=["speech", "high speech", "low speech", "rain", "downpour", "noise"],
)
def test_speech_rain_and_noise_are_said_to_be_no_impact(sound: Array, capfd: pytest.CaptureFixture[str]) -> None:
    status, err, found = walk(sound, capfd)
    assert status == 0 and found["verdict"] != "features"
    assert "x.wav: " in err and ("one impact alone does not" in err or "not an impact" in err)


@parametrize_few(
    "notes",
    [(220, 277.2, 329.6, 440), (523.3, 392), (98, 110, 130.8), (440,)],
    (3,),
    ids=["chord", "two", "low", "one"],
)
def test_music_is_no_impact_and_that_is_said(notes: tuple[float, ...], capfd: pytest.CaptureFixture[str]) -> None:
    status, err, found = walk(music(*notes), capfd)
    assert status == 0 and found["verdict"] != "features"
    assert "one impact alone does not" in err or "not an impact" in err


def test_fit_says_that_music_is_no_impact(capfd: pytest.CaptureFixture[str]) -> None:
    walk(music(220, 277.2, 329.6, 440), capfd)
    assert "one impact alone does not" in check_fit(capfd)[1]


@parametrize_few("gain", [3.0, -4.0], 1)
def test_a_tap_that_clips_is_said(gain: float, capfd: pytest.CaptureFixture[str]) -> None:
    status, err, found = walk(np.clip(gain * tap(), -0.9, 0.9)[: SR // 3], capfd)
    assert status == 0 and "samples are clipped" in err and found["verdict"] != "features"
    assert run("case", "new", "mine", "--material", "steel", "x.wav") == 0
    assert "x.wav: " in (err := capfd.readouterr().err) and "samples are clipped" in err
    assert run("case", "check", "mine") == run("fit", "mine", "-o", "f.json") == 2
    assert all("x.wav is clipped" in line for line in capfd.readouterr().err.strip().splitlines()[-2:])


@pytest.mark.parametrize(
    ("sr", "said"), [(8000, "8000 samples a second: nothing above 3920 Hz is seen"), (192_000, "")]
)
def test_any_rate_gives_the_same_modes(sr: int, said: str, capfd: pytest.CaptureFixture[str]) -> None:
    status, err, found = walk(tap(sr), capfd, sr=sr)
    assert status == 0 and said in err and bool(err) == bool(said)
    rows = sorted(found["features"], key=lambda row: row["freq_hz"])
    assert [row["freq_hz"] for row in rows] == pytest.approx([f for f, _, _ in MODES], rel=1e-5)
    assert [row["decay_per_s"] for row in rows] == pytest.approx([d for _, d, _ in MODES], rel=0.01)
    assert said in check_fit(capfd)[1]


@parametrize_few(
    "sound",
    [speech(120, 1), speech(210, 2), speech(110, 9), speech(230, 7), rain(700, 5)],
    (1,),
    ids=["speech", "high speech", "last syllable", "higher speech", "rain"],
)
def test_fit_of_what_is_no_impact_writes_no_preset(sound: Array, capfd: pytest.CaptureFixture[str]) -> None:
    soundfile.write("x.wav", sound, SR, subtype="FLOAT")
    status, said = check_fit(capfd)
    assert status == 2 and "no impact found: " in said and "record one impact" in said
    assert not Path("fit.json").exists()
    assert run("diagnose", "mine") == 2


def test_a_drift_below_the_band_is_no_reason_to_doubt_an_impact(capfd: pytest.CaptureFixture[str]) -> None:
    """Wind on a microphone, 10 dB louder than the tap and after it."""
    drift = np.sin(2 * np.pi * 4.0 * np.arange(SR // 2) / SR) * np.linspace(0, 1, SR // 2)
    soundfile.write("x.wav", 0.3 * tap() + 0.5 * drift, SR, subtype="FLOAT")
    status, said = check_fit(capfd)
    assert status == 0 and "no impact" not in said
