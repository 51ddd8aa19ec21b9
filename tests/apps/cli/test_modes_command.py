"""`modes` and `materials` at the command line; the analysis itself is replaced by a stub."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet import modal
from sonic_bullet.files import read_model
from sonic_bullet.records import ModalModel
from tests.apps.cli.test_commands import error_of, model, restored, run  # noqa: F401


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    kept: dict[str, Any] = {}

    def analyse(shapes: Any, material: Any, **options: Any) -> ModalModel:
        kept.update(options, shapes=shapes, material=material)
        return model()

    monkeypatch.setattr(modal, "analyse", analyse)
    return kept


@pytest.fixture
def mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    return tmp_path / "t.obj"


def test_modes_writes_json_and_model(mesh: Path, solved: dict[str, Any], capfd: pytest.CaptureFixture[str]) -> None:
    assert (
        run(
            "modes",
            "t.obj",
            "--material",
            "glass",
            "--count",
            2,
            "--fix",
            "0,0,0,0.1",
            "--thickness",
            0.01,
            "--scale",
            0.1,
            "-o",
            "m.npz",
            "--json",
        )
        == 0
    )
    found = json.loads(capfd.readouterr().out)
    assert found["modes"] == [{"freq_hz": 100.0, "decay_per_s": 1.0}, {"freq_hz": 200.0, "decay_per_s": None}]
    assert (
        found["mesh"],
        found["material"],
        found["volume_m3"],
        found["mass_kg"],
        found["dropped"],
        found["note"],
    ) == ("t.obj", "glass", 1e-3, 0.5, 4, "stub")
    assert (solved["count"], solved["fixed"], solved["thickness_m"], solved["material"].name) == (
        2,
        ((0, 0, 0, 0.1),),
        0.01,
        "glass",
    )
    assert solved["shapes"][0].vertex_m.max() == 0.1
    assert read_model("m.npz").mode_count == 2


def test_modes_for_people(mesh: Path, solved: dict[str, Any], capfd: pytest.CaptureFixture[str]) -> None:
    assert run("modes", "t.obj") == 0
    said = capfd.readouterr()
    assert said.err == ""
    assert "steel" in said.out
    assert "4 overdamped" in said.out
    assert said.out.splitlines()[-1].split() == ["2", "200.00", "-"]


def test_constants_make_an_undamped_material_and_override_a_named_one(mesh: Path, solved: dict[str, Any]) -> None:
    assert run("modes", "t.obj", "--young", 7e10, "--poisson", 0.3, "--density", 2700) == 0
    bare = solved["material"]
    assert (bare.alpha_per_s, bare.density_kg_m3) == (None, 2700)
    assert (bare.youngs_pa, bare.poisson) == pytest.approx((7e10, 0.3))
    assert run("modes", "t.obj", "--material", "wood", "--young", 9e9) == 0
    assert (solved["material"].youngs_pa, solved["material"].poisson, solved["material"].alpha_per_s) == pytest.approx(
        (9e9, 0.35, 2.1364)
    )
    assert run("modes", "t.obj", "--material", "spruce", "--density", 500) == 0
    assert solved["material"].density_kg_m3 == 500
    assert solved["material"].stiffness_pa[0, 0] > 5 * solved["material"].stiffness_pa[1, 1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.obj"], "none.obj"),
        (["t.obj", "--young", "1e9"], "--poisson and --density missing"),
        (["t.obj", "--material", "wood", "--poisson", "0.5"], "poisson"),
        (["t.obj", "--material", "wood", "--young", "nan"], "youngs_pa"),
        (["t.obj", "--material", "wood", "--density", "-1"], "density"),
        (["t.obj", "--material", "wodo"], "did you mean"),
        (["t.obj", "--count", "0"], "--count"),
        (["t.obj", "--to-hz", "-5"], "--to-hz"),
        (["t.obj", "--count", "3", "--to-hz", "500"], "both"),
        (["t.obj", "--fix", "1,2,3"], "X,Y,Z,R"),
        (["t.obj", "--scale", "0"], "scale"),
        (["t.obj", "-o", "m.txt"], ".npz"),
        (["t.obj", "-o", "none/m.npz"], "mkdir"),
        (["t.obj", "--json", "none/m.json"], "mkdir"),
        (["bad.obj"], "bad.obj"),
    ],
)
def test_modes_says_what_is_wrong(
    mesh: Path, solved: dict[str, Any], capfd: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    Path("bad.obj").write_text("no mesh at all")
    before = sorted(mesh.parent.iterdir())
    assert said in error_of(capfd, "modes", *words)
    assert sorted(mesh.parent.iterdir()) == before


def test_materials_in_both_forms(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("materials") == 0
    table = capfd.readouterr().out
    assert run("materials", "--json") == 0
    found = json.loads(capfd.readouterr().out)["materials"]
    assert [m["name"] for m in found] == [line.split()[0] for line in table.split("\n\n")[0].splitlines()[1:]]
    assert all(m["source"] and m["density_kg_m3"] > 0 for m in found)
