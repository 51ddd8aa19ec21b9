"""Strikes of one physics step, from the pairs' loads and contact rows to force pulses on modes.

    PAIR: load F - opening of F, over a rising edge -> STRIKE, with its share of up to three steps   [synth.strikes]
        + ROW of these steps -> impulse, normal, lever, approach; what of it has a cause
        -> PULSE: start, length, impulse, share handed over; and Uᵀj on either body

One pulse's rows of up to three steps, several points each, share its time history, so that the manifold's sum and
moment, which are all that is reliable, are kept: Uᵀj is summed over the rows, each at its own point with its own
direction, friction included. Strikes in the order of their pairs' keys, rows of one by step and as they came.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.render.contact_place import (
    add_push,
    contact_modulus,
    effective_mass,
    flat_area_m2,
    smaller_size,
    touch,
)
from sonic_bullet.render.contact_rows import is_loaded, opening
from sonic_bullet.synth.pulse import compliance, pulse_length
from sonic_bullet.synth.strikes import NOW, SPAN

STEEPEST = 10.0
"""Most friction per normal force that a manifold which carries load may show: a contact that Bullet drops within a step
keeps its friction.
"""
STRUCK_FLAT = 0.02
"""Radius, as a share of the smaller body's size, of the least area that a nearly flat impact touches."""
LEAST_JUMP_M_S = 1e-6
"""An impact that changes the speed of its effective mass by less is passed over: a body of 10 cm sends 0 dB SPL to 1 m
then.
"""
ROUNDS = 8
"""Bodies that an impact travels through in one physics step at most."""
STEPS = SPAN - 1
"""Steps that one strike takes at most."""

STRIKE = np.dtype(
    [
        ("body", "i8", (2,)),
        ("share", "f8", (STEPS,)),  # of the normal impulse of its steps
        ("row", "i8", (STEPS, 2)),  # its rows in each of them: first and the one after the last
        ("raw_n_s", "f8"),  # normal impulse of these shares
        ("impulse_n_s", "f8", (3,)),  # the whole of them, on the lower body, world frame
        ("normal", "f8", (3,)),
        ("arm_m", "f8", (2, 3)),
        ("approach_m_s", "f8"),
        ("mass_kg", "f8"),
        ("budget_n_s", "f8"),  # what the approach can cause
        ("accepted_n_s", "f8"),
    ],
    align=True,
)
"""A strike that is being looked at: one for each active pair at most."""


@njit(nogil=True, error_model="numpy")
def find_pulses(
    ahead,
    number,
    earliest_s,
    dt_s,
    gravity_m_s2,
    quaternion,
    rows,
    window,
    pairs,
    active,
    counts,
    bodies,
    faces,
    nodes,
    shapes,
    frequency_hz,
    spectrum,
    strikes,
    pulses,
    push,
    found,
):
    """The strikes that begin ``ahead`` steps (0 or 1) after the one being rendered: into pulses and push (pulses, 2,
    columns) from ``found`` on, their new number comes back. What they use of the loads is marked as used. Ask with
    ahead = 0 first.

    number, dt_s, gravity_m_s2 (3,), quaternion (b, 4): of the step in which they begin. earliest_s: not after 0; a
    strike is dated back that far at most, where the bodies overlap as the step starts. window (4, 2): rows of the step
    being rendered and of the three after it, first and the one after the last. counts: as enter_loads has it.
    frequency_hz: flat, see BODY.frequency_at; spectrum: synth.pulse.spectrum_table. strikes: scratch of STRIKE, one for
    each active pair.

    Pairs of which nothing can sound (no modes, no moving volume) are passed over, and those of which neither moves.
    """
    struck = _split(ahead, pairs, active, counts[0], rows, window, strikes)
    if struck == 0:
        return found
    held = _unheld_steps(ahead, number, pairs, active, counts[0], bodies)
    g = gravity_m_s2
    gravity = np.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) * dt_s
    caused = False
    for q in range(struck):
        strike = strikes[q]
        _gather(strike, rows)
        n, low, high = strike.normal, strike.body[0], strike.body[1]
        # a tenth for what a solver leaves over, a hundredth in every direction for bodies that are wedged
        fall = 1.1 * abs(n[0] * g[0] + n[1] * g[1] + n[2] * g[2]) * dt_s + 0.01 * gravity
        speed = max(strike.approach_m_s - max(held[low], held[high]) * fall, 0.0)
        strike.budget_n_s = 0.0
        if speed > 0:
            strike.budget_n_s = 2.0 * _mass(strike, bodies, quaternion) * speed
            caused = True
    if not caused:
        return found
    accept(strikes, struck, bodies)
    for q in range(struck):
        if _is_audible(strikes[q], bodies, quaternion):
            for side in range(2):
                for c in range(push.shape[2]):
                    push[found, side, c] = 0.0
            _make(strikes[q], rows, bodies, faces, nodes, shapes, frequency_hz, spectrum, pulses[found], push[found])
            pulses[found].start_s = min(max(_meeting_s(strikes[q], rows), earliest_s), dt_s)
            pulses[found].ahead = ahead
            found += 1
    return found


