"""Rolling and sliding of one physics step: from support loads and sweep speeds to forces on modes at audio rate.

    PAIR.support_n, rows of the next step -> loads and speeds at both ends -> synth.surface_kernel -> f - N per voice
        -> drives (Uᵀ on either body's columns and direction, per newton, at the step's start and end)

What a step starts with is what the step before ended with (loads, speeds, gains, direction are carried in PAIR and in
the gains), so nothing jumps at the step rate. A manifold's points flicker from step to step; the gains follow them with
a time constant of `FOLLOW_S`. A pair has a voice (PAIR.rubs) while its support lasts; a voice that neither sweeps nor
still oscillates costs nothing: no force, no gains, no search of triangles. Sides 0 = lower body and 1 = higher.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Body
from sonic_bullet.render.contact_place import (
    add_push,
    contact_modulus,
    effective_mass,
    flat_area_m2,
    touch,
)
from sonic_bullet.render.strike_pulses import STEEPEST
from sonic_bullet.synth.profile import height_octaves
from sonic_bullet.synth.surface_kernel import FASTEST_M_S, contact_radius_m, damping_ratio, sound_voices

FOLLOW_S = 0.02
FRICTION_FLAT = 0.25
"""Radius, as a share of the smaller body's size, of the least area on which a flat face rubs."""
SWEEP_FLOOR_M_S = 2e-4
"""Slower sweeps make nothing audible: even waves of 10 µm pass at 20 Hz.

Solvers let bodies at rest creep about as fast.
"""


def surface_seed(seed: int, body: Body) -> int:
    """BODY.surface_seed: a number for a body's surface, the same in every run, of the seed and of who the body is."""
    who = np.random.SeedSequence(
        [seed & 0xFFFFFFFF, body.body_id & 0xFFFFFFFF, (body.link + 1) & 0xFFFFFFFF, body.epoch]
    )
    return int(who.generate_state(1)[0])


@njit(nogil=True, error_model="numpy")
def advance_friction(
    pairs, active, count, bodies, rows, row_count, faces, nodes, shapes, quaternion, dt_s, x, sr, gain, voices,
    force, gain0, gain1, direction0, direction1, drive_body, drive_slot,
):  # fmt: skip
    """The force signals of one step, a drive each; returns their number d.

    pairs: table of PAIR, support_n of this step filled in; active[:count]: slots in use, by rising key; bodies, faces,
    nodes, shapes: the bodies' tables. rows[:row_count]: ROW of the step that follows, by key and arrival; quaternion (b, 4): its
    orientations. dt_s: of this step; x (n,): share of it of each sample; sr: float, in Hz. gain (slots, 2, columns):
    Uᵀ per newton of either side, carried, known where PAIR.gains says so. voices: scratch of VOICE, and room for as
    many drives as pairs are active:
    force (d, n) in newton: on the lower body along the direction, its negative on the higher. Linear between the step's
    ends: gain0, gain1 (d, 2, columns): Uᵀ on the columns of both bodies a newton (what lies beyond a body's columns is
    not written); direction0, direction1 (d, 3) on the lower body, world. drive_body (d, 2), drive_slot (d,).
    """
    follow = -np.expm1(-dt_s / FOLLOW_S)
    moving = _voices(pairs, active, count, bodies, rows, row_count, faces, nodes, quaternion, follow, voices)
    sound_voices(pairs, voices, moving, x, sr, force)
    drives = 0
    for v in range(moving):
        known = _follow_gains(pairs, bodies, rows, faces, nodes, shapes, follow, voices, v, gain, gain0, gain1, drives)
        if known and _sounds(force, v):
            voice = voices[v]
            for i in range(len(x)):
                force[drives, i] = force[v, i]
            for axis in range(3):
                direction0[drives, axis], direction1[drives, axis] = voice.direction[0, axis], voice.direction[1, axis]
            drive_slot[drives] = voice.slot
            for side in range(2):
                drive_body[drives, side] = pairs[voice.slot].body[side]
            drives += 1
    return drives


@njit(nogil=True, error_model="numpy")
def _sounds(force, v):
    for i in range(force.shape[1]):
        if force[v, i] != 0.0:
            return True
    return False


