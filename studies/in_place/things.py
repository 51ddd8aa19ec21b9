"""Bodies that stand on a board, as the run time has them: modes from geometry and material, decays with the air's.

    Shape + material -> analyse -> build_resonator -> Thing: BodyMobility, and BodyPoint where it is touched
    Thing, springs at its points -> stand -> Stands: first order, as it runs, beside Newton's pole and the eigenproblem

Axes of all bodies are those of the board: z up, the normal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import cast

import numpy as np

from sonic_bullet.engine.bank.resonator import Resonator, build_resonator
from sonic_bullet.engine.contact.coupling import (
    BodyMobility,
    BodyPoint,
    ContactPoint,
    ContactSpring,
    CoupledModes,
    first_order,
)
from sonic_bullet.files.presets import load_material
from sonic_bullet.geometry.nearest_point import nearest
from sonic_bullet.modal import analyse, read_mesh
from sonic_bullet.records import Air, Array, Body, Material, ModalModel, Shape
from studies.thin_walls.blocks import cartesian, welded
from tests.made.newton import newton_modes

AXES = np.eye(3)[[2, 0, 1]]
SR = 48_000
MINDLIN = 2 * (1 - 0.3) / (2 - 0.3)
"""Tangential over normal stiffness [Johnson 1985, eq. 7.42] at ν 0.3."""


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """A body that sounds; centre_m (3,): of its mass, in the frame of its shape."""

    resonator: Resonator
    model: ModalModel
    centre_m: Array
    mobility: BodyMobility

    def place(self, point_m: Array) -> BodyPoint:
        """Where it is touched: at the point of its surface nearest to this one."""
        index = self.resonator.index
        assert index is not None
        face, weight, _ = nearest(index, np.asarray(point_m, float)[None])
        corner = self.model.face[face[0]]
        at = weight[0] @ self.model.vertex_m[corner]
        return BodyPoint(
            np.einsum("c,cxm->xm", weight[0], self.resonator.shape[corner].astype(float)), at - self.centre_m, AXES
        )

    @property
    def hz(self) -> Array:
        return np.asarray(self.mobility.omega_rad_s / 2 / np.pi)


def thing(shape: Shape, material: Material, *, stands: bool = False, to_hz: float = 20_000.0) -> Thing:
    """A body in the air, or one that does not move as a whole (stands) and is placed."""
    import trimesh

    model = analyse((shape,), material, to_hz=to_hz)
    mesh = trimesh.Trimesh(model.vertex_m, model.face, process=False)
    mass = 0.0 if stands else model.mass_kg
    inertia = np.zeros((3, 3)) if stands else mesh.moment_inertia * material.density_kg_m3
    body = Body(
        0, -1, 0, material.name, mass, inertia, volume_m3=model.volume_m3, material=material, model=model,
        mounting="placed" if stands else "free",
    )  # fmt: skip
    made = build_resonator(body, (), SR, Air())
    return Thing(made, model, np.asarray(mesh.center_mass), made.mobility)


def asset(name: str, material: Material, *, upside_down: bool = False) -> Thing:
    from pathlib import Path

    shape = read_mesh(Path(__file__).resolve().parents[2] / "assets" / f"{name}.obj")
    if upside_down:
        shape = replace(shape, vertex_m=np.asarray(shape.vertex_m) * [1, -1, -1])
    return thing(shape, material)


def lossless(name: str) -> Material:
    """A preset that takes nothing of its modes: what is left is the air's."""
    return replace(load_material(name), alpha_per_s=0.0, beta_s=0.0)


def with_loss(one: Thing, loss: float) -> Thing:
    """η ω/2 more of each mode."""
    decay = one.mobility.decay_per_s + loss * one.mobility.omega_rad_s / 2
    return replace(one, mobility=replace(one.mobility, decay_per_s=decay))


def with_plate(one: Thing, mobility_m_n_s: float) -> Thing:
    """A board that yields as a wide plate, and not as its modes."""
    return replace(one, mobility=replace(one.mobility, plate_m_n_s=mobility_m_n_s))


@cache
def board(material: str = "wood", thickness_m: float = 0.024) -> Thing:
    return thing(Shape("box", np.array([0.9, 0.6, thickness_m])), load_material(material), stands=True, to_hz=16_000.0)


@cache
def rod() -> Thing:
    """Steel, ⌀ 12 × 160 mm, along x."""
    lies = np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    return thing(Shape("cylinder", np.array([0.006, 0.16, 0.0]), quaternion_xyzw=lies), load_material("steel"))


@cache
def bar() -> Thing:
    """Steel, 300 × 30 × 6 mm."""
    return thing(Shape("box", np.array([0.3, 0.03, 0.006])), load_material("steel"))


TINE_M, GAP_M, STEM_M, WIDE_M, THICK_M = 0.105, 0.010, 0.040, 0.006, 0.008


