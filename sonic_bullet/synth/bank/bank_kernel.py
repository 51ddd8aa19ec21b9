"""Compiled loops of the modal bank.

Strict IEEE arithmetic, and stated multiply-adds in `tile` and `drive`: one set of bits.

    block start:  tile[n] = Σ Re(w z p^n),  z <- z p^256           all modes of a ringing body at once (tile.py)
    32 samples:   f <- f p + (strikes + forces) (1 + i d/ω),  y = tile[n] + Σ Re(w f)     driven bodies only (drive.py)
    block end:    z <- z + f p,  f <- 0
    bent bodies:  p of each block by |z| at its start, and of what is driven within it every 32 samples

Blocks lie on a fixed grid of absolute samples, and f runs sample by sample: where a frame ends changes nothing. New
poles of a body take effect where one of the 32 begins (pole) or a block (block, too): see `poles`.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np

from sonic_bullet.synth.bank import drive, passing, poles, tile
from sonic_bullet.synth.bank.kernels import uncounted
from sonic_bullet.synth.bank.layout import COLUMNS, DRIVEN, FLOOR, FLUSH, MOST_DUE, PAIR, ROOM
from sonic_bullet.synth.bank.strike_pool import begins, plan_nodes, release_done
from sonic_bullet.synth.bank.tile import BLOCK, CHUNK, ROW, ROWS
from sonic_bullet.synth.bank.translation import translate
from sonic_bullet.synth.vector import LANES

RING_SCRATCH = (2 + 10 + 2 * ROW + 2 * ROWS) * CHUNK
PUSH_SCRATCH = COLUMNS // PAIR * ROOM * drive.STEP
DRIVE_SCRATCH = PUSH_SCRATCH + DRIVEN * LANES + DRIVEN + MOST_DUE


@uncounted
def _ring(
    b, start, columns, z, pole, block, weight, modes, observed, sound, ringing, passes, pass_weight, pass_sound, scratch
):  # pragma: no cover - compiled
    """Compute the tiles of body b for the block that starts: sound (W, b, BLOCK), pass_sound (J·W, b, BLOCK).

    Advances z to the next block. False where all modes are below the floor.
    """
    now, powers = scratch[: 2 * CHUNK], scratch[2 * CHUNK : 12 * CHUNK]
    table = scratch[12 * CHUNK : (12 + 2 * ROW) * CHUNK]
    column = scratch[(12 + 2 * ROW) * CHUNK : RING_SCRATCH]
    alive, sets = False, len(observed)
    end = start + -(-columns // LANES) * LANES
    for lo in range(start, end, CHUNK):
        count = min(CHUNK, end - lo)
        if tile.turn(z, pole, block, modes, lo, count, FLOOR**2, now, powers) == 0:
            continue
        if not alive:
            alive = True
            for w in range(sets):
                if observed[w, b]:
                    sound[w, b, :] = 0.0
            for j in range(passes.shape[1] if ringing[b].passes else 0):
                pass_sound[j * sets : (j + 1) * sets, b, :] = 0.0
        real = min(count, start + columns - lo)  # spare lanes need no table
        tile.rows(powers, real, table)
        for w in range(sets):
            if observed[w, b]:
                tile.columns(now, weight[w], modes, lo, powers, count, column)
                tile.outer(column, table, real, sound[w, b])
        for j in range(passes.shape[1] if ringing[b].passes else 0):
            if passing.sounds(passes[b, j].phase):
                for w in range(j * sets, (j + 1) * sets):
                    tile.columns(now, pass_weight[w], modes, lo, powers, count, column)
                    tile.outer(column, table, real, pass_sound[w, b])
    return alive


@uncounted
def _copy_flushed(values, out):  # pragma: no cover - compiled
    for k in range(len(out)):
        value = values[k]
        out[k] = value if abs(value) >= FLUSH else 0.0


@uncounted
def _close_block(z, driven, pole, modes, start, stop):  # pragma: no cover - compiled
    """End a block: what was driven within it is added to the free state of the next."""
    for re in range(start, stop):
        im = re + modes
        x, y = driven[re], driven[im]
        z[re] += x * pole[re] - y * pole[im]
        z[im] += x * pole[im] + y * pole[re]
        driven[re] = 0.0
        driven[im] = 0.0


@uncounted
def _flush(values, count):  # pragma: no cover - compiled
    for k in range(count):
        values[k] = values[k] if abs(values[k]) >= FLUSH else 0.0


@uncounted
def _part_force(d, n, force_n, progress, period, signal):  # pragma: no cover - compiled
    """Split a force's impulses between both ends of its gains; zeros behind."""
    stride, whole = signal.shape[2], n - n % LANES
    early, late = signal[d, 0], signal[d, 1]
    drive.part_force(
        force_n, d * force_n.shape[1], progress, period, whole, signal, 2 * d * stride, (2 * d + 1) * stride
    )
    for k in range(whole, n):
        push = force_n[d, k] * period
        push = push if push * push >= FLUSH**2 else 0.0
        early[k] = push * (1.0 - progress[k])
        late[k] = push * progress[k]
    for k in range(n, stride):
        early[k] = 0.0
        late[k] = 0.0