@njit(nogil=True, error_model="numpy")
def _voices(pairs, active, count, bodies, rows, row_count, faces, nodes, quaternion, follow, voices):
    """The voices that move in this step, into ``voices``; returns their number. All pairs move on to the step's end."""
    moving, row = 0, 0
    for i in range(count):
        slot = active[i]
        pair = pairs[slot]
        target = max(pair.support_n[1], 0.0)
        if not pair.rubs and (target <= 0.0 or not _can_rub(bodies, pair.body[0], pair.body[1])):
            continue
        while row < row_count and rows[row].key < pair.key:
            row += 1
        begin = row
        while row < row_count and rows[row].key == pair.key:
            row += 1
        voice = voices[moving]
        _aim(rows, begin, row, voices, moving)
        touching = voice.end > voice.begin
        sweep, direction = voice.sweep_m_s, voice.direction
        if not pair.rubs:
            _begin(pairs, slot, bodies, rows, voice.begin, voice.end, faces, nodes, quaternion)
            pair.sweep_m_s[0], pair.sweep_m_s[1] = sweep[1, 0], sweep[1, 1]
        sweep[0, 0], sweep[0, 1] = pair.sweep_m_s[0], pair.sweep_m_s[1]
        fresh = pair.direction[0] == 0.0 and pair.direction[1] == 0.0 and pair.direction[2] == 0.0
        for axis in range(3):
            aim = direction[1, axis]
            start = aim if fresh and touching else pair.direction[axis]
            direction[0, axis] = start
            pair.direction[axis] = direction[1, axis] = start + (follow * (aim - start) if touching else 0.0)
        sweeps = sweep[0, 0] > 0.0 or sweep[0, 1] > 0.0 or sweep[1, 0] > 0.0 or sweep[1, 1] > 0.0
        if (sweeps or pair.depth != 0.0 or pair.lift != 0.0) and (pair.load_n > 0.0 or target > 0.0):
            voice.slot, voice.load_n[0], voice.load_n[1] = slot, pair.load_n, target
            moving += 1
        pair.load_n, pair.sweep_m_s[0], pair.sweep_m_s[1] = target, sweep[1, 0], sweep[1, 1]
        pair.rubs = 1 if target > 0.0 else 0
    return moving


@njit(nogil=True, error_model="numpy")
def _can_rub(bodies, low, high):
    """Whether a body of the pair sounds, and one moves."""
    sounds = bodies[low].modes > 0 or bodies[low].rigid or bodies[high].modes > 0 or bodies[high].rigid
    return bool(sounds) and (bodies[low].mass_kg > 0.0 or bodies[high].mass_kg > 0.0)


@njit(nogil=True, error_model="numpy")
def _aim(rows, begin, end, voices, v):
    """Where a pair is heading by its rows: voice v's sweep and direction at the step's end, its rows and their load.
    None where the manifold does not carry load.
    """
    voice = voices[v]
    total, along_x, along_y, along_z, sweep_low, sweep_high = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(begin, end):
        row = rows[r]
        load, impulse = row.load_n_s, row.impulse_n_s
        total += load
        along_x, along_y, along_z = along_x + impulse[0], along_y + impulse[1], along_z + impulse[2]
        sweep_low, sweep_high = sweep_low + load * row.sweep_m_s[0], sweep_high + load * row.sweep_m_s[1]
    pull = np.sqrt(along_x * along_x + along_y * along_y + along_z * along_z)
    carries = total > 0.0 and total * STEEPEST >= pull
    voice.begin, voice.end, voice.total_n_s = begin, end if carries else begin, total
    share = total if carries else np.inf
    sweep, direction = voice.sweep_m_s, voice.direction
    sweep[1, 0], sweep[1, 1] = _audible_sweep(sweep_low / share), _audible_sweep(sweep_high / share)
    direction[1, 0], direction[1, 1], direction[1, 2] = along_x / share, along_y / share, along_z / share


@njit(nogil=True, error_model="numpy")
def _audible_sweep(sweep_m_s):
    return 0.0 if sweep_m_s < SWEEP_FLOOR_M_S else min(sweep_m_s, FASTEST_M_S)