@cache
def fork(yoke_m: float) -> Thing:
    """Steel, one outline of 8 mm: two tines of 6 mm, their yoke, whose height says how much the foot moves, a stem
    whose foot is at z = 0.
    """
    half, stem = GAP_M / 2 + WIDE_M, WIDE_M / 2
    x = [-half, -GAP_M / 2, -stem, stem, GAP_M / 2, half]
    z = [0, STEM_M, STEM_M + yoke_m, STEM_M + yoke_m + TINE_M]

    def keep(x: float, y: float, z: float) -> bool:
        if z < STEM_M:
            return abs(x) < stem
        return z < STEM_M + yoke_m or abs(x) > GAP_M / 2

    made = welded(cartesian(x, [0, THICK_M], z, [1] * 5, [1], [1, 1, 1], keep))
    shape = Shape("mesh", vertex_m=made.node_m[made.skin], face=made.face.astype(np.int32))
    return thing(shape, load_material("steel"))


def spring(normal_n_m: float, loss: float) -> ContactSpring:
    stiff = normal_n_m * (1 + 1j * loss)
    return ContactSpring(stiff, MINDLIN * stiff)


@dataclass(frozen=True, slots=True, eq=False)
class Stands:
    """A thing at its touches: as it runs, Newton's poles, and the eigenproblem of all: s (k,), q (N + P, k)."""

    thing: Thing
    board: Thing
    runs: CoupledModes
    newton: CoupledModes
    s: Array
    q: Array

    def kept(self, how: CoupledModes) -> Array:
        """(m,) T60 here over T60 free."""
        return np.asarray(self.thing.mobility.decay_per_s / np.maximum(how.decay_per_s, 1e-12))

    def t60_s(self, how: CoupledModes) -> Array:
        return np.asarray(np.log(1000) / np.maximum(how.decay_per_s, 1e-12))

    def off(self, how: CoupledModes) -> Array:
        """(m,) distance of each pole that stands from the nearest exact one, over |s|; NaN where it does not stand."""
        s = -how.decay_per_s + 1j * how.omega_rad_s
        near = np.abs(s[:, None] - self.s).min(axis=1) / np.abs(s)
        return np.where(how.newton, near, np.nan)


def stand(
    one: Thing,
    on: Thing,
    points_m: Array,
    springs: list[ContactSpring],
    at_m: tuple[float, float],
    *,
    eigen: bool = True,
) -> Stands:
    """A thing whose points (c, 3) touch a board's top, its own origin above (x, y) of the board. eigen: with the
    eigenproblem, which knows no wide plate.
    """
    top = float(on.model.vertex_m[:, 2].max())
    touches = [
        ContactPoint(0, one.place(p), on.place(np.array([p[0] + at_m[0], p[1] + at_m[1], top])), k)
        for p, k in zip(points_m, springs, strict=True)
    ]
    if on.mobility.plate_m_n_s:  # and nothing else is known of it
        still = replace(on.mobility, omega_rad_s=np.zeros(0), decay_per_s=np.zeros(0))
        touches = [replace(t, other=replace(t.other, shape=np.zeros((3, 0)))) for t in touches]
        on = replace(on, mobility=still)
    parts = one.mobility, [on.mobility], touches
    s, q = eigenproblem(*parts) if eigen else (np.zeros(0), np.zeros((0, 0)))
    return Stands(one, on, first_order(*parts), newton_modes(*parts), s, q)


def eigenproblem(body: BodyMobility, partners: list[BodyMobility], touches: list[ContactPoint]) -> tuple[Array, Array]:
    """S and q of q̈ + 2Dq̇ + (Λ + BᵀKB)q = 0 of all bodies at once, their rigid motions among them, B = (Φ, −Φ_p)."""
    (partner,) = partners
    both = np.hstack([body.moves([t.own for t in touches]), -partner.moves([t.other for t in touches])])
    stiff = np.concatenate([[t.spring.normal_n_m, *2 * [t.spring.tangential_n_m]] for t in touches])
    lam, decay = np.append(body.lam, partner.lam), np.append(body.decay, partner.decay)
    moves = np.concatenate(
        [np.append(np.ones(len(one.omega_rad_s)), np.full(6, one.mass_kg > 0)) for one in (body, partner)]
    )
    some = np.flatnonzero(moves)
    both, lam, decay = both[:, some], lam[some], decay[some]
    n, scale = len(lam), np.sqrt(lam.max())
    state = np.zeros((2 * n, 2 * n), complex)
    state[:n, n:] = scale * np.eye(n)
    state[n:, :n] = -(np.diag(lam) + both.T @ (stiff[:, None] * both)) / scale
    state[n:, n:] = -2 * np.diag(decay)
    s, vector = np.linalg.eig(state)
    swings = s.imag > 1e-6 * scale
    q = np.zeros((len(moves), int(swings.sum())), complex)
    q[some] = vector[:n, swings]
    return cast(Array, s[swings]), q
