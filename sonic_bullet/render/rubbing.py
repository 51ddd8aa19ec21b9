"""Rolling and sliding of one physics step: from support loads and sweep speeds to forces on modes at audio rate.

    Split.support, rows of the next step -> SurfaceLoads at both ends -> synth.surface -> f - N per pair -> Drive (Uᵀ and direction per newton)

What a step starts with is what the step before ended with (loads, speeds, gains, direction are carried), so nothing jumps at the
step rate. A manifold's points flicker from step to step; the gains follow them with a time constant of `FOLLOW_S`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.contacts import Step
from sonic_bullet.records import Array
from sonic_bullet.render.blows import STEEPEST, effective_mass, flat_area_m2, modulus_pa
from sonic_bullet.render.rotation import to_body, to_world
from sonic_bullet.render.sounder import Sounder, force_on_modes, touch
from sonic_bullet.synth.pulse import contact_modulus_pa
from sonic_bullet.synth.strikes import Split, key_bodies, pair_key
from sonic_bullet.synth.surface import SurfaceLoads, SurfacePairs, SurfaceState, advance, contact_radius_m, damping_ratio

FOLLOW_S = 0.02
RUBBING_FLAT = 0.25
"""Radius, as a share of the smaller body's size, of the least area on which a flat face rubs."""
SWEEP_FLOOR_M_S = 2e-4
"""Slower sweeps make nothing audible: even waves of 10 µm pass at 20 Hz. Solvers let bodies at rest creep about as fast."""


