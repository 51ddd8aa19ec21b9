"""Strikes of one physics step, from the pairs' loads and contact rows to force pulses on modes.

    PAIR: load F - opening of F, over a rising edge -> STRIKE, with its fraction of up to three steps   [load_splitting]
        + ROW of these steps -> impulse, normal, lever, approach; what of it has a cause
        -> PULSE: start, length, impulse, transmitted fraction; and Uᵀj on either body

One pulse's rows of up to three steps, several points each, share its time history, so that the manifold's sum and
moment, which are all that is reliable, are kept: Uᵀj is summed over the rows, each at its own point with its own
direction, friction included. Strikes in the order of their pairs' keys, rows of one by step and as they came.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.contact.contact_place import (
    add_modal_impulse,
    effective_mass,
    flat_area_m2,
    touch,
    turn_modal_impulse,
)
from sonic_bullet.contact.contact_rows import opening
from sonic_bullet.contact.coupling.springs import PERSSON
from sonic_bullet.contact.force_pulse import compliance, pulse_length, rough_share
from sonic_bullet.contact.hertz import ball_stiffness, contact_modulus, impact_depth_m
from sonic_bullet.contact.load_splitting import NOW, SPAN
from sonic_bullet.contact.strike_timing import accept, date_strikes
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records.roughness import WAVE_M

STEEPEST = 10.0
"""Most friction per normal force of a manifold that carries load: a contact that Bullet drops within a step keeps its
friction.
"""
STRUCK_FLAT = 0.02
"""Radius, as a fraction of the smaller body's size, of the least area that a nearly flat impact touches."""
LEAST_JUMP_M_S = 1e-6
"""An impact that changes the speed of its effective mass by less is ignored: a body of 10 cm sends 0 dB SPL to 1 m
then."""
STEPS = SPAN - 1
"""Steps that one strike takes at most."""
RECREATED = 3.0
"""How many times its fixed point a bounce that gravity and the integration repeat reaches: a point that bounces with
restitution e on steps of dt stops losing speed at g·dt·e/(1-e); corners of bars, plates and boxes do up to 2.8 times as
much (Bullet, e 0.3 … 0.8, 1/60 … 1/1000 s).
"""

STRIKE = np.dtype(
    [
        ("body", "i8", (2,)),
        ("share", "f8", (STEPS,)),  # of the normal impulse of its steps
        ("row", "i8", (STEPS, 2)),  # its rows in each of them: first and the one after the last
        ("raw_n_s", "f8"),  # normal impulse of these shares
        ("impulse_n_s", "f8", (3,)),  # the whole of them, on the lower body, world frame
        ("normal", "f8", (3,)),
        ("arm_m", "f8", (2, 3)),
        ("centre_m", "f8", (3,)),  # of its points, in the lower body's frame
        ("approach_m_s", "f8"),
        ("meets_s", "f8"),  # after the start of its first step; negative where the surfaces overlap already
        ("dated", "i8"),  # 1 where meets_s is known
        ("overlaps", "i8"),  # 1 where the surfaces overlap as its first step starts
        ("budget_n_s", "f8"),  # what the approach can cause
        ("accepted_n_s", "f8"),
        ("pulse", "i8"),  # its row among the pulses, -1 where it is not audible
        ("length_s", "f8"),  # of it
    ],
    align=True,
)
"""A candidate strike: one for each active pair at most."""


