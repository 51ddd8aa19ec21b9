"""What a body loses to the air is in a diagnosis' baseline: computed of its shape, and no effect."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet import modal
from sonic_bullet.radiation.far_field import radiation
from sonic_bullet.records import Air, Material
from tests.apps.cli.called_here import call_here
from tests.made.case import make, write_box

SIZE = (0.16, 0.11, 0.003)
GLASS = Material.isotropic(
    "glass", youngs_pa=70e9, poisson=0.22, density_kg_m3=2500, alpha_per_s=2.0, beta_s=2e-8
)  # hardly lossy: the air takes most


def test_what_the_air_takes_is_no_effect_and_no_part_of_the_material(tmp_path: Path) -> None:
    """A glass plate that loses 1.1 times what is computed to the air: no effect, its own α and β, and the factor."""
    write_box(tmp_path / "plate.obj", SIZE)
    model = modal.analyse((modal.read_mesh(tmp_path / "plate.obj"),), GLASS, to_hz=8_000)
    decay = model.decay_per_s + 1.1 * radiation(model, Air())[1]
    assert (decay / model.decay_per_s).max() > 3
    make(
        tmp_path,
        GLASS,
        SIZE,
        guess=(68e9, 2500.0, 0.23),
        decay=decay,
        to_hz=8_000,
        band_hz=[20, 8000],
        medium="air",
        seconds=0.4,
    )
    told = call_here(tmp_path, "diagnose", ".", "--json", "found.json")
    assert told.returncode == 0, told.stderr
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["verdict"] == "none" and found["effects"] == []
    before = found["baseline"]
    assert before["radiation_factor"] == pytest.approx(1.1, abs=0.1)
    assert before["beta_s"] == pytest.approx(2e-8, rel=0.15)
    assert np.isfinite(before["alpha_per_s"])
