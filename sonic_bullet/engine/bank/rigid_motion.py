"""Rigid motion of the surfaces that sensors touch, from the same pulses as the modes.

    pulses, friction of a body -> Σ (j, r × j), body frame, as six further modes of the bank, silent by themselves (V)
    Body: 1/m and I⁻¹, or Step.motions of a jointed one: Ψ_s Ψ_lᵀ       -> gain (6,) of each body at each sensor
    motions that joint springs hold: Ψ_lᵀ V through s²/(s² + 2ds + ω²)  -> the same, one by one
    n·v of the modes, by body  + gain · V                                -> what the sensor reads

The six are plane functions of the place, which linear triangles hold exactly: e_i and e_i × r. A free body that a pulse
has struck moves on for ever, and what brings it back is no pulse: gravity, a motor, a hand. So each of the six is a
body on a soft suspension, d = ω = √2π·LOWEST_HZ: a Butterworth high-pass of the second order, 3 dB down at LOWEST_HZ,
0.1 dB at twice and a half of it. Steps' own slow motion, below that, is not read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sonic_bullet.engine.bank import ModeSet
from sonic_bullet.records import Array, Body, Sensor, Vibrometer
from sonic_bullet.records.step_tables import StepTables
from sonic_bullet.signal.elementary import cos, matrix_product, sin, symmetric_eigenpairs

RIGID_MOTIONS = 6
LOWEST_HZ = 8.0
"""Below hearing, and below what the steady forces of a simulation are made of: a step of 1/240 s, a motor, a fall."""


def surface_sensors(sensors: Sequence[Sensor]) -> tuple[Vibrometer, ...]:
    """Return the sensors that read a surface's motion."""
    return tuple(one for one in sensors if isinstance(one, Vibrometer))


def rigid_rows(sensors: Sequence[Sensor]) -> int:
    """Return the number of weight sets that read V: six, or none where no sensor is on a surface."""
    return RIGID_MOTIONS if surface_sensors(sensors) else 0


def rigid_columns(body: Body, sensors: Sequence[Sensor]) -> int:
    """Return how many rigid motions of a body are played: six where a sensor is on it, or on a link joined to it."""
    felt = any(one.body_id == body.body_id for one in surface_sensors(sensors))
    clamped = body.options is not None and len(body.options.fixed) > 0
    return RIGID_MOTIONS if felt and body.mass_kg > 0 and not clamped else 0


def rigid_shape(vertex_m: Array) -> Array:
    """Return e_i and e_i × r at the vertices: (v, 3, 6) float32."""
    axes = np.broadcast_to(np.eye(3), (len(vertex_m), 3, 3))
    turns = np.cross(np.eye(3)[None], vertex_m[:, None])  # (v, i, x)
    return np.concatenate([axes, turns.transpose(0, 2, 1)], axis=2).astype(np.float32)


def with_rigid(modes: ModeSet, columns: int, gain: float) -> ModeSet:
    """Append a body's six rigid motions to its modes; gain: of its sound at sensors."""
    if not columns:
        return modes
    sets, rate = len(modes.weight), np.full(RIGID_MOTIONS, np.sqrt(2) * np.pi * LOWEST_HZ)
    weight = np.zeros((sets, RIGID_MOTIONS), complex)
    weight[sets - RIGID_MOTIONS :] = gain * np.eye(RIGID_MOTIONS)
    bend, growth = (
        None if law is None else np.concatenate([law, np.zeros(RIGID_MOTIONS)])
        for law in (modes.bend, modes.damping_growth)
    )
    return replace(
        modes,
        omega_rad_s=np.concatenate([modes.omega_rad_s, rate]),
        decay_per_s=np.concatenate([modes.decay_per_s, rate]),
        weight=np.concatenate([modes.weight, weight], axis=1),
        bend=bend,
        damping_growth=growth,
    )


def free_motion(body: Body) -> Array:
    """Return Ψ (6, 6) of a body that nothing is joined to: ΨᵀΨ = 1/m and I⁻¹."""
    motion = np.zeros((RIGID_MOTIONS, RIGID_MOTIONS))
    if body.mass_kg <= 0:
        return motion
    motion[:3, :3] = np.eye(3) / np.sqrt(body.mass_kg)
    moment, axes = symmetric_eigenpairs(body.inertia_kg_m2)
    turns = moment > 1e-12 * moment.max(initial=0.0)  # point masses do not turn
    motion[3:, 3:] = np.where(turns, 1 / np.sqrt(np.where(turns, moment, 1.0)), 0.0)[:, None] * axes.T
    return motion


def until_motions(steps: StepTables) -> int:
    """Count the steps up to the next one, after the first, from which jointed links move otherwise."""
    return next((i for i, one in enumerate(steps.motions) if i and len(one)), len(steps))


def enter_mobility(rows: Array, number: Array, motions: Array) -> None:
    """Enter ΨᵀΨ of links that are known to be joined into rows of BODY; number (b,): of these in the log."""
    for body in np.unique(motions["body"]).tolist() if len(motions) else ():
        row = rows[np.searchsorted(number, body)]
        shape = motions["shape"][motions["body"] == body]
        row["jointed"], row["mobility"] = 1, matrix_product(shape.T, shape)


def swing_taps(rate_rad_s: float, decay_per_s: float, sr: int) -> Array:
    """Return b0, b1, b2, a1, a2 of s²/(s² + 2ds + ω²) at a rate in Hz: a motion that springs hold, of a free one.

    By the bilinear transform, at ω itself without its warp [Oppenheim, Schafer 2010, sec. 7.3].
    """
    turn = min(rate_rad_s / sr, 3.0)
    wide = float(sin(turn)) * decay_per_s / rate_rad_s
    high = (1 + float(cos(turn))) / 2
    return np.asarray(np.array([high, -2 * high, high, -2 * float(cos(turn)), 1 - wide]) / (1 + wide))


def sensor_reading(sensor: Vibrometer, bodies: Sequence[Body], jointed: Sequence[Array | None], motion: int) -> float:
    """Return what a sensor reads of a motion's speed of 1; jointed: LINK_MOTION (d,) of the body's links, else None."""
    reads = np.concatenate([sensor.direction, np.cross(sensor.point_m, sensor.direction)])
    for body, rows in zip(bodies, jointed, strict=True):
        if rows is not None and (body.body_id, body.link) == (sensor.body_id, sensor.link):
            return float((rows["shape"][motion] * reads).sum())
    return 0.0


def sensor_gains(sensor: Vibrometer, bodies: Sequence[Body], jointed: Sequence[Array | None]) -> Array:
    """Compute gains (b, 6) of V of each body at a sensor, in m/s per N·s and N·m·s.

    jointed: Ψ (d, 6) of bodies whose links are known to be joined, None of the others.
    """
    gains = np.zeros((len(bodies), RIGID_MOTIONS))
    reads = np.concatenate([sensor.direction, np.cross(sensor.point_m, sensor.direction)])
    for own, body in enumerate(bodies):
        if (body.body_id, body.link) != (sensor.body_id, sensor.link):
            continue
        here = jointed[own]
        if here is None:
            motion = free_motion(body)
            gains[own] += (motion.T * (motion * reads).sum(axis=1)).sum(axis=1)
            continue
        for b, there in enumerate(jointed):
            if there is not None and (bodies[b].body_id, bodies[b].epoch) == (body.body_id, body.epoch):
                gains[b] += (there.T * (here * reads).sum(axis=1)).sum(axis=1)
    return gains
