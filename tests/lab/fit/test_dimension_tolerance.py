"""The error of a mesh's dimensions in the spread of E/ρ: by the closed form, from the case, from the command line."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from sonic_bullet.apps.cli import main
from sonic_bullet.files.cases import DIMENSION_TOLERANCE, Case, read_case
from sonic_bullet.lab.fit.dimension_tolerance import lines_sd
from sonic_bullet.lab.fit.fitted_preset import preset_of
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.records.errors import FileError
from tests.lab.fit.test_fit_cases import described


def with_tolerance(case: Case, **tolerances: float) -> Case:
    things = {
        name: replace(thing, dimension_tolerance=tolerances.get(name, thing.dimension_tolerance))
        for name, thing in case.objects.items()
    }
    return replace(case, objects=things)


def changed(folder: Path, change: dict[str, Any], of_bar: dict[str, Any]) -> Case:
    content = json.loads((folder / "case.json").read_text())
    content["objects"]["bar"].update(of_bar)
    (folder / "case.json").write_text(json.dumps(content | change))
    return read_case(folder)


@pytest.mark.parametrize("tolerance", [0.001, 0.005, 0.05])
def test_spread_is_that_of_lines_and_of_dimensions(tmp_path: Path, tolerance: float) -> None:
    case = described(tmp_path, ("bar",), units="m")
    exact = fit_case(with_tolerance(case, bar=0.0))
    found = fit_case(with_tolerance(case, bar=tolerance))
    lines = np.sqrt(exact.fit.covariance[2, 2])
    assert exact.dimension_tolerance == 0 and 0 < lines < 1e-3
    assert np.sqrt(found.fit.covariance[2, 2]) == pytest.approx(np.hypot(lines, 2 * tolerance), rel=1e-12)
    assert lines_sd(found.fit.covariance, tolerance) == pytest.approx(lines, rel=1e-4)
    known = found.fit.covariance.copy()
    known[[2, 4], [2, 4]] = exact.fit.covariance[[2, 4], [2, 4]]
    np.testing.assert_array_equal(known, exact.fit.covariance)
    assert found.fit.gamma_m2_s2 == exact.fit.gamma_m2_s2
    written = preset_of(found).provenance
    assert written is not None and written.spreads["gamma_m2_s2"] == pytest.approx(
        found.fit.gamma_m2_s2 * np.hypot(lines, 2 * tolerance)
    )
    assert any("dimensions" in line for line in written.assumed)


def test_a_wrong_scale_moves_gamma_by_twice_itself(tmp_path: Path) -> None:
    """The derivation, by the estimator itself: a mesh 1 % too large reads γ 2 % too high."""
    case = described(tmp_path, ("bar",), units="m")
    large = replace(case, objects={"bar": replace(case.objects["bar"], scale=1.01)})
    ratio = fit_case(large).fit.gamma_m2_s2 / fit_case(case).fit.gamma_m2_s2
    assert np.log(ratio) == pytest.approx(2 * np.log(1.01), rel=1e-3)


def test_a_wrong_dimension_moves_poissons_ratio_as_told(tmp_path: Path) -> None:
    """By the estimator itself: each dimension of the mesh wrong by t in turn, the moves of ν in quadrature."""
    case = described(tmp_path, ("bar",), units="m")
    t = 0.002
    exact, told = (fit_case(with_tolerance(case, bar=by)) for by in (0.0, t))
    mesh = case.objects["bar"].mesh
    assert mesh is not None
    moved = []
    for axis in range(3):
        wrong = trimesh.load(mesh)
        wrong.vertices[:, axis] *= 1 + t
        wrong.export(tmp_path / f"wrong{axis}.obj", digits=12)
        thing = replace(case.objects["bar"], mesh=tmp_path / f"wrong{axis}.obj")
        moved.append(fit_case(replace(case, objects={"bar": thing})).fit.poisson_ratio - exact.fit.poisson_ratio)
    assert told.poisson_sd_of_dimensions == pytest.approx(np.linalg.norm(moved), rel=0.1)
    added = told.fit.covariance[4, 4] - exact.fit.covariance[4, 4]
    assert np.sqrt(added) == pytest.approx(told.poisson_sd_of_dimensions, rel=1e-6)


def test_default_case_and_object(tmp_path: Path) -> None:
    case = described(tmp_path, ("bar", "plate"), units="m")
    assert {thing.dimension_tolerance for thing in case.objects.values()} == {DIMENSION_TOLERANCE}
    case = changed(tmp_path, {"dimension_tolerance": 0.001}, {"dimension_tolerance": 0.02})
    assert not case.warnings
    assert [case.objects[name].dimension_tolerance for name in ("bar", "plate")] == [0.02, 0.001]
    found = fit_case(case)
    assert found.dimension_tolerance == 0.02  # errors of one tool do not average out
    assert np.sqrt(found.fit.covariance[2, 2]) == pytest.approx(0.04, rel=1e-2)


@pytest.mark.parametrize("wrong", [-0.001, 0.21, 1e300])
def test_out_of_range_in_a_case(tmp_path: Path, wrong: float) -> None:
    described(tmp_path, ("bar",), units="m")
    with pytest.raises(FileError, match=r"dimension_tolerance is .* %"):
        changed(tmp_path, {"dimension_tolerance": wrong}, {})
    with pytest.raises(FileError, match=r"object 'bar': dimension_tolerance is .* %"):
        changed(tmp_path, {"dimension_tolerance": None}, {"dimension_tolerance": wrong})


def run(*words: object) -> int:
    sys.argv = ["sonic-bullet", *map(str, words)]
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    described(tmp_path, ("bar",), units="m")
    sd = {}
    for percent in ("0", "2"):
        words = ("fit", tmp_path, "-o", tmp_path / "p.json", "--json", tmp_path / "f.json")
        assert run(*words, "--dimension-tolerance", percent) == 0
        told = json.loads((tmp_path / "f.json").read_text())
        assert told["dimension_tolerance"] == float(percent) / 100
        sd[percent] = np.sqrt(told["covariance"][2][2])
        assert ("dimensions 0.04 of it" in capfd.readouterr().out) == (percent == "2")
    assert sd["2"] == pytest.approx(np.hypot(sd["0"], 0.04), rel=1e-12)


@pytest.mark.parametrize("percent", ["-1", "20.5", "nan"])
def test_command_refuses(tmp_path: Path, capfd: pytest.CaptureFixture[str], percent: str) -> None:
    described(tmp_path, ("bar",), units="m")
    assert run("fit", tmp_path, "-o", tmp_path / "p.json", "--dimension-tolerance", percent) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and f"--dimension-tolerance is {percent} %" in error
    assert not (tmp_path / "p.json").exists()
