"""A fitted preset sounds as recorded: rendered, fitted, and rendered again. All objects and sensors:
studies/round_trip.py.
"""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.presets import total_damping
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.preset_export import preset_of as kept_preset
from sonic_bullet.lab.fit.fitted_preset import preset_of
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.records.errors import FileError
from studies import round_trip
from tests.few_cases import parametrize_few
from tests.made.case import write_box

LINES = [
    {"freq_hz": f, "decay_per_s": 2.0 + 1e-8 * (6.28 * f) ** 2, "decay_sd_per_s": 0.02}
    for f in (988.0, 2704.0, 5240.0, 8540.0, 12550.0)
]


@pytest.mark.slow
@parametrize_few("sensor", ["pressure", "velocity"], 1)
def test_the_bar_sounds_as_recorded(tmp_path: Path, sensor: str) -> None:
    """The bar of scenes/bar.py, at a microphone and at a vibrometer."""
    (bar,) = (t for t in round_trip.subjects(None, tmp_path) if t.name == "bar")
    count, decay, level_db, every, every_db = round_trip.around(bar, sensor, tmp_path)
    assert count >= 5
    assert decay < 0.03 and level_db < 0.5
    assert every < 0.03 and every_db < 0.5  # and all modes that are played, heard or not


@pytest.mark.slow
def test_what_was_fitted_on_one_plate_holds_on_one_twice_as_thick(tmp_path: Path) -> None:
    assert round_trip.thicker(tmp_path, "velocity", "glass", (0.12, 0.09, 0.004)) < 0.05


def fitted_lines(folder: Path, *, mesh: bool = True, **more: Any) -> Any:
    """The fit of a case of measured lines of a steel bar."""
    write_box(folder / "bar.obj", (0.18, 0.025, 0.006))
    thing = {"material": "steel"} | ({"mesh": "bar.obj"} if mesh else {})
    case = {
        "format": "sonic-bullet-case/1",
        "objects": {"bar": thing},
        "recordings": [{"features": LINES}],
        "band_hz": [20, 14000],
    } | more
    (folder / "case.json").write_text(json.dumps(case))
    return fit_case(read_case(folder))


@parametrize_few(
    ("more", "medium", "radiation"),
    [
        ({"sensor": {"type": "microphone"}}, "air", "apart"),
        ({"sensor": {"type": "vibrometer", "position": [0.08, 0, 0.003]}, "medium": "air"}, "air", "apart"),
        ({"sensor": {"type": "microphone"}, "medium": "none"}, "none", "nothing"),
        ({"sensor": {"type": "microphone"}, "medium": "water"}, "unknown", "damping"),
        ({"sensor": {"type": "plain sum of modes"}}, "unknown", "damping"),
        ({}, "unknown", "damping"),
        ({"sensor": {"type": "microphone"}, "mesh": False}, "air", "damping"),
    ],
    (0, 2, 6),
)
def test_damping_says_what_it_includes(tmp_path: Path, more: dict[str, Any], medium: str, radiation: str) -> None:
    """Taken off where mesh and medium are known; else the preset says that damping is total.

    A diagnosis plays total decays until it names radiation.
    """
    found = fitted_lines(tmp_path, **more)
    assert (found.case.medium, found.radiation) == (medium, radiation)
    preset = preset_of(found)
    assert preset.damping.includes_radiation is (radiation == "damping")
    assert total_damping(preset) is (radiation == "damping")


def test_a_diagnosis_counts_radiation_once(tmp_path: Path) -> None:
    def kept(found: Any, *effects: Any) -> bool:
        after = Hypothesis(found.fit.alpha_per_s, found.fit.beta_s, 1.0, effects)
        made = SimpleNamespace(found=found, closed=SimpleNamespace(after=after), verdict="explained")
        return total_damping(kept_preset(made))  # type: ignore[arg-type]

    own = fitted_lines(tmp_path, sensor={"type": "microphone"})
    total = fitted_lines(tmp_path, sensor={"type": "microphone"}, medium="unknown")
    assert total.fit.beta_s > 1.1 * own.fit.beta_s
    assert kept(own) is False  # the baseline holds what the air takes
    assert kept(total) is True
    assert kept(total, Radiation(0.02, 1.0)) is False  # α and β are then what it leaves
    assert kept(fitted_lines(tmp_path, sensor={"type": "microphone"}, medium="none")) is False


def test_an_unknown_medium_is_said(tmp_path: Path) -> None:
    found = fitted_lines(tmp_path, sensor={"type": "microphone"}, medium="water")
    assert [w for w in found.case.warnings if "medium 'water' is not known" in w]
    with pytest.raises(FileError, match="medium"):
        fitted_lines(tmp_path, medium=3)