@uncounted
def list_forces(
    n, drive_count, drive_body, force_n, gain0, gain1, progress, period, bodies, first, side, signal
):  # pragma: no cover - compiled
    """List forces by body: first (b+1,) where each body's begin in side, 2·drive + side each, in order of the drives.

    drive_body (drives, 2): -1 for nobody. signal (drives, 2, stride): impulses at both ends, F·period·(1 - x) and
    F·period·x, 0 behind the last. Gains and impulses below FLUSH become 0, the gains in place.
    """
    count = len(bodies)
    for b in range(count + 1):
        first[b] = 0
    for d in range(drive_count):
        for s in range(2):
            if drive_body[d, s] >= 0:
                first[drive_body[d, s] + 1] += 1
    for b in range(count):
        first[b + 1] += first[b]
    # counting sort: first advances to each body's end, and is shifted back afterwards
    for d in range(drive_count):
        for s in range(2):
            b = drive_body[d, s]
            if b >= 0:
                side[first[b]] = 2 * d + s
                first[b] += 1
                _flush(gain0[d, s], bodies[b].columns)
                _flush(gain1[d, s], bodies[b].columns)
        _part_force(d, n, force_n, progress, period, signal)
    for b in range(count, 0, -1):
        first[b] = first[b - 1]
    first[0] = 0


@uncounted
def _press_strikes(
    sample, count, b, column, lanes, ringing, strikes, rows, hertz, pushes, keep, final, plan, due, push
):  # pragma: no cover - compiled
    """Add body b's strikes to ``lanes`` lanes from ``column`` on at ``count`` samples; return 1 where push is in use.

    pushes: 1 where push is in use already. keep, final: their phasors, and they themselves, advance.
    """
    width = rows.shape[2]
    slot = ringing[b].strike
    while slot >= 0:
        if strikes[slot].modal and strikes[slot].first < sample + count:
            if not pushes:
                drive.clear(push, lanes, count)
                pushes = 1
            begin, end = plan_nodes(slot, sample, count, strikes, hertz, plan, due, final)
            drive.strike_nodes(push, rows, slot * 8 * width + column, width, lanes, plan, due, begin, end, keep)
        slot = strikes[slot].next
    return pushes