@njit(nogil=True, error_model="numpy")
def _split(ahead, pairs, active, count, rows, window, strikes):
    """What is strike of the loads ``ahead`` steps after the one being rendered: the number of strikes, their bodies,
    shares and rows. It is marked as used.

    An opening that the future could still lower is taken as high as it may be, so nothing is struck that may be
    support; asked again when more is known, a strike gives what it lacked.
    """
    column = NOW + ahead
    found = 0
    for i in range(count):
        pair = pairs[active[i]]
        force, used = pair.force_n, pair.struck_n
        if not force[column] > force[column - 1]:
            continue
        excess = _excess(force, used, column)
        if excess == 0:
            continue
        strike = strikes[found]
        found += 1
        strike.body[0], strike.body[1] = pair.body[0], pair.body[1]
        for j in range(STEPS):  # as long as one step strikes on
            if j > 0 and excess > 0:
                excess = _excess(force, used, column + j)
            strike.share[j] = 0.0
            if excess > 0:
                used[column + j] += excess
                strike.share[j] = excess / force[column + j]
                first = _first_row(rows, window[ahead + j, 0], window[ahead + j, 1], pair.key)
                stop = first
                while stop < window[ahead + j, 1] and rows[stop].key == pair.key:
                    stop += 1
                strike.row[j, 0], strike.row[j, 1] = first, stop
    return found


@njit(nogil=True, error_model="numpy")
def _excess(force, used, column):
    """Load in newton above support and what strikes have used up; 0 where it is rounding of the sums."""
    excess = force[column] - opening(force, column) - used[column]
    return excess if excess > 1e-9 * force[column] else 0.0


@njit(nogil=True, error_model="numpy")
def _first_row(rows, start, stop, key):
    """The first of the rows start … stop - 1, sorted by key, that is not below the key."""
    while start < stop:
        middle = (start + stop) // 2
        if rows[middle].key < key:
            start = middle + 1
        else:
            stop = middle
    return start


@njit(nogil=True, error_model="numpy")
def _unheld_steps(ahead, number, pairs, active, count, bodies):
    """(b,) steps for which gravity may have moved each mobile body although it rests: 1 where it carried load on any
    pair within the STEPS before, SPAN where it was just put where it is: Bullet finds the corners on which a box stands
    one a step, and it tilts meanwhile.
    """
    held = np.empty(len(bodies))
    for i in range(len(bodies)):
        held[i] = 0.0
    for i in range(count):
        pair = pairs[active[i]]
        if is_loaded(pair.force_n, NOW + ahead - STEPS, NOW + ahead):
            held[pair.body[0]] = held[pair.body[1]] = 1.0
    for i in range(len(bodies)):
        if bodies[i].mass_kg <= 0:
            held[i] = 0.0
        elif number - bodies[i].placed < SPAN:
            held[i] = SPAN
    return held


@njit(nogil=True, error_model="numpy")
def _gather(strike, rows):
    """Sums over a strike's rows, each weighted by the share of its step that is strike."""
    j, n, low, high = strike.impulse_n_s, strike.normal, strike.arm_m[0], strike.arm_m[1]
    raw, approach = 0.0, 0.0
    for x in range(3):
        j[x], n[x], low[x], high[x] = 0.0, 0.0, 0.0, 0.0
    for delay in range(STEPS):
        share = strike.share[delay]
        if share > 0:
            for r in range(strike.row[delay, 0], strike.row[delay, 1]):
                row = rows[r]
                load = row.load_n_s * share
                raw += load
                approach = max(approach, row.approach_m_s)
                for x in range(3):
                    j[x] += share * row.impulse_n_s[x]
                    n[x] += load * row.normal[x]
                    low[x] += load * row.arm_m[0, x]
                    high[x] += load * row.arm_m[1, x]
    strike.raw_n_s, strike.approach_m_s, strike.mass_kg = raw, approach, -1.0
    raw = max(raw, 1e-300)
    for x in range(3):
        n[x], low[x], high[x] = n[x] / raw, low[x] / raw, high[x] / raw
    length = max(np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), 1e-300)
    for x in range(3):
        n[x] /= length


@njit(nogil=True, error_model="numpy")
def _mass(strike, bodies, quaternion):
    """Effective mass of a strike in kg, 0 where neither body moves: found once, when somebody asks."""
    if strike.mass_kg < 0:
        strike.mass_kg = effective_mass(
            bodies, strike.body[0], strike.body[1], quaternion, strike.arm_m[0], strike.arm_m[1], strike.normal
        )
    return strike.mass_kg


