"""Six small scenes as data, each written out as an ordinary scene file; a change is one entry that is another."""

from __future__ import annotations

import copy
import pprint
from pathlib import Path
from typing import Any

SCENE = '''"""Made by benchmarks/planted_changes.py."""

import dataclasses
import math

import numpy as np

import sonic_bullet as sb

WORLD = {world}
SECONDS = WORLD["seconds"]
MICROPHONE = WORLD["microphone"]


def build(client):
    engine = WORLD["engine"]
    client.setGravity(0, 0, engine["gravity"])
    client.setTimeStep(engine["dt"])
    client.setPhysicsEngineParameter(numSolverIterations=engine["iterations"], numSubSteps=engine["substeps"])
    cast = {{}}
    for one in WORLD["bodies"]:
        kind, size = one["shape"]
        shape = client.createCollisionShape(
            {{"box": client.GEOM_BOX, "ball": client.GEOM_SPHERE}}.get(kind, client.GEOM_CYLINDER),
            **({{"halfExtents": size}} if kind == "box" else {{"radius": size[0]}} if kind == "ball" else
               {{"radius": size[0], "height": size[1]}}),
        )
        body = client.createMultiBody(
            one["mass"], shape, basePosition=one["at"], baseOrientation=client.getQuaternionFromEuler(one["euler"])
        )
        client.changeDynamics(body, -1, lateralFriction=one["friction"], restitution=one["restitution"],
                              rollingFriction=one["rolling"], spinningFriction=one["spinning"],
                              linearDamping=one["damping"], angularDamping=one["damping"])
        client.resetBaseVelocity(body, one["velocity"], one["spin"])
        if one["material"] is not None:
            cast[body] = {{"material": material(one), "name": one["name"], **one["modes"]}}
            if one["fineness"]:
                cast[body]["mesh"] = fine(one)
    sb.keep_restitution(client)
    return cast


def material(one):
    made, by = sb.load_material(one["material"]), one["factors"]
    return dataclasses.replace(
        made,
        density_kg_m3=made.density_kg_m3 * by["density"],
        stiffness_pa=made.stiffness_pa * by["young"],
        alpha_per_s=made.alpha_per_s * by["loss"],
        beta_s=made.beta_s * by["loss"],
        roughness_m=made.roughness_m * by["roughness"],
        source=made.source + one["source"],
        residual=residual() if one["residual"] else None,
    )


def residual():
    from sonic_bullet.records import Residual

    time, freq = np.linspace(0, 0.2, 9), np.geomspace(200, 15000, 12)
    power = 1e-7 * np.exp(-20 * time)[None, :] * np.ones((12, 1))
    none = np.zeros(0)
    mode = (np.array([value]) for value in (900.0, 9.0, 1.0))
    return Residual(*mode, none, none, none, freq, time, power, 1.0, "made")


def fine(one):
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=one["fineness"], radius=one["shape"][1][0])
    return sb.Shape("mesh", vertex_m=mesh.vertices, face=mesh.faces)
'''

BODY: dict[str, Any] = {
    "mass": 0.05, "at": [0, 0, 0.1], "euler": [0, 0, 0], "velocity": [0, 0, 0], "spin": [0, 0, 0], "friction": 0.5,
    "restitution": 0.6, "rolling": 0.0, "spinning": 0.0, "damping": 0.04, "material": "steel", "modes": {},
    "source": "",
    "residual": False, "fineness": 0, "factors": {"density": 1.0, "young": 1.0, "loss": 1.0, "roughness": 1.0},
}  # fmt: skip


def body(name: str, kind: str, size: list[float], **values: Any) -> dict[str, Any]:
    return copy.deepcopy({**BODY, "name": name, "shape": [kind, size], **values})


def world(*bodies: dict[str, Any], seconds: float = 0.5, gravity: float = -9.81) -> dict[str, Any]:
    return {
        "seconds": seconds,
        "microphone": [0.0, -0.5, 0.3],
        "engine": {"gravity": gravity, "dt": 1 / 240, "iterations": 50, "substeps": 1},
        "bodies": list(bodies),
    }


BOARD = body("board", "box", [0.3, 0.2, 0.01], mass=0, at=[0, 0, -0.01], material="wood", modes={"count": 60})
FAR = body("bystander", "box", [0.05, 0.05, 0.05], at=[5, 5, 9], material=None)
SCENES: dict[str, dict[str, Any]] = {
    "drop": world(
        BOARD, body("block", "box", [0.05, 0.03, 0.003], mass=0.1, at=[0, 0, 0.08], euler=[0.4, 0.3, 0]), FAR
    ),
    "slide": world(
        BOARD,
        body("slab", "box", [0.04, 0.03, 0.02], mass=0.13, at=[-0.1, 0, 0.02], velocity=[0.9, 0, 0], material="wood"),
        FAR,
    ),
    "roll": world(
        BOARD,
        body("ball", "ball", [0.015], mass=0.11, at=[-0.15, 0, 0.015], velocity=[0.5, 0, 0], spin=[0, 33, 0]),
        FAR,
    ),
    "bar": world(
        body("bar", "box", [0.12, 0.005, 0.005], mass=0.188, at=[0, 0, 0], restitution=0.9),
        body("striker", "ball", [0.005], mass=0.004, at=[0, 0, 0.05], velocity=[0, 0, -1], restitution=0.9),
        FAR,
        gravity=0.0,
    ),
    "pile": world(
        BOARD,
        *(
            body(f"marble {i}", "ball", [0.009], mass=0.0076, at=[0.002 * i, 0.001 * i, 0.03 + 0.025 * i],
                 material="glass", restitution=0.75)
            for i in range(5)
        ),
        FAR,
    ),
    "rods": world(
        BOARD,
        body("rod", "cylinder", [0.006, 0.12], mass=0.1, at=[0, 0, 0.06], euler=[0, 1.2, 0.3]),
        body("peg", "cylinder", [0.008, 0.05], mass=0.02, at=[0.02, 0.01, 0.12], euler=[1.0, 0.2, 0],
             material="aluminium"),
        FAR,
    ),
}  # fmt: skip


def changed(given: dict[str, Any], *changes: tuple[tuple[Any, ...], Any]) -> dict[str, Any]:
    """A world with other entries; a path is keys and names of bodies, a value None takes a body out."""
    made = copy.deepcopy(given)
    for path, value in changes:
        place: Any = made
        for key in path[:-1]:
            place = _inner(place, key)
        if isinstance(place, list):
            place.remove(_inner(place, path[-1]))
        else:
            place[path[-1]] = value(place[path[-1]]) if callable(value) else value
    return made


def _inner(place: Any, key: Any) -> Any:
    return next(x for x in place if x["name"] == key) if isinstance(place, list) else place[key]


def write(place: Path, given: dict[str, Any]) -> Path:
    """The scene's file."""
    place.write_text(SCENE.format(world=pprint.pformat(given, width=110, sort_dicts=False)), encoding="utf-8")
    return place
