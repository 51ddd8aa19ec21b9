"""Rigid motions of a jointed body, mass-normalised, whatever simulator it comes from.

    poses, masses, inertias, joints -> Jacobians J (l, 6, d) -> M = Σ Jᵀ diag(m, I) J -> K x = ω² M x -> Ψ = J X

Joints are held by nothing at audio rate, unless a spring k (1 + iη) is given: a motor's controller is too slow, and
friction and gravity are no impact. Its loss damps each motion by d = ω/2 · Σ η k q²/Σ k q², q its joints' part. The
impulse (j, r × j) on link l moves link s by Ψ_s Ψ_lᵀ, that is J_s M⁻¹ J_lᵀ [Khatib 1987, eq. 51: its inverse is the
effective mass]. d motions, l links.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class JointedBody:
    """Links and joints of a body at one instant, world frame.

    Parameters
    ----------
    position_m, rotation, mass_kg, inertia_kg_m2 : Array, shapes (l, 3), (l, 3, 3), (l,), (l, 3)
        Of the links, base first; rotation from the link's principal frame into the world.
    moves : Array of bool, shape (d, l)
        The links that a joint's motion moves.
    axis, origin_m : Array, shape (d, 3)
        Of the joints.
    turns : Array of bool, shape (d,)
        True: about the axis; False: along it.
    free : bool
        Whether the base moves.
    stiffness, loss_factor : Array, shape (d,)
        k of the joints, N·m/rad or N/m, 0: none; η.
    """

    position_m: Array
    rotation: Array
    mass_kg: Array
    inertia_kg_m2: Array
    moves: Array
    axis: Array
    origin_m: Array
    turns: Array
    free: bool
    stiffness: Array
    loss_factor: Array


def jacobians(body: JointedBody) -> Array:
    """Compute velocity and spin (l, 6, d) of the links in their own frames, per unit speed of joints and free base."""
    arm = body.position_m[:, None] - body.origin_m
    turning = body.turns[None, :, None]
    speed = np.where(turning, np.cross(body.axis, arm), body.axis)
    spin = np.where(turning, body.axis, 0.0) * np.ones_like(speed)
    moved = body.moves.T[:, :, None]
    parts = [np.where(moved, speed, 0.0), np.where(moved, spin, 0.0)]
    if body.free:  # translation and rotation of all about the base
        axes, from_base = np.eye(3), body.position_m - body.position_m[0]
        still = np.zeros((len(from_base), 3, 3))
        turned = np.cross(axes, from_base[:, None])
        parts = [
            np.concatenate([parts[0], still + axes, turned], axis=1),
            np.concatenate([parts[1], still, still + axes], axis=1),
        ]
    return np.concatenate([np.einsum("lax,lda->lxd", body.rotation, part) for part in parts], axis=1)


def rigid_modes(body: JointedBody) -> tuple[Array, Array, Array]:
    """Compute Ψ (d, l, 6) in 1/√kg and 1/(√kg·m), link frames, rates (d,) in rad/s and decays (d,) in 1/s.

    Both are 0 of motions that are free. A motion's sign is that of its largest number.
    """
    j = jacobians(body)
    weight = np.concatenate([np.repeat(body.mass_kg[:, None], 3, axis=1), body.inertia_kg_m2], axis=1)
    mass = np.einsum("lxd,lx,lxe->de", j, weight, j)
    size, axes = np.linalg.eigh(mass)
    # fraction of the largest eigenvalue of M below which a motion moves no mass, as of a point mass that turns
    least_mass = 1e-12
    axes, size = axes[:, size > least_mass * size.max(initial=0.0)], size[size > least_mass * size.max(initial=0.0)]
    whitened = axes / np.sqrt(size)
    stiffness = np.zeros(mass.shape[0])
    stiffness[: len(body.stiffness)] = body.stiffness
    square, turned = np.linalg.eigh(whitened.T @ (stiffness[:, None] * whitened))
    rate = np.sqrt(np.maximum(square, 0.0))
    rate[square <= least_mass * square.max(initial=0.0)] = 0.0
    lost = np.zeros(mass.shape[0])
    lost[: len(body.stiffness)] = body.stiffness * body.loss_factor
    joints = whitened @ turned
    decay = np.where(rate > 0, (lost @ joints**2) / (2 * np.where(rate > 0, rate, 1.0)), 0.0)
    shape = np.einsum("lxd,de->elx", j, joints)
    flat = shape.reshape(len(shape), -1)
    largest = np.take_along_axis(flat, np.abs(flat).argmax(axis=1)[:, None], axis=1)[:, :, None]
    return np.where(largest < 0, -shape, shape), rate, decay
