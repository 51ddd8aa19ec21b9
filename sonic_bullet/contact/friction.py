"""Rolling and sliding of one physics step: from support loads and sweep speeds to forces on modes at audio rate.

    PAIR.support_n, rows of the next step -> loads and speeds at both ends -> contact.surface_kernel -> f - N per voice
        -> drives (Uᵀ on either body's columns and direction, per newton, at the step's start and end)

A step starts with what the step before ended with (loads, speeds, gains, direction are carried in PAIR and in the
gains), so nothing jumps at the step rate. A manifold's points flicker from step to step; the gains follow them with a
time constant of `FOLLOW_S`. A pair has a contact oscillator, its voice (PAIR.rubs), while its support lasts. Its sweep
grows from 0 within its first step, as its load does: at full speed a contact without load would only bounce. One that
neither sweeps nor oscillates costs nothing: no force, no gains, no search of triangles. Sides 0 = lower body and 1 =
higher.
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
from sonic_bullet.contact.hertz import contact_modulus
from sonic_bullet.contact.load_splitting import SPAN
from sonic_bullet.contact.octave_heights import (
    add_waves,
    close_round,
    given_octaves,
    height_octaves,
    slope_squared,
)
from sonic_bullet.contact.strike_forces import STEEPEST
from sonic_bullet.contact.surface_kernel import (
    DAMPING_RATIO,
    FASTEST_M_S,
    contact_radius_m,
    dissipation_s_m,
    sound_voices,
)
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Body

FOLLOW_S = 0.02
SWEEP_FLOOR_M_S = 2e-4
"""Slower sweeps make nothing audible: even waves of 10 µm pass at 20 Hz.

Solvers let bodies at rest creep about as fast.
"""


def surface_seed(seed: int, body: Body) -> int:
    """Compute BODY.surface_seed from the seed and the body's id: the same in every run."""
    who = np.random.SeedSequence(
        [seed & 0xFFFFFFFF, body.body_id & 0xFFFFFFFF, (body.link + 1) & 0xFFFFFFFF, body.epoch]
    )
    return int(who.generate_state(1)[0])


@njit(nogil=True, error_model="numpy")
def advance_friction(number, x, sr, window, table, pairs, voices, scratch):
    """Compute the force signals of step ``number``, a drive each, and write how many into scratch.count[1].

    Parameters
    ----------
    window : with the step that follows: its rows by key and arrival, orientations of the bodies
    table, pairs : support_n of this step filled in; gain (slots, 2, columns): Uᵀ per newton of either side, carried,
        known where PAIR.gains says so
    x : (n,) position of each sample in the step, 0 … 1
    sr : float, in Hz
    voices : scratch of VOICE, and room for as many drives as pairs are active
    scratch : force (d·n,) in newton, on the lower body along the direction, its negative on the higher; gain0, gain1
        (d, 2, columns): Uᵀ on both bodies' columns a newton at the step's ends, linear between; direction0, direction1
        (d, 3): on the lower body, world, at the step's ends; body, slot (d, 2), (d,)
    """
    here, there, quaternion = window.step[number % SPAN], window.step[(number + 1) % SPAN], window.quaternion_xyzw
    rows, turned, dt_s = window.row[there.row[0] : there.row[1]], quaternion[(number + 1) % SPAN], here.dt_s
    force = scratch.force[: len(scratch.slot) * len(x)].reshape((len(scratch.slot), len(x)))
    follow = 1.0 - np.exp(-dt_s / FOLLOW_S)
    moving, drives, n = 0, 0, len(x)
    for v in range(_voices(pairs, table.bodies, rows, follow, voices)):
        voice = voices[v]
        if voice.fresh:
            _begin(pairs.pair[voice.slot], table, rows, voice.begin, voice.end, turned)
        if voice.moves:
            voices[moving] = voice
            moving += 1
    sound_voices(pairs.pair, voices, moving, x, sr, table.tracks, force)
    for v in range(moving):
        voice = voices[v]
        slot, begin, end = voice.slot, voice.begin, voice.end
        pair = pairs.pair[slot]
        if end == begin and not pair.gains:
            continue
        for r in range(begin, end):
            touch(rows, r, table)
        for side in range(2):
            start, aim, kept = scratch.gain0[drives, side], scratch.gain1[drives, side], pairs.gain[slot, side]
            columns = table.bodies[pair.body[side]].columns
            for c in range(columns):
                aim[c] = 0.0
            for r in range(begin, end):
                add_modal_impulse(rows, r, side, 1.0 / voice.total_n_s, table, aim)
            turn_modal_impulse(table.bodies[pair.body[side]], table.turns, aim)
            for c in range(columns):
                start[c] = kept[c] if pair.gains else aim[c]
                aim[c] = start[c] + follow * (aim[c] - start[c]) if end > begin else start[c]
                kept[c] = aim[c]
            scratch.body[drives, side] = pair.body[side]
        pair.gains = 1
        for axis in range(3):
            scratch.direction0[drives, axis] = voice.direction[0, axis]
            scratch.direction1[drives, axis] = voice.direction[1, axis]
        scratch.slot[drives] = slot
        sounds = False
        for i in range(n):
            force[drives, i] = force[v, i]
            sounds = sounds or force[v, i] != 0.0
        drives += 1 if sounds else 0
    scratch.count[1] = drives


