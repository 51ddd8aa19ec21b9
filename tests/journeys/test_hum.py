"""Hum that stands before the tap is taken off and said; the modes stay where they are."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sonic_bullet.lab.lines.standing_hum import find_session_hum, find_standing_hum
from sonic_bullet.records import Array
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few

SR = 44_100
TIME = np.arange(int(0.7 * SR)) / SR
MODES = ((180.0, 4.0, 0.2), (1680.0, 8.0, 0.3), (2900.0, 12.0, 0.2), (3360.0, 25.0, 0.2))


def tap(at_s: float = 0.2) -> Array:
    u = np.maximum(TIME - at_s, 0)
    sound = sum(a * np.exp(-d * u) * np.sin(2 * np.pi * f * u) for f, d, a in MODES)
    return np.asarray(0.5 * sound + 1e-4 * np.random.default_rng(1).standard_normal(len(TIME)))


def hum(hz: float, level: float, multiples: tuple[int, ...] = (1, 2, 3, 4, 5)) -> Array:
    return np.asarray(level * sum(np.sin(2 * np.pi * hz * k * TIME + k) / k for k in multiples))


def rows(path: str) -> list[tuple[float, float]]:
    with open(path, newline="", encoding="utf-8") as file:
        return sorted((float(row["freq_hz"]), float(row["decay_per_s"])) for row in csv.DictReader(file))


def check_near(found: list[tuple[float, float]], plain: list[tuple[float, float]]) -> None:
    """The same modes; off by no more than a fifth beyond what they are off without hum, or by what can be told."""
    assert len(found) == len(plain) == len(MODES)
    for (f, d), (f0, d0), (freq, decay, _) in zip(found, plain, MODES, strict=True):
        assert abs(f - freq) < max(1.2 * abs(f0 - freq), 1e-4)
        assert abs(d - decay) < max(1.2 * abs(d0 - decay), 1e-3 * decay)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SONIC_BULLET_PROGRESS", "0")


@parametrize_few(
    ("beside", "said"),
    [
        (hum(50, 0.05), "hum at 50 Hz"),
        (hum(60, 0.05), "hum at 60 Hz"),
        (hum(49.95, 0.02, (2, 4, 6)), "hum at 50 Hz"),
        (hum(50.03, 0.002, (1, 3)), "hum at 50 Hz"),
    ],
    (1, 3),
    ids=["50 Hz", "60 Hz, a multiple at a mode", "of a rectifier", "weak"],
)
def test_hum_is_said_and_no_mode(
    beside: Array, said: str, plain: dict[str, list[tuple[float, float]]], capfd: pytest.CaptureFixture[str]
) -> None:
    found = walk(tap() + beside)
    assert capfd.readouterr().err.count(said) == 2
    for command, lines in found.items():
        check_near(lines, plain[command])
    (take,) = json.loads(Path("fit.json").read_text())["takes"]
    assert take["predicted_db"] < 3.0  # of what hums, no part is missed


def walk(sound: Array) -> dict[str, list[tuple[float, float]]]:
    """Frequency and decay that `features` and `fit` find, by command."""
    soundfile.write("x.wav", sound, SR, subtype="FLOAT")
    assert run("features", "x.wav", "--csv", "features.csv") == 0
    assert run("case", "new", "mine", "--material", "steel", "x.wav") == 0
    assert run("fit", "mine", "-o", "p.json", "--csv", "fit.csv", "--json", "fit.json") == 0
    return {command: rows(f"{command}.csv") for command in ("features", "fit")}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[tuple[float, float]]]:
    """Of the tap without hum."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("plain"))
        return walk(tap())


@pytest.mark.parametrize(
    "sound",
    [tap(), tap() + hum(50, 0.05) * (TIME < 0.4), tap() + hum(73, 0.05, (1,)), tap(0.05) + hum(50, 0.05)],
    ids=["none", "ends", "a tone of its own", "too short before"],
)
def test_what_is_no_standing_hum_is_left(sound: Array) -> None:
    start = 0.2 if np.abs(sound[: SR // 6]).max() < 0.2 else 0.05
    found, hz = find_standing_hum(sound, SR, round(start * SR))
    assert hz == 0 and not found.any()


def test_hum_too_weak_for_one_take_is_found_by_all_and_to_a_hundredth_of_a_hertz() -> None:
    rng = np.random.default_rng(2)
    weak = 0.0001
    takes = [
        tap() + hum(49.97, weak, (1, 2, 3)) * rng.choice([-1, 1]) + 9e-4 * rng.standard_normal(len(TIME))
        for _ in range(6)
    ]
    starts = [round(0.2 * SR)] * 6
    assert not any(find_standing_hum(one, SR, at)[1] for one, at in zip(takes, starts, strict=True))
    found, hz = find_session_hum(takes, SR, starts)
    assert hz == pytest.approx(49.97, abs=0.05) and sum(one.any() for one in found) >= 4


def test_a_take_without_silence_before_it_loses_the_session_hum_too() -> None:
    beside = hum(50.02, 0.02)
    takes = [tap() + beside, tap() + np.roll(beside, 300), tap(0.05) + np.roll(beside, 700)]
    found, hz = find_session_hum(takes, SR, [round(s * SR) for s in (0.2, 0.2, 0.05)])
    assert hz == pytest.approx(50.02, abs=0.01)
    for left, plain in zip((x - h for x, h in zip(takes, found, strict=True)), (tap(), tap(), tap(0.05)), strict=True):
        assert np.sqrt(((left - plain) ** 2).mean()) < 0.1 * np.sqrt((beside**2).mean())


def test_hum_that_goes_on_through_a_session_is_taken_off_to_a_thirtieth() -> None:
    rng = np.random.default_rng(5)
    beside = [hum(50.03, 0.004) * rng.choice([-1, 1]) for _ in range(5)]
    takes = [tap() + one + 2e-3 * rng.standard_normal(len(TIME)) for one in beside]
    found, hz = find_session_hum(takes, SR, [round(0.2 * SR)] * 5)
    assert hz == pytest.approx(50.03, abs=0.005)
    left = np.sqrt(np.mean([((a - b) ** 2).mean() for a, b in zip(found, beside, strict=True)]))
    assert left < np.sqrt((beside[0] ** 2).mean()) / 30
