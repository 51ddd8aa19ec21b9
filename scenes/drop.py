"""One object dropped: the porcelain mug that comes with PyBullet falls on a wooden board, bounces and comes to rest."""

import pybullet_data

import sonic_bullet as sb

SECONDS = 2.5
MICROPHONE = (0.0, -0.6, 0.4)


def build(client):
    client.setGravity(0, 0, -9.81)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    board = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.3, 0.2, 0.01]), basePosition=[0, 0, -0.01]
    )
    mug = client.loadURDF("objects/mug.urdf", [0, 0, 0.25], client.getQuaternionFromEuler([0.5, 0.3, 0.0]))
    client.changeDynamics(mug, -1, mass=0.35, localInertiaDiagonal=[5e-4, 5e-4, 5e-4])  # the file says 1 kg and 1 kg·m²
    for body, restitution in ((board, 0.8), (mug, 0.6)):
        client.changeDynamics(body, -1, restitution=restitution)
    sb.keep_restitution(client)
    return {board: {"material": "made-spruce", "name": "board"}, mug: {"material": "made-porcelain", "name": "mug"}}