@njit(nogil=True, error_model="numpy")
def _voices(pairs, bodies, rows, follow, voices):
    """Collect the voices that move or begin in this step in ``voices``; return their number.

    All pairs advance to the step's end.
    """
    found, row, row_count = 0, 0, len(rows)
    for i in range(pairs.count[0]):
        slot = pairs.active[i]
        pair, voice = pairs.pair[slot], voices[found]
        low, high = bodies[pair.body[0]], bodies[pair.body[1]]
        target, voice.fresh = pair.support_n[1], 0
        if not pair.rubs:
            sounds = low.modes > 0 or low.rigid > 0 or high.modes > 0 or high.rigid > 0
            if target <= 0.0 or not sounds or (low.mass_kg <= 0.0 and high.mass_kg <= 0.0):
                continue
            voice.fresh, pair.depth, pair.separation_speed, pair.substeps = 1, 0.0, 0.0, 0
            pair.load_n, pair.gains = 0.0, 0
            for axis in range(3):
                pair.direction[axis] = 0.0
        while row < row_count and rows[row].key < pair.key:
            row += 1
        begin = row
        while row < row_count and rows[row].key == pair.key:
            row += 1
        _aim(rows, begin, row, voice)
        sweep, direction, touching = voice.sweep_m_s, voice.direction, voice.end > begin
        unknown = pair.direction[0] == 0.0 and pair.direction[1] == 0.0 and pair.direction[2] == 0.0
        for axis in range(3):
            aim = direction[1, axis]
            start = aim if unknown and touching else pair.direction[axis]
            direction[0, axis] = start
            pair.direction[axis] = direction[1, axis] = start + (follow * (aim - start) if touching else 0.0)
        moves = pair.depth != 0.0 or pair.separation_speed != 0.0
        for side in range(2):
            sweep[0, side] = 0.0 if voice.fresh else pair.sweep_m_s[side]
            pair.sweep_m_s[side] = sweep[1, side]
            moves = moves or sweep[0, side] > 0.0 or sweep[1, side] > 0.0
        voice.slot, voice.load_n[0], voice.load_n[1] = slot, pair.load_n, target
        voice.moves = moves and (pair.load_n > 0.0 or target > 0.0)
        found += 1 if voice.moves or voice.fresh else 0
        pair.load_n, pair.rubs = target, target > 0.0
    return found


@njit(nogil=True, error_model="numpy")
def _aim(rows, begin, end, voice):
    """Set a voice's sweep and direction at the step's end, its rows and their load, from its pair's rows.

    No rows where the manifold does not carry load.
    """
    total, along_x, along_y, along_z, sweep_low, sweep_high = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(begin, end):
        row = rows[r]
        load, impulse, sweep = row.load_n_s, row.impulse_n_s, row.sweep_m_s
        total += load
        along_x += impulse[0]
        along_y += impulse[1]
        along_z += impulse[2]
        sweep_low += load * sweep[0]
        sweep_high += load * sweep[1]
    pull = np.sqrt(along_x * along_x + along_y * along_y + along_z * along_z)
    carries = total > 0.0 and total * STEEPEST >= pull
    voice.begin, voice.end, voice.total_n_s = begin, end if carries else begin, total
    share = total if carries else np.inf
    direction = voice.direction
    direction[1, 0], direction[1, 1], direction[1, 2] = along_x / share, along_y / share, along_z / share
    for side in range(2):
        mean = (sweep_high if side else sweep_low) / share
        mean = 0.0 if mean < SWEEP_FLOOR_M_S else mean
        voice.sweep_m_s[1, side] = FASTEST_M_S if mean > FASTEST_M_S else mean


