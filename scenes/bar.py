"""A steel bar floats free and a small ball strikes it in the middle: it rings with its odd bending modes, and its even
ones stay silent.
"""

import sonic_bullet as sb

SECONDS = 1.5
MICROPHONE = (0.0, -0.4, 0.3)
LENGTH_M, SIDE_M = 0.24, 0.01


def build(client):
    client.setGravity(0, 0, 0)
    bar = client.createMultiBody(
        7850 * LENGTH_M * SIDE_M**2,
        client.createCollisionShape(client.GEOM_BOX, halfExtents=[LENGTH_M / 2, SIDE_M / 2, SIDE_M / 2]),
    )
    ball = client.createMultiBody(
        0.004, client.createCollisionShape(client.GEOM_SPHERE, radius=0.005), basePosition=[0, 0, 0.05]
    )
    for body in (bar, ball):
        client.changeDynamics(body, -1, restitution=0.9, linearDamping=0, angularDamping=0)
    client.resetBaseVelocity(ball, [0, 0, -1.0])
    sb.keep_restitution(client)
    return {bar: {"material": "steel", "name": "bar"}, ball: {"material": "steel", "name": "ball"}}
