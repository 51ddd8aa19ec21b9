"""What nobody knows of a case is not printed; what would tell it is said; what was guessed before is held beside."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sonic_bullet.apps.cli.fit_command import FitReport
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.presets import load_material
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.fitted_preset import preset_of
from sonic_bullet.lab.fit.material_fit import fit_case
from sonic_bullet.lab.fit.takes.next_measurement import next_measurement
from sonic_bullet.lab.fit.takes.plausible_preset import with_shipped_damping
from sonic_bullet.records import Array, Material
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few
from tests.lab.fit.test_held_out_takes import DECAY, HZ, case_of
from tests.made.case import make


@pytest.fixture(scope="module")
def taps(tmp_path_factory: pytest.TempPathFactory) -> CaseFit:
    return fit_case(read_case(case_of(tmp_path_factory.mktemp("taps"), 1)))


@pytest.fixture(scope="module")
def bar(tmp_path_factory: pytest.TempPathFactory) -> CaseFit:
    brass = Material.isotropic("made", youngs_pa=1.0e11, poisson=0.36, density_kg_m3=8400, alpha_per_s=8.0, beta_s=4e-8)
    made = make(tmp_path_factory.mktemp("bar"), brass, (0.12, 0.025, 0.006), guess=(1.1e11, 8400.0, 0.34), strikes=3)
    return fit_case(read_case(made.folder))


@pytest.mark.slow
@parametrize_few("material", [None, "steel", "glass"], 2)
def test_no_constant_is_printed_that_nobody_gave(
    material: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, told = case_of(tmp_path, 0), tmp_path / "fit.json"
    if material is not None:
        case = json.loads((folder / "case.json").read_text())
        case["objects"] = {"thing": {"material": material}}
        case["recordings"] = [entry | {"object": "thing"} for entry in case["recordings"]]
        (folder / "case.json").write_text(json.dumps(case))
    capsys.readouterr()
    assert run("fit", str(folder), "-o", str(tmp_path / "p.json"), "--json", str(told)) == 0
    out, found = capsys.readouterr().out, json.loads(told.read_text())
    parameters = json.loads((tmp_path / "p.json").read_text())["provenance"]["parameters"]
    for said in ("E in Pa", "density", "Poisson"):
        assert (said in out) == (material is not None)
    for name in ("gamma_m2_s2", "poisson_ratio"):
        assert (found[name] is None) == (material is None) == (name not in parameters)


def changed(found: CaseFit, **lines: Any) -> CaseFit:
    (e,) = found.evidence
    return replace(found, evidence=(replace(e, lines=replace(e.lines, **lines)),))


@pytest.mark.parametrize("open_ones", [(), (0,), (1,), (0, 1)])
def test_damping_is_the_guess_s_only_where_the_decays_tell_neither_number(
    bar: CaseFit, open_ones: tuple[int, ...]
) -> None:
    """With one of the two told the pair still meets the decays that were heard."""
    covariance = bar.fit.covariance.copy()
    for one in open_ones:
        covariance[one, :] = covariance[:, one] = np.nan
    found = replace(bar, fit=replace(bar.fit, covariance=covariance))
    preset = preset_of(found)
    fitted = (bar.fit.alpha_per_s, bar.fit.beta_s)
    assert ((preset.damping.alpha_per_s, preset.damping.beta_s) == fitted) == (len(open_ones) < 2)
    for i, row in enumerate(("alpha in 1/s", "beta in s")):
        (line,) = (x for text in FitReport(found, preset).lines() for x in text.splitlines() if x.startswith(row))
        assert ("not identifiable" in line) == (i in open_ones)
        assert ("the guess's" in line) == (len(open_ones) == 2)
        assert ("fitted with " in line) == (open_ones == (i,))


@pytest.mark.slow
def test_of_one_take_another_is_asked_for(taps: CaseFit) -> None:
    (e,) = taps.evidence
    assert e.signals is not None
    lines = replace(e.lines, amplitude=e.lines.amplitude[:1])
    one = replace(e, recordings=e.recordings[:1], signals=e.signals[:1], lines=lines)
    assert next_measurement(replace(taps, evidence=(one,))).startswith("strike the same place again")


def test_without_a_shape_it_is_asked_for(taps: CaseFit) -> None:
    assert next_measurement(taps).startswith("measure the shape")


@pytest.mark.parametrize("apart_hz", [0.5, 2.0])
def test_lines_within_their_widths_ask_for_another_point(taps: CaseFit, apart_hz: float) -> None:
    hz = np.array([HZ[0], HZ[0] + apart_hz, *HZ[2:]])
    (e,) = taps.evidence
    assert e.signals is not None
    n = np.arange(e.signals.shape[1]) / e.sr
    waves = np.exp((-DECAY + 2j * np.pi * hz)[:, None] * n)
    amplitude = np.tile(np.array([0.3, 0.2, 0.1, 0.1], complex), (3, 1))
    alike = replace(e, signals=(amplitude @ waves).real)
    found = replace(taps, evidence=(alike,))
    lines = {"freq_hz": hz, "decay_per_s": DECAY, "amplitude": amplitude, "energy": np.full(4, 1e6)}
    (e,) = changed(found, **lines).evidence
    # a nodal line is a shape's: it is asked for where there is none, or where one of the two is no mode of it
    assert next_measurement(replace(found, evidence=(e,))).startswith("measure the shape")
    for paired in ([0, 1, -1], [0, -1, -1]):
        o: Any = SimpleNamespace(evidence=e, line=np.array(paired))
        said = next_measurement(replace(found, evidence=(e,), objects=(o,)))
        assert (f"nodal line of one of the modes at {hz[0]:.1f} and {hz[1]:.1f} Hz" in said) == (1 in paired)


def test_an_attack_asks_for_the_force(taps: CaseFit) -> None:
    (e,) = taps.evidence
    assert e.signals is not None
    burst: Array = np.zeros(e.signals.shape)
    burst[:, :100] = 3 * np.abs(e.signals).max()
    assert "record the hammer's force" in next_measurement(replace(taps, evidence=(replace(e, signals=burst),)))


@pytest.mark.slow
def test_the_guess_on_the_shape_is_held_beside_the_fit(bar: CaseFit, taps: CaseFit) -> None:
    for take in bar.takes:
        assert take.predicted_db < take.plausible_db <= take.silence_db
    assert all(np.isnan(take.plausible_db) for take in taps.takes)


@parametrize_few("name", ["steel", "glass", "wood"], 1)
def test_a_guess_without_damping_takes_that_of_the_nearest_preset(name: str) -> None:
    own = load_material(name)
    bare = Material.isotropic("x", youngs_pa=7e10, poisson=0.2, density_kg_m3=2500)
    assert with_shipped_damping(own) is own
    assert with_shipped_damping(bare).name == "glass"
