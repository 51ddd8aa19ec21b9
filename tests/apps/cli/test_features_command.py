"""`sonic-bullet features`: JSON, table, picture; what is no recording says so in one line."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.apps.cli.line_table import decay_values
from tests.apps.cli.called_here import call_here
from tests.few_cases import parametrize_few


def features(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return call_here(Path(), "features", *map(str, words))


def test_the_installed_command_is_this_one(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "silent.wav", np.zeros(48_000), 48_000)
    words = ["features", str(tmp_path / "silent.wav")]
    command = [str(Path(sys.executable).with_name("sonic-bullet")), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    here = features(*words[1:])
    assert (done.returncode, done.stdout, done.stderr) == (here.returncode, here.stdout, here.stderr)
    assert done.returncode == 2 and "silent.wav is silent" in done.stderr


def test_a_tap_in_stereo(tmp_path: Path) -> None:
    time = np.arange(24_000) / 48_000
    tap = 0.3 * np.exp(-12 * time) * np.sin(2 * np.pi * 700 * time) + 1e-5 * np.random.default_rng(0).standard_normal(
        len(time)
    )
    soundfile.write(tmp_path / "tap.wav", np.stack([0.1 * tap, tap], axis=1), 48_000, subtype="FLOAT")
    done = features(tmp_path / "tap.wav", "--channel", "1", "--json", "--picture", tmp_path / "tap.png")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    (one,) = said["features"]
    assert (
        abs(one["freq_hz"] - 700) < 5 * one["freq_sd_hz"] and abs(one["decay_per_s"] - 12) < 5 * one["decay_sd_per_s"]
    )
    assert abs(one["amplitude"] - 0.3) < 5 * one["amplitude_sd"]
    assert "2 channels: channel 1 is used" in said["note"] and "2 channels: channel 1 is used" in done.stderr
    assert said["verdict"] == "features"  # asked for, so no doubt
    assert set(said) >= {"features", "onset_s", "noise_dbfs"} and {
        "freq_hz",
        "decay_per_s",
        "amplitude",
        "freq_sd_hz",
        "decay_sd_per_s",
    } <= set(one)
    assert (tmp_path / "tap.png").stat().st_size > 10_000


def test_the_first_channel_is_used_and_said(tmp_path: Path) -> None:
    """As `fit`, `residual` and `diagnose` do, however loud the others are; what is not there is one line."""
    time = np.arange(24_000) / 48_000
    one, two = (0.3 * np.exp(-12 * time) * np.sin(2 * np.pi * f * time) for f in (700, 1900))
    soundfile.write(tmp_path / "two.wav", np.stack([0.1 * one, two], axis=1), 48_000, subtype="FLOAT")
    for words, freq_hz, said in (
        ([], 700, "2 channels: the first is used"),
        (["--channel", "0"], 700, "channel 0 is used"),
        (["--channel", "1"], 1900, "channel 1 is used"),
    ):
        done = features(tmp_path / "two.wav", *words, "--json")
        assert [round(line["freq_hz"]) for line in json.loads(done.stdout)["features"]] == [freq_hz]
        assert len(done.stderr.splitlines()) == 1 and said in done.stderr
    done = features(tmp_path / "two.wav", "--channel", "2")
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"sonic-bullet: {tmp_path / 'two.wav'} has no channel 2; it has 2 channels, 0 to 1"
    ]


def test_what_is_no_recording_gets_one_line(tmp_path: Path) -> None:
    (tmp_path / "text.wav").write_text("not audio")
    soundfile.write(tmp_path / "silent.wav", np.zeros(48_000), 48_000)
    soundfile.write(tmp_path / "short.wav", np.ones(100), 48_000)
    for words in (
        ["text.wav"],
        ["silent.wav"],
        ["short.wav"],
        ["missing.wav"],
        ["silent.wav", "--band", "8000,200"],
        ["silent.wav", "--picture", "x.gif"],
    ):
        done = features(tmp_path / words[0], *words[1:])
        assert done.returncode == 2, words
        assert len(done.stderr.strip().splitlines()) == 1 and "Traceback" not in done.stderr


@parametrize_few(("freq_hz", "decay_per_s"), [(700.0, 12.0), (180.0, 3.0), (5200.0, 60.0)], 1)
def test_t60_loss_factor_and_q_stand_beside_the_decay(tmp_path: Path, freq_hz: float, decay_per_s: float) -> None:
    """T60 = ln(1000)/d, η = d/(πf) = 1/Q, each to its spread, in the table, the JSON and the CSV."""
    time = np.arange(24_000) / 48_000
    tap = 0.3 * np.exp(-decay_per_s * time) * np.sin(2 * np.pi * freq_hz * time)
    tap += 1e-5 * np.random.default_rng(1).standard_normal(len(time))
    soundfile.write(tmp_path / "tap.wav", tap, 48_000, subtype="FLOAT")
    done = features(tmp_path / "tap.wav", "--json", tmp_path / "tap.json", "--csv", tmp_path / "tap.csv")
    assert done.returncode == 0, done.stderr
    assert all(word in done.stdout.splitlines()[1] for word in ("T60 s", "loss factor", "Q"))
    (one,) = json.loads((tmp_path / "tap.json").read_text())["features"]
    want = {
        "t60_s": np.log(1000) / decay_per_s,
        "loss_factor": decay_per_s / (np.pi * freq_hz),
        "q": np.pi * freq_hz / decay_per_s,
    }
    for name, value in want.items():
        sd = one["t60_sd_s" if name == "t60_s" else f"{name}_sd"]
        assert abs(one[name] - value) < 5 * sd < 0.05 * value
    (row,) = csv.DictReader((tmp_path / "tap.csv").read_text().splitlines())
    assert {name: float(value) for name, value in row.items()} == one


def test_what_has_no_decay_has_no_t60() -> None:
    assert set(decay_values(100.0, float("nan"), 1.0).values()) == {None}
    assert set(decay_values(100.0, 0.0, 1.0).values()) == {None}
    assert set(decay_values(3523.0, 0.0008, 0.075).values()) == {None}  # a short take of a bar that rings for a minute
    known = decay_values(100.0, 3.0, float("inf"))
    assert known["q"] == pytest.approx(100 * np.pi / 3) and known["q_sd"] is None