@dataclass(frozen=True, slots=True, eq=False)
class Rubbing:
    """The touching pairs between two steps. key (p,) sorted; load_n (p,), sweep_m_s (p, 2) lower body first; direction (p, 3): force on
    the lower body per newton of normal load, world; gain: per pair Uᵀ of that force on either body's modes, None until it moves.
    """

    key: Array
    pairs: SurfacePairs
    state: SurfaceState
    load_n: Array
    sweep_m_s: Array
    direction: Array
    gain: tuple[tuple[Array, Array] | None, ...]

    @classmethod
    def none(cls) -> Rubbing:
        """No pair touches."""
        pairs = SurfacePairs(*(np.zeros(0),) * 4, *(np.zeros((0, 2)),) * 3)
        return cls(np.zeros(0, np.int64), pairs, SurfaceState.at_rest(0), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 3)), ())

    def take(self, rows: Array) -> Rubbing:
        """The pairs ``rows`` alone."""
        return Rubbing(
            self.key[rows],
            self.pairs.take(rows),
            self.state.take(rows),
            self.load_n[rows],
            self.sweep_m_s[rows],
            self.direction[rows],
            tuple(self.gain[r] for r in rows),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A force signal on one body: force_n (n,); gain0, gain1 (m,) on its modes and push0, push1 (3,) in the world at the step's ends, linear between."""

    body: int
    force_n: Array
    gain0: Array
    gain1: Array
    push0: Array
    push1: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Target:
    """Where pairs (p,) are heading: the rows of the step's end, one manifold each."""

    load_n: Array
    sweep_m_s: Array
    direction: Array
    rows: tuple[Array, ...]


def _targets(key: Array, split: Split, step: Step) -> _Target:
    """Loads, speeds and directions at the end of the step, of the pairs ``key``; ``step`` is the one that follows."""
    rows = step.contacts
    keys = pair_key(rows)
    at = np.searchsorted(key, keys)
    inside = np.flatnonzero(np.append(key, -1)[at] == keys) if len(key) else np.zeros(0, np.int64)
    at = at[inside]
    swap = rows.a[inside] > rows.b[inside]
    impulse = np.where(swap, -1.0, 1.0)[:, None] * rows.impulse_n_s[inside]
    weight = np.maximum(np.einsum("ri,ri->r", rows.impulse_n_s[inside], rows.normal[inside]), 0.0)
    total = np.bincount(at, weight, len(key))
    carries = total * STEEPEST >= np.sqrt(sum(np.bincount(at, impulse[:, axis], len(key)) ** 2 for axis in range(3)))
    total = np.where(carries & (total > 0), total, np.inf)
    sweep = np.where(swap[:, None], rows.sweep_m_s[inside][:, ::-1], rows.sweep_m_s[inside])
    mean = np.stack([np.bincount(at, weight * sweep[:, side], len(key)) for side in (0, 1)], axis=1) / total[:, None]
    direction = np.stack([np.bincount(at, impulse[:, axis], len(key)) for axis in range(3)], axis=1) / total[:, None]
    load = np.zeros(len(key))
    known = np.searchsorted(split.key, key)
    found = np.append(split.key, -1)[known] == key
    load[found] = split.support_n[known[found], 1]
    order = np.argsort(at, kind="stable")
    bounds = np.searchsorted(at[order], np.arange(len(key) + 1))
    members = tuple(inside[order[bounds[p] : bounds[p + 1] if np.isfinite(total[p]) else bounds[p]]] for p in range(len(key)))
    return _Target(load, np.where(mean < SWEEP_FLOOR_M_S, 0.0, mean), direction, members)


def advance_rubbing(
    rubbing: Rubbing, split: Split, window: tuple[Step, ...], sounders: tuple[Sounder, ...], x: Array, sr: int, seed: int
) -> tuple[tuple[Drive, ...], Rubbing]:
    """Drives of the step window[0], and the state after it.

    x (n,): share of the step of each sample. window: the step and the known ones after it, two at least.
    """
    follower = window[1]
    key = np.union1d(rubbing.key, split.key[split.support_n.any(axis=1)])
    key = key[[_audible_pair(sounders, k) for k in key]] if len(key) else key
    target = _targets(key, split, follower)
    rubbing = _joined(rubbing.take(np.flatnonzero(np.isin(rubbing.key, key))), key, target, follower, sounders, seed)
    moving = (rubbing.sweep_m_s > 0).any(axis=1) | (target.sweep_m_s > 0).any(axis=1) | (rubbing.state.depth != 0) | (rubbing.state.lift != 0)
    follow = -np.expm1(-window[0].dt_s / FOLLOW_S)
    touching = np.array([len(rows) > 0 for rows in target.rows], bool)
    fresh = ~rubbing.direction.any(axis=1)
    direction = np.where((fresh & touching)[:, None], target.direction, rubbing.direction)
    turned = direction + np.where(touching, follow, 0.0)[:, None] * (target.direction - direction)
    ends = SurfaceLoads(rubbing.load_n, rubbing.sweep_m_s), SurfaceLoads(target.load_n, target.sweep_m_s)
    force, state = advance(rubbing.pairs, rubbing.state, *ends, x, sr)
    drives: list[Drive] = []
    gains = list(rubbing.gain)
    low, high = key_bodies(key)
    for p in np.flatnonzero(moving):
        old = gains[p]
        if len(target.rows[p]):
            new = _gain_at(target.rows[p], follower, sounders[low[p]], sounders[high[p]])
            old = new if old is None else old
            gains[p] = (old[0] + follow * (new[0] - old[0]), old[1] + follow * (new[1] - old[1]))
        now = gains[p]
        if force[p].any() and old is not None and now is not None:
            pushes = (direction[p], turned[p]), (-direction[p], -turned[p])
            drives += [Drive(int(body[p]), force[p], old[side], now[side], *pushes[side]) for side, body in enumerate((low, high))]
    after = Rubbing(key, rubbing.pairs, state, target.load_n, target.sweep_m_s, turned, tuple(gains))
    return tuple(drives), after.take(np.flatnonzero(target.load_n > 0))


def _audible_pair(sounders: tuple[Sounder, ...], key: int) -> bool:
    low, high = int(key) >> 32, int(key) & 0xFFFFFFFF
    return any(s.body.material is not None and (s.mode_count > 0 or s.body.mass_kg > 0) for s in (sounders[low], sounders[high]))


def _joined(rubbing: Rubbing, key: Array, target: _Target, step: Step, sounders: tuple[Sounder, ...], seed: int) -> Rubbing:
    """The pairs ``key``: those that touched before as they are, new ones at rest and without load."""
    new = np.flatnonzero(~np.isin(key, rubbing.key))
    if not len(new):
        return rubbing
    count = len(new)
    pairs = rubbing.pairs.append(_new_pairs(key[new], [target.rows[p] for p in new], step, sounders, seed))
    order = np.argsort(np.concatenate([rubbing.key, key[new]]), kind="stable")
    grown = Rubbing(
        np.concatenate([rubbing.key, key[new]]),
        pairs,
        rubbing.state.append(SurfaceState.at_rest(count)),
        np.concatenate([rubbing.load_n, np.zeros(count)]),
        np.concatenate([rubbing.sweep_m_s, target.sweep_m_s[new]]),
        np.concatenate([rubbing.direction, np.zeros((count, 3))]),
        (*rubbing.gain, *(None,) * count),
    )
    return grown.take(order)


def _new_pairs(key: Array, members: list[Array], step: Step, sounders: tuple[Sounder, ...], seed: int) -> SurfacePairs:
    """Constants of new pairs, from the manifold with which they begin (none: as two flats of the bodies' size)."""
    columns: list[tuple[float, ...]] = []
    for one, rows in zip(key, members, strict=True):
        sides = sounders[int(one) >> 32], sounders[int(one) & 0xFFFFFFFF]
        mass, curvature, area = _contact(rows, step, sides)
        modulus = float(contact_modulus_pa(np.array(modulus_pa(sides[0].body)), np.array(modulus_pa(sides[1].body))))
        radius = float(contact_radius_m(np.array(curvature), np.array(area)))
        restitution = min(s.body.material.restitution for s in sides if s.body.material is not None)
        rough = [s.body.material.roughness_m if s.body.material is not None else 0.0 for s in sides]
        hurst = [s.body.material.hurst if s.body.material is not None else 0.75 for s in sides]
        seeds = [_surface_seed(seed, s) for s in sides]
        columns.append((mass, modulus, radius, float(damping_ratio(np.array(restitution))), *rough, *hurst, *seeds))
    table = np.array(columns).reshape(len(key), 10)
    return SurfacePairs(*table[:, :4].T, table[:, 4:6], table[:, 6:8], table[:, 8:10].astype(np.int64))


def _surface_seed(seed: int, sounder: Sounder) -> int:
    """A number for a body's surface, the same in every run: of the seed and of who the body is."""
    who = np.random.SeedSequence([seed & 0xFFFFFFFF, sounder.body.body_id & 0xFFFFFFFF, (sounder.body.link + 1) & 0xFFFFFFFF, sounder.body.epoch])
    return int(who.generate_state(1)[0])


def _contact(rows: Array, step: Step, sides: tuple[Sounder, Sounder]) -> tuple[float, float, float]:
    """Effective mass in kg, relative curvature in 1/m and flat area in m² of a manifold."""
    bodies = [s.body for s in sides]
    if not len(rows):
        masses = [b.mass_kg for b in bodies if b.mass_kg > 0]
        return (1 / sum(1 / m for m in masses) if masses else 1.0), 0.0, flat_area_m2(np.zeros((1, 3)), np.ones(1), sides, 0.0, RUBBING_FLAT)
    turn, point, normal, load = _manifold(rows, step)
    index = [np.where(step.contacts.a[rows] < step.contacts.b[rows], step.contacts.a[rows], step.contacts.b[rows])[:1]]
    index.append((step.contacts.a[rows] + step.contacts.b[rows])[:1] - index[0])
    share = load / load.sum()
    arms = [(share @ to_world(turn[side], point[side]))[None] for side in (0, 1)]
    mean = share @ normal
    mean = (mean / max(float(np.linalg.norm(mean)), 1e-300))[None]
    mass = float(effective_mass(bodies, index[0], index[1], step, arms, mean, places=(0, 1))[0])
    strongest = int(np.argmax(load))
    curvature = 0.0
    for side in (0, 1):
        outward = (-1.0, 1.0)[side] * to_body(turn[side], normal)
        curvature += float(touch(sides[side], point[side], outward).curvature_per_m[strongest])
    return mass, curvature, flat_area_m2(point[0], share, sides, curvature, RUBBING_FLAT)


def _manifold(rows: Array, step: Step) -> tuple[tuple[Array, Array], tuple[Array, Array], Array, Array]:
    """Orientations, points in either body's frame, normals onto the lower body and normal impulses of rows (r,) of one pair."""
    c = step.contacts
    swap = c.a[rows] > c.b[rows]
    low, high = np.where(swap, c.b[rows], c.a[rows]), np.where(swap, c.a[rows], c.b[rows])
    turn = step.quaternion_xyzw[low], step.quaternion_xyzw[high]
    point = np.where(swap[:, None], c.point_b_m[rows], c.point_a_m[rows]), np.where(swap[:, None], c.point_a_m[rows], c.point_b_m[rows])
    load = np.maximum(np.einsum("ri,ri->r", c.impulse_n_s[rows], c.normal[rows]), 1e-300)
    return turn, point, np.where(swap, -1.0, 1.0)[:, None] * c.normal[rows], load


def _gain_at(rows: Array, step: Step, low: Sounder, high: Sounder) -> tuple[Array, Array]:
    """Uᵀ of the manifold's force per newton of normal load, on the lower and the higher body."""
    turn, point, normal, load = _manifold(rows, step)
    sign = np.where(step.contacts.a[rows] > step.contacts.b[rows], -1.0, 1.0)[:, None]
    force = sign * step.contacts.impulse_n_s[rows] / load.sum()
    out = []
    for side, sounder in ((0, low), (1, high)):
        facing = (-1.0, 1.0)[side]
        where = touch(sounder, point[side], facing * to_body(turn[side], normal))
        out.append(force_on_modes(sounder, where, -facing * to_body(turn[side], force)))
    return out[0], out[1]
