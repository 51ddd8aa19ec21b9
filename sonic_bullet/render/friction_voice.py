"""Rolling and sliding of one physics step: from support loads and sweep speeds to forces on modes at audio rate.

    Split.support, rows of the next step -> SurfaceLoads at both ends -> synth.surface -> f - N per pair -> Drive (Uᵀ
        and direction per newton)

What a step starts with is what the step before ended with (loads, speeds, gains, direction are carried), so nothing
jumps at the step rate. A manifold's points flicker from step to step; the gains follow them with a time constant of
`FOLLOW_S`. p pairs, sides 0 = lower body and 1 = higher.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Step
from sonic_bullet.render.impacts import effective_mass, flat_area_m2, modulus_pa
from sonic_bullet.render.manifold import STEEPEST, Rows, group_sum, modal_pushes, touches
from sonic_bullet.render.resonator import Resonator, touch_one
from sonic_bullet.render.rotation import matrix
from sonic_bullet.synth.pulse import contact_modulus_pa
from sonic_bullet.synth.strikes import Split, key_bodies
from sonic_bullet.synth.surface import (
    SurfaceLoads,
    SurfacePairs,
    SurfaceState,
    advance,
    contact_radius_m,
    damping_ratio,
)

FOLLOW_S = 0.02
FRICTION_FLAT = 0.25
"""Radius, as a share of the smaller body's size, of the least area on which a flat face rubs."""
SWEEP_FLOOR_M_S = 2e-4
"""Slower sweeps make nothing audible: even waves of 10 µm pass at 20 Hz.

Solvers let bodies at rest creep about as fast.
"""


