"""Kernels of `first_order`: stiffness, a motion for each mode, and each motion's pole, transmission and forces.

    CoupledSystem                    -> `couple`           both, stiff
    eigenvectors, pairs              -> `choose_motions`   which of them each mode becomes
    CoupledSystem, Motions           -> `solve_motions`    MotionPoles

Equations: `first_order`. Complex numbers of large tables stand as two real ones, which a compiler makes vectors of.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.contact.coupling.coupled_modes import STIFFEST_RATIO, STOPPED_RATIO
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array


class Motions(NamedTuple):
    """Motions of a body, and of its light partners, on its springs without losses.

    Attributes
    ----------
    value : ω² of all (n,)
    vector : (n, n) of all, by columns; rows of pairs are turned in place
    both : (r, n) of `couple`; columns of pairs are turned in place
    chosen : (m,) that of each mode; of a pair in place in the order in which they resemble those before
    pairs : (p,)
    before : (m, m) earlier turn; (0, 0) for the identity
    """

    value: Array
    vector: Array
    both: Array
    chosen: Array
    pairs: Array
    before: Array


class MotionPoles(NamedTuple):
    """Poles of the motions chosen; see `CoupledModes`.

    Attributes
    ----------
    omega_rad_s, decay_per_s : (m,)
    turn, motion : (m, m)
    shares : (m, 3)
    newton : (m,)
    force : (2, r, m) at the springs, for a velocity of 1 of a motion
    moved : (P, m) complex, velocity of all partners' modes
    """

    omega_rad_s: Array
    decay_per_s: Array
    turn: Array
    motion: Array
    shares: Array
    newton: Array
    force: Array
    moved: Array


@njit(nogil=True, error_model="numpy")
def couple(x):
    """Compute both (r, n), motion at the springs of the body and of light partners' rigid motions, and their stiffness.

    The stiffness (n, n) is Λ + bothᵀ Re(K) both.
    """
    r, own = x.own.shape
    light = np.zeros(len(x.other_lam), np.bool_)
    for p in range(len(light)):
        for c in range(r if x.other_lam[p] == 0.0 else 0):
            light[p] |= x.other[c, p] != 0.0
    n = own + np.count_nonzero(light)
    both, stiff = np.empty((r, n)), np.zeros((n, n))
    for c in range(r):
        both[c, :own] = x.own[c]
        at = own
        for p in range(len(light)):
            if light[p]:
                both[c, at] = -x.other[c, p]
                at += 1
        here, spring = both[c], x.spring[c].real
        for i in range(n):
            factor, row = spring * here[i], stiff[i]
            for j in range(n):
                row[j] += factor * here[j]
    for i in range(own):
        stiff[i, i] += x.lam[i]
    return both, stiff


@njit(nogil=True, error_model="numpy")
def choose_motions(vector, m, pairs):
    """Choose for each of m modes the column (m,) of vector with most of it, of a pair the two with most of both.

    Where two choose the same, the first of them is -1: their sum is not the largest.
    """
    n = vector.shape[1]
    chosen, taken, share = np.full(m, -1), np.zeros(n, np.bool_), np.empty(n)
    many, paired = 1, 0
    for i in range(m):
        if many == 2:  # the second of a pair has its column
            many = 1
            continue
        many = 2 if paired < len(pairs) and pairs[paired] == i else 1
        paired += many - 1
        for k in range(n):
            share[k] = vector[i, k] ** 2
            if many == 2:
                share[k] += vector[i + 1, k] ** 2
        for j in range(many):
            best = 0
            for k in range(1, n):
                if share[k] > share[best]:
                    best = k
            if taken[best]:
                chosen[0] = -1
                return chosen
            taken[best], chosen[i + j], share[best] = True, best, -1.0
    return chosen


@njit(nogil=True, error_model="numpy")
def turn_pairs(motions, m):
    """Turn the pairs (p,) of m modes to their motions: rows of vector, columns of both; return turn (m, m).

    Of each pair the turn is the orthogonal matrix nearest to its part of the two motions [Schönemann 1966], columns in
    the order, and with the sign, in which they resemble those before.
    """
    vector, both, chosen, before = motions.vector, motions.both, motions.chosen, motions.before
    turn = np.eye(m)
    made, along, old = np.empty((2, 2)), np.empty((2, 2)), np.eye(2)
    for i in motions.pairs:
        a, b = vector[i, chosen[i]], vector[i, chosen[i + 1]]
        c, d = vector[i + 1, chosen[i]], vector[i + 1, chosen[i + 1]]
        sign = 1.0 if a * d - b * c >= 0.0 else -1.0
        x, y = a + sign * d, b - sign * c
        length = np.sqrt(x * x + y * y)
        x, y = (x / length, y / length) if length > 0.0 else (1.0, 0.0)
        made[0, 0], made[0, 1], made[1, 0], made[1, 1] = x, y, -sign * y, sign * x
        for row in range(2):
            for column in range(2 if len(before) else 0):
                old[row, column] = before[i + row, i + column]
        for row in range(2):
            for column in range(2):
                along[row, column] = old[0, row] * made[0, column] + old[1, row] * made[1, column]
        first, second = 0, 1
        if abs(along[0, 1]) + abs(along[1, 0]) > abs(along[0, 0]) + abs(along[1, 1]):
            first, second = 1, 0
            chosen[i], chosen[i + 1] = chosen[i + 1], chosen[i]
        one = -1.0 if along[0, first] < 0.0 else 1.0
        other = -1.0 if along[1, second] < 0.0 else 1.0
        p, q, r, s = made[0, first] * one, made[0, second] * other, made[1, first] * one, made[1, second] * other
        turn[i, i], turn[i, i + 1], turn[i + 1, i], turn[i + 1, i + 1] = p, q, r, s
        for n in range(vector.shape[1]):
            u, v = vector[i, n], vector[i + 1, n]
            vector[i, n], vector[i + 1, n] = p * u + r * v, q * u + s * v
        for n in range(both.shape[0]):
            u, v = both[n, i], both[n, i + 1]
            both[n, i], both[n, i + 1] = p * u + r * v, q * u + s * v
    return turn


@njit(nogil=True, error_model="numpy")
def move_partners(x, force, square, moved, gives):
    """Add the partners' motion (2, r, m) at the springs to gives; return Σ moved² (2, m).

    force (r, m); square (m,): ω²; moved (4, P, m): filled with motion and compliance of each of their modes.
    """
    (r, m), mode = force.shape, 0
    slope, along = np.zeros((2, m)), np.empty(m)
    for p in range(len(x.other_lam)):
        lam, loss = x.other_lam[p], 2.0 * x.other_decay[p]
        if lam <= 0.0:
            continue
        along[:] = 0.0
        for c in range(r):
            shape, row = x.other[c, p], force[c]
            for k in range(m):
                along[k] += shape * row[k]
        u, v, y, z = moved[0, mode], moved[1, mode], moved[2, mode], moved[3, mode]
        for k in range(m):
            real, imaginary = lam - square[k], loss * np.sqrt(square[k])
            size = 1.0 / (real * real + imaginary * imaginary)
            y[k], z[k] = real * size, -imaginary * size
            u[k], v[k] = along[k] * y[k], along[k] * z[k]
            slope[0, k] += u[k] * u[k] - v[k] * v[k]
            slope[1, k] += 2.0 * u[k] * v[k]
        for c in range(r):
            shape, first, second = x.other[c, p], gives[0, c], gives[1, c]
            for k in range(m):
                first[k] += shape * u[k]
                second[k] += shape * v[k]
        mode += 1
    return slope


@njit(nogil=True, error_model="numpy")
def hold_against(spring, value, own, force, gives):
    """Compute gᵀRg (2, m) of forces F (r, n) of all motions and compliant motion of the chosen ones, gives (2, r, m).

    value (n,), own (m,): ω² of all, and of the chosen ones.

    Two motions of nearly one frequency would each need the other's: their mutual term is bounded by their product.
    """
    r, m = gives.shape[1:]
    held, x, y = np.zeros((2, m)), np.empty(m), np.empty(m)
    for n in range(len(value)):
        x[:], y[:] = 0.0, 0.0
        for c in range(r):
            first, second, f = gives[0, c], gives[1, c], force[c, n]
            for k in range(m):
                x[k] += f * first[k]
                y[k] += f * second[k]
        for k in range(m):  # a motion is 0 apart from itself
            apart = value[n] - own[k]
            bound = apart * apart + (x[k] * x[k] + y[k] * y[k])
            part = apart / (bound if bound > 0.0 else 1.0)
            held[0, k] -= (x[k] * x[k] - y[k] * y[k]) * part
            held[1, k] -= 2.0 * x[k] * y[k] * part
    for c in range(r):
        for k in range(m):
            u, v = gives[0, c, k], gives[1, c, k]
            held[0, k] += spring[c] * (u * u - v * v)
            held[1, k] += spring[c] * (2.0 * u * v)
    return held


@njit(nogil=True, error_model="numpy")
def press_springs(x, motions):
    """Compute the forces (r, n) at the springs of all motions."""
    n, r = len(motions.value), len(x.spring)
    every = np.zeros((r, n))
    for c in range(r):
        row = every[c]
        for i in range(n):
            shape, column = motions.both[c, i] * x.spring[c].real, motions.vector[i]
            for k in range(n):
                row[k] += shape * column[k]
    return every


@njit(nogil=True, error_model="numpy")
def yield_springs(x, force, square, gives):
    """Add what lies under the springs, and their loss, to gives (2, r, m); return Fᵀg of the loss and of the partners.

    force (r, m); square (m,): ω²; gives holds the partners' modes.
    """
    r, m = force.shape
    contact, partner = np.zeros(m, np.complex128), np.zeros(m, np.complex128)
    for c in range(r):
        loss = 1.0 / x.spring[c] - 1.0 / x.spring[c].real
        for k in range(m):
            w, f = np.sqrt(square[k]), force[c, k]
            below = x.plate[c] + x.half_space[c] * square[k]
            if w > 0.0:
                gives[1, c, k] -= below / w * f
            else:
                gives[0, c, k] += below * f
            contact[k] += f * f * loss
            partner[k] += f * complex(gives[0, c, k], gives[1, c, k])
            gives[0, c, k] += loss.real * f
            gives[1, c, k] += loss.imag * f
    return contact, partner


@njit(nogil=True, error_model="numpy")
def split_decay(own, contact, partner, size, decay, shares):
    """Split a decay into shares (3,): the body's own, the contacts', the partners', each with a power not below 0."""
    shares[0], shares[1], shares[2] = max(own, 0.0), max(-contact * size, 0.0), max(-partner * size, 0.0)
    whole = max(shares[0] + shares[1] + shares[2], 1e-300)
    for i in range(3):
        shares[i] *= decay / whole


