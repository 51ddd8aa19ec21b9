"""Contact patches: points tracked and loads smoothed, without the flicker of a simulator's points.

    rows of the step being rendered, load less strikes -> each row to the tracked point near it, or a new one
        -> n += a (load of its rows − n),   a = 1 − e^{−dt/30 ms}
        -> CONTACT_PATCH: up to PATCH_POINTS points a pair, sum and moment those of the rows, smoothed
    sets or loads that differ from those of the present poles -> SUPPORT_STATE.stale of both bodies

A resting box shows two, three or four of its corners, another choice each step; sum and moment alone are right. Each
point keeps the mean of the loads of its rows, so sum and moment of the tracked points are the smoothed ones exactly,
and the set changes only where a point was not loaded for long, or lies elsewhere. A box that slides keeps its own
corners as its points; that they lie elsewhere on the board makes its poles stale.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.contact.load_splitting import NOW, SPAN
from sonic_bullet.machine.compiled import njit

PATCH_POINTS = 4
"""Points of a pair: a solver of convex shapes gives no more at a time."""
LEAST_PATCH = 0.02
"""Fraction of a pair's load below which a point is dropped."""

CONTACT_PATCH = np.dtype(
    [
        ("count", "i8"),
        ("point_m", "f8", (PATCH_POINTS, 2, 3)),  # in either body's frame
        ("load_n", "f8", (PATCH_POINTS,)),
        ("outward", "f8", (2, 3)),  # of either body's surface, its frame, mean over the points
        ("used", "i8"),  # of the set that poles were made for: how many points
        ("used_m", "f8", (PATCH_POINTS, 2, 3)),
        ("used_n", "f8", (PATCH_POINTS,)),
        ("used_s", "f8"),  # since then
    ],
    align=True,
)
"""Contact patch of a pair; beside its row of PAIR, in the same slot."""

SUPPORT_STATE = np.dtype(
    [
        ("stale", "i8"),  # 1 where its poles are not those of its contacts
        ("stale_s", "f8"),  # since when
        ("wait_s", "f8"),  # until they may be made again
        ("wanted", "i8"),  # 1: they are to be made before this step rings
        ("points", "i8"),  # tracked points of its poles
        ("steps", "i8"),  # steps that it rang on them, and below those with contact separation
        ("separated", "i8"),
    ],
    align=True,
)
"""Support state of a body."""

SAVED_S = 0.03
"""Most of it that is saved up for a moment in which many come to rest."""


@njit(nogil=True, error_model="numpy")
def track_contact_patches(here, rows, table, pairs, support_state):
    """Advance the contact patches of all pairs by a step, a row of WINDOW.

    A patch without rows for SPAN steps is released.
    """
    same_point = 0.15  # of the smaller body's size: rows nearer than this to a tracked point are the same point
    # time constant of loads: of 20 to 50 ms, seven steps at 240 Hz, within which each corner of a box is loaded
    smooth_s = 0.03
    (row, stop), dt_s, bodies = here.row, here.dt_s, table.bodies
    follow = 1.0 - np.exp(-dt_s / smooth_s)
    target, place = np.empty(PATCH_POINTS), np.empty((PATCH_POINTS + 1, 2, 3))
    for i in range(pairs.count[0]):
        slot = pairs.active[i]
        pair, one = pairs.pair[slot], pairs.patch[slot]
        while row < stop and rows[row].key < pair.key:
            row += 1
        begin = row
        while row < stop and rows[row].key == pair.key:
            row += 1
        carries = pair.support_n[0] > 0.0
        if one.count == 0 and not carries:
            continue
        touches = False
        for column in range(NOW, NOW + SPAN):
            touches = touches or pair.force_n[column] > 0.0
        if not touches:
            release_patch(one, pair, support_state)
            continue
        size = np.inf
        for side in range(2):
            if bodies[pair.body[side]].volume_m3 > 0.0:
                size = min(size, bodies[pair.body[side]].size_m)
        near = same_point * size if size < np.inf else np.inf
        share = min(pair.support_n[0] / pair.force_n[NOW], 1.0) / dt_s if pair.force_n[NOW] > 0.0 else 0.0
        _smooth(one, rows[begin:row], share, near, follow, target, place)
        one.used_s += dt_s
        if _differs(one, near):
            one.used, one.used_s = one.count, 0.0
            for k in range(one.count):
                one.used_n[k] = one.load_n[k]
                _copy(one.point_m[k], one.used_m[k])
            support_state[pair.body[0]].stale = support_state[pair.body[1]].stale = 1


