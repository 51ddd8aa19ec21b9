"""Strikes of one physics step, from contact rows to force pulses on modes.

    Split (synth.strikes) + rows of the step and the next ones -> ForcePulse: time, length, impulse, Uᵀf on either body

One `Impact` is one pulse: rows of up to three steps, several points each, share its time history, so that the
manifold's sum and moment, which are all that is reliable, are kept: Uᵀf is summed over the rows, each at its own point
with its own direction, friction included.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.records import Array, Body
from sonic_bullet.records.contacts import Step
from sonic_bullet.render.manifold import STEEPEST, Rows, group_sum, modal_pushes, touches
from sonic_bullet.render.resonator import Resonator
from sonic_bullet.render.rotation import matrix
from sonic_bullet.synth.pulse import compliant_share, contact_modulus_pa, contact_time_s, effective_mass_kg
from sonic_bullet.synth.strikes import Split, accepted_impulse, causing_approach_m_s, key_bodies, unheld_steps

STRUCK_FLAT = 0.02
"""Radius, as a share of the smaller body's size, of the least area that a nearly flat impact touches."""
FLAT_CURVATURE = 0.1
"""Curvature times size below which a contact is flat: a cap of ten times the body's size."""
LEAST_JUMP_M_S = 1e-6
"""An impact that changes the speed of its effective mass by less is passed over: a body of 10 cm sends 0 dB SPL to 1 m
then.
"""


@dataclass(frozen=True, slots=True, eq=False)
class ForcePulse:
    """One strike. low, high: body indices. start_s: after its step's start, or before it. length_s: of the pulse. flat:
    half-sine, not Hertz'.

    impulse_n_s (3,): world, on low. modes_low, modes_high (m,): Uᵀj of the whole impulse in N·s/√kg.
    share: of all these, what the pulse hands over (`compliant_share`).
    """

    low: int
    high: int
    start_s: float
    length_s: float
    flat: bool
    impulse_n_s: Array
    modes_low: Array
    modes_high: Array
    share: float


def _gather(split: Split, oriented: Sequence[Rows]) -> tuple[Rows, Array, Array]:
    """Rows of struck pairs in the step and its followers, impulses scaled to the part that is strike; strike number and
    delay of each (r,).

    Sorted by strike.
    """
    key = split.key[split.strike]
    parts, strikes, delays = [], [], []
    for delay, rows in enumerate(oriented[: split.share.shape[1]]):
        at = np.minimum(np.searchsorted(key, rows.key), len(key) - 1)
        share = np.where(key[at] == rows.key, split.share[at, delay], 0.0)
        mine = np.flatnonzero(share > 0)
        if len(mine):
            part, scale = rows.take(mine), share[mine]
            parts.append(
                replace(
                    part,
                    impulse_n_s=part.impulse_n_s * scale[:, None],
                    load_n_s=part.load_n_s * scale,
                    push_n_s=part.push_n_s * scale[:, None, None],
                )
            )
            strikes.append(at[mine])
            delays.append(np.full(len(mine), delay))
    strike = np.concatenate(strikes)
    order = np.argsort(strike, kind="stable")
    return Rows.joined(parts).take(order), strike[order], np.concatenate(delays)[order]


def find_pulses(
    split: Split,
    oriented: Sequence[Rows],
    step: Step,
    resonators: tuple[Resonator, ...],
    placed: Array,
    earliest_s: float,
) -> tuple[ForcePulse, ...]:
    """The strikes that the rows of ``step`` begin; oriented: the rows of that step and of the known ones after it.
    placed (bodies,): just put there.

    earliest_s: not after 0; a strike is dated back that far at most, where the bodies overlap as the step starts. Pairs
    of which nothing can sound (no modes, no moving volume) are passed over, and those of which neither moves (links
    without mass).
    """
    if not len(split.strike):
        return ()
    rows, strike, delay = _gather(split, oriented)
    count = len(split.strike)
    low, high = key_bodies(split.key[split.strike])
    bodies = [resonator.body for resonator in resonators]
    raw = group_sum(strike, rows.load_n_s, count)
    share = rows.load_n_s / np.maximum(raw, 1e-300)[strike]
    normal = group_sum(strike, share[:, None] * rows.normal, count)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    arm = group_sum(strike, share[:, None, None] * rows.arm_m, count)
    mass = effective_mass(
        [bodies[i] for i in low],
        [bodies[i] for i in high],
        matrix(step.quaternion_xyzw[low]),
        matrix(step.quaternion_xyzw[high]),
        arm,
        normal,
    )
    approach = np.zeros(count)
    np.maximum.at(approach, strike, rows.approach_m_s)
    mobile = np.array([body.mass_kg > 0 for body in bodies])
    caused = causing_approach_m_s(
        approach, low, high, normal, unheld_steps(split, mobile, placed), step.gravity_m_s2 * step.dt_s
    )
    accepted = accepted_impulse(raw, 2.0 * mass * caused, low, high, mobile)
    impulse = group_sum(strike, rows.impulse_n_s, count)
    audible = np.array([_can_sound(resonators[i]) or _can_sound(resonators[j]) for i, j in zip(low, high, strict=True)])
    observed = np.flatnonzero(
        (mass > 0) & (accepted > LEAST_JUMP_M_S * mass) & (raw * STEEPEST >= np.linalg.norm(impulse, axis=1)) & audible
    )
    if not len(observed):
        return ()
    return _blows(
        rows,
        strike,
        delay,
        observed,
        resonators,
        (low, high),
        mass,
        raw,
        accepted,
        approach,
        impulse,
        earliest_s,
        step.dt_s,
    )


