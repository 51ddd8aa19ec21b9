"""A wooden box is pushed and slides to rest on a wooden board: the sound falls with its speed and ends when
it stands.
"""

import sonic_bullet as sb

SECONDS = 2.0
MICROPHONE = (0.0, -0.5, 0.3)
HALF_M = [0.04, 0.03, 0.02]


def build(client):
    client.setGravity(0, 0, -9.81)
    board = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.8, 0.2, 0.01]), basePosition=[0, 0, -0.01]
    )
    volume = 8 * HALF_M[0] * HALF_M[1] * HALF_M[2]
    box = client.createMultiBody(
        700 * volume,
        client.createCollisionShape(client.GEOM_BOX, halfExtents=HALF_M),
        basePosition=[-0.5, 0, HALF_M[2]],
    )
    client.changeDynamics(board, -1, lateralFriction=0.6)
    client.changeDynamics(box, -1, lateralFriction=0.5)
    client.resetBaseVelocity(box, [1.5, 0, 0])
    sb.keep_restitution(client)
    return {
        board: {"material": "made-wood", "name": "board", "roughness_m": 3e-6},
        box: {"material": "made-wood", "name": "box", "roughness_m": 3e-6},
    }
