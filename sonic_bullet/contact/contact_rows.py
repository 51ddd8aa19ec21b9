"""Contacts of a step in the frames of both bodies of each pair, and their loads in the pairs' histories.

    CONTACT (k,) -> orient: ROW (k,), turned onto the pair's lower body, sorted by pair, as they came within it
        -> enter_loads: PAIR, found by its key or begun anew; the newest load enters, the oldest leaves
        -> support N at both ends of the step being rendered: the opening of the load   [load_splitting]

A pair keeps its place in the PAIR table as long as it touches: `active` (places) lists those in use, sorted by key, and
`free` the others, the next one to be taken last; count (2,): how many of both. Python makes room before it calls: for
the active pairs and all that the steps at hand name. No result depends on which place a pair has.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.contact.load_splitting import HISTORY, NOW, opening
from sonic_bullet.machine.compiled import njit


@njit(nogil=True, error_model="numpy")
def orient(contacts, quaternion, rows):
    """Turn the contacts (k,) of a step onto the lower body of each pair: rows (k,), sorted by key, stably.

    quaternion (b, 4): of the bodies in that step.
    """
    count = len(contacts)
    key, order, other = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    for i in range(count):
        a, b = np.int64(contacts[i].a), np.int64(contacts[i].b)
        key[i], order[i] = (min(a, b) << 32) | max(a, b), i
    width = 1
    while width < count:  # merged pairwise, from single ones on
        for start in range(0, count, 2 * width):
            middle, stop = min(start + width, count), min(start + 2 * width, count)
            i, j = start, middle
            for place in range(start, stop):
                if j >= stop or (i < middle and key[order[i]] <= key[order[j]]):
                    other[place] = order[i]
                    i += 1
                else:
                    other[place] = order[j]
                    j += 1
        order, other = other, order
        width *= 2
    turn = np.empty((3, 3))
    for i in range(count):
        rows[i].key = key[order[i]]
        _turn(contacts[order[i]], quaternion, turn, rows[i])


@njit(nogil=True, error_model="numpy")
def _turn(contact, quaternion, turn, row):
    """Fill a row but for its key. turn (3, 3): scratch."""
    swapped = contact.a > contact.b
    impulse, normal = contact.impulse_n_s, contact.normal
    sign, load_n_s = -1.0 if swapped else 1.0, 0.0
    for x in range(3):
        row.impulse_n_s[x], row.normal[x] = sign * impulse[x], sign * normal[x]
        load_n_s += impulse[x] * normal[x]
    row.load_n_s = max(load_n_s, 0.0)
    row.approach_m_s, row.gap_m, row.touched = contact.approach_m_s, contact.gap_m, 0
    for side in range(2):
        is_a = (side == 1) == swapped
        body, point = (contact.a, contact.point_a_m) if is_a else (contact.b, contact.point_b_m)
        sign = 1.0 if is_a else -1.0  # the row acts on a and points to it
        row.body[side], row.sweep_m_s[side] = body, contact.sweep_m_s[0 if is_a else 1]
        q = quaternion[body]
        norm = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        w = q[3] / norm
        for x in range(3):  # body to world [Kuipers, Quaternions and Rotation Sequences, 1999, sec. 5.15]
            y, z = (x + 1) % 3, (x + 2) % 3
            u, v, t = q[x] / norm, q[y] / norm, q[z] / norm
            turn[x, x], turn[x, y], turn[y, x] = 1 - 2 * (v * v + t * t), 2 * (u * v - t * w), 2 * (u * v + t * w)
        for x in range(3):
            arm_m, outward, local_impulse_n_s = 0.0, 0.0, 0.0
            for y in range(3):
                arm_m += turn[x, y] * point[y]
                outward -= turn[y, x] * (sign * normal[y])
                local_impulse_n_s += turn[y, x] * (sign * impulse[y])
            row.point_m[side, x], row.arm_m[side, x] = point[x], arm_m
            row.outward[side, x], row.local_impulse_n_s[side, x] = outward, local_impulse_n_s


@njit(nogil=True, error_model="numpy")
def enter_loads(rows, start, stop, dt_s, pairs):
    """Enter the loads of rows start … stop - 1, one step's, into the histories, which are shifted by a step.

    Pairs without load in all of their history and without friction (rubs) leave.
    """
    active, counts, free = pairs.active, pairs.count, pairs.free
    merged = np.empty(counts[0] + stop - start, np.int64)
    i, r, kept = 0, start, 0
    while i < counts[0] or r < stop:  # pairs of both lists, by key
        fresh = r < stop and (i == counts[0] or rows[r].key < pairs.pair[active[i]].key)
        if fresh:
            counts[1] -= 1
            place = free[counts[1]]
            _begin(pairs.pair[place], rows[r])
        else:
            place = active[i]
            i += 1
        pair = pairs.pair[place]
        force, struck = pair.force_n, pair.struck_n
        stays = pair.rubs != 0
        for column in range(1, HISTORY):
            force[column - 1], struck[column - 1] = force[column], struck[column]
            stays = stays or force[column] > 0
        load_n_s = 0.0
        while r < stop and rows[r].key == pair.key:
            load_n_s += rows[r].load_n_s
            r += 1
        force[HISTORY - 1], struck[HISTORY - 1] = load_n_s / dt_s, 0.0
        if stays or load_n_s > 0:
            for end in range(2):
                pair.support_n[end] = opening(force, NOW + end)
            merged[kept] = place
            kept += 1
        else:
            free[counts[1]] = place
            counts[1] += 1
    counts[0] = kept
    for i in range(kept):
        active[i] = merged[i]


@njit(nogil=True, error_model="numpy")
def _begin(pair, row):
    """Reset a place for the pair of a row: no load so far, no friction."""
    pair.key = row.key
    pair.rubs, pair.gains, pair.load_n = 0, 0, 0.0
    for side in range(2):
        pair.body[side], pair.sweep_m_s[side] = row.body[side], 0.0
    for x in range(3):
        pair.direction[x] = 0.0
    for column in range(HISTORY):
        pair.force_n[column] = pair.struck_n[column] = 0.0
