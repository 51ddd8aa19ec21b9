"""Strikes that nobody placed: lines stand for modes where they were recorded; a measured list keeps its mesh."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from sonic_bullet.apps.cli import cli
from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.diagnosis.evidence.baseline import baseline
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation
from sonic_bullet.lab.fit.recorded import gather
from tests.lab.fit.test_held_out_takes import case_of
from tests.made.closed_forms import bar_bending_hz


def test_a_measured_list_without_places_keeps_its_mesh(tmp_path: Path) -> None:
    """Its frequencies alone tell of stiffness, so effects on stiffness can be asked for."""
    trimesh.creation.box((0.2, 0.02, 0.01)).export(tmp_path / "bar.obj")
    hz = bar_bending_hz(0.2, 0.02, 0.01, 2e11, 0.3, 7850.0, 4)
    objects = {"bar": {"mesh": "bar.obj", "units": "m", "material": "steel"}}
    entry = {"features": [{"freq_hz": float(f)} for f in hz], "object": "bar"}
    case = {"format": "sonic-bullet-case/1", "case": "list", "objects": objects, "recordings": [entry]}
    (tmp_path / "case.json").write_text(json.dumps(case | {"band_hz": [500, 9000]}))
    found = read_case(tmp_path)
    (body,) = baseline(found, gather(found, clipped=True)).bodies
    assert body.family is not None


@pytest.mark.slow
@pytest.mark.parametrize("gain", [0.03, 1.0, 40.0])
def test_a_take_without_an_impulse_has_one_floor_and_distance_at_any_gain(tmp_path: Path, gain: float) -> None:
    case = read_case(case_of(tmp_path, 0))
    take = baseline(case, gather(case, clipped=True)).takes[0]
    assert isinstance(take, AudioObservation) and np.isnan(take.body.impulse_n_s[take.strike])

    class Played:
        """What is predicted, at a gain."""

        def __init__(self, by: float) -> None:
            self.by = by

        def sound(self, _: int, n: int, __: int) -> np.ndarray:
            return self.by * np.roll(take.sample[:n], 3)

    one, other = (Played(by) for by in (1.0, gain))
    assert take.distance(other) == pytest.approx(take.distance(one), abs=0.02)  # type: ignore[arg-type]
    assert take.least(other) == pytest.approx(take.least(one), abs=0.02)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_diagnosis_without_a_mesh_keeps_the_lines_that_play(tmp_path: Path) -> None:
    folder, out = case_of(tmp_path, 1), tmp_path / "d_preset.json"
    done = CliRunner().invoke(cli, ["diagnose", str(folder), "-o", str(out)])
    assert done.exit_code == 0, done.output
    preset = json.loads(out.read_text())
    assert preset["effects"][-1]["id"] == "recorded-lines"
    assert preset["provenance"]["verdict"] in done.output
