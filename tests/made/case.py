"""Cases with known answers: a box of our own choice, struck and heard in closed form, without air, written as anyone
would record it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import soundfile

from sonic_bullet import modal
from sonic_bullet.records import Array, Material, ModalModel

SR = 44_100
CORNER = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
FACE = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
)


@dataclass(frozen=True)
class Planted:
    """What a case was made of."""

    material: Material
    model: ModalModel
    gain: float
    noise: float
    folder: Path


def write_box(path: Path, size_m: tuple[float, float, float]) -> None:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in (CORNER - 0.5) * size_m] + [
        f"f {a} {b} {c}" for a, b, c in FACE + 1
    ]
    path.write_text("\n".join(lines) + "\n")


def sound(
    model: ModalModel,
    decay: Array,
    points: tuple[int, int],
    directions: tuple[Array, Array],
    impulse: float,
    n: int,
    sr: int = SR,
) -> Array:
    """gain 1 · J (φ(p)·e)(φ(q)·n) e^{−dt}(cos ωt − (d/ω) sin ωt)."""
    psi = (
        (directions[0] @ model.shape[points[0]].astype(float))
        * (directions[1] @ model.shape[points[1]].astype(float))
        * impulse
    )
    t = np.arange(n) / sr
    omega = 2 * np.pi * model.freq_hz
    made = np.zeros(n)
    for a, w, d in zip(psi, omega, decay, strict=True):
        made += a * np.exp(-d * t) * (np.cos(w * t) - d / w * np.sin(w * t))
    return made


def make(
    folder: Path,
    material: Material,
    size_m: tuple[float, float, float] = (0.14, 0.03, 0.005),
    *,
    guess: tuple[float, float, float],
    strikes: int = 4,
    seconds: float = 0.8,
    noise: float = 3e-5,
    decay: Array | None = None,
    fixed: tuple[tuple[float, float, float, float], ...] = (),
    edge_m: float | None = None,
    to_hz: float = 18_000,
    seed: int = 3,
    **changes: Any,
) -> Planted:
    """A case of one box; guess: (E, density, ν). The last strike is held out. edge_m: of the mesh the truth is made
    with.
    """
    rng = np.random.default_rng(seed)
    write_box(folder / "box.obj", size_m)
    model = modal.analyse((modal.read_mesh(folder / "box.obj"),), material, to_hz=to_hz, fixed=fixed, edge_m=edge_m)
    decay = model.decay_per_s if decay is None else decay
    top = np.flatnonzero(model.vertex_m[:, 2] > size_m[2] / 2 - 1e-9)
    end = int(top[np.argmax(model.vertex_m[top] @ (1.0, 0.7, 0))])
    up, down = np.array([0, 0, 1.0]), np.array([0, 0, -1.0])
    selected = rng.choice(top, strikes, replace=False)
    impulses = rng.uniform(0.005, 0.03, strikes)
    sounds = [
        sound(model, decay, (int(p), end), (down, up), float(j), int(seconds * SR))
        for p, j in zip(selected, impulses, strict=True)
    ]
    gain = 0.3 / max(np.abs(s).max() for s in sounds)
    entries = []
    for i, (p, j, s) in enumerate(zip(selected, impulses, sounds, strict=True)):
        soundfile.write(folder / f"s{i}.wav", gain * s + noise * rng.standard_normal(len(s)), SR, subtype="FLOAT")
        strike = {"position": [float(x) for x in model.vertex_m[p]], "direction": [0, 0, -1], "impulse": float(j)}
        entries.append(
            {
                "file": f"s{i}.wav",
                "object": "box",
                "split": "holdout" if i == strikes - 1 and strikes > 1 else "fit",
                "strike": strike,
            }
        )
    case = {
        "format": "sonic-bullet-case/1",
        "objects": {
            "box": {
                "mesh": "box.obj",
                "material": "brass",
                "elastic_guess": dict(zip(("youngs_modulus", "density", "poisson_ratio"), guess, strict=True)),
            }
        },
        "medium": "none",
        "support": {"fixed": [{"position": list(f[:3]), "radius": f[3]} for f in fixed]},
        "sensor": {
            "response": "gain * normal surface velocity",
            "position": {"box": [float(x) for x in model.vertex_m[end]]},
            "direction": {"box": [0, 0, 1]},
        },
        "band_hz": [20, 18000],
        "onset": "the impulse arrives at sample 0 of every file",
        "recordings": entries,
    } | changes
    (folder / "case.json").write_text(json.dumps(case))
    return Planted(material, model, float(gain), noise, folder)
