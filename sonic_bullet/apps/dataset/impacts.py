"""Ready recipe: one body falls on a floor. Random shape, size, material, height and orientation, two microphones.

Make it yours by a changed file: OBJECTS, IMPACT_MATERIALS and the ranges in `sample`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from sonic_bullet.apps.dataset import DatasetScene
from sonic_bullet.files.presets import load_material
from sonic_bullet.records import Shape
from sonic_bullet.session.known_shapes import KnownShape, known_shape
from sonic_bullet.simulators import keep_restitution

IMPACT_MATERIALS = ("steel", "aluminium", "brass", "copper", "glass", "porcelain", "plastic", "wood")
SIZE_RATIOS = (0.6, 1.4)


def box(*size_m: float) -> Shape:
    """Make a box."""
    return Shape("box", np.array(size_m))


def cylinder(radius_m: float, height_m: float) -> Shape:
    """Make a cylinder."""
    return Shape("cylinder", np.array([radius_m, height_m, 0]))


def mesh(made: trimesh.Trimesh) -> Shape:
    """Make a shape of a mesh."""
    return Shape("mesh", vertex_m=made.vertices - made.center_mass, face=made.faces)


def ring(inner_m: float, outer_m: float, height_m: float) -> Shape:
    """Make a ring."""
    return mesh(trimesh.creation.annulus(inner_m, outer_m, height_m, sections=48))


def bowl(radius_m: float, height_m: float, wall_m: float) -> Shape:
    """Make a bowl: an outer and an inner parabola turned around z."""
    x = np.linspace(0, 1, 17)
    outer = np.column_stack([radius_m * x, height_m * x**2])
    inner = np.column_stack([(radius_m - wall_m) * x, wall_m + (height_m - wall_m) * x**2])[::-1]
    return mesh(trimesh.creation.revolve(np.concatenate([outer, inner]), sections=48))


OBJECTS = {
    "bar": box(0.2, 0.025, 0.006),
    "beam": box(0.16, 0.02, 0.02),
    "plate": box(0.16, 0.12, 0.004),
    "square-plate": box(0.12, 0.12, 0.005),
    "tile": box(0.1, 0.1, 0.01),
    "block": box(0.08, 0.06, 0.04),
    "strip": box(0.15, 0.04, 0.003),
    "rod": cylinder(0.006, 0.18),
    "disc": cylinder(0.06, 0.005),
    "puck": cylinder(0.04, 0.02),
    "coin": cylinder(0.03, 0.004),
    "ring": ring(0.035, 0.05, 0.01),
    "tube": ring(0.016, 0.02, 0.14),
    "washer": ring(0.02, 0.05, 0.004),
    "bowl": bowl(0.07, 0.04, 0.005),
    "dish": bowl(0.09, 0.02, 0.005),
    "cup": bowl(0.04, 0.07, 0.004),
}
"""What falls, at size 1."""


def sample(rng: np.random.Generator) -> DatasetScene:
    """Draw a scene."""
    heights_m = (0.05, 0.5)
    name = str(rng.choice(list(OBJECTS)))
    drawn = {
        "object": name,
        "size": float(np.exp(rng.uniform(*np.log(SIZE_RATIOS)))),
        "material": str(rng.choice(IMPACT_MATERIALS)),
        "height_m": float(rng.uniform(*heights_m)),
        "quaternion_xyzw": rng.normal(size=4).tolist(),
        "spin_rad_s": rng.normal(0, 3, 3).tolist(),
    }
    ears = rng.uniform((-0.5, -1.0, 0.3), (0.5, -0.6, 0.8)) + np.array([[0, 0, 0], [0.2, 0, 0]])
    return DatasetScene(lambda client: build(client, **drawn), drawn, name, seconds=1.5, microphones=ears)


def build(
    client: Any,
    *,
    object: str,
    size: float,
    material: str,
    height_m: float,
    quaternion_xyzw: list[float],
    spin_rad_s: list[float],
) -> dict[int, Any]:
    """Set up a floor and the body above it."""
    floor_material = "concrete"
    made = load_material(material)
    model = load_known_shape(object, material).model(size, made)
    client.setGravity(0, 0, -9.81)
    client.setTimeStep(1 / 480)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    body = client.createMultiBody(
        model.mass_kg,
        collision_shape(client, OBJECTS[object], size),
        basePosition=(0, 0, height_m + 0.12 * size),
        baseOrientation=np.array(quaternion_xyzw) / np.linalg.norm(quaternion_xyzw),
    )
    client.resetBaseVelocity(body, angularVelocity=spin_rad_s)
    for one, of in ((floor, load_material(floor_material)), (body, made)):
        client.changeDynamics(one, -1, restitution=of.restitution, lateralFriction=0.5, linearDamping=0)
    keep_restitution(client)
    return {
        floor: {"material": floor_material, "name": "floor"},
        body: {"material": made, "model": model, "name": object},
    }


def load_known_shape(object: str, material: str) -> KnownShape:
    """Solve an object once for all its sizes and materials; apart for slow ones, which have several times the modes."""
    slow = ("plastic",)
    group = [name for name in IMPACT_MATERIALS if (name in slow) == (material in slow)]
    return known_shape(OBJECTS[object], group, largest=SIZE_RATIOS[1])


def collision_shape(client: Any, shape: Shape, size: float) -> int:
    """Make a collision shape; Bullet takes the convex hull of a mesh."""
    x, y, z = (size * shape.size_m).tolist()
    if shape.kind == "box":
        return int(client.createCollisionShape(client.GEOM_BOX, halfExtents=(x / 2, y / 2, z / 2)))
    if shape.kind == "cylinder":
        return int(client.createCollisionShape(client.GEOM_CYLINDER, radius=x, height=y))
    return int(client.createCollisionShape(client.GEOM_MESH, vertices=(size * shape.vertex_m).tolist()))