@njit(nogil=True, error_model="numpy")
def _begin(pairs, slot, bodies, rows, begin, end, faces, nodes, quaternion):
    """A voice at rest and without load, its constants by the manifold with which it begins (none: two flats of the
    bodies' size).
    """
    pair = pairs[slot]
    low, high = pair.body[0], pair.body[1]
    pair.load_n, pair.depth, pair.lift, pair.substeps, pair.gains = 0.0, 0.0, 0.0, 0, 0
    for axis in range(3):
        pair.direction[axis] = 0.0
    for side in range(2):
        body = bodies[pair.body[side]]
        pair.swept_m[side], pair.seed[side] = 0.0, body.surface_seed
        height_octaves(body.roughness_m, body.hurst, pair.height_m[side])
    pair.modulus_pa = contact_modulus(bodies[low].modulus_pa, bodies[high].modulus_pa)
    pair.damping_ratio = damping_ratio(min(bodies[low].restitution, bodies[high].restitution))
    if end > begin:
        pair.mass_kg, curvature, spread = _manifold(rows, begin, end, bodies, low, high, faces, nodes, quaternion)
    else:
        mobility, curvature, spread = 0.0, 0.0, 0.0
        for side in range(2):
            if bodies[pair.body[side]].mass_kg > 0.0:
                mobility += 1.0 / bodies[pair.body[side]].mass_kg
        pair.mass_kg = 1.0 / mobility
    pair.radius_m = contact_radius_m(curvature, flat_area_m2(bodies, low, high, spread, curvature, FRICTION_FLAT))


@njit(nogil=True, error_model="numpy")
def _manifold(rows, begin, end, bodies, low, high, faces, nodes, quaternion):
    """Effective mass in kg, relative curvature in 1/m where the load is highest, and spread in m of the rows begin …
    end - 1 of one pair.
    """
    mean = np.zeros((4, 3))  # normal, levers of both sides, point on the lower body
    total, strongest = 0.0, begin
    for r in range(begin, end):
        total += rows[r].load_n_s
        if rows[r].load_n_s > rows[strongest].load_n_s:
            strongest = r
    for r in range(begin, end):
        row = rows[r]
        share = row.load_n_s / total
        for axis in range(3):
            mean[0, axis] += share * row.normal[axis]
            mean[1, axis] += share * row.arm_m[0, axis]
            mean[2, axis] += share * row.arm_m[1, axis]
            mean[3, axis] += share * row.point_m[0, axis]
    length = np.sqrt(mean[0, 0] * mean[0, 0] + mean[0, 1] * mean[0, 1] + mean[0, 2] * mean[0, 2])
    square = 0.0
    for axis in range(3):
        mean[0, axis] /= max(length, 1e-300)
        for r in range(begin, end):
            off = rows[r].point_m[0, axis] - mean[3, axis]
            square += rows[r].load_n_s / total * (off * off)
    mass = effective_mass(bodies, low, high, quaternion, mean[1], mean[2], mean[0])
    touch(rows, strongest, bodies, faces, nodes)
    bent = rows[strongest].curvature_per_m
    return mass, bent[0] + bent[1], np.sqrt(square)


@njit(nogil=True, error_model="numpy")
def _follow_gains(pairs, bodies, rows, faces, nodes, shapes, follow, voices, v, gain, gain0, gain1, d):
    """Gains of voice v at the step's start and end into row d, towards where its contacts are now; False where they
    are not known.
    """
    voice = voices[v]
    slot, begin, end = voice.slot, voice.begin, voice.end
    pair = pairs[slot]
    if end == begin and not pair.gains:
        return False
    for r in range(begin, end):
        touch(rows, r, bodies, faces, nodes)
    for side in range(2):
        columns = bodies[pair.body[side]].columns
        start, aim, kept = gain0[d, side], gain1[d, side], gain[slot, side]
        for c in range(columns):
            aim[c] = 0.0
        for r in range(begin, end):
            add_push(rows, r, side, 1.0 / voice.total_n_s, bodies, faces, shapes, aim)
        for c in range(columns):
            start[c] = kept[c] if pair.gains else aim[c]
            aim[c] = start[c] + follow * (aim[c] - start[c]) if end > begin else start[c]
            kept[c] = aim[c]
    pair.gains = 1
    return True