@uncounted
def _drive(
    at, i, count, b, place, start, stop, law, weight, observed, ringing, driven, sound, pole, passes, pass_weight,
    pass_sound, passed, strikes, rows, hertz, f0, f1, side, gain0, gain1, signal, plan, scratch, source,
):  # fmt: skip  # pragma: no cover - compiled
    """Advance ``count`` samples from ``i`` on, within one of the DRIVEN; sum driven and free part."""
    modes = law.shape[1]
    push, partial = scratch[:PUSH_SCRATCH], scratch[PUSH_SCRATCH : PUSH_SCRATCH + DRIVEN * LANES]
    total = scratch[PUSH_SCRATCH + DRIVEN * LANES : PUSH_SCRATCH + DRIVEN * LANES + DRIVEN]
    due = scratch[PUSH_SCRATCH + DRIVEN * LANES + DRIVEN : DRIVE_SCRATCH]
    ringing[b].driven = 1
    sets, last = len(observed), passing.last_set(b, ringing, observed, passes)
    for w in range(last + 1):  # each active weight set in turn: the state advances with the last
        j, v = w // sets - 1, w % sets  # of partner j, where it is 0 or above
        if w > 0 and not (observed[v, b] if j < 0 else passing.sounds(passes[b, j].phase)):
            continue
        keep = w == last
        for k in range(count * LANES):
            partial[k] = 0.0
        for lo in range(start, stop, COLUMNS):
            lanes, column, pushes = min(COLUMNS, stop - lo), lo - start, 0
            if f1 > f0:
                pushes = 1
                drive.press(
                    push, gain0, gain1, gain0.shape[2], side, f0, f1, signal, signal.shape[2], i,
                    law, 2 * modes + lo, column, lanes, count,
                )  # fmt: skip
            final = keep and lo + COLUMNS >= stop
            if ringing[b].strike >= 0:
                pushes = _press_strikes(
                    at + i, count, b, column, lanes, ringing, strikes, rows, hertz, pushes, keep, final, plan, due, push
                )
            if not pushes:
                for k in range(drive.STEP):
                    push[k] = 0.0
            read = weight if j < 0 else pass_weight
            at_w = w if j < 0 else w - sets
            drive.run(driven, pole, modes, lo, lanes, read, 2 * at_w * modes + lo, push, pushes, count, partial, keep)
        if j >= 0 or observed[w, b]:
            drive.across(partial, count, total)
            free = sound[w, b] if j < 0 else pass_sound[w - sets, b]
            for k in range(count if ringing[b].tiled else 0):
                total[k] += free[place + k]
            if j < 0:
                _copy_flushed(total, source[w, b, i : i + count])
            else:
                passing.pass_on(b, j, v, i, place, total, count, passes, ringing, passed)


@uncounted
def _sound_free(
    b, i, end, place, observed, ringing, sound, passes, pass_sound, passed, source
):  # pragma: no cover - compiled
    """Compute samples i … end - 1 of a body that only rings, or is silent."""
    for w in range(len(observed)):
        if observed[w, b]:
            if ringing[b].tiled:
                _copy_flushed(sound[w, b, place : place + end - i], source[w, b, i:end])
            else:
                source[w, b, i:end] = 0.0
    sets = len(observed)
    for j in range(passes.shape[1] if ringing[b].passes and ringing[b].tiled else 0):
        if passing.sounds(passes[b, j].phase):
            for w in range(sets):
                free = pass_sound[j * sets + w, b, place : place + end - i]
                passing.pass_on(b, j, w, i, place, free, end - i, passes, ringing, passed)


@uncounted
def _open_block(
    b, start, stop, bodies, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes, pass_weight,
    pass_sound, scratch,
):  # fmt: skip  # pragma: no cover - compiled
    """Begin a block: take new poles and those that depend on the level, and compute its free sound."""
    poles.take_coming(b, start, stop, ringing, law, pole, block, coming)
    passing.move_on(b, ringing, passes)
    if bodies[b].bent and ringing[b].ringing:
        poles.bend_poles(z, driven, np.int64(BLOCK), law, start, stop, pole, block)
    alive = ringing[b].ringing != 0 and _ring(
        b, start, bodies[b].columns, z, pole, block, weight, law.shape[1], observed, sound, ringing, passes,
        pass_weight, pass_sound, scratch,
    )  # fmt: skip
    ringing[b].tiled = ringing[b].ringing = 1 if alive else 0


