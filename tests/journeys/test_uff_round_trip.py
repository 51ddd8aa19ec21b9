"""A hammer test in a UFF file becomes a case, is fitted, and what is fitted goes out as UFF again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from sonic_bullet import modal
from sonic_bullet.files import presets
from sonic_bullet.files.uff.reader import read_uff
from sonic_bullet.records import Array, Material
from tests.apps.cli.test_commands import run
from tests.few_cases import parametrize_few
from tests.made import responses as made
from tests.made.case import write_box

FREQ_HZ, DECAY = np.array([410.0, 1130.0, 2215.0]), np.array([6.0, 11.0, 24.0])
SHAPE = {1: (0.8, -0.5, 0.3), 2: (0.5, 0.6, -0.4), 3: (0.3, 0.7, 0.6)}
PLACES = {1: (0.0, 0.0, 0.0), 2: (0.1, 0.0, 0.0), 3: (0.2, 0.0, 0.0)}
SENSOR = 2
BRASS = Material.isotropic("made", youngs_pa=1.04e11, poisson=0.345, density_kg_m3=8500, alpha_per_s=12.0, beta_s=1e-7)
BAR_M = (0.3, 0.03, 0.008)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SONIC_BULLET_PROGRESS", "0")


def noisy(value: Array, seed: int, level: float = 1e-4) -> Array:
    rng = np.random.default_rng(seed)
    size = level * np.abs(value).max() / np.sqrt(2)
    return value + size * (rng.standard_normal(len(value)) + 1j * rng.standard_normal(len(value)))


def three_modes(*, roving: str = "hammer") -> list[dict[str, Any]]:
    """Datasets of a body of three modes at three points, as accelerance."""
    at = made.at_lines(8_001)
    ones = []
    for node, shape in SHAPE.items():
        mobility = made.mobility(FREQ_HZ, DECAY, np.multiply(shape, SHAPE[SENSOR]), at)
        value = made.as_quantity(noisy(mobility, node), at, "acceleration")
        ends = {"strike": (node, 3), "sensor": (SENSOR, 3)}
        if roving == "sensor":
            ends = {"strike": ends["sensor"], "sensor": ends["strike"]}
        ones.append(made.response(value, at, **ends))
    return [made.nodes(PLACES), *ones]


def told(name: str = "f.json") -> dict[str, Any]:
    return json.loads(Path(name).read_text())


@parametrize_few("roving", ["hammer", "sensor"], 1)
def test_modes_come_back_within_their_spreads(roving: str, capfd: pytest.CaptureFixture[str]) -> None:
    made.write_uff(Path("test.uff"), *three_modes(roving=roving))
    assert run("case", "new", "mine", "test.uff") == 0
    shown = capfd.readouterr().out
    assert "integrated to velocity" in shown and "now say" not in shown
    assert ("exciter and sensor change places" in shown) == (roving == "sensor")
    case = json.loads(Path("mine/case.json").read_text())
    assert case["sensor"] == {"response": "velocity", "position": [0.1, 0, 0], "direction": [0, 0, 1]}
    assert [r["strike"]["position"] for r in case["recordings"]] == [list(p) for p in PLACES.values()]
    assert run("case", "check", "mine") == 0
    assert run("fit", "mine", "-o", "p.json", "--json", "f.json", "--uff", "out.uff") == 0
    lines = [line for line in told()["lines"] if line["decay_sd_per_s"] is not None]
    assert len(lines) == 3
    for line, f, d in zip(lines, FREQ_HZ, DECAY, strict=True):
        assert abs(line["freq_hz"] - f) < 3 * line["freq_sd_hz"] < 1e-4 * f
        assert abs(line["decay_per_s"] - d) < 3 * line["decay_sd_per_s"] < 0.01 * d
    sets = [one for one in pyuff.UFF("out.uff").read_sets() if one["type"] == 55]
    for f, d, own in zip(FREQ_HZ, DECAY, np.array(list(SHAPE.values())).T, strict=True):
        mode = min(sets, key=lambda one, f=f: abs(one["freq"] - f))
        assert mode["freq"] == pytest.approx(f, rel=1e-5)
        assert mode["modal_damp_vis"] == pytest.approx(d / (2 * np.pi * f), rel=1e-3)
        assert np.array([mode["r1"], mode["r2"]]).max() == 0
        np.testing.assert_allclose(mode["r3"] / mode["r3"][0], own / own[0], rtol=5e-3)


def bar() -> Any:
    write_box(Path("bar.obj"), BAR_M)
    return modal.analyse((modal.read_mesh("bar.obj"),), BRASS, to_hz=9_000)


def test_a_bar_with_its_mesh_and_out_again(capfd: pytest.CaptureFixture[str]) -> None:
    """Responses per N have a level, 60 dB over their noise: with the true density σ is 1.

    What the fit writes is read as what it fitted.
    """
    model = bar()
    top = np.flatnonzero(model.vertex_m[:, 2] > BAR_M[2] / 2 - 1e-9)
    picked = np.random.default_rng(2).choice(top, 3, replace=False)
    normal = model.shape[picked, 2].astype(float)
    at = made.at_lines(8_001)
    ones = [
        made.response(
            noisy(made.mobility(model.freq_hz, model.decay_per_s, -row * normal[0], at), k, 1e-3),
            at,
            strike=(k + 1, -3),
            sensor=(1, 3),
            ordinate_spec_data_type=11,
        )
        for k, row in enumerate(normal)
    ]
    places = {k + 1: tuple(float(x) for x in model.vertex_m[v]) for k, v in enumerate(picked)}
    made.write_uff(Path("bar.uff"), made.nodes(places), *ones)
    Path("guess.json").write_text(_guess())
    new = ("case", "new", "mine", "bar.uff", "--mesh", "bar.obj", "--material", "guess.json", "--medium", "none")
    assert run(*new) == 0
    fit = ("fit", "mine", "-o", "p.json", "--json", "f.json", "--uff", "out.uff")
    assert run(*fit) == 0
    first = told()
    assert first["gamma_m2_s2"] == pytest.approx(BRASS.youngs_pa / BRASS.density_kg_m3, rel=1e-3)
    assert first["sigma"] == pytest.approx(1.0, rel=5e-3)
    assert first["alpha_per_s"] == pytest.approx(12.0, rel=2e-3) and first["beta_s"] == pytest.approx(1e-7, rel=2e-3)
    sets = pyuff.UFF("out.uff").read_sets()
    modes = [one for one in sets if one["type"] == 55]
    assert [mode["freq"] for mode in modes] == pytest.approx([m["freq_hz"] for m in first["modes"]], rel=1e-5)
    (nodes,) = (one for one in sets if one["type"] == 15)
    corner = np.argmax(np.array([nodes["x"], nodes["y"], nodes["z"]]).sum(axis=0))
    own = model.shape[np.argmax(model.vertex_m.sum(axis=1)), 2, 0]
    assert abs(modes[0]["r3"][int(corner)]) == pytest.approx(abs(own), rel=0.02)
    assert len(read_uff("out.uff").responses) == 3
    assert run("case", "new", "again", "out.uff", *new[4:]) == 0
    assert run(*(word.replace("mine", "again").replace("out", "out2") for word in fit)) == 0
    second = told()
    # without noise every mode is a line, with it those that stand out of it; modes above the band are a series' terms
    modes_hz = [mode["freq_hz"] for mode in first["modes"]]
    assert [line["freq_hz"] for line in second["lines"]] == pytest.approx(modes_hz, rel=1e-5)
    assert len(first["lines"]) < len(second["lines"])
    for name in ("gamma_m2_s2", "alpha_per_s", "beta_s", "sigma"):
        assert second[name] == pytest.approx(first[name], rel=2e-3), name
    capfd.readouterr()


def _guess() -> str:
    """Brass of the true density, its E 10 % off, as a preset file."""
    brass = json.loads((Path(presets.__file__).parent / "materials" / "brass.json").read_text())
    elasticity = brass["elasticity"] | {"youngs_pa": 1.15e11}
    return json.dumps(brass | {"name": "guess", "density_kg_m3": 8500, "elasticity": elasticity})


def test_modes_of_a_mesh_are_written(capfd: pytest.CaptureFixture[str]) -> None:
    bar()
    assert run("modes", "bar.obj", "--material", "brass", "--count", "4", "--uff", "m.uff", "--json", "m.json") == 0
    modes = [one for one in pyuff.UFF("m.uff").read_sets() if one["type"] == 55]
    assert [m["freq"] for m in modes] == pytest.approx([m["freq_hz"] for m in told("m.json")["modes"]], rel=1e-5)
    assert run("modes", "bar.obj", "--uff", "m.txt") == 2
    assert "UFF files end in .uff or .unv" in capfd.readouterr().err


def test_a_structure_to_200_hz_is_read(capfd: pytest.CaptureFixture[str]) -> None:
    """Five modes from 12 to 164 Hz of a floor, which nobody hears."""
    freq, loss, at = np.array([12.3, 34.0, 66.5, 110.0, 164.0]), 0.01, made.at_lines(801, 0.25)
    along = np.array([0.05, 0.275, 0.5, 0.725, 0.95])
    shape = np.cos(np.outer(along, np.arange(1, 6)) * 2.7)
    decay = 2 * np.pi * freq * loss
    ones = [
        made.response(
            noisy(made.as_quantity(made.mobility(freq, decay, row * shape[0], at), at, "acceleration"), k, 1e-3),
            at,
            strike=(k + 1, 3),
            sensor=(1, 3),
        )
        for k, row in enumerate(shape)
    ]
    places = {k + 1: (float(x), 0.0, 0.0) for k, x in enumerate(along)}
    made.write_uff(Path("floor.uff"), made.nodes(places), *ones)
    assert run("case", "new", "floor", "floor.uff", "--medium", "none") == 0
    assert run("case", "check", "floor") == 0
    assert run("fit", "floor", "-o", "p.json", "--json", "f.json") == 0
    capfd.readouterr()
    lines = told()["lines"]
    assert [line["freq_hz"] for line in lines] == pytest.approx(freq, rel=1e-3)
    assert [line["decay_per_s"] for line in lines] == pytest.approx(decay, rel=0.02)
    assert all(take["predicted_db"] < 1.2 * take["other_take_db"] for take in told()["takes"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("test.uff", "--split"), "beside --split"),
        (("test.uff", "--force-channel", "1"), "beside --force-channel"),
        (("test.uff", "a.wav"), "beside audio"),
        (("cut.uff",), "cut.uff is cut"),
        (("none.uff",), "cannot read none.uff"),
        (("text.unv",), "text.unv is no UFF file"),
        (("zeros.uff",), "zeros alone"),
    ],
)
def test_bad_input_is_one_line(words: tuple[str, ...], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    path = made.write_uff(Path("test.uff"), *three_modes())
    Path("cut.uff").write_bytes(path.read_bytes()[:40_000])
    Path("text.unv").write_text("no such thing\n")
    at = made.at_lines(1000)
    made.write_uff(Path("zeros.uff"), made.response(np.zeros(1000, complex), at))
    assert run("case", "new", "mine", *words) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and said in error
    assert not Path("mine").exists()


def test_others_than_one_sensors_are_left_out_and_said(capfd: pytest.CaptureFixture[str]) -> None:
    sets = three_modes()
    other = dict(sets[1]) | {"rsp_node": 3, "ref_node": 9}
    made.write_uff(Path("test.unv"), *sets, other)
    assert run("case", "new", "mine", "test.unv") == 0
    ended = capfd.readouterr()
    assert "1 of 4 responses are left out" in ended.err and "of node 9, whose place stays null" in ended.err
    assert len(json.loads(Path("mine/case.json").read_text())["recordings"]) == 3


def test_time_records_are_takes_of_unknown_impulse(capfd: pytest.CaptureFixture[str]) -> None:
    rate = 16_000
    t = np.arange(rate) / rate
    ring = np.where(t > 0.1, np.exp(-8 * (t - 0.1)) * np.sin(2 * np.pi * 500 * (t - 0.1)), 0.0)
    more = {"func_type": 1, "ordinate_spec_data_type": 11, "orddenom_spec_data_type": 0}
    made.write_uff(Path("t.uff"), made.nodes(PLACES), made.response(noisy(ring, 1).real, t, **more))
    assert run("case", "new", "mine", "t.uff") == 0
    assert "now say how hard each strike was" in capfd.readouterr().out
    case = json.loads(Path("mine/case.json").read_text())
    assert case["onset"] is None and case["recordings"][0]["strike"]["impulse"] is None
    assert run("fit", "mine", "-o", "p.json", "--json", "f.json") == 0
    (line,) = told()["lines"]
    assert line["freq_hz"] == pytest.approx(500, rel=1e-4) and line["decay_per_s"] == pytest.approx(8, rel=0.02)


def test_a_fit_of_no_known_place_has_no_shapes(capfd: pytest.CaptureFixture[str]) -> None:
    made.write_uff(Path("test.uff"), *three_modes()[1:])
    assert run("case", "new", "mine", "test.uff") == 0
    assert run("fit", "mine", "-o", "p.json", "--uff", "out.uff") == 2
    assert "has no modal shapes" in capfd.readouterr().err
    assert not Path("out.uff").exists() and not Path("p.json").exists()