@njit(nogil=True, error_model="numpy")
def release_patch(one, pair, support_state):
    """Release the contact patch of a pair."""
    if one.used:
        support_state[pair.body[0]].stale = support_state[pair.body[1]].stale = 1
    one.count = one.used = 0
    one.used_s = 0.0


@njit(nogil=True, error_model="numpy")
def _nearest(one, point, count):
    """Find the tracked point nearest to a row's (2, 3), by the body on which it moved less, and its distance."""
    best, least = 0, np.inf
    for k in range(count):
        for side in range(2):
            square = 0.0
            for x in range(3):
                off = one.point_m[k, side, x] - point[side, x]
                square += off * off
            if square < least:
                best, least = k, square
    return best, np.sqrt(least)


@njit(nogil=True, error_model="numpy")
def _smooth(one, rows, share, near, follow, target, place):
    """Update the tracked points by a pair's rows, whose loads in N·s times ``share`` are newtons.

    target (PATCH_POINTS,), place (PATCH_POINTS + 1, 2, 3): scratch for the rows' loads, and for their normals.
    """
    least_n = 1e-9  # newtons below which nothing is carried
    old = one.count
    total = _take_rows(one, rows, share, near, target, place)
    if total > 0.0:
        _lean(one, place[PATCH_POINTS], total, follow if old else 1.0)
    whole = 0.0
    for k in range(one.count):
        one.load_n[k] += follow * (target[k] - one.load_n[k])
        whole += one.load_n[k]
        if target[k] > 0.0:  # its position enters with its added load, so that the moment is smoothed as the load is
            share = follow * target[k] / one.load_n[k]
            for side in range(2):
                for x in range(3):
                    one.point_m[k, side, x] += share * (place[k, side, x] / target[k] - one.point_m[k, side, x])
    kept = 0
    for k in range(one.count):
        if one.load_n[k] >= max(LEAST_PATCH * whole, least_n) or target[k] > 0.0:
            one.load_n[kept] = one.load_n[k]
            _copy(one.point_m[k], one.point_m[kept])
            kept += 1
    one.count = kept


@njit(nogil=True, error_model="numpy")
def _take_rows(one, rows, share, near, target, place):
    """Assign each row to the tracked point near it, or to a new one; return the sum of the loads in N.

    target (PATCH_POINTS,): loads; place (PATCH_POINTS + 1, 2, 3): their moments and, last, that of the normals.
    """
    target[:], place[:] = 0.0, 0.0
    old, total, most = one.count, 0.0, 0.0
    for r in range(len(rows)):
        load = rows[r].load_n_s * share
        if load <= 0.0:
            continue
        k, off = _nearest(one, rows[r].point_m, one.count)
        if off > near and one.count < PATCH_POINTS:
            k = one.count
            one.count += 1
            one.load_n[k] = 0.0
            _copy(rows[r].point_m, one.point_m[k])
        target[k] += load
        total += load
        if old == 0 and load > most:  # a new pair takes its heaviest row's normal, then the mean
            most = load
            _copy(rows[r].outward, one.outward)
        for side in range(2):
            for x in range(3):
                place[k, side, x] += load * rows[r].point_m[side, x]
                place[PATCH_POINTS, side, x] += load * rows[r].outward[side, x]
    return total


@njit(nogil=True, error_model="numpy")
def _lean(one, outward, total, follow):
    """Smooth the pair's normals towards those of a step, (2, 3) weighted by loads of ``total`` in all.

    Where these press from opposite sides and cancel, the normals stay.
    """
    for side in range(2):
        length, mean = _length(outward[side]), one.outward[side]
        if length < LEAST_PATCH * total:
            continue
        for x in range(3):
            mean[x] += follow * (outward[side, x] / length - mean[x])
        length = max(_length(mean), 1e-300)
        for x in range(3):
            mean[x] /= length


@njit(nogil=True, error_model="numpy")
def _copy(vectors, out):
    """Copy (2, 3); numba's own assignment would compile 3 s of text for an error that cannot occur."""
    for side in range(2):
        for x in range(3):
            out[side, x] = vectors[side, x]


@njit(nogil=True, error_model="numpy")
def _length(vector):
    """Compute the length of (3,)."""
    return np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@njit(nogil=True, error_model="numpy")
