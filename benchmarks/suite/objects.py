"""What is struck: ten bodies laid out as bent grids, seven materials, and their modes, solved once and kept.

    Recipe (grid of bricks, a place for each of its points) + Material (as it is) -> Modes
    γ = E/ρ scales λ, ρ scales shapes by ρ^{−1/2}, size s: λ s^{−2}, shapes s^{−3/2}
        [physics of linear elasticity; exact]

so one solve a recipe, ν and mesh serves every E, ρ and size. A case's guess is not what the object is made of. Of
cells there are so many that a third more along each axis move no mode below 20 kHz by 0.2 % (tests/suite).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.suite.bricks import Bricks, Modes, grid, isotropic, modes
from sonic_bullet.records import Array

SPARE = 1.1  # modes are kept up to 20 kHz × SPARE, for what is softer than guessed


@dataclass(frozen=True, slots=True)
class Material:
    """E in Pa, ρ in kg/m³, ν, and Rayleigh's α in 1/s, β in s."""

    name: str
    youngs_pa: float
    density: float
    poisson: float
    alpha: float
    beta: float


MATERIALS = {
    m.name: m
    for m in (
        Material("steel", 200e9, 7850, 0.28, 1.5, 1.2e-8),
        Material("glass", 70e9, 2500, 0.24, 6, 8e-8),
        Material("aluminium", 70e9, 2700, 0.345, 2.5, 2.5e-8),
        Material("porcelain", 65e9, 2400, 0.22, 14, 1e-7),
        Material("brass", 105e9, 8500, 0.34, 2, 3e-8),
        Material("wood", 11e9, 650, 0.35, 25, 8e-7),
        Material("plastic", 3e9, 1200, 0.37, 30, 1e-6),
    )
}


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """A body by name: cells of its grid, place of the grid's points (0..1 along each axis) in m, what it is made of.

    closed: the first axis runs round.
    """

    name: str
    material: str
    cells: tuple[int, int, int]
    place: Callable[[Array], Array]
    closed: bool = False
    keep: Callable[[Array], Array] | None = None
    other: str = ""  # another body of the same material; "" where a scaled copy serves


def _box(length: float, width: float, height: float) -> Callable[[Array], Array]:
    return lambda u: (u - 0.5) * np.array([length, width, height])


def _tapered(u: Array) -> Array:
    x = (u - 0.5) * np.array([0.16, 0.03, 0.008])
    return np.stack([x[:, 0], x[:, 1] * (1.2 - 0.6 * u[:, 0]), x[:, 2] * (1.4 - 0.8 * u[:, 0])], axis=1)


def _slab(u: Array) -> Array:
    x = (u - 0.5) * np.array([0.14, 0.1, 0.008])
    bump = 1 + 0.08 * np.sin(7 * u[:, 0] + 1) * np.cos(5 * u[:, 1])
    return np.stack(
        [x[:, 0] + 0.15 * x[:, 1], x[:, 1] + 0.06 * x[:, 0], x[:, 2] * bump + 0.002 * (u[:, 0] - 0.5) ** 2], axis=1
    )


def _revolved(profile: Array, thickness: float) -> Callable[[Array], Array]:
    """Round z: the first axis is azimuth, the second runs along profile (k, 2) of (r, z), the third across the wall."""
    step = np.linalg.norm(np.diff(profile, axis=0), axis=1)
    way = np.concatenate([[0], np.cumsum(step)]) / step.sum()
    tangent = np.gradient(profile, way, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1) / np.linalg.norm(tangent, axis=1)[:, None]

    def place(u: Array) -> Array:
        r, z, nr, nz = (np.interp(u[:, 1], way, c) for c in (*profile.T, *normal.T))
        off = (u[:, 2] - 0.5) * thickness
        r, z = r + nr * off, z + nz * off
        angle = 2 * np.pi * u[:, 0]
        return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)

    return place


def _arc(radius: float, first: float, last: float, squash: float = 1.0) -> Array:
    angle = np.linspace(first, last, 60)
    return np.stack([radius * np.sin(angle), -squash * radius * np.cos(angle)], axis=1)


def _cup() -> Array:
    floor = np.stack([np.linspace(0.008, 0.024, 20), np.zeros(20)], axis=1)
    turn = np.linspace(-np.pi / 2, 0, 20)[1:]
    corner = np.stack([0.024 + 0.012 * np.cos(turn), 0.012 + 0.012 * np.sin(turn)], axis=1)
    wall = np.stack([np.linspace(0.036, 0.042, 30)[1:], np.linspace(0.012, 0.08, 30)[1:]], axis=1)
    return np.concatenate([floor, corner, wall])