@njit(nogil=True, error_model="numpy")
def _begin(pair, table, rows, begin, end, quaternion):
    """Set the constants of a voice by the manifold with which it begins: effective mass, curvature, spread.

    The curvature is that where the load is highest. Without rows: as two flats of the bodies' size.
    """
    # radius, as a fraction of the smaller body's size, of the least area of friction of a flat face
    friction_flat = 0.25
    (low, high), bodies = pair.body, table.bodies
    pair.modulus_pa = contact_modulus(bodies[low].modulus_pa, bodies[high].modulus_pa)
    restitution, other = bodies[low].restitution, bodies[high].restitution
    pair.damping_ratio = DAMPING_RATIO
    pair.dissipation_s_m = dissipation_s_m(restitution if restitution < other else other)
    total, mobility = 0.0, 0.0
    for side in range(2):
        body = bodies[high if side else low]
        pair.swept_m[side], pair.seed[side] = 0.0, body.surface_seed
        mobility += 1.0 / body.mass_kg if body.mass_kg > 0.0 else 0.0
    pair.mass_kg, curvature, square, strongest = 1.0 / mobility, 0.0, 0.0, begin
    for r in range(begin, end):
        total += rows[r].load_n_s
        if rows[r].load_n_s > rows[strongest].load_n_s:
            strongest = r
    if end > begin:
        mean = np.zeros(12)
        normal, arm_low, arm_high, point = mean[:3], mean[3:6], mean[6:9], mean[9:]
        for r in range(begin, end):
            row = rows[r]
            share = row.load_n_s / total
            for axis in range(3):
                normal[axis] += share * row.normal[axis]
                arm_low[axis] += share * row.arm_m[0, axis]
                arm_high[axis] += share * row.arm_m[1, axis]
                point[axis] += share * row.point_m[0, axis]
        length = np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
        for axis in range(3):
            normal[axis] /= length if length > 0.0 else 1.0
            for r in range(begin, end):
                off = rows[r].point_m[0, axis] - point[axis]
                square += rows[r].load_n_s / total * (off * off)
        pair.mass_kg = effective_mass(bodies, low, high, quaternion, arm_low, arm_high, normal)
        touch(rows, strongest, table)
        bent = rows[strongest].curvature_per_m
        curvature = bent[0] + bent[1]
    area = flat_area_m2(bodies, low, high, np.sqrt(square), curvature, friction_flat)
    if area > 0.0:  # faces touch on the crests of their waves [Johnson 1985, sec. 13.2]
        curvature += bodies[low].crest_per_m + bodies[high].crest_per_m
    pair.radius_m = contact_radius_m(curvature, area)
    _begin_surfaces(pair, bodies, 0.0 if area > 0.0 else pair.radius_m)


@njit(nogil=True, error_model="numpy")
def _begin_surfaces(pair, bodies, round_m):
    """Set what either side's profile is of. round_m: R* of a ball, 0 for faces, which rest on many crests.

    Only a spectrum that is stated is limited by the ball's roundness, and only two of them tell how much of the patch
    touches: the slope of a preset's goes on below its finest wave, and with it the spots.
    """
    slope, pair.ball_m = 0.0, round_m
    for side in range(2):
        body, height_m = bodies[pair.body[side]], pair.height_m[side]
        stated = body.octave_rms_m[0] >= 0.0
        if stated:
            given_octaves(body.octave_rms_m, height_m)
        else:
            height_octaves(body.roughness_m, body.hurst, height_m)
        add_waves(body.waviness_m, body.waviness_length_m, height_m)
        slope = slope + slope_squared(height_m) if stated and slope >= 0.0 else -1.0
        if body.track_count > 0 or not stated:
            pair.ball_m = 0.0
        pair.track_at[side], pair.track_count[side] = body.track_at, body.track_count
        pair.track_spacing_m[side] = body.track_spacing_m
        if body.track_count > 0:
            for j in range(len(height_m)):
                height_m[j] = 1.0
        pair.around[side] = pair.stretch[side] = 0.0
        if body.curvature_per_m > 0.0 and body.track_count == 0:
            pair.around[side], pair.stretch[side] = close_round(2.0 * np.pi / body.curvature_per_m, height_m)
    pair.slope = np.sqrt(2.0 * slope) if slope > 0.0 else 0.0  # of a gradient, of a trace's slope