@njit(nogil=True, error_model="numpy")
def solve_motions(x, motions):
    """Compute the MotionPoles of the motions chosen, of a `CoupledSystem`."""
    chosen, (r, m) = motions.chosen, (len(x.spring), len(motions.chosen))
    turn = turn_pairs(motions, m)
    every, own, damped = press_springs(x, motions), np.empty((m, m)), np.zeros(m)
    for i in range(m):
        for k in range(m):
            own[i, k] = motions.vector[i, chosen[k]]
            damped[k] += own[i, k] * own[i, k] * x.decay[i]
    highest, square, free, force = np.sqrt(x.lam[:m].max()), np.empty(m), np.empty(m), np.empty((r, m))
    for k in range(m):
        free[k], square[k] = motions.value[chosen[k]], max(motions.value[chosen[k]], 0.0)
        for c in range(r):
            force[c, k] = every[c, chosen[k]]
    moved, gives = np.empty((4, np.count_nonzero(x.other_lam > 0.0), m)), np.zeros((2, r, m))
    slope = move_partners(x, force, square, moved, gives)
    contact, partner = yield_springs(x, force, square, gives)
    held = hold_against(x.spring.real, motions.value, free, every, gives)
    omega, decay, newton = np.empty(m), np.empty(m), np.empty(m, np.bool_)
    shares, made, part, shift = np.empty((m, 3)), np.zeros((2, r, m)), np.empty((2, m)), np.empty((2, m))
    for k in range(m):
        w, yielded, against = np.sqrt(square[k]), contact[k] + partner[k], complex(held[0, k], held[1, k])
        one = 1.0 / (1.0 + against / (yielded if abs(yielded) > 0.0 else complex(1.0, 0.0)))
        steep = -(one * one) * complex(slope[0, k], slope[1, k])
        off = one * yielded * (2.0 / (1.0 + np.sqrt(1.0 - 4.0 * steep)))
        off = complex(off.real, 0.0) if off.imag > 0.0 else off  # no mode gains
        new = -damped[k] + 1j * np.sqrt(square[k] - off - damped[k] * damped[k])
        newton[k] = not (w > STIFFEST_RATIO * highest or -new.real > STOPPED_RATIO * abs(new) or not new.imag > 0.0)
        if not newton[k]:
            root = np.sqrt(x.lam[k])
            new = complex(-root * STOPPED_RATIO, root * np.sqrt(1.0 - STOPPED_RATIO * STOPPED_RATIO))
        omega[k], decay[k] = new.imag, max(-new.real, 0.0)
        along, turned = one / (1j * w) if w > 0.0 else one, off * one
        for c in range(r if newton[k] else 0):
            made[0, c, k], made[1, c, k] = force[c, k] * along.real, force[c, k] * along.imag
        part[0, k], part[1, k], shift[0, k], shift[1, k] = one.real, one.imag, turned.real, turned.imag
        size = (one.real * one.real + one.imag * one.imag) / max(2.0 * w, 1e-300)
        split_decay(damped[k], contact[k].imag, partner[k].imag, size, decay[k], shares[k])
    share_motion(newton, part, shift, moved)
    return MotionPoles(omega, decay, turn, own, shares, newton, made, moved[0] + 1j * moved[1])


