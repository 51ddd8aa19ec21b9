"""What lies outside the band that was asked for changes nothing; a second tap is named with its time."""

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

SR, SECONDS = 48_000, 1.5
TIME = np.arange(int(SECONDS * SR)) / SR
MODES = ((1680.0, 3.0, 0.03), (4170.0, 12.0, 0.02), (7360.0, 25.0, 0.02))


def tap(at_s: float, gain: float = 1.0) -> Array:
    """Σ a e^{−du} sin 2πfu, u from the strike on."""
    u = np.maximum(TIME - at_s, 0)
    return gain * sum(a * np.exp(-d * u) * np.sin(2 * np.pi * f * u) for f, d, a in MODES)


def noise(level: float, seed: int = 1) -> Array:
    return level * np.random.default_rng(seed).standard_normal(len(TIME))


def wind(level: float) -> Array:
    """Noise that falls by 24 dB an octave above 20 Hz."""
    freq = np.fft.rfftfreq(len(TIME), 1 / SR)
    made = np.fft.irfft(np.fft.rfft(noise(1.0, 2)) / (1 + (freq / 20) ** 4), len(TIME))
    return level * made / made.std()


def features(sound: Array | Path, *words: str) -> dict[str, Any]:
    if not isinstance(sound, Path):
        soundfile.write("tap.wav", sound, SR, subtype="FLOAT")
        sound = Path("tap.wav")
    run("features", str(sound), "--json", "found.json", *words)
    found: dict[str, Any] = json.loads(Path("found.json").read_text())
    return found


def check_modes(found: dict[str, Any], onset_s: float) -> None:
    """The three modes and no other, by closed form; onset to a tenth of a millisecond; nothing said."""
    rows = sorted(found["features"], key=lambda row: row["freq_hz"])
    assert [row["freq_hz"] for row in rows] == pytest.approx([f for f, _, _ in MODES], rel=1e-5)
    assert [row["decay_per_s"] for row in rows] == pytest.approx([d for _, d, _ in MODES], rel=0.01)
    assert [row["amplitude"] for row in rows] == pytest.approx([a for _, _, a in MODES], rel=0.01)
    assert found["onset_s"] == pytest.approx(onset_s, abs=1e-4)
    assert (found["verdict"], found["note"]) == ("features", "")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.shared
@parametrize_few("name", ["clean", "rumble"], (1,))
def test_rumble_below_the_band_hides_no_mode(shared_path: Path, name: str) -> None:
    check_modes(features(shared_path / f"faults/02-rumble-hides-every-mode/{name}.wav", "--band", "200,20000"), 0.5)


@parametrize_few(
    ("beside", "band"),
    [
        (0.2 + wind(0.05), "400,20000"),
        (0.2 * np.sin(2 * np.pi * 12_000 * TIME + 1), "200,10000"),
        (sum(0.05 / k * np.sin(2 * np.pi * 60 * k * TIME + k) for k in (1, 2, 3)), "200,20000"),
    ],
    1,
    ids=["offset and wind", "tone above", "hum"],
)
def test_what_lies_outside_the_band_changes_nothing(beside: Array, band: str) -> None:
    check_modes(features(tap(0.4) + beside + noise(1e-5), "--band", band), 0.4)


@pytest.mark.parametrize(
    ("sound", "said"),
    [
        (tap(0.3) + tap(0.5), "2 hits, at 0.30 and 0.50 s"),
        (tap(0.3) + tap(0.5, 0.4) + 0.005 * np.sin(2 * np.pi * 50 * TIME), "2 hits, at 0.30 and 0.50 s"),
        (tap(0.1) + tap(0.3) + tap(0.9, 2.0), "3 hits, at 0.10, 0.30 and 0.90 s"),
    ],
    ids=["alike", "softer, in hum", "three"],
)
def test_each_tap_is_named_and_the_first_is_used(sound: Array, said: str) -> None:
    found = features(sound + noise(1e-4))
    assert f"{said}: only what comes before the second" in found["note"]
    assert [row["freq_hz"] for row in found["features"][:1]] == pytest.approx([MODES[0][0]], abs=0.1)


def test_fit_and_diagnose_name_a_second_tap(capsys: pytest.CaptureFixture[str]) -> None:
    for i in range(2):
        sound = tap(0.1) + (tap(0.3) if i else 0) + noise(1e-4, i)
        soundfile.write(f"s{i}.wav", sound[: SR // 2], SR, subtype="FLOAT")
    assert run("case", "new", "bar", "--recordings", "s0.wav", "s1.wav", "--material", "steel") == 0
    for command in (("fit", "bar", "-o", "f.json"), ("diagnose", "bar", "-o", "d.json")):
        capsys.readouterr()
        run(*command)
        said = capsys.readouterr().err
        assert "s1.wav holds 2 hits, at 0.10 and 0.30 s" in said and "s0.wav holds" not in said


def test_a_take_that_a_second_tap_ends_does_not_shorten_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    """Its first second would pass for a usual length: of the others nearly a third would be lost."""
    for i in range(4):
        soundfile.write(f"s{i}.wav", tap(0.1) + (tap(1.1) if i == 3 else 0) + noise(1e-4, i), SR, subtype="FLOAT")
    assert run("case", "new", "bar", "--recordings", *(f"s{i}.wav" for i in range(4)), "--material", "steel") == 0
    capsys.readouterr()
    assert run("fit", "bar", "-o", "f.json") == 0
    said = capsys.readouterr().err
    assert "s3.wav goes for 1 s, the others of object for 1.4 s and more: the lines are read without it" in said
