"""Driver of the run time: physics steps in, samples out, all stages in one compiled call.

    CONTACT rows, poses of a step -> take: ROW, load histories, into a window of SPAN steps
        -> excite: PULSE (strikes), drives (friction) of the step LOOKAHEAD before
        -> settle: contact patches, and bodies whose poles they change, which Python computes (supports.py)
        -> ring: modes and translations of all bodies -> source (W, b, n), pushed (b, 3, n)
        -> hear: through the air to the microphones; other sensors sum their weight set over the bodies

Live listening is this driver with one step, a replay the same with many: the result of a step depends on nothing else.
It stops before a step for which a table is too small, having changed nothing of it; the caller enlarges the table and
calls again. Sums in a fixed order: rows as they came, pairs by key, bodies by index.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from struct import Struct

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.render.contact_rows import enter_loads, orient
from sonic_bullet.render.friction import advance_friction
from sonic_bullet.render.standing.held_contacts import choose_bodies, count_lifted, hold_contacts
from sonic_bullet.render.strike_pulses import STRIKE, find_pulses
from sonic_bullet.synth.bank import bank_kernel
from sonic_bullet.synth.bank.bank_kernel import DRIVE_SCRATCH, RING_SCRATCH
from sonic_bullet.synth.bank.layout import DRIVEN
from sonic_bullet.synth.bank.strike_pool import enter_pulses
from sonic_bullet.synth.path_kernel import WORK, hear
from sonic_bullet.synth.path_places import DONE
from sonic_bullet.synth.strikes import LOOKAHEAD, SPAN
from sonic_bullet.synth.surface_kernel import VOICE
from sonic_bullet.synth.vector import LANES

TO_GROW, PAUSED, BROKEN, TO_SETTLE = -1, -2, -3, -4
"""Why the driver returned early: a table is too small; asked to stop before `hear`; an error (a sum that is not finite
or a strike without a place); poles are to be computed. Else it is DONE, or the result of `path_kernel.hear`."""
ANEW, RINGS, EXCITED = 0, 1, 2
"""Progress of the first step: nothing is done; it rings, and `hear` is next; its pulses and drives are there."""
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


@njit(nogil=True, error_model="numpy")
def aligned(size):  # pragma: no cover - compiled
    """Allocate (size,) numbers that begin where a vector register does."""
    raw = np.empty(size + LANES)
    skip = (-(raw.ctypes.data // 8)) % LANES
    return raw[skip : skip + size]


@njit(nogil=True, error_model="numpy")
def take(
    slot, step, contacts, position, quaternion, teleported, window, window_position, window_quaternion,
    window_teleported, rows, pairs, active, counts, free,
):  # fmt: skip  # pragma: no cover - compiled
    """Take a step into a slot of the window: its poses (b, ·), its rows, the pairs' loads."""
    for b in range(len(position)):
        for axis in range(3):
            window_position[slot, b, axis] = position[b, axis]
        for axis in range(4):
            window_quaternion[slot, b, axis] = quaternion[b, axis]
        window_teleported[slot, b] = teleported[b]
    first = slot * (len(rows) // SPAN)
    count = step.row[1] - step.row[0]
    orient(contacts[step.row[0] : step.row[1]], window_quaternion[slot], rows[first : first + count])
    here = window[slot]
    here.dt_s, here.row[0], here.row[1] = step.dt_s, first, first + count
    for axis in range(3):
        here.gravity_m_s2[axis] = step.gravity_m_s2[axis]
    enter_loads(rows, first, first + count, step.dt_s, pairs, active, counts, free)


@njit(nogil=True, error_model="numpy")
def excite(
    number, quench, x, sr, window, window_quaternion, window_teleported, rows, bodies, faces, nodes, shapes,
    frequency_hz, spectrum, pairs, active, counts, gain, pulses, push, force, gain0, gain1, direction0, direction1,
    drive_body, drive_slot,
):  # fmt: skip  # pragma: no cover - compiled
    """Find strikes and friction of step ``number``; return the numbers of its pulses and drives."""
    here, there = window[number % SPAN], window[(number + 1) % SPAN]
    known = np.empty((SPAN, 2), np.int64)
    for j in range(SPAN):
        known[j, 0], known[j, 1] = window[(number + j) % SPAN].row[0], window[(number + j) % SPAN].row[1]
    for b in range(len(bodies)):
        if window_teleported[(number + 1) % SPAN, b]:
            bodies[b].placed = number + 1
    strikes, voices = np.empty(counts[0], STRIKE), np.empty(counts[0], VOICE)
    found = find_pulses(
        np.int64(0), number, 0.0, here.dt_s, here.gravity_m_s2, window_quaternion[number % SPAN], rows, known, pairs,
        active, counts, bodies, faces, nodes, shapes, frequency_hz, spectrum, strikes, pulses, push, np.int64(0),
    )  # fmt: skip
    # else a strike after the quench would be dated back before it and be lost: it waits for its own step
    if not quench:
        found = find_pulses(
            np.int64(1), number + 1, -here.dt_s, there.dt_s, there.gravity_m_s2, window_quaternion[(number + 1) % SPAN],
            rows, known, pairs, active, counts, bodies, faces, nodes, shapes, frequency_hz, spectrum, strikes, pulses,
            push, found,
        )  # fmt: skip
    drives = advance_friction(
        pairs, active, counts[0], bodies, rows[known[1, 0] : known[1, 1]], known[1, 1] - known[1, 0], faces, nodes,
        shapes, window_quaternion[(number + 1) % SPAN], here.dt_s, x, sr, gain, voices, force, gain0, gain1, direction0,
        direction1, drive_body, drive_slot,
    )  # fmt: skip
    return found, drives


@njit(nogil=True, error_model="numpy")
def settle(
    number, window, rows, pairs, active, counts, held, stand, credit_s, bodies, bank_body, ringing, law, z, driven,
    pulses, found, drive_body, drives,
):  # fmt: skip  # pragma: no cover - compiled
    """Update the support state of step ``number``; return how many bodies' poles are to be computed."""
    here = window[number % SPAN]
    hold_contacts(pairs, active, counts[0], held, stand, bodies, rows, here.row[0], here.row[1], here.dt_s)
    count_lifted(stand, bank_body, ringing, law, z, driven)
    return choose_bodies(
        pairs, active, counts[0], held, stand, bodies, ringing, pulses, found, drive_body, drives, here.dt_s, credit_s
    )


@njit(nogil=True, error_model="numpy")
def ring(
    step, sr, found, pulses, push, drives, drive_body, force, gain0, gain1, direction0, direction1, x, bank_body, law,
    weight, observed, ringing, z, driven, sound, pole, block, coming, passes, pass_weight, pass_sound, passed, strikes,
    phasors, free_strikes, hertz, source, pushed, sounds,
):  # fmt: skip  # pragma: no cover - compiled
    """Apply the step's pulses and drives to the bank: source (W, b, n or more) and pushed (b, 3, n or more).

    False where a pulse found no place.
    """
    entered = enter_pulses(
        pulses, found, push, step.begin_s, step.after_s, step.sample, sr, bank_body, law, ringing, strikes, phasors,
        free_strikes, hertz,
    )  # fmt: skip
    n = step.count
    bank_kernel.advance(
        step.sample, n, sr, bank_body, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes,
        pass_weight, pass_sound, passed, strikes, phasors, free_strikes, hertz, drives, drive_body, force, gain0,
        gain1, direction0, direction1, x,
        np.empty(len(bank_body) + 1, np.int64), np.empty(2 * drives, np.int64), np.empty((drives, 2, n + LANES)),
        np.empty((6, n + LANES)), np.empty((DRIVEN, 3), np.int64), aligned(max(DRIVE_SCRATCH, RING_SCRATCH)), source,
        pushed, sounds,
    )  # fmt: skip
    return entered == found


@njit(nogil=True, error_model="numpy")
def sum_at_sensors(source, n, reads, out, out_at, apart):  # pragma: no cover - compiled
    """Compute a step's signal at sensors that read modes themselves; False where it is not finite.

    reads (c,): their weight set, 0 for a microphone. apart 1: of each body of it.
    """
    channels = len(reads)
    for c in range(channels):
        if reads[c] == 0:
            continue
        for k in range(n):
            total = 0.0
            for b in range(source.shape[1]):
                total += source[reads[c], b, k]
                if apart:
                    out[b * channels + c, out_at + k] = source[reads[c], b, k]
            if not apart:
                out[c, out_at + k] = total
            if not abs(total) < np.inf:
                return False
    return True


@njit(nogil=True, error_model="numpy")
def advance_steps(  # noqa: PLR0911 - one return a reason to come back
    first, taken, start, pause, resume, found, drives, sr, steps, contacts, position, quaternion, teleported, aim_m,
    window, window_position, window_quaternion, window_teleported, rows,
    bodies, faces, nodes, shapes, frequency_hz, spectrum, pairs, active, counts, free, gain,
    held, stand, credit_s, pulses, push, force, gain0, gain1, direction0, direction1, drive_body, drive_slot,
    bank_body, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes, pass_weight, pass_sound,
    passed, strikes, phasors, free_strikes, hertz, source, pushed, sounds, microphone_m, samples_per_m, sources, places,
    lines, memory, taps, reads, apart, pressure, out,
):  # fmt: skip  # pragma: no cover - compiled
    """Render steps ``first`` … of the table into out (channels, samples of all of them).

    Returns how many are done, why it returned, and how many pulses and drives the last one has.

    Parameters
    ----------
    taken : number of the first step of the table
    start : sample of out's first
    contacts : of all steps
    position, quaternion, teleported : (k, b, 3), (k, b, 4), (k, b)
    aim_m : (k + 1, b, c, 3) as `path_kernel.hear` has it, at each step's start and the last one's end; (0, …): at rest
    pressure : (microphones, as out)
    pause : return before `hear` of the first step
    resume : progress of the first step
    found, drives : its pulses and drives, where it is EXCITED
    credit_s : (1,), (0,) where nothing supports
    apart : 1: out is (bodies·channels, …) and pressure (bodies·microphones, …), body by body, nothing summed
    """
    done = 0
    for i in range(first, len(steps)):
        step, number, far = steps[i], taken + i, resume if i == first else ANEW
        anew = far == ANEW
        if anew:
            new = step.row[1] - step.row[0]
            bound = counts[0] + new
            if counts[1] < new or len(rows) // SPAN < new or len(pulses) < 2 * bound or len(drive_slot) < bound:
                return done, TO_GROW, found, drives
            if free_strikes[0] < 4 * bound:
                return done, TO_GROW, found, drives
            take(
                number % SPAN, step, contacts, position[i], quaternion[i], teleported[i], window, window_position,
                window_quaternion, window_teleported, rows, pairs, active, counts, free,
            )  # fmt: skip
        number -= LOOKAHEAD
        if number >= 0:
            n, dt_s = step.count, window[number % SPAN].dt_s
            x = np.empty(n)
            for k in range(n):
                x[k] = min(max((k + step.offset) / (dt_s * sr), 0.0), 1.0)
            signal = force[: len(drive_slot) * n].reshape((len(drive_slot), n))
            if anew:
                found, drives = excite(
                    number, step.quench, x, sr, window, window_quaternion, window_teleported, rows, bodies, faces,
                    nodes, shapes, frequency_hz, spectrum, pairs, active, counts, gain, pulses, push, signal, gain0,
                    gain1, direction0, direction1, drive_body, drive_slot,
                )  # fmt: skip
                if len(credit_s) > 0 and settle(
                    number, window, rows, pairs, active, counts, held, stand, credit_s, bodies, bank_body, ringing, law,
                    z, driven, pulses, found, drive_body, drives,
                ):  # fmt: skip
                    return done, TO_SETTLE, found, drives
            if far != RINGS:
                if not ring(
                    step, sr, found, pulses, push, drives, drive_body, signal, gain0, gain1, direction0, direction1, x,
                    bank_body, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes,
                    pass_weight, pass_sound, passed, strikes, phasors, free_strikes, hertz, source, pushed, sounds,
                ):  # fmt: skip
                    return done, BROKEN, found, drives
                if pause:
                    return done, PAUSED, found, drives
            status = finish(
                number, step, start, x, window_position, window_teleported, source, pushed, microphone_m,
                aim_m[i : i + 2] if len(aim_m) > 0 else aim_m, samples_per_m, sources, places, lines, memory, taps,
                reads, apart, pressure, out,
            )  # fmt: skip
            if status != DONE:
                return done, status, found, drives
        done += 1
    return done, DONE, found, drives


@njit(nogil=True, error_model="numpy")
def finish(
    number, step, start, x, window_position, window_teleported, source, pushed, microphone_m, aim_m, samples_per_m,
    sources, places, lines, memory, taps, reads, apart, pressure, out,
):  # fmt: skip  # pragma: no cover - compiled
    """Write step ``number``, which rings in source and pushed, into out (channels, …), whose first sample is ``start``.

    Returns DONE, or what is in the way.
    """
    here, there, at = number % SPAN, (number + 1) % SPAN, step.sample - start
    status = hear(
        step.sample, number, step.count, np.int64(0), source[0], pushed, window_position[here], window_position[there],
        window_teleported[there], x, microphone_m, aim_m, samples_per_m, sources, places, lines, memory, taps,
        np.zeros(WORK), pressure, at, apart,
    )  # fmt: skip
    if status != DONE:
        return status
    if not sum_at_sensors(source, step.count, reads, out, at, apart):
        return BROKEN
    m = 0
    for row in range(len(out)):
        if reads[row % len(reads)] == 0:
            for k in range(at, at + step.count):
                out[row, k] = pressure[m, k]
            m += 1
    return DONE
