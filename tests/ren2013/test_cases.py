"""The command that holds the paper's procedure against this project's fit, on a case with a known answer."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from sonic_bullet.records import Material
from studies.ren2013 import cases
from studies.ren2013.published import MATERIALS
from tests.made.case import make

BRASS = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A brass bar whose truth is known, and a case without a mesh."""
    folder = tmp_path_factory.mktemp("data")
    (folder / "bar").mkdir()
    made = make(folder / "bar", BRASS, guess=(1.1e11, 8400.0, 0.36), strikes=3, seconds=0.4, band_hz=[20, 6000])
    truth = {
        "effects": [],
        "alpha": 8.0,
        "beta": 4e-8,
        "modes_hz": made.model.freq_hz.tolist(),
        "decay_per_s": made.model.decay_per_s.tolist(),
    }
    (folder / "bar" / "truth.json").write_text(json.dumps(truth))
    (folder / "shapeless").mkdir()
    case = json.loads((folder / "bar" / "case.json").read_text())
    del case["objects"]["box"]["mesh"]
    for entry in case["recordings"]:
        entry["file"] = f"../bar/{entry['file']}"
    (folder / "shapeless" / "case.json").write_text(json.dumps(case))
    return folder


@pytest.mark.slow
def test_the_papers_procedure_and_the_fit_find_a_planted_material(data: Path) -> None:
    x = cases.recorded(data / "bar")
    for procedure in cases.PROCEDURES.values():
        e = procedure(x)
        alpha, beta, freq, decay = cases.errors(x, e)
        assert e.gamma_m2_s2 == pytest.approx(1.0e11 / 8400, rel=0.01)
        assert max(abs(alpha), abs(beta), decay) < 0.1
        assert freq < 5e-3
        assert (e.starts > 0) == (e.procedure != cases.FIT)


def test_what_cannot_be_compared_is_counted(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cases.main(data, ["shapeless"]) == 1
    assert re.search(r"^0 estimates of 1 cases, 3 that could not be made$", capsys.readouterr().out, re.M)
    assert cases.main(data / "bar", []) == 2


def test_the_papers_tables_are_those_of_the_page() -> None:
    page = (Path(__file__).parents[2] / "docs" / "measured" / "ren2013.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.split("|")[1:2] and line.split("|")[1].strip() in MATERIALS]
    assert len(rows) == len(MATERIALS) == 5
    assert all(row in page for row in cases.tables().splitlines())
