"""A KUKA arm of pybullet_data sweeps low over a table: it knocks a row of dominoes over, then pushes a mug into a
rubber duck.

The flange that meets the dominoes is silent (its mesh, link_7.stl, has no tetrahedra yet); the wrist that meets the mug
sounds.
"""

import math

import pybullet_data

import sonic_bullet as sb

SECONDS = 4.0
MICROPHONE = (0.6, -0.8, 0.5)
WRIST = 5
# flange 0.6 m from the base, pointing down, its rim 3 to 9 cm above the table
REST = [-0.6, 1.22, 0.0, -1.383, 0.0, 0.538, 0.0]
SWEEP_RAD, BEGIN_S, SWEEP_S = 1.1, 0.2, 1.8


def build(client):
    client.setGravity(0, 0, -9.81)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    table = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.35, 0.5, 0.015]), basePosition=[0.6, 0, -0.015]
    )
    arm = client.loadURDF("kuka_iiwa/model.urdf", [0, 0, 0], useFixedBase=True)
    for joint, angle in enumerate(REST):
        client.resetJointState(arm, joint, angle)
    cast = {
        table: {"material": "made-wood", "name": "table", "count": 80},
        (arm, WRIST): {"material": "made-aluminium", "name": "wrist"},
    }
    for i in range(8):
        domino = client.loadURDF(
            "domino/domino.urdf",
            [0.6 - 0.003 * i, -0.05 + 0.028 * i, 0.0254],
            client.getQuaternionFromEuler([0, 0, math.pi / 2]),
        )
        # plastic; the file says 1 kg·m²
        client.changeDynamics(domino, -1, mass=0.0098, localInertiaDiagonal=[2.6e-6, 2.1e-6, 5.6e-7])
        cast[domino] = {"material": "made-plastic", "name": f"domino {i + 1}"}
    mug = client.loadURDF("objects/mug.urdf", [0.51, 0.31, 0.003])
    client.changeDynamics(mug, -1, mass=0.35, localInertiaDiagonal=[5e-4, 5e-4, 5e-4])
    cast[mug] = {"material": "made-porcelain", "name": "mug"}
    duck = client.loadURDF("duck_vhacd.urdf", [0.46, 0.4, 0.031], client.getQuaternionFromEuler([math.pi / 2, 0, 0]))
    client.changeDynamics(duck, -1, mass=0.06)
    cast[duck] = {"material": "made-plastic", "name": "duck"}
    for body in range(client.getNumBodies()):
        for link in range(-1, client.getNumJoints(body)):
            client.changeDynamics(body, link, restitution=0.5, lateralFriction=0.5)
    sb.keep_restitution(client)
    return cast


def act(client, time_s):
    """Swing the first joint along a half cosine."""
    share = min(max((time_s - BEGIN_S) / SWEEP_S, 0.0), 1.0)
    target = [REST[0] + SWEEP_RAD * 0.5 * (1 - math.cos(math.pi * share)), *REST[1:]]
    client.setJointMotorControlArray(1, range(7), client.POSITION_CONTROL, targetPositions=target, forces=[300.0] * 7)
