"""Every finding fires where it should, and a clean scene has none."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
import pytest

from sonic_bullet.records import Material
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators import diagnose_world, keep_restitution, open_world
from tests.made.scenes import DUCK, floor, listen, thing

ASSETS = Path(__file__).parents[2] / "assets"
WOOD = Material.isotropic("wood", youngs_pa=1e10, poisson=0.3, density_kg_m3=700, alpha_per_s=1.0, beta_s=1e-8)


def ids(findings: Any) -> set[str]:
    assert all("\n" not in finding.what + finding.remedy and finding.remedy for finding in findings)
    return {finding.id for finding in findings}


@pytest.fixture
def clean(client: Any) -> Any:
    floor(client)
    for k, shape in enumerate(("sphere", "box", "capsule")):
        thing(client, shape, [0.5 * k, 0, 0.3])
    return client


def test_a_clean_scene_has_no_findings(clean: Any) -> None:
    world, steps = listen(clean)
    before = clean.getBasePositionAndOrientation(1)
    assert ids(diagnose_world(clean)) == set()
    assert ids(diagnose_world(world, steps=300)) == set()
    assert clean.getBasePositionAndOrientation(1) == before
    assert not steps


def test_settings_are_named(clean: Any) -> None:
    clean.setPhysicsEngineParameter(numSubSteps=4)
    clean.setTimeStep(1 / 60)
    assert ids(diagnose_world(clean)) == {"sub-steps", "long-step"}
    clean.setTimeStep(1 / 120)
    assert ids(diagnose_world(clean)) == {"sub-steps"}


def test_lost_restitution_is_named_and_mended(clean: Any) -> None:
    clean.changeDynamics(1, -1, restitution=0.5)
    assert ids(diagnose_world(clean)) == set()  # the product with the floor's 0 is 0: nothing to lose
    clean.changeDynamics(0, -1, restitution=1.0)
    assert ids(diagnose_world(clean)) == {"restitution-lost"}
    assert keep_restitution(clean) == 4
    assert ids(diagnose_world(clean)) == set()


@pytest.mark.parametrize("dt", [1 / 240, 1 / 1000, 1 / 4000])
def test_keep_restitution_keeps_it(client: Any, dt: float) -> None:
    def rebound(kept: bool) -> float:
        client.resetSimulation()
        client.setTimeStep(dt)
        ground, ball = floor(client), thing(client, "sphere", [0, 0, 0.06])
        client.changeDynamics(ground, -1, restitution=1.0)
        client.changeDynamics(ball, -1, restitution=0.5)
        if kept:
            keep_restitution(client)
        client.resetBaseVelocity(ball, [0, 0, -2])
        for _ in range(round(0.02 / dt)):
            client.stepSimulation()
        return client.getBaseVelocity(ball)[0][2] / 2

    assert 0.4 < rebound(True) < 0.7
    assert dt > 1 / 2000 or rebound(False) < 0.1


def test_hull_lids_are_named(client: Any) -> None:
    floor(client)
    mug = client.loadURDF(pybullet_data.getDataPath() + "/objects/mug.urdf", [0, 0, 0.2])
    assert client.getDynamicsInfo(mug, -1)[0] > 0
    duck = client.createMultiBody(
        1, client.createCollisionShape(p.GEOM_MESH, fileName=DUCK, meshScale=[0.1] * 3), basePosition=[1, 0, 1]
    )
    hollow = [
        client.createMultiBody(
            1, client.createCollisionShape(p.GEOM_MESH, fileName=str(ASSETS / f"{name}.obj")), basePosition=[2, 0, k]
        )
        for k, name in enumerate(("bowl", "tumbler"))
    ]
    found = [f for f in diagnose_world(client) if f.id == "hull-lid"]
    for body in (duck, *hollow):
        assert any(f"body {body} " in f.what for f in found)
    fixed = [f for f in found if "body 0 " in f.what]
    assert not fixed


def test_convex_meshes_have_no_lid(client: Any) -> None:
    corners = np.array(np.meshgrid(*[[-0.1, 0.1]] * 3)).reshape(3, -1).T.tolist()
    client.createMultiBody(1, client.createCollisionShape(p.GEOM_MESH, vertices=corners))
    assert ids(diagnose_world(client)) == set()


def test_sleepers_are_named(client: Any) -> None:
    floor(client)
    body = thing(client, "box", [0, 0, 0.03])
    client.changeDynamics(body, -1, activationState=p.ACTIVATION_STATE_ENABLE_SLEEPING)
    assert ids(diagnose_world(client)) == set()
    assert ids(diagnose_world(client, steps=1200)) == {"sleeping"}
    for _ in range(1200):
        client.stepSimulation()
    assert ids(diagnose_world(client)) == {"sleeping"}


@pytest.mark.parametrize("scale", [100.0, 1e-4])
def test_millimetre_meshes_are_named(client: Any, scale: float) -> None:
    client.createMultiBody(1, client.createCollisionShape(p.GEOM_SPHERE, radius=scale))
    assert "scale" in ids(diagnose_world(client))


@pytest.mark.parametrize("mass", [math.nan, 1e300])
def test_absurd_masses_are_named(clean: Any, mass: float) -> None:
    clean.createMultiBody(mass, clean.createCollisionShape(p.GEOM_SPHERE, radius=0.1), basePosition=[0, 0, 5])
    assert "mass" in ids(diagnose_world(clean))


def test_lost_numbers_are_named(clean: Any) -> None:
    clean.resetBaseVelocity(1, [math.nan, 0, 0])
    assert "nan" in ids(diagnose_world(clean))


def test_mass_that_no_material_has_is_named(client: Any) -> None:
    body = thing(client, "box", [0, 0, 1])  # 0.3 kg, 1.2 litres: 250 kg/m³
    world = open_world(client)
    world.add(body, material=WOOD, volume_m3=0.0012)
    assert ids(diagnose_world(world)) == set()
    client.changeDynamics(body, -1, mass=0.1)
    world.add(body, material=WOOD, volume_m3=0.0012)
    assert ids(diagnose_world(world)) == {"density"}


def test_a_lost_client_is_named() -> None:
    with pytest.raises(SceneError, match="not connected"):
        diagnose_world(4000)
    with pytest.raises(SceneError, match="not connected"):
        keep_restitution(4000)


def test_a_contact_threshold_that_the_scene_sets_itself_is_known(clean: Any) -> None:
    world, _ = listen(clean)
    for body in range(4):
        clean.changeDynamics(body, -1, restitution=0.5)
    assert ids(diagnose_world(world)) == {"restitution-lost"}
    for body in range(4):
        clean.changeDynamics(body, -1, contactProcessingThreshold=0)
    assert ids(diagnose_world(world)) == set()


@pytest.mark.parametrize(
    ("threshold", "step_s", "restitution", "named"),
    [(0.0, 1 / 240, 0.7, True), (0.0, 1 / 1000, 0.9, True), (0.01, 1 / 240, 0.8, True), (0.2, 1 / 240, 0.7, False),
     (0.0, 1 / 240, 0.0, False)],
)  # fmt: skip
def test_what_never_comes_to_rest_is_named(
    clean: Any, threshold: float, step_s: float, restitution: float, named: bool
) -> None:
    world, _ = listen(clean)
    clean.setTimeStep(step_s)
    for body in range(4):
        clean.changeDynamics(body, -1, restitution=restitution, contactProcessingThreshold=0)
    clean.setPhysicsEngineParameter(restitutionVelocityThreshold=threshold)
    found = [one for one in diagnose_world(world) if one.id == "restitution-threshold"]
    assert len(found) == named
    if named:
        e = restitution**2
        assert f"{9.81 * step_s * e / (1 - e):.2g} m/s" in found[0].what


BUILT = """
def build(client):
    client.setGravity(0, 0, -9.81)
    client.setPhysicsEngineParameter(restitutionVelocityThreshold=0)
    half = [0.1, 0.02, 0.01]
    ground = client.createMultiBody(0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[1, 1, 0.1]),
                                    basePosition=[0, 0, -0.1])
    bar = client.createMultiBody(0.1, client.createCollisionShape(client.GEOM_BOX, halfExtents=half),
                                 basePosition=[0, 0, 0.012])
    for body in (ground, bar):
        client.changeDynamics(body, -1, restitution=0.7, contactProcessingThreshold=0)
    return {bar: "wood"}
"""
PLAIN = """
import pybullet as p
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.setPhysicsEngineParameter(restitutionVelocityThreshold=0)
ground = p.createMultiBody(0, p.createCollisionShape(p.GEOM_BOX, halfExtents=[1, 1, 0.1]), basePosition=[0, 0, -0.1])
bar = p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.02, 0.01]),
                        basePosition=[0, 0, 0.012])
for body in (ground, bar):
    p.changeDynamics(body, -1, restitution=0.7, contactProcessingThreshold=0)
for _ in range(240):
    p.stepSimulation()
"""


@pytest.mark.slow
@pytest.mark.parametrize("scene", [BUILT, PLAIN])
def test_the_doctor_names_what_keeps_a_bar_from_resting(scene: str, tmp_path: Path) -> None:
    from click.testing import CliRunner

    from sonic_bullet.apps.cli import cli

    (tmp_path / "still.py").write_text(scene)
    done = CliRunner().invoke(cli, ["doctor", str(tmp_path / "still.py"), "--seconds", "0.2"])
    assert done.exit_code == 0, done.output
    said = done.output
    assert "restitution-threshold" in said
    assert "restitution-lost" not in said
