"""A KUKA arm of pybullet_data sweeps over a table and knocks a row of dominoes, a mug and a rubber duck over."""

import math

import pybullet_data

SECONDS = 4.0
MICROPHONE = (0.6, -0.8, 0.5)
TIP_LINK = 6


def build(client):
    client.setGravity(0, 0, -9.81)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    table = client.createMultiBody(0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.35, 0.45, 0.015]), basePosition=[0.6, 0, -0.015])
    arm = client.loadURDF("kuka_iiwa/model.urdf", [0, 0, 0], useFixedBase=True)
    for joint, angle in enumerate(REST):
        client.resetJointState(arm, joint, angle)
    cast = {table: "wood", (arm, TIP_LINK): "aluminium"}
    for i in range(8):
        domino = client.loadURDF("domino/domino.urdf", [0.62, -0.02 + 0.028 * i, 0.0254], client.getQuaternionFromEuler([0, 0, math.pi / 2]))
        client.changeDynamics(domino, -1, mass=0.0098, localInertiaDiagonal=[2.6e-6, 2.1e-6, 5.6e-7])  # plastic; the file says 1 kg·m²
        cast[domino] = "plastic"
    mug = client.loadURDF("objects/mug.urdf", [0.5, 0.12, 0.0])
    client.changeDynamics(mug, -1, mass=0.35, localInertiaDiagonal=[5e-4, 5e-4, 5e-4])
    cast[mug] = "porcelain"
    for body in range(client.getNumBodies()):
        for link in range(-1, client.getNumJoints(body)):
            client.changeDynamics(body, link, restitution=0.5, contactProcessingThreshold=0)
    return cast


REST = [-0.6, 1.15, 0.0, -1.2, 0.0, 0.65, 0.0]


def act(client, time_s):
    """Swing the first joint once from -0.6 to 0.7 rad in 2 s, along a half cosine."""
    share = min(max((time_s - 0.3) / 2.0, 0.0), 1.0)
    target = [*REST]
    target[0] = REST[0] + 1.3 * 0.5 * (1 - math.cos(math.pi * share))
    client.setJointMotorControlArray(1, range(7), client.POSITION_CONTROL, targetPositions=target, forces=[300.0] * 7)
