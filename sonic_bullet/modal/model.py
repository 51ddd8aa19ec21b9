"""Shapes + material -> ModalModel: fill, assemble, solve, damp, keep the surface.

    K u = λ M u,  UᵀMU = 1,   d = (α + βλ)/2,   f = √(λ − d²)/2π            [Ren, Yeh, Lin 2013, eq. 5-7]

Solved without units: lengths by the body's diagonal L, stiffness by its largest entry C, density by itself; then
λ = λ' C/(ρL²) and u = u'/√(ρL³). Another size, density or damping of the same body is therefore the same problem.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np

from sonic_bullet.errors import MeshError
from sonic_bullet.records import Array, Material, ModalModel, Shape

MOST_MODES = 200


def analyse(
    shapes: tuple[Shape, ...],
    material: Material,
    *,
    to_hz: float = 20_000.0,
    count: int | None = None,
    fixed: tuple[tuple[float, float, float, float], ...] = (),
    thickness_m: float | None = None,
    edge_m: float | None = None,
    cache: Path | Literal["default"] | None = "default",
    progress: Callable[[str], None] | None = None,
) -> ModalModel:
    """Vibration modes of a body up to to_hz, or the lowest ``count``."""
    from sonic_bullet.modal import eigen, fem
    from sonic_bullet.modal.shapes import solid as fill
    from sonic_bullet.modal.solid import Solid, surface

    say = progress or (lambda _: None)
    if any(shape.kind == "plane" for shape in shapes):
        none = np.zeros(0)
        return ModalModel(none, none, np.zeros((0, 3, 0)), np.zeros((0, 3)), np.zeros((0, 3)), none, 0.0, 0.0, note="plane: unbounded, no modes")
    if not shapes:
        raise MeshError("body has no shape", "give it a collision or visual shape, or pass mesh=")
    body = fill(shapes, edge_m, thickness_m, say)
    length_m = float(np.linalg.norm(np.ptp(body.node_m, axis=0)))
    unit = Solid(body.node_m / length_m, body.tet, body.affine)
    pascal = float(np.abs(material.stiffness_pa).max())
    per_s2 = pascal / (material.density_kg_m3 * length_m**2)
    volume = fem.volume_m3(unit)
    skin = surface(unit)
    say(f"assembling {3 * len(unit.node_m)} unknowns")
    stiffness, mass = fem.assemble(unit, material.stiffness_pa / pascal, 1.0)
    limit = (2 * np.pi * to_hz) ** 2 / per_s2
    area = 1.0
    shift = -5 * (2 * volume / area) ** 2
    if count is None:
        modes = eigen.solve(stiffness, mass, shift, 6, lambda value: bool(value[-1] > limit), MOST_MODES)
        keep = modes.lambda_per_s2 <= limit
    else:
        modes = eigen.solve(stiffness, mass, shift, 6, lambda value: len(value) >= count, count)
        keep = np.arange(len(modes.lambda_per_s2)) < count
    lam = modes.lambda_per_s2[keep] * per_s2
    vector = modes.vector[:, keep].reshape(len(unit.node_m), 3, -1)[skin.node] / np.sqrt(material.density_kg_m3 * length_m**3)
    freq, decay, alive = damped(lam, material)
    return ModalModel(
        freq_hz=freq,
        decay_per_s=decay,
        shape=vector[:, :, alive].astype(np.float32),
        vertex_m=body.node_m[skin.node],
        face=skin.face,
        curvature_per_m=np.zeros(len(skin.face)),
        volume_m3=volume * length_m**3,
        mass_kg=volume * length_m**3 * material.density_kg_m3,
        dropped=int((~alive).sum()),
        note=body.note,
    )


def damped(lambda_per_s2: Array, material: Material) -> tuple[Array, Array, Array]:
    """Frequencies and decays of the modes that oscillate, and which (m,) do [Ren et al. 2013, eq. 7]."""
    if material.alpha_per_s is None or material.beta_s is None:
        return np.sqrt(lambda_per_s2) / (2 * np.pi), np.full(len(lambda_per_s2), np.nan), np.ones(len(lambda_per_s2), bool)
    decay = (material.alpha_per_s + material.beta_s * lambda_per_s2) / 2
    alive = decay**2 < lambda_per_s2
    freq = np.sqrt(lambda_per_s2[alive] - decay[alive] ** 2) / (2 * np.pi)
    order = np.argsort(freq, kind="stable")
    index = np.flatnonzero(alive)[order]
    return freq[order], decay[index], alive