def _differs(one, near):
    """Return whether points or loads differ from those that the present poles were computed for."""
    # factors by which a load must differ from the one of the present poles before new ones are computed: at once, 17 %
    # of a Hertz spring, and after rest_s, 3 %
    far_off, off_patch, rest_s = 1.6, 1.1, 0.2
    if one.count != one.used:
        return True
    off = off_patch if one.used_s > rest_s else far_off
    for k in range(one.count):
        if not one.used_n[k] / off <= one.load_n[k] <= one.used_n[k] * off:
            return True
        for side in range(2):
            square = 0.0
            for x in range(3):
                square += (one.point_m[k, side, x] - one.used_m[k, side, x]) ** 2
            if np.sqrt(square) > near:
                return True
    return False


@njit(nogil=True, error_model="numpy")
def price_s(modes, points):
    """Estimate the cost of new poles, in s of a processor of 2025, from their counts: the same on every machine."""
    return 5e-4 + 1.5e-4 * points + 2e-7 * (modes + 6) ** 2


@njit(nogil=True, error_model="numpy")
def choose_bodies(dt_s, table, pairs, supports, bank, scratch):
    """Mark as wanted the bodies whose poles are to be computed before this step rings; return their number.

    Silent bodies wait.
    """
    again_s = 0.02  # a body's poles stay at least so long, four blocks of the bank
    # fraction of simulated time that may go into new poles: with it, sound costs a pile of a hundred boxes a third
    # more, and live sound is never late for it. The body that waits longest is served first, moving ones before fixed
    # ones.
    poles_share = 0.06
    support_state, credit_s, bodies = supports.support_state, supports.credit_s, table.bodies
    credit_s[0] = min(credit_s[0] + poles_share * dt_s, SAVED_S)
    some = False
    for b in range(len(support_state)):
        one = support_state[b]
        one.wait_s = max(one.wait_s - dt_s, 0.0)
        if one.stale:
            one.stale_s += dt_s
            some = some or (one.wait_s == 0.0 and bodies[b].modes > 0)
    if not some or credit_s[0] <= 0.0:
        return 0
    sounds, points = np.zeros(len(support_state), np.int64), np.zeros(len(support_state), np.int64)
    for side in range(2):
        for i in range(scratch.count[0]):
            sounds[scratch.pulse[i].body[side]] = 1
        for i in range(scratch.count[1]):
            sounds[scratch.body[i, side]] = 1
        for i in range(pairs.count[0]):
            points[pairs.pair[pairs.active[i]].body[side]] += pairs.patch[pairs.active[i]].count
    for b in range(len(support_state)):
        now = bank.ringing[b]
        sounds[b] |= now.ringing | now.driven | now.tiled | (now.strike >= 0)
        sounds[b] &= support_state[b].stale & (support_state[b].wait_s == 0.0) & (bodies[b].modes > 0)
    wanted = 0
    while credit_s[0] > 0.0:
        best = _longest_stale(support_state, bodies, sounds)
        if best < 0:
            break
        one = support_state[best]
        sounds[best] = one.stale = 0
        one.wanted, one.stale_s, one.wait_s, one.points = 1, 0.0, again_s, points[best]
        if points[best]:  # its free poles are known
            credit_s[0] -= price_s(bodies[best].modes, points[best])
        wanted += 1
    return wanted


@njit(nogil=True, error_model="numpy")
def _longest_stale(support_state, bodies, waits):
    """Choose the next of those that wait: of moving bodies, the one stale longest, then of fixed ones; -1 for none."""
    best = -1
    for b in range(len(support_state)):
        if waits[b]:
            if best < 0:
                best = b
                continue
            fixed, best_fixed = bodies[b].mass_kg <= 0.0, bodies[best].mass_kg <= 0.0
            if (best_fixed and not fixed) or (
                fixed == best_fixed and support_state[b].stale_s > support_state[best].stale_s
            ):
                best = b
    return best


@njit(nogil=True, error_model="numpy")
def count_separations(support_state, bank):
    """Count the steps in which ringing may cause contact separation: Σ_k law[6, k] |z_k| > 1.

    law[6]: newtons per unit of z over the load, of each mode at the point where it separates first. No step is
    missed, and some are counted in which modes separate at different points.
    """
    ringing, law, z, driven = bank.ringing, bank.law, bank.z, bank.driven
    modes = law.shape[1]
    for b in range(len(support_state)):
        if support_state[b].points and (ringing[b].ringing or ringing[b].driven):
            total = 0.0
            for m in range(bank.body[b].start, bank.body[b].stop):
                if law[6, m] > 0.0:
                    x, y = z[m] + driven[m], z[modes + m] + driven[modes + m]
                    total += law[6, m] * np.sqrt(x * x + y * y)
            support_state[b].steps += 1
            support_state[b].separated += total > 1.0
