"""`fit` and `diagnose` of one case tell one story: what the one plays the other begins from."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.diagnosis.diagnose import diagnose
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.records import Array, Material
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few
from tests.lab.fit.test_held_out_takes import SR, case_of
from tests.made.case import make

AGREE_DB = 0.1
Beside = Callable[[int, int], Array]


def silence(_: int, n: int) -> Array:
    return np.zeros(n)


def hum(_: int, n: int) -> Array:
    return np.asarray(0.01 * np.sin(2 * np.pi * 50 * np.arange(n) / SR))


def attack(i: int, n: int) -> Array:
    """A burst of noise that is over in some milliseconds."""
    burst = np.random.default_rng(i).standard_normal(n) * np.exp(-np.arange(n) / (0.004 * SR))
    return np.asarray(0.05 * np.roll(burst, SR // 20) * (np.arange(n) >= SR // 20))


def with_sound(folder: Path, beside: Beside) -> Path:
    """A case of taps with something more in its takes."""
    case_of(folder, 1, seconds=0.4)
    for i, path in enumerate(sorted(folder.glob("take*.wav"))):
        sound, sr = soundfile.read(path)
        soundfile.write(path, sound + beside(i, len(sound)), sr, subtype="FLOAT")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("beside", [silence, attack])
def test_a_diagnosis_begins_from_the_distance_that_fit_prints(beside: Beside, tmp_path: Path) -> None:
    """And names nothing of what an attack leaves, which is no line."""
    folder = str(with_sound(tmp_path, beside))
    assert run("fit", folder, "-o", str(tmp_path / "p.json"), "--json", str(tmp_path / "fit.json")) == 0
    assert run("diagnose", folder, "--json", str(tmp_path / "diagnose.json")) == 0
    fit, found = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("fit", "diagnose"))
    predicted = np.mean([take["predicted_db"] for take in fit["takes"]])
    assert abs(found["errors"]["before"]["holdout"] - predicted) < AGREE_DB
    assert not found["effects"]


@parametrize_few("beside", [silence, hum], 1)
def test_a_diagnosis_begins_from_the_distance_of_the_fit(beside: Beside, tmp_path: Path) -> None:
    """Hum is taken off by both."""
    check_agree(with_sound(tmp_path, beside))


def check_agree(folder: Path) -> None:
    case = read_case(folder)
    fit, found = fit_case(case), diagnose(case, effects=())
    predicted = np.mean([take.predicted_db for take in fit.takes])
    assert fit.takes[0].split == "holdout"
    assert abs(found.errors["before"]["holdout"] - predicted) < AGREE_DB
    assert fit.worse_than_silence == (found.verdict == "worse-than-silence")


@pytest.mark.slow
def test_on_a_mesh_struck_by_unknown_impulses_too(tmp_path: Path) -> None:
    shorter: dict[str, Any] = {"seconds": 0.4, "band_hz": [20, 6000]}
    brass = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)
    folder = make(tmp_path, brass, (0.12, 0.025, 0.006), guess=(1.1e11, 8400.0, 0.34), strikes=3, **shorter).folder
    case = json.loads((folder / "case.json").read_text())
    for entry in case["recordings"]:
        del entry["strike"]["impulse"]
    (folder / "case.json").write_text(json.dumps(case))
    check_agree(folder)


@pytest.mark.slow
@pytest.mark.shared
def test_on_a_case_of_another_laboratory_too(shared_path: Path, tmp_path: Path) -> None:
    check_agree(shutil.copytree(shared_path / "practice" / "practice-03", tmp_path / "case"))


@parametrize_few("factor", [3e3, 1e4, 1e-4], (1,))
def test_both_say_worse_than_silence(factor: float, tmp_path: Path) -> None:
    """The impulses of the takes held out are stated so many times too large; or those of the others."""
    folder = case_of(tmp_path, 1, seconds=0.3)
    case = json.loads((folder / "case.json").read_text())
    for entry in case["recordings"]:
        over = factor if entry["split"] == "holdout" else 1 / factor
        entry["strike"] = {"impulse": 0.01 * max(over, 1.0)}
    (folder / "case.json").write_text(json.dumps(case))
    for command in ("fit", "diagnose"):
        out = folder / f"{command}.out.json"
        assert run(command, str(folder), "-o", str(out)) == (1 if factor > 1 else 0)
        verdict = json.loads(out.read_text())["provenance"]["verdict"]
        assert verdict.startswith("worse-than-silence") == (factor > 1)
