"""Meshes that came from elsewhere: the practice cases' independent solver, and a sample of pybullet_data's thousand."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.modal import analyse, read_mesh
from sonic_bullet.records import Material
from sonic_bullet.records.errors import MeshError, ModalError

# Poisson's ratio that the recorded object has, as far as its frequency ratios tell; the case's guess is off by up to
# 0.04.
RECORDED = {"practice-01": 0.30, "practice-03": 0.22, "practice-04": 0.325}


@pytest.mark.shared
@pytest.mark.parametrize("case", sorted(RECORDED))
def test_ratios_of_the_independent_solver(case: str, shared_path: Path) -> None:
    place = shared_path / "practice" / case
    body = next(iter(json.loads((place / "case.json").read_text())["objects"].values()))
    truth = np.array(json.loads((place / "truth.json").read_text())["modes_hz"])[:15]
    guess = body["elastic_guess"]
    assert abs(RECORDED[case] - guess["poisson_ratio"]) <= 0.04
    material = Material.isotropic(
        "guess", youngs_pa=guess["youngs_modulus"], poisson=RECORDED[case], density_kg_m3=guess["density"]
    )
    found = analyse((read_mesh(place / body["mesh"]),), material, count=len(truth), cache=None).freq_hz
    assert np.abs(found / found[0] / (truth / truth[0]) - 1).max() < 0.01


@pytest.mark.slow
@pytest.mark.timeout(600)  # of wall time, which a busy machine multiplies
def test_ten_of_the_thousand_have_modes_or_a_name() -> None:
    import pybullet_data

    plastic = Material.isotropic("plastic", youngs_pa=2.4e9, poisson=0.37, density_kg_m3=1050.0)
    root = Path(pybullet_data.getDataPath()) / "random_urdfs"
    asked = range(0, 1000, 100)
    done = 0
    for k in asked:
        urdf = root / f"{k:03d}" / f"{k:03d}.urdf"
        scale = re.search(r'scale="([-\d.e]+)', urdf.read_text())
        shape = read_mesh(urdf.with_suffix(".obj"), float(scale.group(1)) if scale else 1.0)
        size = float(np.linalg.norm(np.ptp(shape.vertex_m, axis=0)))
        try:
            model = analyse((shape,), plastic, count=3, edge_m=size / 4, cache=None)
        except (MeshError, ModalError) as error:
            assert "\n" not in str(error) and error.remedy
        else:
            assert model.mode_count == 3 and model.mass_kg > 0
            done += 1
    print(f"{done} of {len(asked)} have modes")
    assert done >= 9
