"""Driver of the run time: physics steps in, samples out, all stages in one compiled call.

    CONTACT rows, poses of a step -> take: ROW, load histories, into a window of SPAN steps
        -> excite: PULSE (strikes), drives (friction) of the step LOOKAHEAD before
        -> track_supports: contact patches, and bodies whose poles they change, as Python computes them (pole_updates)
        -> ring: modes and translations of all bodies -> source (W, b, n), dipole (b, 3, n)
        -> hear: through the air to the microphones; other sensors sum their weight set over the bodies

Live listening is this driver with one step, a replay the same with many: the result of a step depends on nothing else.
It stops before a step for which a table is too small, having changed nothing of it; the caller enlarges the table and
calls again. Sums in a fixed order: rows as they came, pairs by key, bodies by index.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from struct import Struct
from typing import NamedTuple

import numpy as np

from sonic_bullet.bank import bank_kernel
from sonic_bullet.bank.bank_kernel import DRIVE_SCRATCH, RING_SCRATCH
from sonic_bullet.bank.layout import DRIVEN, BankWork
from sonic_bullet.bank.strike_pool import enter_pulses
from sonic_bullet.contact.contact_patches import choose_bodies, count_separations, track_contact_patches
from sonic_bullet.contact.contact_rows import enter_loads, orient
from sonic_bullet.contact.friction import advance_friction
from sonic_bullet.contact.load_splitting import LOOKAHEAD, SPAN
from sonic_bullet.contact.strike_forces import STRIKE, find_pulses
from sonic_bullet.contact.surface_kernel import VOICE
from sonic_bullet.machine.compiled import njit
from sonic_bullet.machine.grouping import grouping
from sonic_bullet.machine.vector import LANES
from sonic_bullet.path.images.image_gains import image_gains
from sonic_bullet.path.path_kernel import WORK, hear
from sonic_bullet.path.path_places import OUTCOME, Arrivals, Course, Emission
from sonic_bullet.runtime.groups import Groups


class _Stops(NamedTuple):
    """Why the driver returned early; else its status is `OUTCOME.done`, or another result of `path_kernel.hear`."""

    to_grow: int = -1  # a table is too small
    paused: int = -2  # asked to stop before `hear`
    broken: int = -3  # a sum is not finite, or a strike has no place
    to_update_poles: int = -4


STOP = _Stops()


class _Resumes(NamedTuple):
    """Progress of the first step."""

    anew: int = 0  # nothing is done
    rings: int = 1  # and `hear` is next
    excited: int = 2  # its pulses and drives are there


RESUME = _Resumes()

STEP = np.dtype(
    [
        ("dt_s", "f8"),  # of the step taken in
        ("gravity_m_s2", "f8", (3,)),
        ("row", "i8", (2,)),  # its contacts: first and the one after the last
        ("sample", "i8"),  # first sample of the step that is rendered, LOOKAHEAD before
        ("count", "i8"),  # samples of it; 0 while there is none
        ("offset", "f8"),  # of the first sample behind the step's start, in samples
        ("begin_s", "f8"),  # time at which it starts, and at which the one after it does
        ("after_s", "f8"),
        ("quench", "i8"),  # 1: all stops ringing before the step after it
    ],
    align=True,
)
"""A physics step for the driver: what is taken in, and the time of what is rendered then."""
STEP_LAYOUT = Struct("4d4q3dq")
"""STEP, field by field: packing a row so is ten times as fast as setting its fields."""
assert STEP_LAYOUT.size == STEP.itemsize


grouped = grouping(Groups)


@njit(nogil=True, error_model="numpy")
def aligned(size):  # pragma: no cover - compiled
    """Allocate (size,) numbers that begin where a vector register does."""
    raw = np.empty(size + LANES)
    skip = (-(raw.ctypes.data // 8)) % LANES
    return raw[skip : skip + size]


@njit(nogil=True, error_model="numpy")
def take(i, number, given, window, pairs):  # pragma: no cover - compiled
    """Take step i of those given into the window as step ``number``: its poses, its rows, the pairs' loads."""
    slot, step, rows = number % SPAN, given.steps[i], window.row
    for b in range(given.position.shape[1]):
        for axis in range(3):
            window.position_m[slot, b, axis] = given.position[i, b, axis]
        for axis in range(4):
            window.quaternion_xyzw[slot, b, axis] = given.quaternion[i, b, axis]
        window.teleported[slot, b] = given.teleported[i, b]
    first = slot * (len(rows) // SPAN)
    count = step.row[1] - step.row[0]
    orient(given.contacts[step.row[0] : step.row[1]], window.quaternion_xyzw[slot], rows[first : first + count])
    here = window.step[slot]
    here.dt_s, here.row[0], here.row[1] = step.dt_s, first, first + count
    for axis in range(3):
        here.gravity_m_s2[axis] = step.gravity_m_s2[axis]
    enter_loads(rows, first, first + count, step.dt_s, pairs)


@njit(nogil=True, error_model="numpy")
def excite(number, quench, x, sr, window, table, pairs, scratch):  # pragma: no cover - compiled
    """Find strikes and friction of step ``number``: its pulses and drives, as many as scratch.count tells."""
    for b in range(len(table.bodies)):
        if window.teleported[(number + 1) % SPAN, b]:
            table.bodies[b].placed = number + 1
    strikes, voices = np.empty(pairs.count[0], STRIKE), np.empty(pairs.count[0], VOICE)
    found = find_pulses(np.int64(0), number, np.int64(0), window, table, pairs, strikes, scratch)
    # else a strike after the quench would be dated back before it and be lost: it waits for its own step
    if not quench:
        found = find_pulses(np.int64(1), number + 1, found, window, table, pairs, strikes, scratch)
    scratch.count[0] = found
    advance_friction(number, x, sr, window, table, pairs, voices, scratch)


@njit(nogil=True, error_model="numpy")
def track_supports(number, window, table, pairs, supports, bank, scratch):  # pragma: no cover - compiled
    """Update the support state of step ``number``; return how many bodies' poles are to be computed."""
    here = window.step[number % SPAN]
    track_contact_patches(here, window.row, table, pairs, supports.support_state)
    count_separations(supports.support_state, bank)
    return choose_bodies(here.dt_s, table, pairs, supports, bank, scratch)


@njit(nogil=True, error_model="numpy")
def ring(step, x, sr, bank, scratch):  # pragma: no cover - compiled
    """Apply the step's pulses and drives to the bank: source (W, b, n or more) and dipole (b, 3, n or more).

    False where a pulse found no place.
    """
    entered = enter_pulses(step.begin_s, step.after_s, step.sample, sr, bank, scratch)
    n, drives = step.count, scratch.count[1]
    work = BankWork(
        np.empty(len(bank.body) + 1, np.int64), np.empty(2 * drives, np.int64), np.empty((drives, 2, n + LANES)),
        np.empty((6, n + LANES)), np.empty((DRIVEN, 3), np.int64), aligned(max(DRIVE_SCRATCH, RING_SCRATCH)),
    )  # fmt: skip
    bank_kernel.advance(step.sample, n, sr, x, bank, scratch, work)
    return entered == scratch.count[0]


@njit(nogil=True, error_model="numpy")
def sum_at_sensors(source, n, out_at, frames):  # pragma: no cover - compiled
    """Compute a step's signal at sensors that read modes themselves; False where it is not finite."""
    reads, out = frames.reads, frames.out
    channels = len(reads)
    for c in range(channels):
        if reads[c] == 0:
            continue
        for k in range(n):
            total = 0.0
            for b in range(source.shape[1]):
                total += source[reads[c], b, k]
                if frames.apart:
                    out[b * channels + c, out_at + k] = source[reads[c], b, k]
            if not frames.apart:
                out[c, out_at + k] = total
            if not abs(total) < np.inf:
                return False
    return True


@njit(nogil=True, error_model="numpy")
def has_room(new, window, pairs, bank, scratch):  # pragma: no cover - compiled
    """Test whether the tables have room for a step of so many contacts."""
    bound = pairs.count[0] + new
    short = pairs.count[1] < new or len(window.row) // SPAN < new
    short = short or len(scratch.pulse) < 2 * bound or len(scratch.slot) < bound
    return not short and bank.free[0] >= 4 * bound


@njit(nogil=True, error_model="numpy")
def advance_steps(values):  # pragma: no cover - compiled
    """Render the steps of the table from ``call.first`` on into ``frames.out`` (channels, samples of all of them).

    Returns how many are done, and why it returned. Of the last one, its pulses and drives are in the scratch.

    Parameters
    ----------
    values : flat, of all fields of `groups.Groups`
    """
    call, given, frames, window, table, pairs, supports, bank, scratch, path = grouped(values)
    done, sr = 0, call.sr
    for i in range(call.first, len(given.steps)):
        step, number, far = given.steps[i], call.taken + i, call.resume if i == call.first else RESUME.anew
        if far == RESUME.anew:
            if not has_room(step.row[1] - step.row[0], window, pairs, bank, scratch):
                return done, STOP.to_grow
            take(i, number, given, window, pairs)
        number -= LOOKAHEAD
        if number >= 0:
            n, dt_s = step.count, window.step[number % SPAN].dt_s
            x = np.empty(n)
            for k in range(n):
                x[k] = min(max((k + step.offset) / (dt_s * sr), 0.0), 1.0)
            if far == RESUME.anew:
                excite(number, step.quench, x, sr, window, table, pairs, scratch)
                if len(supports.credit_s) > 0 and track_supports(number, window, table, pairs, supports, bank, scratch):
                    return done, STOP.to_update_poles
            if far != RESUME.rings:
                if not ring(step, x, sr, bank, scratch):
                    return done, STOP.broken
                if call.pause:
                    return done, STOP.paused
            status = finish(i, number, x, given, frames, window, scratch, path)
            if status != OUTCOME.done:
                return done, status
        done += 1
    return done, OUTCOME.done


@njit(nogil=True, error_model="numpy")
def finish(i, number, x, given, frames, window, scratch, path):  # pragma: no cover - compiled
    """Write step ``number``, i of those given, which rings in the scratch, into frames.out.

    Returns `OUTCOME.done`, or what is in the way.
    """
    step, here, there = given.steps[i], number % SPAN, (number + 1) % SPAN
    at, aim_m, out, reads = step.sample - frames.start, given.aim_m, frames.out, frames.reads
    emission = Emission(scratch.source, scratch.dipole, np.int64(0), frames.sets)
    aim_m = aim_m[i : i + 2] if len(aim_m) > 0 else aim_m
    gain = image_gains((here, there), window, aim_m, path.microphone_m)
    course = Course(window.position_m[here], window.position_m[there], window.teleported[there], x, aim_m, gain)
    arrivals = Arrivals(frames.pressure, at, frames.apart)
    status = hear(step.sample, number, step.count, emission, course, path, np.zeros(WORK), arrivals)
    if status != OUTCOME.done:
        return status
    if not sum_at_sensors(scratch.source, step.count, at, frames):
        return STOP.broken
    m = 0
    for row in range(len(out)):
        if reads[row % len(reads)] == 0:
            for k in range(at, at + step.count):
                out[row, k] = frames.pressure[m, k]
            m += 1
    return OUTCOME.done
