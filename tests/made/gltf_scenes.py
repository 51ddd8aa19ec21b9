"""glTF scenes with physics and sound, written by hand: a box that rings, over a floor that does not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.gltf_writer import GltfBuffer, write_gltf

HALF_M = np.array([0.06, 0.005, 0.02])
"""Of the box, y up."""
FREQ_HZ, DECAY_PER_S = np.array([2400.0, 900.0, 5200.0]), np.array([12.0, 8.0, 40.0])
DENSITY = 7850.0
MASS_KG = float(8 * HALF_M.prod() * DENSITY)
MATERIAL = {
    "name": "Steel", "density": DENSITY, "youngsModulus": 2e11, "poissonRatio": 0.29, "alpha": 5.0, "beta": 3e-8,
}  # fmt: skip
FINISH = {"name": "Machined", "material": 0, "roughness": 2e-6, "correlationLength": 5e-5, "spectralSlope": -2.4}
CORNER_M = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * HALF_M
FACE = np.reshape(
    [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3],
    (-1, 3),
)


def gltf_scene(buffer: GltfBuffer, scale: float = 1.0, drop_m: float = 0.1) -> dict[str, Any]:
    """The tree of such a scene; change it and write it with `write_gltf`."""
    shape = np.random.default_rng(5).normal(size=(3, 8, 3)) / MASS_KG**0.5
    model = {
        "name": "box modes",
        "frequencies": buffer.append(FREQ_HZ),
        "decayRates": buffer.append(DECAY_PER_S),
        "positions": buffer.append(CORNER_M),
        "shapes": buffer.append(shape.reshape(-1, 3)),
        "indices": buffer.append(FACE.ravel()),
        "material": 0,
        "massProperties": {"mass": MASS_KG},
    }
    x, y, z = 2 * HALF_M
    moment = MASS_KG * scale**5 / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    box: dict[str, Any] = {
        "name": "box",
        "translation": [0.0, float(HALF_M[1] * scale + drop_m), 0.0],
        "rotation": [0.0, float(np.sin(0.2)), 0.0, float(np.cos(0.2))],
        "scale": [scale] * 3,
        "extensions": {
            "KHR_physics_rigid_bodies": {
                "motion": {
                    "mass": MASS_KG * scale**3,
                    "inertiaDiagonal": moment.tolist(),
                    "angularVelocity": [0, 0, 1],
                },
                "collider": {"geometry": {"shape": 1}, "physicsMaterial": 0},
            },
            "KHR_audio_rigid_bodies": {"modalModel": 0, "acousticSurface": 0},
        },
    }
    floor = {
        "name": "floor",
        "translation": [0.0, -0.05, 0.0],
        "extensions": {
            "KHR_physics_rigid_bodies": {"collider": {"geometry": {"shape": 0}, "physicsMaterial": 0}},
            "KHR_audio_rigid_bodies": {"acousticSurface": 0},
        },
    }
    return {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_implicit_shapes", "KHR_physics_rigid_bodies", "KHR_audio_rigid_bodies"],
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [floor, box],
        "extensions": {
            "KHR_implicit_shapes": {
                "shapes": [
                    {"type": "box", "box": {"size": [1.0, 0.1, 1.0]}},
                    {"type": "box", "box": {"size": (2 * HALF_M).tolist()}},
                ]
            },
            "KHR_physics_rigid_bodies": {
                "physicsMaterials": [{"staticFriction": 0.4, "dynamicFriction": 0.4, "restitution": 0.3}]
            },
            "KHR_audio_rigid_bodies": {
                "acousticMaterials": [dict(MATERIAL)],
                "acousticSurfaces": [dict(FINISH)],
                "modalModels": [model],
            },
        },
    }


def write_scene(path: Path, **options: float) -> Path:
    """Such a scene as a file."""
    buffer = GltfBuffer()
    write_gltf(path, gltf_scene(buffer, **options), buffer)
    return path
