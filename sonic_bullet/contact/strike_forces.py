"""Where a contact becomes a force: from pairs' loads and contact rows to the strikes' force pulses on modes.

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
from sonic_bullet.contact.coupling.springs import PERSSON
from sonic_bullet.contact.hertz import ball_stiffness, contact_modulus, impact_depth_m
from sonic_bullet.contact.load_splitting import NOW, SPAN, STEPS, split_loads
from sonic_bullet.contact.pulse_shape import compliance, pulse_length, rough_share
from sonic_bullet.contact.strike_cause import accept, is_recreated, set_unheld_steps
from sonic_bullet.contact.strike_timing import date_by_gap, date_others, set_starts
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records.roughness import WAVE_M

STEEPEST = 10.0
"""Most friction per normal force of a manifold that carries load: a contact that Bullet drops within a step keeps its
friction.
"""
STRUCK_FLAT = 0.02
"""Radius, as a fraction of the smaller body's size, of the least area that a nearly flat impact touches."""
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
    volume) are skipped, and those of which neither moves. A strike of bodies that overlap as the step starts is dated
    back into the step being rendered.

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
        _gather(strike, window.row)
        date_by_gap(strike, window.row, back_s, dt_s)
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
        date_others(strikes, struck, bodies, held, back_s, dt_s)
        set_starts(strikes, struck, scratch.pulse, ahead, back_s, dt_s)
    return found


@njit(nogil=True, error_model="numpy")
def _gather(strike, rows):
    """Sum over a strike's rows, each weighted by the fraction of its step that is strike; no budget as yet."""
    j, n, arm, centre = strike.impulse_n_s, strike.normal, strike.arm_m, strike.centre_m
    raw, approach = 0.0, 0.0
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
    # an impact that changes the speed of its effective mass by less is ignored: a body of 10 cm sends 0 dB SPL to 1 m
    # then
    least_jump_m_s = 1e-6
    low, high, bodies = strike.body[0], strike.body[1], table.bodies
    j, raw, accepted = strike.impulse_n_s, max(strike.raw_n_s, 1e-300), strike.accepted_n_s
    mass = effective_mass(bodies, low, high, quaternion, strike.arm_m[0], strike.arm_m[1], strike.normal)
    sounds = bodies[low].modes + bodies[low].rigid + bodies[high].modes + bodies[high].rigid > 0
    steep = np.sqrt(j[0] * j[0] + j[1] * j[1] + j[2] * j[2]) > raw * STEEPEST
    if not sounds or steep or mass <= 0 or not accepted > least_jump_m_s * mass:
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
