"""What was not added and never moves is as rough as any floor; what moves and was not added is smooth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.records.roughness import ORDINARY_HURST, ORDINARY_ROUGHNESS_M
from sonic_bullet.scene import render_scene
from tests.made.models import STEEL
from tests.made.worlds import box, floor, plate_model


def test_it_is_the_surface_that_an_endless_plane_gets() -> None:
    concrete = sb.load_material("concrete")
    assert (concrete.roughness_m, concrete.hurst) == (ORDINARY_ROUGHNESS_M, ORDINARY_HURST)


def slide(client: Any, *, mass: float, material: str | None) -> np.ndarray:
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=(0, -0.6, 0.4), sr=24_000)
    ground = floor(client)
    client.changeDynamics(ground, -1, mass=mass, localInertiaDiagonal=[mass] * 3)
    if mass:
        client.createConstraint(ground, -1, -1, -1, client.JOINT_FIXED, [0, 0, 0], [0, 0, 0], [0, 0, 0])
    if material is not None:
        listener.world.add(ground, -1, material=sb.load_material(material))
    plate = box(client, (0, 0, 0.005), turn=(0, 0, 0))
    client.resetBaseVelocity(plate, [0.8, 0, 0])
    listener.add(plate, material=STEEL, model=plate_model())
    for _ in range(60):
        client.stepSimulation()
    return np.asarray(listener.sound()[0])


def test_a_slide_on_a_floor_that_was_not_added_is_as_loud_as_on_concrete(client: Any) -> None:
    """Within what concrete's own stiffness makes of it."""
    alone, added = slide(client, mass=0.0, material=None), []
    client.resetSimulation()
    added = slide(client, mass=0.0, material="concrete")
    level_db = 20 * np.log10(np.sqrt((alone**2).mean()) / np.sqrt((added**2).mean()))
    assert abs(level_db) < 6, level_db
    assert np.abs(alone).max() > 1e-3


@pytest.mark.shared
@pytest.mark.slow
def test_the_faults_block_is_as_loud_as_on_the_same_floor_of_concrete(shared_path: Path, tmp_path: Path) -> None:
    folder = shared_path / "faults" / "12-slide-on-silent-partner"
    (tmp_path / "c.py").write_text((folder / "both_added.py").read_text().replace('f: "wood"', 'f: "concrete"'))
    alone = render_scene(folder / "block_alone.py").samples
    both = render_scene(tmp_path / "c.py", silent=["body 0"]).samples
    level_db = 20 * np.log10(np.abs(alone).max() / np.abs(both).max())
    assert abs(level_db) < 4, level_db
