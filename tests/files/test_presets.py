"""Materials are typed files with sources; a wrong one is named by file and field."""

from __future__ import annotations

import json
import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sonic_bullet.effects.damping_law.damping_form import rayleigh_of_loss_factor
from sonic_bullet.files import presets
from sonic_bullet.records.errors import MaterialError

TABLE_I = {
    "wood": (2.1364, 3.0828e-6),
    "plastic": (52.627, 8.7753e-7),
    "metal": (6.3035, 2.1160e-8),
    "glass": (18.301, 1.4342e-7),
    "porcelain": (0.037388, 8.4142e-8),
}
# longitudinal sound speed of a thin rod, m/s: handbooks agree within these bounds whatever the grade
ROD_SPEED_M_S = {
    "wood": (3500, 5000),
    "metal": (5000, 5300),
    "steel": (5000, 5300),
    "aluminium": (4900, 5200),
    "brass": (3200, 3600),
    "glass": (5000, 5600),
}


@pytest.mark.parametrize("name", TABLE_I)
def test_the_seed_s_damping_carries_over(name: str) -> None:
    material = presets.load_material(name)
    assert (material.alpha_per_s, material.beta_s) == TABLE_I[name]


@pytest.mark.parametrize("name", ROD_SPEED_M_S)
def test_density_and_stiffness_give_the_rod_speed_of_the_handbooks(name: str) -> None:
    material = presets.load_material(name)
    low, high = ROD_SPEED_M_S[name]
    assert low < math.sqrt(material.youngs_pa / material.density_kg_m3) < high


def test_every_material_rings_and_says_where_its_numbers_come_from() -> None:
    materials = [presets.load_material(name) for name in presets.table_names()]
    assert {"wood", "plastic", "metal", "glass", "porcelain", "steel", "aluminium", "brass", "rubber", "concrete"} <= {
        m.name for m in materials
    }
    for material in materials:
        preset = presets.read_preset(presets.TABLES_FOLDER / f"{material.name}.json")
        assert preset.name == material.name
        groups = (preset.elasticity, preset.damping, preset.surface, preset.impact)
        assert all(any(c.isdigit() for c in group.source) for group in groups), material.name  # an edition or a year
        assert all(group.source in material.source for group in groups)
        assert material.alpha_per_s is not None
        assert 0 < material.poisson < 0.5


@pytest.mark.parametrize("name", presets.table_names())
def test_every_shipped_number_has_a_range_that_holds_it_and_a_spread(name: str) -> None:
    preset = presets.read_preset(presets.TABLES_FOLDER / f"{name}.json")
    density = {"density_kg_m3": preset.density_kg_m3}
    for group, more in ((preset.elasticity, density), (preset.damping, {}), (preset.surface, {}), (preset.impact, {})):
        numbers = {
            key: getattr(group, key) for key in group.__struct_fields__ if isinstance(getattr(group, key), float)
        } | more
        if (tensor := getattr(group, "stiffness_pa", None)) is not None:
            numbers["stiffness_pa"] = max(max(row) for row in tensor)
        assert set(group.range) == set(group.spread) == set(numbers), name
        assert len(group.range_source) > 10
        for key, value in numbers.items():
            low, high = group.range[key]
            assert 0 <= low < high, (name, key)
            assert low * 0.999 <= value <= high * 1.001, (name, key)
            assert 0 < group.spread[key] < 3, (name, key)


def test_range_and_spread_change_no_sound(tmp_path: Path) -> None:
    bare = json.loads((presets.TABLES_FOLDER / "wood.json").read_text())
    for group in ("elasticity", "damping", "surface", "impact"):
        for key in ("range", "range_source", "spread"):
            del bare[group][key]
    (tmp_path / "bare.json").write_text(json.dumps(bare))
    bare_wood, wood = presets.load_material(tmp_path / "bare.json"), presets.load_material("wood")
    assert (bare_wood.stiffness_pa == wood.stiffness_pa).all()
    same = ("density_kg_m3", "alpha_per_s", "beta_s", "roughness_m", "hurst", "restitution")
    assert all(getattr(bare_wood, key) == getattr(wood, key) for key in same)


def test_a_loss_factor_is_met_at_its_two_frequencies_and_undercut_between() -> None:
    alpha, beta = rayleigh_of_loss_factor(1e-3, 500, 8000)

    def loss(f: float) -> float:  # η = 2d/ω
        w = 2 * np.pi * f
        return float((alpha + beta * w**2) / w)

    assert loss(500) == pytest.approx(1e-3)
    assert loss(8000) == pytest.approx(1e-3)
    assert loss(2000) == pytest.approx(1e-3 * 2 * math.sqrt(500 * 8000) / 8500)
    assert loss(100) > 1e-3 < loss(20_000)
    steel = presets.load_material("steel")
    assert (steel.alpha_per_s, steel.beta_s) == pytest.approx(rayleigh_of_loss_factor(7.7e-5, 500, 8000))


def test_spruce_is_the_tensor_of_its_engineering_constants() -> None:
    compliance = np.linalg.inv(presets.load_material("spruce").stiffness_pa)
    e_l = 1.1 * 10.8e9
    np.testing.assert_allclose(
        1 / np.diag(compliance), e_l * np.array([1, 0.078, 0.043, 0.003, 0.061, 0.064]), rtol=1e-3
    )
    assert -compliance[1, 0] / compliance[0, 0] == pytest.approx(0.372, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "near"),
    [("wod", "wood"), ("porcelin", "porcelain"), ("GLAS", "glass"), ("xyzzy", "one of"), ("", "one of")],
)
def test_an_unknown_name_lists_the_near_ones(name: str, near: str) -> None:
    with pytest.raises(MaterialError, match=near) as caught:
        presets.load_material(name)
    assert "\n" not in str(caught.value)


