"""Loss of metals by heat: Lifshitz and Roukes' beam, bounds of plates, no loss where nothing bends, and by command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet import modal
from sonic_bullet.effects.damping_law.thermoelastic import ThermoelasticLoss, relaxation, walls
from sonic_bullet.files import presets
from sonic_bullet.records import ModalModel, Shape
from sonic_bullet.records.mode_shapes import quantize_shapes
from sonic_bullet.session.body_models import analyse_body
from tests.apps.cli.test_commands import run
from tests.made.models import box_surface

ALUMINIUM = presets.load_material("aluminium")
(LOSS,) = ALUMINIUM.effects
PLATE = Path(__file__).parents[3] / "assets" / "plate.obj"


def exact_model(shape: Shape, count: int) -> ModalModel:
    return modal.analyse((shape,), ALUMINIUM, count=count, exact_shapes=True, cache=None)


def test_the_loss_is_the_presets_own() -> None:
    assert isinstance(LOSS, ThermoelasticLoss)
    assert LOSS.strength == pytest.approx(4.7e-3, rel=0.02), "Zener's of aluminium at 20 °C"
    h = 1e-3
    peak_hz = np.pi * LOSS.diffusivity_m2_s / (2 * h**2)  # ωτ = 1, τ = h²/π²χ
    assert LOSS.loss_of_beam(np.array(h), np.array(2 * np.pi * peak_hz)) == pytest.approx(LOSS.strength / 2, rel=0.02)


def test_the_relaxation_has_its_limits_and_its_peak() -> None:
    assert relaxation(np.array(0.03)) == pytest.approx(0.03**2 / 5)
    assert relaxation(np.array(500.0)) == pytest.approx(6 / 500**2 - 6 / 500**3)
    for joint in (0.1, 40.0):
        below, above = relaxation(np.array([joint * (1 - 1e-9), joint * (1 + 1e-9)]))
        assert below == pytest.approx(above, rel=1e-4)
    xi = np.linspace(1, 5, 4001)
    assert xi[np.argmax(relaxation(xi))] == pytest.approx(2.225, abs=2e-3)
    assert relaxation(xi).max() == pytest.approx(0.494, abs=1e-3)


def test_a_slender_bar_has_lifshitz_and_roukes_s_loss_in_both_planes() -> None:
    width, height = 2e-3, 1e-3
    model = exact_model(Shape("box", np.array([0.2, width, height])), 10)
    assert isinstance(LOSS, ThermoelasticLoss)
    omega = np.sqrt(model.omega0_squared_per_s2)
    found, energy = LOSS.loss_factors(model), (model.shape.astype(float) ** 2).sum(axis=0)
    bending = 0
    for axis, thickness in ((2, height), (1, width)):
        mine = np.flatnonzero(energy[axis] > 0.8 * energy.sum(axis=0))
        bending += len(mine)
        beam = LOSS.loss_of_beam(np.full(len(mine), thickness), omega[mine])
        np.testing.assert_allclose(found[mine], beam, rtol=0.01)
    assert bending >= 9


def test_a_plate_s_modes_lie_under_the_bound_and_twisting_loses_little() -> None:
    height = 1e-3
    model = exact_model(Shape("box", np.array([0.1, 0.1, height])), 12)
    assert isinstance(LOSS, ThermoelasticLoss)
    ratio = LOSS.loss_factors(model) / LOSS.loss_of_beam(np.full(12, height), np.sqrt(model.omega0_squared_per_s2))
    bound = 2 / (1 - LOSS.poisson)  # (κ₁ + κ₂)² over the bending energy is most where κ₁ = κ₂
    assert ratio.max() < bound
    assert ratio[2] > 0.75 * bound, "the third bends both ways alike: a ring is its node"
    assert ratio[0] < 0.15, "the first is a twist: what one side gains in one direction it loses in the other"


def test_stretching_loses_nothing_by_this_road() -> None:
    rod = modal.analyse(
        (Shape("box", np.array([0.2, 0.02, 0.02])),), ALUMINIUM, to_hz=14_000.0, exact_shapes=True, cache=None
    )
    assert isinstance(LOSS, ThermoelasticLoss)
    along = (rod.shape.astype(float) ** 2).sum(axis=0)
    (first,) = np.flatnonzero(along[0] > 0.8 * along.sum(axis=0))
    loss = LOSS.loss_factors(rod)
    assert loss[first] < 0.05 * np.median(loss)


def test_walls_are_as_thick_as_they_are() -> None:
    vertex, face = box_surface((0.3, 0.2, 0.01))
    height, across = walls(vertex, face)
    normal = np.cross(vertex[face[:, 1]] - vertex[face[:, 0]], vertex[face[:, 2]] - vertex[face[:, 0]])
    axis = np.abs(normal).argmax(axis=1)
    np.testing.assert_allclose(height, np.array([0.3, 0.2, 0.01])[axis], rtol=1e-3)
    assert (axis[across] == axis).all()


def test_rounded_shapes_are_no_basis_for_strains_and_bodies_do_not_use_them() -> None:
    shape = Shape("box", np.array([0.2, 2e-3, 1e-3]))
    exact = exact_model(shape, 4)
    made = analyse_body((shape,), ALUMINIUM, count=4, cache=None)
    assert isinstance(LOSS, ThermoelasticLoss)
    omega = np.sqrt(exact.omega0_squared_per_s2)
    added = made.decay_per_s - 0.5 * ((ALUMINIUM.alpha_per_s or 0) + (ALUMINIUM.beta_s or 0) * omega**2)
    np.testing.assert_allclose(added, 0.5 * omega * LOSS.loss_factors(exact), rtol=1e-3)
    assert np.array_equal(made.shape, quantize_shapes(made.shape))


def test_a_sheet_of_aluminium_rings_as_its_thickness_lets_it_by_the_command(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    content = json.loads((presets.TABLES_FOLDER / "aluminium.json").read_text())
    del content["thermal"]
    (tmp_path / "cold.json").write_text(json.dumps(content))
    decays = {}
    for name in ("aluminium", tmp_path / "cold.json"):
        assert run("modes", PLATE, "--material", name, "--count", "6", "--json") == 0
        decays[name] = np.array([m["decay_per_s"] for m in json.loads(capfd.readouterr().out)["modes"]])
    assert (decays["aluminium"] > 1.02 * decays[tmp_path / "cold.json"]).any()
    assert (decays["aluminium"] >= decays[tmp_path / "cold.json"]).all()


def test_total_damping_holds_the_heat_already_and_wood_has_none(tmp_path: Path) -> None:
    content = json.loads((presets.TABLES_FOLDER / "steel.json").read_text())
    content["damping"] |= {"includes_radiation": True}
    (tmp_path / "total.json").write_text(json.dumps(content))
    assert presets.load_material(tmp_path / "total.json").effects == ()
    assert len(presets.load_material("steel").effects) == 1
    assert presets.load_material("wood").effects == ()
