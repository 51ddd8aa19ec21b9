"""A steel ball rolls along two boards: the first is smooth, the second, from x = 0 on, is forty times rougher.

The seam is level.
"""

import math

import sonic_bullet as sb

SECONDS = 3.0
MICROPHONE = (0.0, -0.5, 0.3)
RADIUS_M = 0.015
SPEED_M_S = 0.7


def build(client):
    client.setGravity(0, 0, -9.81)
    half = [0.6, 0.15, 0.01]
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=half)
    smooth = client.createMultiBody(0, shape, basePosition=[-half[0], 0, -half[2]])
    rough = client.createMultiBody(0, shape, basePosition=[half[0], 0, -half[2]])
    mass = 7850 * 4 / 3 * math.pi * RADIUS_M**3
    ball = client.createMultiBody(
        mass, client.createCollisionShape(client.GEOM_SPHERE, radius=RADIUS_M), basePosition=[-1.0, 0, RADIUS_M]
    )
    for body in (smooth, rough, ball):
        client.changeDynamics(body, -1, lateralFriction=0.6, linearDamping=0, angularDamping=0)
    client.resetBaseVelocity(ball, [SPEED_M_S, 0, 0], [0, SPEED_M_S / RADIUS_M, 0])
    sb.keep_restitution(client)
    return {
        smooth: {"material": "made-wood", "name": "smooth board", "roughness_m": 0.1e-6},
        rough: {"material": "made-wood", "name": "rough board", "roughness_m": 4e-6},
        ball: {"material": "made-steel", "name": "ball", "roughness_m": 0.02e-6},
    }
