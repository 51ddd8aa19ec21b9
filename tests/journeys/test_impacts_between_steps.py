"""From an example scene to its impacts: they lie between the steps of the physics, not on them."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import soundfile
from scipy.signal import butter, hilbert, sosfilt

from sonic_bullet.records import Array
from sonic_bullet.scene import render_scene
from tests.apps.cli.called_here import call_here
from tests.few_cases import parametrize_few

REPO = Path(__file__).parents[2]
STEP_HZ = 240
SCENES = ("robot_arm", "tabletop", "drop")
LIGHT = '''"""{name}, each body with a few modes that die within 10 ms: its impacts are the same."""
import runpy
from dataclasses import replace
from tests.made.models import STEEL, box_model

REAL = runpy.run_path({path!r})
SECONDS, MICROPHONE = REAL["SECONDS"], (0.0, -0.6, 0.4)
if "act" in REAL:
    act = REAL["act"]
QUICK = replace(STEEL, name="quick", alpha_per_s=1400.0)


def build(client):
    model = box_model((0.05, 0.04, 0.03), (6500, 7700, 9100, 10300, 11900), QUICK)
    how = {{"material": QUICK, "model": model}}
    return {{who: how | {{"name": one["name"]}} for who, one in REAL["build"](client).items()}}
'''


def comb_db(sound: Array, sr: int) -> float:
    """How far the envelope's spectrum, of what rings briefly, lies at multiples of the step rate over its neighbours.

    Mean of the first five lines: one alone varies by 3 dB with chance.
    """
    power = np.zeros(sound.shape[1] // 2 + 1)
    for row in sound:
        high = sosfilt(butter(4, 6000, "high", fs=sr, output="sos"), row)
        envelope = np.sqrt(np.abs(hilbert(high)))
        power += np.abs(np.fft.rfft((envelope - envelope.mean()) * np.hanning(len(envelope)))) ** 2
    off = np.abs(np.fft.rfftfreq(sound.shape[1], 1 / sr) - STEP_HZ * np.arange(1, 6)[:, None])
    line = [power[one <= 1.0].mean() / power[(one > 3.0) & (one < 100.0)].mean() for one in off]
    return 10 * float(np.log10(np.mean(line)))


@parametrize_few("name", SCENES, (0, 2))
def test_impacts_of_a_scene_lie_between_its_steps(name: str, tmp_path: Path) -> None:
    scene = LIGHT.format(name=name, path=str(REPO / "scenes" / f"{name}.py"))
    (tmp_path / "light.py").write_text(scene, encoding="utf-8")
    done = call_here(tmp_path, "render", "light.py", "-o", "mix.wav", "--events", "events.csv")
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "events.csv", encoding="utf-8") as file:
        start_s = np.array([float(one["start_s"]) for one in csv.DictReader(file) if one["kind"] == "impact"])
    phase = start_s * STEP_HZ % 1
    near = np.minimum(phase, 1 - phase) < 0.01
    sound, sr = soundfile.read(tmp_path / "mix.wav", always_2d=True)
    print(f"{name}: {near.sum()} of {len(phase)} impacts at the steps' edges, comb {comb_db(sound.T, sr):.1f} dB")
    assert len(phase) >= 20
    assert near.mean() <= 0.05
    assert np.histogram(phase, 4, (0, 1))[0].max() < 0.5 * len(phase)
    assert comb_db(sound.T, sr) < 3


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_the_step_rate_is_not_heard_in_a_scene(name: str) -> None:
    result = render_scene(REPO / "scenes" / f"{name}.py")
    assert comb_db(result.samples, result.sr) < 3