@njit(nogil=True, error_model="numpy")
def accept(strikes, count, bodies):
    """Strike impulses that a cause explains: the own budget, or that of a neighbour struck in the same step. A body
    that never moves hands nothing on: the floor.

    The largest neighbour counts, not the sum: solver noise of a pile must not add up to an impact.
    """
    through = np.empty(len(bodies))
    for q in range(count):
        strikes[q].accepted_n_s = min(strikes[q].raw_n_s, strikes[q].budget_n_s)
    for _ in range(ROUNDS):
        for q in range(count):
            through[strikes[q].body[0]] = through[strikes[q].body[1]] = 0.0
        for q in range(count):
            for side in range(2):
                body = strikes[q].body[side]
                if bodies[body].mass_kg > 0:
                    through[body] = max(through[body], strikes[q].accepted_n_s)
        grown = False
        for q in range(count):
            strike = strikes[q]
            handed = max(through[strike.body[0]], through[strike.body[1]])
            more = min(strike.raw_n_s, max(strike.budget_n_s, handed))
            grown = grown or more != strike.accepted_n_s
            strike.accepted_n_s = more
        if not grown:
            break


@njit(nogil=True, error_model="numpy")
def _is_audible(strike, bodies, quaternion):
    """Whether anything of a strike is heard."""
    if strike.accepted_n_s <= 0:
        return False
    sounds = False
    for side in range(2):
        body = bodies[strike.body[side]]
        sounds = sounds or body.modes > 0 or body.rigid != 0
    j, mass = strike.impulse_n_s, _mass(strike, bodies, quaternion)
    return (
        sounds
        and mass > 0
        and strike.accepted_n_s > LEAST_JUMP_M_S * mass
        and strike.raw_n_s * STEEPEST >= np.sqrt(j[0] * j[0] + j[1] * j[1] + j[2] * j[2])
    )


@njit(nogil=True, error_model="numpy")
def _meeting_s(strike, rows):
    """When the surfaces meet: gap / approach of the first step's rows, negative where they overlap already."""
    meets = np.inf
    if strike.share[0] > 0:
        for r in range(strike.row[0, 0], strike.row[0, 1]):
            if rows[r].approach_m_s > 0:
                meets = min(meets, rows[r].gap_m / rows[r].approach_m_s)
    return meets if np.isfinite(meets) else 0.0


@njit(nogil=True, error_model="numpy")
def _make(strike, rows, bodies, faces, nodes, shapes, frequency_hz, spectrum, pulse, push):
    """The pulse of a strike, but for its start; its Uᵀj is added to push (2, columns)."""
    low, high = strike.body[0], strike.body[1]
    scale = strike.accepted_n_s / max(strike.raw_n_s, 1e-300)
    most, bent = -1.0, 0.0
    px, py, pz = 0.0, 0.0, 0.0
    for delay in range(STEPS):
        share = strike.share[delay]
        if share > 0:
            for r in range(strike.row[delay, 0], strike.row[delay, 1]):
                row = rows[r]
                touch(rows, r, bodies, faces, nodes)
                add_push(rows, r, 0, share * scale, bodies, faces, shapes, push[0])
                add_push(rows, r, 1, share * scale, bodies, faces, shapes, push[1])
                load, p = row.load_n_s * share, row.point_m[0]
                if load > most:
                    most, bent = load, row.curvature_per_m[0] + row.curvature_per_m[1]
                px, py, pz = px + load * p[0], py + load * p[1], pz + load * p[2]
    raw = max(strike.raw_n_s, 1e-300)
    px, py, pz = px / raw, py / raw, pz / raw
    spread = 0.0
    for delay in range(STEPS):
        share = strike.share[delay]
        if share > 0:
            for r in range(strike.row[delay, 0], strike.row[delay, 1]):
                p = rows[r].point_m[0]
                x, y, z = p[0] - px, p[1] - py, p[2] - pz
                spread += rows[r].load_n_s * share / raw * (x * x + y * y + z * z)
    area = flat_area_m2(np.sqrt(spread), smaller_size(bodies, low, high), bent, STRUCK_FLAT)
    mass = strike.mass_kg
    speed = strike.approach_m_s if strike.approach_m_s > 0 else strike.accepted_n_s / (1.5 * mass)
    modulus = contact_modulus(bodies[low].modulus_pa, bodies[high].modulus_pa)
    length, flat = pulse_length(mass, modulus, bent, area, max(speed, 1e-6))
    given = 0.0
    for side in range(2):
        body = bodies[strike.body[side]]
        given += compliance(push[side], frequency_hz, body.frequency_at, body.modes, length, spectrum[1 if flat else 0])
    square = strike.accepted_n_s * strike.accepted_n_s
    pulse.body[0], pulse.body[1] = low, high
    pulse.length_s, pulse.flat = length, 1 if flat else 0
    # an impulse below 1e-162 N·s, which only a forged log has: nothing of it is heard
    pulse.share = 1.0 / (1.0 + mass * given / square) if square > 0 else 1.0
    for x in range(3):
        pulse.impulse_n_s[x] = scale * strike.impulse_n_s[x]