@njit(nogil=True, error_model="numpy")
def find_pulses(ahead, number, found, window, table, pairs, strikes, scratch):
    """Find the strikes that begin in step ``number``, ``ahead`` steps (0 or 1) after the one being rendered.

    They are written to scratch.pulse and modal_impulse (pulses, 2, columns) from ``found`` on; returns the new number.
    Loads that they use are marked as used. Call with ahead = 0 first. Pairs that cannot sound (no modes, no moving
    volume) are skipped, and those of which neither moves. A strike is dated by gap and approach (`_gather`), else by
    `date_strikes`; where the bodies overlap as the step starts, back into the step being rendered.

    Parameters
    ----------
    window : steps from the one being rendered to the third after it
    strikes : scratch of STRIKE, one for each active pair
    """
    bodies, here, turned = table.bodies, window.step[number % SPAN], window.quaternion_xyzw[number % SPAN]
    dt_s, g = here.dt_s, here.gravity_m_s2
    back_s = window.step[(number - 1) % SPAN].dt_s
    for i in range(pairs.count[0]):
        pair = pairs.pair[pairs.active[i]]
        if pair.force_n[NOW + ahead - 1] > 0:
            for side in range(2):
                bodies[pair.body[side]].loaded = max(bodies[pair.body[side]].loaded, number - 1)
    struck = split_loads(ahead, number, window, pairs, strikes)
    if struck == 0:
        return found
    held = np.empty(len(bodies))
    set_unheld_steps(ahead, number, pairs, bodies, held)
    gravity = np.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) * dt_s
    caused = False
    for q in range(struck):
        strike = strikes[q]
        _gather(strike, window.row, back_s, dt_s)
        n, low, high = strike.normal, strike.body[0], strike.body[1]
        # a tenth for a solver's remainder, a hundredth in every direction for wedged bodies
        fall = 1.1 * abs(n[0] * g[0] + n[1] * g[1] + n[2] * g[2]) * dt_s + 0.01 * gravity
        speed = max(strike.approach_m_s - max(held[low], held[high]) * fall, 0.0)
        if speed > 0 and not is_recreated(bodies, low, high, strike.approach_m_s, fall, number):
            arm = strike.arm_m
            strike.budget_n_s = 2.0 * effective_mass(bodies, low, high, turned, arm[0], arm[1], n) * speed
            caused = True
    if caused:
        accept(strikes, struck, bodies, held)
        for q in range(struck):
            strike, pulse = strikes[q], scratch.pulse[found]
            strike.pulse, strike.length_s = -1, 0.0
            if strike.accepted_n_s > 0 and _make(
                strike, turned, window.row, table, pulse, scratch.modal_impulse[found]
            ):
                strike.pulse, strike.length_s = found, pulse.length_s
                found += 1
        date_strikes(strikes, struck, bodies, held, back_s, dt_s)
        for q in range(struck):
            if strikes[q].pulse >= 0:
                pulse, meets_s = scratch.pulse[strikes[q].pulse], strikes[q].meets_s
                late_s = 0.0 if ahead or meets_s >= 0.0 else back_s  # found a step late: it keeps its phase
                pulse.start_s, pulse.ahead = min(meets_s + late_s, dt_s), ahead
    return found


@njit(nogil=True, error_model="numpy")
def is_recreated(bodies, low, high, approach_m_s, fall_m_s, number):
    """Return whether gravity and the integration repeat a strike of a body at rest; else record it as the last cause.

    fall_m_s: speed that gravity gives along the normal in a step. Bounces of restitution e lose speed at g (1-e)/(2e)
    [a flight 2ve/g long loses (1-e)v]. Half of that is required of them, for solvers give back up to 15 % more than e,
    and gravity of a step as well. A strike that comes sooner than after a flight of that speed, no faster than
    `RECREATED` allows, and faster than the last cause leaves it by now, has no cause but the steps' length.

    A body that leaves at v is back after 2v/g at most: its fastest strike since then is all that is left of that cause.
    Corners of a plate strike many times in a flight, and lose sooner what a ball would keep.
    """
    e = min(bodies[low].rebound * bodies[high].rebound, 1.0)
    limit = RECREATED * max(1.0, e / max(1.0 - e, 1e-9))
    loss_m_s = fall_m_s * (1.0 - e) / (4.0 * max(e, 1e-9))  # a step
    left, recent = 0.0, True
    for body in (low, high):
        one = bodies[body]
        if one.mass_kg > 0:
            if one.since_m_s > 0 and (number - one.cause_step) * fall_m_s >= 2.0 * one.cause_m_s:
                one.cause_m_s, one.cause_step, one.since_m_s = one.since_m_s, one.since_step, 0.0
            left = max(left, one.cause_m_s - loss_m_s * max(number - one.cause_step, 0))
            recent = recent and number - one.loaded <= 2.0 * limit + 2.0
    if recent and left < approach_m_s <= limit * fall_m_s:
        return True
    for body in (low, high):
        one = bodies[body]
        if approach_m_s >= one.cause_m_s - loss_m_s * max(number - one.cause_step, 0):
            one.cause_m_s, one.cause_step, one.since_m_s = approach_m_s, number, 0.0
        elif approach_m_s >= one.since_m_s - loss_m_s * max(number - one.since_step, 0):
            one.since_m_s, one.since_step = approach_m_s, number
    return False


