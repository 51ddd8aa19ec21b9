"""A material's law of loss: as a preset states it, as modes have it, and as takes vary it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonic_bullet.effects.damping_law import DampingLaw, own_decay_per_s
from sonic_bullet.files import presets
from sonic_bullet.records import Body, Shape
from sonic_bullet.session.body_models import analyse_body
from sonic_bullet.session.variation import vary_body
from tests.apps.cli.test_commands import error_of, run

RAYLEIGH_HZ = (500.0, 8000.0)

BAR = Shape("box", np.array([0.2, 0.05, 0.02]))
OMEGA = 2 * np.pi * np.geomspace(50, 20_000, 40)


def preset_file(tmp_path: Path, **damping: Any) -> Path:
    """Steel with another damping."""
    content = json.loads((presets.TABLES_FOLDER / "steel.json").read_text())
    del content["thermal"]
    content |= {"name": "mine", "damping": {"source": "made up in 2026", **damping}}
    (tmp_path / "mine.json").write_text(json.dumps(content))
    return tmp_path / "mine.json"


@pytest.mark.parametrize(("law", "power"), [("constant-loss", 1.0), ("power", 1.6)])
def test_a_floor_is_added_to_t60(law: str, power: float) -> None:
    bare, floored = DampingLaw(law, 2e-3, power), DampingLaw(law, 2e-3, power, floor_s=0.1)
    t60 = np.log(1000) / bare.decay_per_s(OMEGA)
    np.testing.assert_allclose(np.log(1000) / floored.decay_per_s(OMEGA), t60 + 0.1, rtol=1e-12)
    assert floored.freedom() == bare.freedom() + 1
    assert floored.parameters() == bare.parameters() | {"floor_s": 0.1}


def test_a_loss_factor_alone_holds_at_every_mode_by_the_command(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    preset, mesh = preset_file(tmp_path, loss_factor=4e-3), Path(__file__).parents[3] / "assets" / "plate.obj"
    assert run("modes", mesh, "--material", preset, "--count", "8", "--json") == 0
    modes = json.loads(capfd.readouterr().out)["modes"]
    assert len(modes) == 8
    for mode in modes:
        omega = np.hypot(2 * np.pi * mode["freq_hz"], mode["decay_per_s"])
        assert mode["decay_per_s"] == pytest.approx(2e-3 * omega, rel=1e-6)


def test_rayleigh_s_pair_meets_a_law_at_two_frequencies(tmp_path: Path) -> None:
    material = presets.load_material(preset_file(tmp_path, loss_factor=2e-3, exponent=1.5, floor_s=0.08))
    square = (2 * np.pi * np.array(RAYLEIGH_HZ)) ** 2
    pair = replace(material, effects=())
    np.testing.assert_allclose(own_decay_per_s(pair, square), own_decay_per_s(material, square), rtol=1e-9)
    assert own_decay_per_s(pair, 4 * square)[1] > 2 * own_decay_per_s(material, 4 * square)[1]


@pytest.mark.parametrize(
    "damping",
    [
        {},
        {"exponent": 1.2},
        {"floor_s": 0.1, "alpha_per_s": 1.0, "beta_s": 1e-8},
        {"loss_factor": 1e-3, "alpha_per_s": 1.0},
        {"loss_factor": 1e-3, "equal_at_hz": [500, 8000], "floor_s": 0.1},
    ],
)
def test_a_damping_that_contradicts_itself_is_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], damping: dict[str, Any]
) -> None:
    mesh = Path(__file__).parents[3] / "assets" / "plate.obj"
    said = error_of(capfd, "modes", mesh, "--material", preset_file(tmp_path, **damping))
    assert "damping is neither Rayleigh's pair nor a loss factor" in said


def test_a_take_varies_a_law_s_numbers_and_its_modes_with_them(tmp_path: Path) -> None:
    material = presets.load_material(preset_file(tmp_path, loss_factor=2e-3, exponent=1.4, floor_s=0.05))
    model = analyse_body((BAR,), material, count=12, cache=None)
    body = Body(0, -1, 0, "bar", model.mass_kg, np.eye(3), material=material, model=model)
    factors = {"loss_factor": 1.5, "exponent": 0.9, "floor_s": 2.0, "youngs_pa": 1.2}
    made = vary_body(body, factors)
    assert made.model is not None
    assert made.material is not None
    assert made.material.effects == (DampingLaw("power", 3e-3, 1.26, floor_s=0.1),)
    again = analyse_body((BAR,), made.material, count=12, cache=None)
    np.testing.assert_allclose(made.model.freq_hz, again.freq_hz, rtol=1e-6)
    np.testing.assert_allclose(made.model.decay_per_s, again.decay_per_s, rtol=1e-4)