@uncounted
def _advance_modes(
    at, n, b, bodies, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes, pass_weight,
    pass_sound, passed, strikes, rows, hertz, f0, f1, side, gain0, gain1, signal, plan, scratch, source,
):  # fmt: skip  # pragma: no cover - compiled
    """Compute samples at … at + n - 1 of body b's modes into source (W, b, n or more)."""
    start, stop, modes = bodies[b].start, bodies[b].stop, law.shape[1]
    i = np.int64(0)  # a literal has its own type, and its callees would be compiled twice
    while i < n:
        place = (at + i) % BLOCK
        if place == 0:
            _open_block(
                b, start, stop, bodies, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes,
                pass_weight, pass_sound, scratch,
            )  # fmt: skip
        end = min(n, i + BLOCK - place)
        if ringing[b].driven or f1 > f0 or ringing[b].strike >= 0:
            end = min(end, i + DRIVEN - (at + i) % DRIVEN)
        if ringing[b].driven or f1 > f0 or begins(b, at + end, ringing, strikes):
            # driven motion begins with the poles of the free ringing
            if bodies[b].bent and (not ringing[b].driven or (at + i) % DRIVEN == 0):
                poles.bend_poles(z, driven, np.int64(DRIVEN), law, start, stop, pole, block)
            _drive(
                at, i, end - i, b, place, start, stop, law, weight, observed, ringing, driven, sound, pole, passes,
                pass_weight, pass_sound, passed, strikes, rows, hertz, f0, f1, side, gain0, gain1, signal, plan,
                scratch, source,
            )  # fmt: skip
        else:
            _sound_free(b, i, end, place, observed, ringing, sound, passes, pass_sound, passed, source)
        if place + end - i == BLOCK:
            ringing[b].tiled = 0
            if ringing[b].driven:
                _close_block(z, driven, pole, modes, start, stop)
                ringing[b].ringing = 1
                ringing[b].driven = 0
        i = end


@uncounted
def advance(
    at, n, sr, bodies, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes, pass_weight,
    pass_sound, passed, strikes, rows, free, hertz, drive_count, drive_body, force_n, gain0, gain1, direction0,
    direction1, progress, first, side, signal, kick, plan, scratch, source, pushed, sounds,
):  # fmt: skip  # pragma: no cover - compiled
    """Compute samples at … at + n - 1 into source (W, b, n or more) and pushed (b, 3, n or more).

    sounds (b, 2): 1 where a body's rows of source, of pushed are not zero. On entry it must hold for the rows passed
    in: rows that stay silent are cleared only where it is 1. See layout.py for the tables; all in place.
    """
    period = 1.0 / sr
    list_forces(n, drive_count, drive_body, force_n, gain0, gain1, progress, period, bodies, first, side, signal)
    for b in range(len(bodies)):
        f0, f1 = first[b], first[b + 1]
        loud = ringing[b].ringing or ringing[b].driven or ringing[b].tiled or f1 > f0
        loud = bodies[b].columns > 0 and (loud or begins(b, at + n, ringing, strikes))
        if loud:
            _advance_modes(
                at, n, b, bodies, law, weight, observed, ringing, z, driven, sound, pole, block, coming, passes,
                pass_weight, pass_sound, passed, strikes, rows, hertz, f0, f1, side, gain0, gain1, signal, plan,
                scratch, source,
            )  # fmt: skip
        elif sounds[b, 0]:
            for w in range(len(observed)):
                source[w, b, :] = 0.0
        sounds[b, 0] = 1 if loud else 0
        moves = bodies[b].rigid != 0 and translate(
            at, n, b, bodies, ringing, strikes, hertz, f0, f1, side, signal, direction0, direction1, kick, pushed[b]
        )
        if not moves and sounds[b, 1]:
            pushed[b, :, :] = 0.0
        sounds[b, 1] = 1 if moves else 0
        if ringing[b].strike >= 0:
            release_done(b, ringing, strikes, free)
    if passes.shape[1]:
        passing.add_passed(n, ringing, observed, source, passed, sounds)