@njit(nogil=True, error_model="numpy")
def share_motion(newton, part, shift, moved):
    """Compute the partners' velocities (P, m), moved[:2], per velocity of each motion; of one that is held, 0.

    part, shift (2, m): 1/(1 + ρ), and δ times it; moved (4, P, m): of the partners' modes, and their compliance.
    """
    count, m = moved.shape[1:]
    size = np.ones(m)
    for p in range(count):
        u, v, y, z = moved[0, p], moved[1, p], moved[2, p], moved[3, p]
        for k in range(m):
            real = 1.0 + shift[0, k] * y[k] - shift[1, k] * z[k]
            imaginary = shift[0, k] * z[k] + shift[1, k] * y[k]
            below = 1.0 / (real * real + imaginary * imaginary)
            a, b = u[k] * part[0, k] - v[k] * part[1, k], u[k] * part[1, k] + v[k] * part[0, k]
            first, second = (a * real + b * imaginary) * below, (b * real - a * imaginary) * below
            fine = newton[k] and abs(first) < np.inf and abs(second) < np.inf
            u[k], v[k] = (first, second) if fine else (0.0, 0.0)
            size[k] += u[k] * u[k] + v[k] * v[k]
    for p in range(count):
        for k in range(m):
            moved[0, p, k] /= size[k]
            moved[1, p, k] /= size[k]