def test_names_are_not_case_sensitive_and_never_paths() -> None:
    assert presets.load_material("Wood").name == "wood"
    with pytest.raises(MaterialError):
        presets.load_material("../materials/wood")


def edited(tmp_path: Path, **changes: object) -> Path:
    """The file of wood with dotted fields replaced; None removes."""
    content = json.loads((presets.TABLES_FOLDER / "wood.json").read_text())
    for dotted, value in changes.items():
        *path, last = dotted.split("__")
        part = content
        for key in path:
            part = part[key]
        part.pop(last, None)
        if value is not None:
            part[last] = value
    (tmp_path / "mine.json").write_text(json.dumps(content))
    return tmp_path / "mine.json"


def test_a_preset_file_comes_back(tmp_path: Path) -> None:
    preset = presets.read_preset(edited(tmp_path, name="mine", density_kg_m3=701.5))
    presets.write_preset(tmp_path / "again.json", preset)
    assert presets.read_preset(tmp_path / "again.json") == preset
    assert presets.load_material(str(tmp_path / "again.json")).density_kg_m3 == 701.5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"density_kg_m3": None}, "density_kg_m3"),
        ({"density_kg_m3": -1.0}, "density_kg_m3"),
        ({"density_kg_m3": float("nan")}, "mine.json"),
        ({"density_kg_m3": 1e999}, "mine.json"),
        ({"density_kg_m3": "heavy"}, "density_kg_m3"),
        ({"elasticity__poisson": 0.5}, "poisson"),
        ({"elasticity__poisson": None}, "neither isotropic nor a tensor"),
        ({"elasticity__stiffness_pa": [[1.0] * 6] * 6}, "neither isotropic nor a tensor"),
        (
            {"elasticity__youngs_pa": None, "elasticity__poisson": None, "elasticity__stiffness_pa": [[1.0] * 6] * 6},
            "positive definite",
        ),
        ({"elasticity__stiffness_pa": [[1.0] * 6] * 5}, "stiffness_pa"),
        ({"elasticity__source": ""}, "source"),
        ({"damping__beta_s": None}, "neither Rayleigh"),
        ({"damping__loss_factor": 0.1}, "neither Rayleigh"),
        ({"damping__alpha_per_s": -2}, "alpha_per_s"),
        ({"surface__hurst": 1.0}, "hurst"),
        ({"impact__restitution": 1.1}, "restitution"),
        ({"colour": "brown"}, "colour"),
        ({"format": "sonic-bullet-preset/9"}, "preset/9"),
        ({"effects": [{"id": "damping-law"}]}, "damping-law.*law"),
        ({"effects": [{"id": "damping-law", "law": "power", "etta": 0.1}]}, "'etta' is not known; did you mean eta"),
        ({"residual": {"a": 1}}, "residual"),
        ({"provenance": "fit"}, "provenance"),
    ],
)
def test_a_wrong_preset_file_is_named_with_its_field(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    path = edited(tmp_path, **changes)
    with pytest.raises(MaterialError, match=words) as caught:
        presets.load_material(str(path))
    assert "mine.json" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[" * 100_000, b"null", b" " * 2_000_000])
def test_what_is_no_preset_is_one_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "mine.json").write_bytes(content)
    with pytest.raises(MaterialError, match=r"mine\.json"):
        presets.load_material(tmp_path / "mine.json")


def test_missing_preset_files_and_folders(tmp_path: Path) -> None:
    for path in (tmp_path / "none.json", tmp_path, "a\0.json"):
        with pytest.raises(MaterialError, match="cannot read"):
            presets.load_material(path)


@pytest.mark.parametrize("name", presets.made_names())
def test_a_material_as_things_are_made_of_it_differs_by_its_loss_alone(name: str) -> None:
    made = presets.named_preset(name)
    alone = presets.named_preset(name.removeprefix("made-"))
    assert (made.name, made.density_kg_m3, made.elasticity) == (name, alone.density_kg_m3, alone.elasticity)
    assert (made.surface, made.impact, made.effects, made.residual) == (alone.surface, alone.impact, (), None)
    assert presets.load_material(name).includes_radiation
    numbers = {"loss_factor", "exponent", "floor_s"} & {
        key for key, value in msgspec.structs.asdict(made.damping).items() if value is not None
    }
    assert set(made.damping.range) == set(made.damping.spread) == numbers
    for key in numbers:
        low, high = made.damping.range[key]
        assert low <= msgspec.structs.asdict(made.damping)[key] <= high
        assert 0 < made.damping.spread[key] < 3
    assert "decays.csv" in made.damping.source and "bodies" in made.damping.source


def test_as_things_are_made_of_it_names_are_material_names() -> None:
    assert {"made-steel", "made-wood", "made-porcelain", "made-glass", "made-plastic"} <= set(presets.made_names())
    assert set(presets.made_names()) <= set(presets.material_names())
    with pytest.raises(MaterialError, match="made-steel"):
        presets.load_material("made-steal")