@njit(nogil=True, error_model="numpy")
def split_loads(ahead, number, window, pairs, strikes):
    """Find the strikes in the loads of step ``number``, ``ahead`` after the one being rendered; mark them as used.

    Returns the number of strikes; their bodies, fractions and rows are set. An opening that the future could still
    lower is taken as high as it may be, so that support is never struck; a later call gives a strike what it lacked.
    """
    found, rows = 0, window.row
    for i in range(pairs.count[0]):
        pair, column = pairs.pair[pairs.active[i]], NOW + ahead
        force = pair.force_n
        if not force[column] > force[column - 1]:
            continue
        strike = strikes[found]
        for j in range(STEPS):
            strike.share[j] = 0.0
        for j in range(STEPS):
            load = force[column + j]
            excess = load - opening(force, column + j) - pair.struck_n[column + j]
            if not excess > 1e-9 * load:  # rounding of the sums is no impact
                break
            pair.struck_n[column + j] += excess
            strike.share[j] = excess / load
            first, last = window.step[(number + j) % SPAN].row
            stop = last
            while first < stop:  # its first row: they are sorted
                middle = (first + stop) // 2
                if rows[middle].key < pair.key:
                    first = middle + 1
                else:
                    stop = middle
            while stop < last and rows[stop].key == pair.key:
                stop += 1
            strike.row[j, 0], strike.row[j, 1] = first, stop
        if strike.share[0] > 0:
            strike.body[0], strike.body[1] = pair.body[0], pair.body[1]
            found += 1
    return found


@njit(nogil=True, error_model="numpy")
def set_unheld_steps(ahead, number, pairs, bodies, held):
    """Set held (b,): steps for which gravity may have moved each mobile body although it rests.

    1 where it carried load on any pair within the STEPS before, SPAN where it was just placed: Bullet finds the corners
    of a resting box one a step, and it tilts meanwhile.
    """
    for i in range(len(bodies)):
        held[i] = 0.0
    for i in range(pairs.count[0]):
        pair = pairs.pair[pairs.active[i]]
        for column in range(NOW + ahead - STEPS, NOW + ahead):
            if pair.force_n[column] > 0:
                held[pair.body[0]] = held[pair.body[1]] = 1.0
    for i in range(len(bodies)):
        if bodies[i].mass_kg <= 0:
            held[i] = 0.0
        elif number - bodies[i].placed < SPAN:
            held[i] = SPAN


@njit(nogil=True, error_model="numpy")
def _gather(strike, rows, back_s, dt_s):
    """Sum over a strike's rows, each weighted by the fraction of its step that is strike; no budget as yet.

    It is dated to gap/approach of the row with the largest product of load and approach, of those that met within the
    step or the one before, dt_s and back_s long. A gap of exactly 0 is one that nobody knows.
    """
    j, n, arm, centre = strike.impulse_n_s, strike.normal, strike.arm_m, strike.centre_m
    raw, approach, most = 0.0, 0.0, 0.0
    strike.dated = strike.overlaps = 0
    for x in range(3):
        j[x] = n[x] = arm[0, x] = arm[1, x] = centre[x] = 0.0
    for delay in range(STEPS):
        share = strike.share[delay]
        if share > 0:
            for r in range(strike.row[delay, 0], strike.row[delay, 1]):
                row = rows[r]
                load, speed = row.load_n_s * share, row.approach_m_s
                raw += load
                approach = max(approach, speed)
                if delay == 0 and row.gap_m < 0.0:
                    strike.overlaps = 1
                if delay == 0 and load * speed > most and row.gap_m != 0.0:
                    meets_s = row.gap_m / speed
                    if -back_s <= meets_s <= dt_s:
                        most, strike.meets_s, strike.dated = load * speed, meets_s, 1
                for x in range(3):
                    j[x] += share * row.impulse_n_s[x]
                    n[x] += load * row.normal[x]
                    centre[x] += load * row.point_m[0, x]
                    for side in range(2):
                        arm[side, x] += load * row.arm_m[side, x]
    strike.raw_n_s, strike.approach_m_s, strike.budget_n_s = raw, approach, 0.0
    length = 0.0
    for x in range(3):
        n[x] /= max(raw, 1e-300)
        centre[x] /= max(raw, 1e-300)
        length += n[x] * n[x]
        for side in range(2):
            arm[side, x] /= max(raw, 1e-300)
    for x in range(3):
        n[x] /= max(np.sqrt(length), 1e-300)


