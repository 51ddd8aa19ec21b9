"""A table-top with porcelain, metal, glass and wood that collide, roll and slide (after Figure 14 of Ren, Yeh and Lin
2013).

Plate, bowl and tumbler are meshes of this project, the wooden toy is one of PyBullet's random_urdfs.
"""

import math
from pathlib import Path

import pybullet_data

import sonic_bullet as sb

SECONDS = 5.0
MICROPHONE = [(-0.15, -0.7, 0.5), (0.15, -0.7, 0.5)]
ASSETS = Path(__file__).resolve().parent.parent / "assets"
DENSITY_KG_M3 = {"porcelain": 2400, "steel": 7850, "glass": 2500, "wood": 700}
VOLUME_M3 = {"plate": 206.8e-6, "bowl": 75.1e-6, "tumbler": 67.4e-6}


def build(client):
    client.setGravity(0, 0, -9.81)
    table = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.45, 0.3, 0.012]), basePosition=[0, 0, -0.012]
    )
    cast = {table: {"material": "made-spruce", "name": "table", "count": 120}}

    def place(name, material, volume, shape, position, euler=(0, 0, 0), velocity=(0, 0, 0), spin=(0, 0, 0)):
        mass = DENSITY_KG_M3[material] * volume
        body = client.createMultiBody(
            mass, shape, basePosition=position, baseOrientation=client.getQuaternionFromEuler(euler)
        )
        client.resetBaseVelocity(body, velocity, spin)
        cast[body] = {"material": f"made-{material}", "name": name}
        return body

    def mesh(name):
        return client.createCollisionShape(client.GEOM_MESH, fileName=str(ASSETS / f"{name}.obj"))

    ball, marble, block, rod = 0.014, 0.009, [0.04, 0.025, 0.02], (0.006, 0.16)
    sphere = client.createCollisionShape(client.GEOM_SPHERE, radius=ball)
    place("plate", "porcelain", VOLUME_M3["plate"], mesh("plate"), [-0.18, 0.08, 0.16], (0.25, 0.1, 0))
    place("bowl", "steel", VOLUME_M3["bowl"], mesh("bowl"), [0.2, 0.1, 0.22], (0.5, 0.2, 0))
    place("tumbler", "glass", VOLUME_M3["tumbler"], mesh("tumbler"), [0.02, 0.05, 0.052])
    place(
        "ball",
        "steel",
        4 / 3 * math.pi * ball**3,
        sphere,
        [-0.4, -0.12, ball],
        velocity=(0.5, 0, 0),
        spin=(0, 0.5 / ball, 0),
    )
    place(
        "block",
        "wood",
        8 * math.prod(block),
        client.createCollisionShape(client.GEOM_BOX, halfExtents=block),
        [0.38, 0.05, 0.02],
        velocity=(-1.6, 0, 0),
    )
    place(
        "rod",
        "steel",
        math.pi * rod[0] ** 2 * rod[1],
        client.createCollisionShape(client.GEOM_CYLINDER, radius=rod[0], height=rod[1]),
        [-0.05, -0.2, 0.3],
        (0, 1.2, 0.3),
    )
    for i in range(3):
        shape = client.createCollisionShape(client.GEOM_SPHERE, radius=marble)
        place(
            f"marble {i + 1}",
            "glass",
            4 / 3 * math.pi * marble**3,
            shape,
            [0.1 + 0.05 * i, -0.1, 0.35 + 0.12 * i],
            velocity=(0.1, 0.05, 0),
        )
    toy = client.loadURDF(
        str(Path(pybullet_data.getDataPath()) / "random_urdfs/000/000.urdf"),
        [0.33, -0.2, 0.12],
        client.getQuaternionFromEuler((0.4, 0.2, 0)),
    )
    client.changeDynamics(toy, -1, mass=700 * 86.9e-6, localInertiaDiagonal=[6e-5, 4e-5, 8e-5])  # the file says 1 kg·m²
    cast[toy] = {"material": "made-wood", "name": "toy"}
    for body in cast:
        client.changeDynamics(
            body, -1, restitution=0.75, lateralFriction=0.5, rollingFriction=1e-4, spinningFriction=2e-5
        )
    sb.keep_restitution(client)
    return cast