@dataclass(frozen=True, slots=True, eq=False)
class FrictionVoice:
    """The touching pairs between two steps. key (p,) sorted; load_n (p,), sweep_m_s (p, 2); direction (p, 3): force on
    the lower body per newton of normal load, world; gain: per pair Uᵀ of that force on either body's modes, None until
    it moves.
    """

    key: Array
    pairs: SurfacePairs
    state: SurfaceState
    load_n: Array
    sweep_m_s: Array
    direction: Array
    gain: tuple[tuple[Array, Array] | None, ...]

    @classmethod
    def none(cls) -> FrictionVoice:
        """No pair touches."""
        pairs = SurfacePairs(*(np.zeros(0),) * 4, *(np.zeros((0, 2)),) * 3)
        return cls(
            np.zeros(0, np.int64), pairs, SurfaceState.at_rest(0), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 3)), ()
        )

    def take(self, rows: Array) -> FrictionVoice:
        """The pairs ``rows`` alone."""
        gain = tuple(self.gain[r] for r in rows)
        return FrictionVoice(
            self.key[rows],
            self.pairs.take(rows),
            self.state.take(rows),
            self.load_n[rows],
            self.sweep_m_s[rows],
            self.direction[rows],
            gain,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A force signal on one pair. force_n (n,): on the lower body along the direction, its negative on the higher.

    Linear between the step's ends: gain0, gain1: Uᵀ on the modes of both bodies, each (m,) a newton; direction0,
    direction1 (3,) on the lower body, world.
    """

    low: int
    high: int
    force_n: Array
    gain0: tuple[Array, Array]
    gain1: tuple[Array, Array]
    direction0: Array
    direction1: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Target:
    """Where pairs (p,) are heading at the step's end: loads, speeds, directions; rows sorted by pair, pair i having
    bounds[i] … bounds[i+1]-1.
    """

    load_n: Array
    sweep_m_s: Array
    direction: Array
    rows: Rows
    bounds: Array

    @property
    def touching(self) -> Array:
        return np.diff(self.bounds) > 0


def _targets(key: Array, split: Split, rows: Rows) -> _Target:
    """The targets of the pairs ``key`` (p,) by the rows of the step that follows."""
    count = len(key)
    at = np.searchsorted(key, rows.key)
    inside = np.flatnonzero(np.append(key, -1)[at] == rows.key)
    order = inside[np.argsort(at[inside], kind="stable")]
    rows, at = rows.take(order), at[order]
    total = np.bincount(at, rows.load_n_s, count)
    pull = np.linalg.norm(group_sum(at, rows.impulse_n_s, count), axis=1)
    carries = (total > 0) & (total * STEEPEST >= pull)
    kept = np.flatnonzero(carries[at])
    rows, at = rows.take(kept), at[kept]
    total = np.where(carries, total, np.inf)[:, None]
    sweep = group_sum(at, rows.load_n_s[:, None] * rows.sweep_m_s, count) / total
    load = np.zeros(count)
    known = np.searchsorted(split.key, key)
    found = np.append(split.key, -1)[known] == key
    load[found] = split.support_n[known[found], 1]
    direction = group_sum(at, rows.impulse_n_s, count) / total
    return _Target(
        load, np.where(sweep < SWEEP_FLOOR_M_S, 0.0, sweep), direction, rows, np.searchsorted(at, np.arange(count + 1))
    )


def advance_friction(
    friction: FrictionVoice,
    split: Split,
    step: Step,
    following: Step,
    rows: Rows,
    resonators: tuple[Resonator, ...],
    x: Array,
    sr: int,
    seed: int,
) -> tuple[tuple[Drive, ...], FrictionVoice]:
    """Drives of ``step``, and the state after it.

    following, rows: the next step and its rows. x (n,): share of the step of each sample.
    """
    key = np.union1d(friction.key, split.key[split.support_n.any(axis=1)])
    key = key[[_audible_pair(resonators, k) for k in key]] if len(key) else key
    target = _targets(key, split, rows)
    friction = _joined(
        friction.take(np.flatnonzero(np.isin(friction.key, key))), key, target, following, resonators, seed
    )
    moving = (
        (friction.sweep_m_s > 0).any(axis=1)
        | (target.sweep_m_s > 0).any(axis=1)
        | (friction.state.depth != 0)
        | (friction.state.lift != 0)
    )
    follow = -np.expm1(-step.dt_s / FOLLOW_S)
    touching = target.touching
    fresh = ~friction.direction.any(axis=1)
    direction = np.where((fresh & touching)[:, None], target.direction, friction.direction)
    turned = direction + np.where(touching, follow, 0.0)[:, None] * (target.direction - direction)
    ends = SurfaceLoads(friction.load_n, friction.sweep_m_s), SurfaceLoads(target.load_n, target.sweep_m_s)
    force, state = advance(friction.pairs, friction.state, *ends, x, sr)
    before, after = _followed(friction.gain, np.flatnonzero(moving & touching), target, resonators, follow)
    low, high = key_bodies(key)
    drives = []
    for p in np.flatnonzero(moving & force.any(axis=1)):
        start, end = before[p], after[p]
        if start is not None and end is not None:
            drives.append(Drive(int(low[p]), int(high[p]), force[p], start, end, direction[p], turned[p]))
    now = FrictionVoice(key, friction.pairs, state, target.load_n, target.sweep_m_s, turned, tuple(after))
    return tuple(drives), now.take(np.flatnonzero(target.load_n > 0))


Gains = list[tuple[Array, Array] | None]


def _followed(
    gain: Sequence[tuple[Array, Array] | None],
    which: Array,
    target: _Target,
    resonators: tuple[Resonator, ...],
    follow: float,
) -> tuple[Gains, Gains]:
    """Gains at the step's start and end; those of the pairs ``which`` move by ``follow`` towards where the contacts are
    now.
    """
    before, after = list(gain), list(gain)
    if len(which):
        starts, stops = target.bounds[which], target.bounds[which + 1]
        chosen = np.concatenate([np.arange(start, stop) for start, stop in zip(starts, stops, strict=True)])
        rows = target.rows.take(chosen)
        bounds = np.concatenate([[0], np.cumsum(stops - starts)])
        group = np.repeat(np.arange(len(which)), stops - starts)
        total = np.bincount(group, rows.load_n_s, len(which))
        for p, aim in zip(
            which, modal_pushes(resonators, rows, touches(resonators, rows), bounds, (1 / total)[group]), strict=True
        ):
            start = before[p] = before[p] or aim
            after[p] = (start[0] + follow * (aim[0] - start[0]), start[1] + follow * (aim[1] - start[1]))
    return before, after


def _audible_pair(resonators: tuple[Resonator, ...], key: int) -> bool:
    low, high = int(key) >> 32, int(key) & 0xFFFFFFFF
    sides = resonators[low], resonators[high]
    return any(s.mode_count > 0 or s.rigid is not None for s in sides) and any(s.body.mass_kg > 0 for s in sides)


def _joined(
    friction: FrictionVoice, key: Array, target: _Target, step: Step, resonators: tuple[Resonator, ...], seed: int
) -> FrictionVoice:
    """The pairs ``key``: those that touched before as they are, new ones at rest and without load."""
    new = np.flatnonzero(~np.isin(key, friction.key))
    if not len(new):
        return friction
    count = len(new)
    fresh = _new_pairs(
        key[new],
        [target.rows.take(np.arange(target.bounds[p], target.bounds[p + 1])) for p in new],
        step,
        resonators,
        seed,
    )
    grown = FrictionVoice(
        np.concatenate([friction.key, key[new]]),
        friction.pairs.append(fresh),
        friction.state.append(SurfaceState.at_rest(count)),
        np.concatenate([friction.load_n, np.zeros(count)]),
        np.concatenate([friction.sweep_m_s, target.sweep_m_s[new]]),
        np.concatenate([friction.direction, np.zeros((count, 3))]),
        (*friction.gain, *(None,) * count),
    )
    return grown.take(np.argsort(grown.key, kind="stable"))


def _new_pairs(
    key: Array, manifolds: list[Rows], step: Step, resonators: tuple[Resonator, ...], seed: int
) -> SurfacePairs:
    """Constants of new pairs, from the manifold with which they begin (none: as two flats of the bodies' size)."""
    table = np.zeros((len(key), 10))
    for row, (one, rows) in enumerate(zip(key, manifolds, strict=True)):
        sides = resonators[int(one) >> 32], resonators[int(one) & 0xFFFFFFFF]
        mass, curvature, area = _contact(rows, step, sides)
        modulus = float(contact_modulus_pa(*(np.array(modulus_pa(s.body)) for s in sides)))
        radius = float(contact_radius_m(np.array(curvature), np.array(area)))
        materials = [s.body.material for s in sides]
        restitution = min(m.restitution for m in materials if m is not None)
        rough = [m.roughness_m if m is not None else 0.0 for m in materials]
        hurst = [m.hurst if m is not None else 0.7 for m in materials]
        table[row] = (
            mass,
            modulus,
            radius,
            float(damping_ratio(np.array(restitution))),
            *rough,
            *hurst,
            *(_surface_seed(seed, s) for s in sides),
        )
    mass_kg, modulus_all, radius_m, zeta = table[:, :4].T
    return SurfacePairs(
        mass_kg, modulus_all, radius_m, zeta, table[:, 4:6], table[:, 6:8], table[:, 8:10].astype(np.int64)
    )


def _surface_seed(seed: int, resonator: Resonator) -> int:
    """A number for a body's surface, the same in every run: of the seed and of who the body is."""
    who = np.random.SeedSequence(
        [
            seed & 0xFFFFFFFF,
            resonator.body.body_id & 0xFFFFFFFF,
            (resonator.body.link + 1) & 0xFFFFFFFF,
            resonator.body.epoch,
        ]
    )
    return int(who.generate_state(1)[0])


def _contact(rows: Rows, step: Step, sides: tuple[Resonator, Resonator]) -> tuple[float, float, float]:
    """Effective mass in kg, relative curvature in 1/m and flat area in m² of a manifold."""
    bodies = [s.body for s in sides]
    if not len(rows.key):
        masses = [b.mass_kg for b in bodies if b.mass_kg > 0]
        return (
            (1 / sum(1 / m for m in masses) if masses else 1.0),
            0.0,
            flat_area_m2(np.zeros((1, 3)), np.ones(1), sides, 0.0, FRICTION_FLAT),
        )
    share = rows.load_n_s / rows.load_n_s.sum()
    normal = share @ rows.normal
    normal = (normal / max(float(np.linalg.norm(normal)), 1e-300))[None]
    turn_low, turn_high = (matrix(step.quaternion_xyzw[rows.body[0, side]])[None] for side in (0, 1))
    mass = float(
        effective_mass(
            bodies[:1], bodies[1:], turn_low, turn_high, np.einsum("k,ksi->si", share, rows.arm_m)[None], normal
        )[0]
    )
    touched = _touch_pair(rows, sides)
    strongest = int(np.argmax(share))
    curvature = float(touched[0][strongest] + touched[1][strongest])
    return mass, curvature, flat_area_m2(rows.point_m[:, 0], rows.load_n_s, sides, curvature, FRICTION_FLAT)


def _touch_pair(rows: Rows, sides: tuple[Resonator, Resonator]) -> tuple[Array, Array]:
    """Curvature (k,) of either surface at the rows of one pair."""
    low, high = (touch_one(sides[side], rows.point_m[:, side], rows.outward[:, side])[2] for side in (0, 1))
    return low, high