RECIPES = {
    r.name: r
    for r in (
        Recipe("bar_steel_170", "steel", (39, 6, 2), _box(0.17, 0.024, 0.007), other="bar_steel_120"),
        Recipe("bar_steel_120", "steel", (30, 6, 2), _box(0.12, 0.024, 0.007)),
        Recipe("plate_glass", "glass", (24, 18, 2), _box(0.18, 0.13, 0.006)),
        Recipe("plate_alu", "aluminium", (36, 15, 2), _box(0.26, 0.11, 0.004), other="square_alu"),
        Recipe("square_alu", "aluminium", (21, 21, 2), _box(0.15, 0.15, 0.005)),
        Recipe("slab_porcelain", "porcelain", (22, 16, 2), _slab),
        Recipe("bowl_porcelain", "porcelain", (48, 16, 2), _revolved(_arc(0.07, 0.15, 1.4, 0.8), 0.005), closed=True),
        Recipe("cup_glass", "glass", (45, 21, 2), _revolved(_cup(), 0.0045), closed=True),
        Recipe("ring_brass", "brass", (48, 6, 2), _revolved(np.array([[0.02, 0.0], [0.065, 0.0]]), 0.006), closed=True),
        Recipe(
            "tube_alu",
            "aluminium",
            (36, 21, 2),
            _revolved(np.array([[0.018, -0.07], [0.018, 0.07]]), 0.0025),
            closed=True,
        ),
        Recipe("tapered_steel", "steel", (33, 6, 2), _tapered),
        Recipe("plank_wood", "wood", (33, 10, 2), _box(0.24, 0.07, 0.012)),
        Recipe(
            "angle_plastic",
            "plastic",
            (21, 15, 2),
            _box(0.14, 0.1, 0.012),
            keep=lambda c: (c[:, 0] < 0.35) | (c[:, 1] < 0.4),
        ),
    )
}


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One object of a case: name, modes as it is, scale of its recipe."""

    name: str
    modes: Modes
    normal: Array  # (v, 3) outward, area-weighted


def laid(recipe: Recipe, fineness: float = 1.0) -> Bricks:
    """The recipe's grid, its cells along the two long axes multiplied."""
    a, b, c = recipe.cells
    return grid(
        (max(4, round(a * fineness)), max(3, round(b * fineness)), c),
        recipe.place,
        closed=recipe.closed,
        keep=recipe.keep,
    )


def solved(
    recipe: Recipe,
    poisson: float,
    folder: Path,
    *,
    fineness: float = 1.0,
    tensor: Array | None = None,
    softer: Callable[[Array], Array] | None = None,
    load: dict[int, float] | None = None,
    tag: str = "",
) -> Modes:
    """Modes at E = 1 Pa (tensor (6, 6) in units of E where given), ρ = 1 kg/m³, kept in folder. load: vertex -> mass in
    units of the body's own.

    tag: names ``tensor``, ``softer`` and ``load`` among the kept files.
    """
    name = hashlib.sha256(f"2 {recipe.name} {recipe.cells} {poisson:.4f} {fineness} {tag}".encode()).hexdigest()[:16]
    path = folder / f"{recipe.name}-{name}.npz"
    body = laid(recipe, fineness)
    if path.exists():
        with np.load(path) as kept:
            return Modes(
                kept["value"],
                kept["shape"].astype(float),
                kept["rigid"],
                body.node_m[body.skin],
                body.face,
                float(kept["mass"]),
            )
    made = MATERIALS[recipe.material]
    speed2 = made.youngs_pa / made.density
    stiffness = isotropic(1.0, poisson) if tensor is None else tensor
    mass = _volume(body)
    found = modes(
        body,
        stiffness,
        1.0,
        to_hz=20_000 * SPARE / np.sqrt(speed2),
        softer=softer(body.centre) if softer else None,
        load_kg={v: part * mass for v, part in (load or {}).items()},
    )
    folder.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.tmp.npz")
    np.savez(partial, value=found.value, shape=found.shape.astype(np.float32), rigid=found.rigid, mass=found.mass_kg)
    os.replace(partial, path)
    return replace(found, shape=found.shape.astype(np.float32).astype(float))


def _volume(body: Bricks) -> float:
    a, b, c = (body.node_m[body.skin][body.face][:, k] for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def as_made(unit: Modes, material: Material, scale: float = 1.0) -> Modes:
    """Unit modes at the E, ρ of a material and the size of a scaled copy, those below 20 kHz."""
    value = unit.value * material.youngs_pa / material.density / scale**2
    keep = value < (2 * np.pi * 20_000) ** 2
    root = 1 / np.sqrt(material.density * scale**3)
    return Modes(
        value[keep],
        unit.shape[:, :, keep] * root,
        unit.rigid * root,
        unit.vertex_m * scale,
        unit.face,
        unit.mass_kg * material.density * scale**3,
    )


def body(name: str, modes_: Modes) -> Body:
    """A body with its vertex normals."""
    corner = modes_.vertex_m[modes_.face]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.zeros_like(modes_.vertex_m)
    for k in range(3):
        np.add.at(normal, modes_.face[:, k], area)
    length = np.linalg.norm(normal, axis=1)
    return Body(name, modes_, normal / np.where(length > 0, length, np.nan)[:, None])


def write_obj(path: Path, body_: Body, per_unit: float = 1.0) -> None:
    """The surface as OBJ, its coordinates divided by per_unit."""
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in body_.modes.vertex_m / per_unit]
    lines += [f"f {a} {b} {c}" for a, b, c in body_.modes.face + 1]
    path.write_text("\n".join(lines) + "\n")
