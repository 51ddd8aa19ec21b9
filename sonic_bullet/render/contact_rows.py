"""Contacts of a step as both bodies of each pair see them, and the loads that they add to the pairs' histories.

    CONTACT (k,) -> orient: ROW (k,), turned onto the pair's lower body, sorted by pair, as they came within it
        -> enter_loads: PAIR, found by its key or begun anew; the newest load enters, the oldest leaves
        -> support N at both ends of the step being rendered: the opening of the load   [synth.strikes]

A pair keeps its place in the PAIR table as long as it touches: `active` (places) lists those in use, sorted by key, and
`free` the others, the next one to be taken last; counts (2,): how many of both. Python makes room before it calls: for
the active pairs and all that the steps at hand name. Nothing hangs on which place a pair has.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.render.contact_place import rotation
from sonic_bullet.render.tables import HISTORY
from sonic_bullet.synth.strikes import NOW, SPAN


@njit(nogil=True, error_model="numpy")
def orient(contacts, quaternion, rows):
    """Turn the contacts (k,) of a step onto the lower body of each pair: rows (k,), sorted by key, stably. quaternion
    (b, 4): of the bodies in that step.
    """
    count = len(contacts)
    key = np.empty(count, np.int64)
    for i in range(count):
        a, b = np.int64(contacts[i].a), np.int64(contacts[i].b)
        key[i] = (min(a, b) << 32) | max(a, b)
    order = _sorted_places(key)
    for i in range(count):
        at = order[i]
        rows[i].key = key[at]
        _turn(contacts[at], quaternion, rows[i])


@njit(nogil=True, error_model="numpy")
def _sorted_places(key):
    """Places (k,) that sort the keys (k,), equal ones as they come: merged pairwise, from single ones on."""
    count = len(key)
    order, other = np.empty(count, np.int64), np.empty(count, np.int64)
    for i in range(count):
        order[i] = i
    width = 1
    while width < count:
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
    return order


@njit(nogil=True, error_model="numpy")
def _turn(contact, quaternion, row):
    """Fill a row but for its key."""
    swapped = contact.a > contact.b
    lower = 1 if swapped else 0  # the contact's side that is the row's side 0
    row.body[lower], row.body[1 - lower] = contact.a, contact.b
    sweep = contact.sweep_m_s
    row.sweep_m_s[lower], row.sweep_m_s[1 - lower] = sweep[0], sweep[1]
    row.approach_m_s, row.gap_m = contact.approach_m_s, contact.gap_m
    row.touched = 0
    sign = -1.0 if swapped else 1.0
    impulse, normal = contact.impulse_n_s, contact.normal
    jx, jy, jz = sign * impulse[0], sign * impulse[1], sign * impulse[2]
    nx, ny, nz = sign * normal[0], sign * normal[1], sign * normal[2]
    _set(row.impulse_n_s, jx, jy, jz)
    _set(row.normal, nx, ny, nz)
    row.load_n_s = max(jx * nx + jy * ny + jz * nz, 0.0)
    _set_side(row, 0, contact.point_b_m if swapped else contact.point_a_m, quaternion, jx, jy, jz, -nx, -ny, -nz)
    _set_side(row, 1, contact.point_a_m if swapped else contact.point_b_m, quaternion, -jx, -jy, -jz, nx, ny, nz)


@njit(nogil=True, error_model="numpy")
def _set(vector, x, y, z):
    vector[0], vector[1], vector[2] = x, y, z


@njit(nogil=True, error_model="numpy")
def _set_side(row, side, point, quaternion, jx, jy, jz, nx, ny, nz):
    """One body's view: contact in its frame, impulse j on it and outward normal n in the world."""
    q = quaternion[row.body[side]]
    xx, xy, xz, yx, yy, yz, zx, zy, zz = rotation(q)
    x, y, z = point[0], point[1], point[2]
    _set(row.point_m[side], x, y, z)
    _set(row.arm_m[side], xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z)
    _set(row.outward[side], xx * nx + yx * ny + zx * nz, xy * nx + yy * ny + zy * nz, xz * nx + yz * ny + zz * nz)
    _set(row.push_n_s[side], xx * jx + yx * jy + zx * jz, xy * jx + yy * jy + zy * jz, xz * jx + yz * jy + zz * jz)


@njit(nogil=True, error_model="numpy")
def enter_loads(rows, start, stop, dt_s, pairs, active, counts, free):
    """The loads of rows start … stop - 1, one step's, enter the histories, which are one step older then. Pairs without
    load in all of their history and without a voice (rubs) leave.
    """
    for i in range(counts[0]):
        pair = pairs[active[i]]
        _shift(pair.force_n)
        _shift(pair.struck_n)
    merged = np.empty(counts[0] + stop - start, np.int64)
    i, r, kept = 0, start, 0
    while i < counts[0] or r < stop:  # pairs of both lists, by key
        if r < stop and (i == counts[0] or rows[r].key < pairs[active[i]].key):
            counts[1] -= 1
            place = free[counts[1]]
            _begin(pairs[place], rows[r])
        else:
            place = active[i]
            i += 1
        pair = pairs[place]
        key, load_n_s = pair.key, 0.0
        while r < stop and rows[r].key == key:
            load_n_s += rows[r].load_n_s
            r += 1
        force = pair.force_n
        force[HISTORY - 1] = load_n_s / dt_s
        if pair.rubs != 0 or is_loaded(force, 0, HISTORY):
            pair.support_n[0], pair.support_n[1] = opening(force, NOW), opening(force, NOW + 1)
            merged[kept] = place
            kept += 1
        else:
            free[counts[1]] = place
            counts[1] += 1
    counts[0] = kept
    for i in range(kept):
        active[i] = merged[i]


@njit(nogil=True, error_model="numpy")
def _shift(column):
    for i in range(HISTORY - 1):
        column[i] = column[i + 1]
    column[HISTORY - 1] = 0.0


@njit(nogil=True, error_model="numpy")
def _begin(pair, row):
    """A place for the pair of a row: no load so far, no voice."""
    pair.key = row.key
    pair.body[0], pair.body[1] = row.body[0], row.body[1]
    for i in range(HISTORY):
        pair.force_n[i] = 0.0
        pair.struck_n[i] = 0.0
    pair.rubs = 0
    pair.gains = 0
    pair.load_n = 0.0
    pair.sweep_m_s[0], pair.sweep_m_s[1] = 0.0, 0.0
    _set(pair.direction, 0.0, 0.0, 0.0)


@njit(nogil=True, error_model="numpy")
def is_loaded(force, start, stop):
    """Whether any of the loads start … stop - 1 is above 0."""
    loaded = False
    for i in range(start, stop):
        loaded = loaded or force[i] > 0
    return loaded


@njit(nogil=True, error_model="numpy")
def opening(force, column):
    """Opening of the load at a column: the best of the windows of SPAN steps around it, cut where the future is not
    known.
    """
    best = 0.0
    if force[column] > 0:
        for first in range(max(column - SPAN + 1, 0), column + 1):
            least = force[first]
            for i in range(first + 1, min(first + SPAN, HISTORY)):
                least = min(least, force[i])
            best = max(best, least)
    return best