def _blows(
    rows: Rows, strike: Array, delay: Array, observed: Array, resonators: tuple[Resonator, ...],
    pair: tuple[Array, Array], mass: Array, raw: Array, accepted: Array, approach: Array, impulse: Array,
    earliest_s: float, dt_s: float,
) -> tuple[ForcePulse, ...]:  # fmt: skip
    """The pulses of the strikes ``observed``, of all strikes (q,) and their rows (r,)."""
    start = _start_s(rows, strike, delay, len(mass), earliest_s, dt_s)
    mine = np.flatnonzero(np.isin(strike, observed))
    rows, group = rows.take(mine), np.searchsorted(observed, strike[mine])
    bounds = np.searchsorted(group, np.arange(len(observed) + 1))
    where = touches(resonators, rows)
    scale = (accepted / np.maximum(raw, 1e-300))[observed]
    pushes = modal_pushes(resonators, rows, where, bounds, scale[group])
    bent = where[0].curvature_per_m + where[1].curvature_per_m
    strongest = [start_ + int(np.argmax(rows.load_n_s[start_:stop])) for start_, stop in itertools.pairwise(bounds)]
    sides = [(resonators[pair[0][q]], resonators[pair[1][q]]) for q in observed]
    speed = np.where(approach[observed] > 0, approach[observed], accepted[observed] / (1.5 * mass[observed]))
    area = [
        flat_area_m2(
            rows.point_m[bounds[i] : bounds[i + 1], 0],
            rows.load_n_s[bounds[i] : bounds[i + 1]],
            sides[i],
            float(bent[strongest[i]]),
            STRUCK_FLAT,
        )
        for i in range(len(observed))
    ]
    modulus = contact_modulus_pa(*(np.array([modulus_pa(side[i].body) for side in sides]) for i in (0, 1)))
    length, flat = contact_time_s(mass[observed], modulus, bent[strongest], np.array(area), np.maximum(speed, 1e-6))
    pulses = []
    for i, q in enumerate(observed):
        pushed = [(side.omega_rad_s / (2 * np.pi), push) for side, push in zip(sides[i], pushes[i], strict=True)]
        share = compliant_share(float(mass[q]), float(accepted[q]), pushed, float(length[i]), bool(flat[i]))
        pulses.append(
            ForcePulse(
                int(pair[0][q]),
                int(pair[1][q]),
                float(start[q]),
                float(length[i]),
                bool(flat[i]),
                scale[i] * impulse[q],
                *pushes[i],
                share,
            )
        )
    return tuple(pulses)


def _can_sound(resonator: Resonator) -> bool:
    return resonator.mode_count > 0 or resonator.rigid is not None


def modulus_pa(body: Body) -> float:
    """E/(1-ν²) of the body, infinite where it is a rigid partner."""
    return body.material.plane_strain_pa if body.material is not None else np.inf


def effective_mass(
    low: Sequence[Body], high: Sequence[Body], turn_low: Array, turn_high: Array, arm_m: Array, normal: Array
) -> Array:
    """m* (q,) in kg of pairs [synth.pulse]: orientations (q, 3, 3), levers (q, 2, 3) and normals (q, 3) in the world.
    0 where neither can move.
    """
    mass_low, mass_high = (np.array([body.mass_kg for body in bodies]) for bodies in (low, high))
    inertia_low, inertia_high = (
        np.einsum("kij,kjl,kml->kim", turn, np.array([body.inertia_kg_m2 for body in bodies]), turn)
        for bodies, turn in ((low, turn_low), (high, turn_high))
    )
    moves = (mass_low > 0) | (mass_high > 0)
    columns = (mass_low, inertia_low, arm_m[:, 0], mass_high, inertia_high, arm_m[:, 1], normal)
    out = np.zeros(len(normal))
    out[moves] = effective_mass_kg(*(column[moves] for column in columns))
    return out


def _start_s(rows: Rows, strike: Array, delay: Array, count: int, earliest_s: float, dt_s: float) -> Array:
    """(q,) when the surfaces meet: gap / approach of the first step's rows, negative where they overlap already."""
    first = (delay == 0) & (rows.approach_m_s > 0)
    meet = np.full(count, np.inf)
    np.minimum.at(meet, strike[first], rows.gap_m[first] / rows.approach_m_s[first])
    return np.clip(np.where(np.isfinite(meet), meet, 0.0), earliest_s, dt_s)


def flat_area_m2(
    point_m: Array, load: Array, pair: tuple[Resonator, Resonator], curvature_per_m: float, least_share: float
) -> float:
    """Area of a flat contact, 0 where it is curved: the disc with the spread of the manifold's points (r, 3) under
    loads (r,).

    least_share: of the smaller body's size, below which no flat contact's radius is taken to be.
    """
    size = min((s.size_m for s in pair if s.body.volume_m3 > 0), default=0.1)
    if curvature_per_m * size > FLAT_CURVATURE:
        return 0.0
    share = load / max(float(load.sum()), 1e-300)
    spread = float(np.sqrt(np.sum(share[:, None] * (point_m - share @ point_m) ** 2)))
    return float(np.pi * max(spread, least_share * size) ** 2)
