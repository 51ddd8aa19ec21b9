"""Three scenes that comparing was not developed with, as text, and what is changed in them: one text for another.

hinged: a clapper on a point-to-point joint is pushed against an aluminium plate, each step, by `act`
mug: a URDF of pybullet_data with inertia, scaling, two microphones, a helper module beside the scene
script: a plain script with a listener of its own, random starts, a kick under way, a body that goes, a motor
"""

from __future__ import annotations

HINGED = """import sonic_bullet as sb

SECONDS = 0.5
MICROPHONE = (0.1, -0.3, 0.2)
PUSH_N = 0.06


def build(client):
    client.setGravity(0, 0, -9.81)
    client.setTimeStep(1 / 300)
    client.setPhysicsEngineParameter(erp=0.2, contactBreakingThreshold=0.02)
    plate = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.004, 0.06, 0.05]), basePosition=[0.018, 0, 0.1])
    clapper = client.createMultiBody(
        0.05, client.createCollisionShape(client.GEOM_CAPSULE, radius=0.01, height=0.08), basePosition=[0, 0, 0.1])
    joint = client.createConstraint(
        clapper, -1, -1, -1, client.JOINT_POINT2POINT, [0, 0, 0], [0, 0, 0.06], [0, 0, 0.16])
    client.changeConstraint(joint, maxForce=500)
    client.changeDynamics(clapper, -1, linearDamping=0.04, rollingFriction=0.001, restitution=0.7)
    client.changeDynamics(plate, -1, restitution=0.7, lateralFriction=0.4)
    sb.keep_restitution(client)
    global CLAPPER
    CLAPPER = clapper
    return {plate: {"material": "aluminium", "name": "plate", "count": 12, "fixed": [(0, 0.06, -0.05, 0.02)]},
            clapper: {"material": "wood", "name": "clapper"}}


def act(client, time_s):
    client.applyExternalForce(CLAPPER, -1, [PUSH_N, 0, 0], [0, 0, 0], client.LINK_FRAME)
"""

MUG = """import sys
from pathlib import Path

import pybullet_data

import sonic_bullet as sb

sys.path.insert(0, str(Path(__file__).parent))
from held_out_heights import HEIGHT_M

SECONDS = 0.6
MICROPHONE = [(0.0, -0.6, 0.4), (0.3, 0.2, 0.5)]


def build(client):
    client.setGravity(0, 0, -9.81)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    client.setDefaultContactERP(0.2)
    board = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.3, 0.2, 0.01]), basePosition=[0, 0, -0.01])
    mug = client.loadURDF("objects/mug.urdf", [0, 0, HEIGHT_M], client.getQuaternionFromEuler([0.5, 0.3, 0.0]))
    client.changeDynamics(mug, -1, mass=0.35, localInertiaDiagonal=[5e-4, 5e-4, 5e-4], angularDamping=0.04)
    for body, restitution in ((board, 0.8), (mug, 0.6)):
        client.changeDynamics(body, -1, restitution=restitution)
    sb.keep_restitution(client)
    return {board: {"material": "wood", "count": 60}, mug: "porcelain"}
"""

SCRIPT = """import numpy as np
import pybullet as p

import sonic_bullet as sb

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
rng = np.random.default_rng(7)
tile = p.createMultiBody(0, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.08, 0.08, 0.004]))
beads = [
    p.createMultiBody(0.004, p.createCollisionShape(p.GEOM_SPHERE, radius=0.0075),
                      basePosition=[*rng.uniform(-0.03, 0.03, 2), 0.03 + 0.02 * i])
    for i in range(3)
]
for bead in beads:
    p.changeDynamics(bead, -1, restitution=0.3, spinningFriction=0.001)
    p.resetBaseVelocity(bead, [0.1, 0.05, 0])
p.changeDynamics(tile, -1, restitution=0.9, contactStiffness=1e5, contactDamping=20)
listener = sb.attach(p, microphone=(0.0, -0.4, 0.3), seed=3, air=sb.Air(sound_speed_m_s=343.0))
listener.add(tile, material="porcelain", name="tile", count=40)
for i, bead in enumerate(beads):
    listener.add(bead, material="glass", name=f"bead {i}", roughness_m=1e-6)
for step in range(120):
    if step == 70:
        p.resetBaseVelocity(beads[0], [0.05, 0, 0.6])
    if step == 90:
        p.removeBody(beads[2])
    p.stepSimulation()
    listener.step()
"""

HELPER = ("held_out_heights.py", "HEIGHT_M = 0.12\n")
SCENES = {"hinged": HINGED, "mug": MUG, "script": SCRIPT}
CHANGES: tuple[tuple[str, str, str, str, str], ...] = (
    ("hinged", "[0, 0, 0.06], [0, 0, 0.16])", "[0, 0, 0.063], [0, 0, 0.16])", "clapper", "joint position"),
    ("hinged", "linearDamping=0.04", "linearDamping=0.05", "clapper", "linear damping"),
    ("hinged", "PUSH_N = 0.06", "PUSH_N = 0.0605", "clapper", "force"),
    ("hinged", "erp=0.2", "erp=0.21", "", "erp"),
    ("hinged", '"count": 12', '"count": 11', "plate", "count"),
    ("hinged", "-0.05, 0.02)]", "-0.05, 0.021)]", "plate", "fixed"),
    ("hinged", "maxForce=500", "maxForce=0.3", "joint of clapper", "largest force"),
    ("hinged", "radius=0.01, height=0.08", "radius=0.01, height=0.081", "clapper", "shape height"),
    ("mug", "setDefaultContactERP(0.2)", "setDefaultContactERP(0.25)", "", "contact ERP"),
    ("mug", "[5e-4, 5e-4, 5e-4]", "[5e-4, 5e-4, 5.1e-4]", "mug", "inertia"),
    ("mug", "([0.5, 0.3, 0.0]))", "([0.5, 0.3, 0.0]), globalScaling=1.004)", "mug", "scale"),
    ("mug", "[0.5, 0.3, 0.0]", "[0.5, 0.3, 0.001]", "mug", "start orientation"),
    ("mug", "(0.3, 0.2, 0.5)]", "(0.3, 0.2, 0.5), (0, 0, 1)]", "", "microphones"),
    ("mug", "[(0.0, -0.6, 0.4), (0.3, 0.2, 0.5)]", "[(0.3, 0.2, 0.5), (0.0, -0.6, 0.4)]", "", "microphones"),
    ("mug", "0.12", "0.1201", "mug", "start position"),
    ("mug", "angularDamping=0.04", "angularDamping=0.0401", "mug", "angular damping"),
    ("script", "p.resetBaseVelocity(beads[0], [0.05", "p.resetBaseVelocity(beads[0], [0.051", "bead 0", "velocity"),
    ("script", "step == 70", "step == 71", "bead 0", "velocity"),
    ("script", "step == 90", "step == 35", "bead 2", "removeBody"),
    ("script", "sound_speed_m_s=343.0", "sound_speed_m_s=342.9", "", "sound_speed_m_s"),
    ("script", "roughness_m=1e-6", "roughness_m=1.3e-6 if i == 1 else 1e-6", "bead 1", "roughness_m"),
    ("script", "seed=3", "seed=4", "", "seed"),
    ("script", "contactDamping=20", "contactDamping=20.2", "tile", "contactDamping"),
    ("script", "p.createMultiBody(0.004,", "p.createMultiBody(0.00402 if i == 2 else 0.004,", "bead 2", "mass"),
)  # fmt: skip
"""scene, text, the other text, whom it is of, what of it (a part of its name)."""
