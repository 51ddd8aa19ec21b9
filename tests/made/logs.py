"""A model and a contact log of random numbers, with everything in them that a file can hold."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.rows.log_steps import LogSteps
from sonic_bullet.files.storage.json_text import as_json_text
from sonic_bullet.records import Air, Body, Material, Microphone, ModalModel, ModalSum, Vibrometer
from sonic_bullet.records.contacts import ROW_FIELDS, Contacts, Event, Step
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.simulated import Change


def model(seed: int = 0, modes: int = 3) -> ModalModel:
    rng = np.random.default_rng(seed)
    decay = rng.uniform(1, 9, modes)
    decay[:1] = np.nan
    return ModalModel(
        freq_hz=np.sort(rng.uniform(100, 9000, modes)),
        decay_per_s=decay,
        shape=rng.normal(size=(4, 3, modes)),
        vertex_m=rng.normal(size=(4, 3)),
        face=[[0, 1, 2], [0, 2, 3]],
        curvature_per_m=rng.normal(size=2),
        volume_m3=1e-3 / 3,
        mass_kg=0.1,
        dropped=2,
        note="P2, edge 1 mm \u03b1",
    )


def turns(rng: np.random.Generator, count: int) -> np.ndarray:
    """Unit quaternions (count, 4)."""
    made = rng.normal(size=(count, 4))
    return np.asarray(made / np.linalg.norm(made, axis=1, keepdims=True))


def log(seed: int = 0, steps: int = 5, *, facts: bool = True) -> ContactLog:
    """facts False: without what formats 1 and 2 do not hold."""
    rng = np.random.default_rng(seed)
    wood = Material.isotropic(
        "wood", youngs_pa=1.1e10 / 3, poisson=0.3, density_kg_m3=700.1, alpha_per_s=0.1, beta_s=1 / 3e7, source="x"
    )
    bare = Material.isotropic("bare", youngs_pa=1e9, poisson=0.1, density_kg_m3=1.0)
    bodies = (
        Body(0, -1, 0, "plane", 0.0, np.zeros((3, 3)), material=bare),
        Body(1, -1, 0, "cup \ud800 \u00e9", 0.1, np.diag(rng.uniform(size=3)), 1e-4, 3.7, wood, model(1)),
        Body(1, 0, 1, "handle", 0.2, np.eye(3), material=wood, model=model(1), since_step=2, until_step=4),
        Body(7, -1, 1, "other", 0.2, np.eye(3), model=model(2, modes=0)),
    )
    if facts:
        asked = ModalOptions(to_hz=1e5 / 3, count=7, fixed=[(0, 1 / 3, 0, 0.1)], thickness_m=1e-3 / 7)
        dynamics = {"restitution": 1 / 3, "lateralFriction": 0.5, "contactStiffness": -1.0}
        bodies = (
            replace(bodies[0], dynamics={"lateralFriction": 1 / 7}),
            replace(bodies[1], dynamics=dynamics, options=asked),
            *bodies[2:],
        )

    def step(i: int) -> Step:
        b, k = min(2 + i, 4), int(rng.integers(0, 4))
        rows = {name: rng.normal(size=(k, *tail)) for name, (_, tail) in ROW_FIELDS.items()}
        rows["a"], rows["b"] = rng.integers(0, b, k), rng.integers(0, b, k)
        return Step(
            1 / (240 + i),
            rng.normal(size=(b, 3)) / 3,
            turns(rng, b),
            rng.random(b) < 0.3,
            Contacts(**rows),
        )

    sensors = (Microphone([0.1, -1 / 3, 1e-300]), Vibrometer(1, [1 / 3, 2 / 3, 0], [1, 2, 3 / 7], 0), ModalSum(1 / 7))
    events = (Event("quench", 0), Event("quench", 3), Event("quench", 3))
    made = ContactLog(
        bodies, tuple(step(i) for i in range(steps)), sensors, 44_100, 2**40 + 1, Air(1.19, 340.1 / 3), events=events
    )
    if not facts:
        return made
    changes = (
        Change(0, None, {"erp": 0.2}),
        Change(2, 1, {"restitution": 0.25, "linearDamping": 0.04}),
        Change(2, None, {"erp": None, "numSolverIterations": 10.0}),
    )
    engine = {"fixedTimeStep": 1 / 240, "erp": 1 / 7}
    return replace(made, engine=engine, versions={"pybullet": "3.2.7"}, changes=changes, residual=False)


def same(x: object, y: object) -> bool:
    """Equal to the last bit, NaN to NaN, through tuples, steps of logs, records and arrays."""
    x, y = (tuple(one) if isinstance(one, LogSteps) else one for one in (x, y))
    if isinstance(x, np.ndarray):
        return isinstance(y, np.ndarray) and x.dtype == y.dtype and x.shape == y.shape and x.tobytes() == y.tobytes()
    if isinstance(x, tuple):
        return isinstance(y, tuple) and len(x) == len(y) and all(same(a, b) for a, b in zip(x, y, strict=True))
    if isinstance(x, Mapping):
        return isinstance(y, Mapping) and same(tuple(x.items()), tuple(y.items()))
    if hasattr(x, "__dataclass_fields__"):
        return type(x) is type(y) and all(same(getattr(x, name), getattr(y, name)) for name in x.__dataclass_fields__)
    if isinstance(x, float):
        return isinstance(y, float) and struct.pack("d", x) == struct.pack("d", y)
    return as_json_text(x) == as_json_text(y) if isinstance(x, str) and isinstance(y, str) else x == y