@njit(nogil=True, error_model="numpy")
def _roughened(bodies, low, high, mass_kg, modulus_pa, curvature_per_m, speed_m_s):
    """Return how many times as long a ball's pulse is by the waves that its patch covers, where they are stated.

    Of a preset's surface they would make it longer by 2 % at most, and are left out.
    """
    low_m, high_m = bodies[low].octave_rms_m, bodies[high].octave_rms_m
    if not curvature_per_m > 0.0 or (low_m[0] < 0.0 and high_m[0] < 0.0):
        return 1.0
    depth = impact_depth_m(mass_kg, ball_stiffness(modulus_pa, 1.0 / curvature_per_m), speed_m_s)
    across, square = 2.0 * np.sqrt(depth / curvature_per_m), 0.0
    for j in range(len(low_m)):
        if WAVE_M[j] < across:
            square += max(low_m[j], 0.0) ** 2 + max(high_m[j], 0.0) ** 2
    return rough_share(mass_kg, modulus_pa, curvature_per_m, speed_m_s, PERSSON * np.sqrt(square))


@njit(nogil=True, error_model="numpy")
def _make(strike, quaternion, rows, table, pulse, modal_impulse):
    """Make a strike's pulse, but for its start, and its modal_impulse Uᵀj (2, columns); False where it is inaudible."""
    low, high, bodies = strike.body[0], strike.body[1], table.bodies
    j, raw, accepted = strike.impulse_n_s, max(strike.raw_n_s, 1e-300), strike.accepted_n_s
    mass = effective_mass(bodies, low, high, quaternion, strike.arm_m[0], strike.arm_m[1], strike.normal)
    sounds = bodies[low].modes + bodies[low].rigid + bodies[high].modes + bodies[high].rigid > 0
    steep = np.sqrt(j[0] * j[0] + j[1] * j[1] + j[2] * j[2]) > raw * STEEPEST
    if not sounds or steep or mass <= 0 or not accepted > LEAST_JUMP_M_S * mass:
        return False
    for side in range(2):
        for c in range(modal_impulse.shape[1]):
            modal_impulse[side, c] = 0.0
    scale, most, bent, spread = accepted / raw, -1.0, 0.0, 0.0
    for delay in range(STEPS):
        share = strike.share[delay]
        if share > 0:
            for r in range(strike.row[delay, 0], strike.row[delay, 1]):
                touch(rows, r, table)
                for side in range(2):
                    add_modal_impulse(rows, r, side, share * scale, table, modal_impulse[side])
                load = rows[r].load_n_s * share
                if load > most:
                    most, bent = load, rows[r].curvature_per_m[0] + rows[r].curvature_per_m[1]
                for x in range(3):
                    off = rows[r].point_m[0, x] - strike.centre_m[x]
                    spread += load / raw * (off * off)
    area = flat_area_m2(bodies, low, high, np.sqrt(spread), bent, STRUCK_FLAT)
    speed = strike.approach_m_s if strike.approach_m_s > 0 else accepted / (1.5 * mass)
    modulus = contact_modulus(bodies[low].modulus_pa, bodies[high].modulus_pa)
    length, flat = pulse_length(mass, modulus, bent, area, max(speed, 1e-6))
    if not flat:
        length *= _roughened(bodies, low, high, mass, modulus, bent, max(speed, 1e-6))
    given = 0.0
    for side in range(2):
        body = bodies[strike.body[side]]
        turn_modal_impulse(body, table.turns, modal_impulse[side])
        given += compliance(
            modal_impulse[side], table.frequency_hz, body.frequency_at, body.modes, length, table.spectrum[flat]
        )
        pulse.body[side] = strike.body[side]
    pulse.length_s, pulse.flat = length, flat
    # the square of an impulse below 1e-162 N·s is zero; it is inaudible
    square = accepted * accepted
    pulse.share = 1.0 / (1.0 + mass * given / square) if square > 0 else 1.0
    for x in range(3):
        pulse.impulse_n_s[x] = scale * j[x]
    return True
