"""Modes of another object's mesh are as many as by chance, and then nothing of a material is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.apps.report.plots.fit_plot import _synthesize_strike
from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.chance_pairs import _move_clusters, strong_lines
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.lab.lines.line_values import Lines
from sonic_bullet.records import Material
from tests.made.case import make, write_box

MOVED_MOST = 0.06
CLUSTER = 0.02

BRASS = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)
SIZE_M = (0.12, 0.025, 0.006)


def fitted(folder: Path, size_m: tuple[float, float, float]) -> CaseFit:
    """A fit of taps on a brass bar of SIZE_M, struck nobody says where, with the mesh of a box of another size."""
    made = make(folder, BRASS, SIZE_M, guess=(1.1e11, 8400.0, 0.34), strikes=2)
    case = json.loads((made.folder / "case.json").read_text())
    (thing,) = case["objects"].values()
    write_box(made.folder / "other.obj", size_m)
    thing["mesh"] = "other.obj"
    case["sensor"] = {"response": "gain * sound pressure"}
    case["recordings"] = [entry | {"strike": {}} for entry in case["recordings"]]
    (made.folder / "case.json").write_text(json.dumps(case))
    return fit_case(read_case(made.folder))


@pytest.mark.slow
@pytest.mark.parametrize("size_m", [(0.1, 0.08, 0.01)])
def test_a_mesh_of_another_object_is_said(tmp_path: Path, size_m: tuple[float, float, float]) -> None:
    found = fitted(tmp_path, size_m)
    assert "as many as by chance (another object's?)" in found.fit.verdict
    assert np.isnan(found.fit.covariance).all()
    made, words = _synthesize_strike(found, found.objects[0])
    assert words.startswith("lines as struck") and found.evidence[0].signals is not None
    assert np.linalg.norm(made) == pytest.approx(np.linalg.norm(found.evidence[0].signals[0]))


@pytest.mark.slow
def test_its_own_mesh_is_not_doubted(tmp_path: Path) -> None:
    found = fitted(tmp_path, SIZE_M)
    assert "chance" not in found.fit.verdict and np.isfinite(found.fit.covariance[2, 2])
    assert found.fit.gamma_m2_s2 == pytest.approx(1.0e11 / 8400, rel=0.01)


def test_lines_that_are_close_move_together() -> None:
    hz = np.array([4000.0, 1000.0, 1010.0, 2000.0])
    one, row = np.ones(4), np.ones((1, 4))
    lines = Lines(hz, one, row, one, one, row, np.ones(1), one, True)
    moved = _move_clusters(lines, np.random.default_rng(3)).freq_hz
    assert np.abs(np.log(moved / hz)).max() <= MOVED_MOST
    assert moved[2] / moved[1] == pytest.approx(1.01) and CLUSTER > 0.01
    assert moved[3] / moved[1] != pytest.approx(2.0, rel=1e-4)


def test_lines_that_cancel_are_no_strong_ones() -> None:
    """A lossy plank's attack is fitted by heaps of fast lines, each of thousands of times a mode's energy."""
    freq, decay = np.array([900.0, 2500.0, 16_370.0, 16_390.0]), np.array([20.0, 100.0, 2500.0, 2500.0])
    amplitude = np.array([[0.08, 0.14, 60.0, -60.0]], complex)
    none = np.zeros(4)
    lines = Lines(
        freq, decay, amplitude, none, none, none[None], np.ones(1), np.abs(amplitude[0]) ** 2 / (2 * decay), True
    )
    assert strong_lines(lines).tolist() == [True, True, False, False]
