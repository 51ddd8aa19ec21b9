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

from sonic_bullet.bank import drive, poles, tile, transmission
from sonic_bullet.bank.kernels import uncounted
from sonic_bullet.bank.layout import COLUMNS, DRIVEN, FLOOR, FLUSH, LANE_PAIR, MOST_DUE, ROOM, Lanes, Stretch
from sonic_bullet.bank.strike_pool import begins, plan_nodes, release_done
from sonic_bullet.bank.tile import BLOCK, CHUNK, ROWS, TILE_ROW
from sonic_bullet.bank.translation import translate
from sonic_bullet.machine.vector import LANES, At

RING_SCRATCH = (2 + 10 + 2 * TILE_ROW + 2 * ROWS) * CHUNK
IMPULSE_SCRATCH = COLUMNS // LANE_PAIR * ROOM * drive.SAMPLE_NUMBERS
DRIVE_SCRATCH = IMPULSE_SCRATCH + DRIVEN * LANES + DRIVEN + MOST_DUE


@uncounted
def _ring(b, bank, scratch):  # noqa: PLR0912 - a loop a set  # pragma: no cover - compiled
    """Compute the tiles of body b for the block that starts: sound (W, b, BLOCK), transmission_sound (J·W, b, BLOCK).

    Advances z to the next block. False where all modes are below the floor. scratch: RING_SCRATCH numbers.
    """
    now, powers = scratch[: 2 * CHUNK], scratch[2 * CHUNK : 12 * CHUNK]
    table = scratch[12 * CHUNK : (12 + 2 * TILE_ROW) * CHUNK]
    column = scratch[(12 + 2 * TILE_ROW) * CHUNK : RING_SCRATCH]
    start, columns, modes = bank.body[b].start, bank.body[b].columns, bank.law.shape[1]
    alive, sets, partners = (
        False,
        len(bank.observed),
        bank.transmissions.shape[1] if bank.ringing[b].transmissions else 0,
    )
    end = start + -(-columns // LANES) * LANES
    for lo in range(start, end, CHUNK):
        lanes = Lanes(modes, lo, min(CHUNK, end - lo))
        if tile.turn(bank.z, bank.pole, bank.block, lanes, FLOOR**2, now, powers) == 0:
            continue
        if not alive:
            alive = True
            for w in range(sets):
                if bank.observed[w, b]:
                    bank.sound[w, b, :] = 0.0
            bank.blend[:, :] = 0.0
            for j in range(partners):
                bank.transmission_sound[j * sets : (j + 1) * sets, b, :] = 0.0
        real = min(lanes.count, start + columns - lo)  # spare lanes need no table
        tile.rows(powers, real, table)
        for w in range(sets):
            if bank.observed[w, b]:
                k = bank.aims[w]
                tile.columns(now, bank.weight[w] if k < 0 else bank.aim[2 * k], lanes, powers, column)
                tile.outer(column, table, real, bank.sound[w, b])
                if k >= 0 and bank.turned[k, b]:
                    tile.columns(now, bank.aim[2 * k + 1], lanes, powers, column)
                    tile.outer(column, table, real, bank.blend[k])
        for j in range(partners):
            if transmission.sounds(bank.transmissions[b, j].phase):
                for w in range(j * sets, (j + 1) * sets):
                    tile.columns(now, bank.transmission_weight[w], lanes, powers, column)
                    tile.outer(column, table, real, bank.transmission_sound[w, b])
    if alive:
        _turn(b, bank)
    return alive


@uncounted
def _turn(b, bank):  # pragma: no cover - compiled
    """Let the block's free sound of aimed sets pass from the weights as they were to those from its end on."""
    for w in range(len(bank.observed)):
        k = bank.aims[w]
        if k >= 0 and bank.turned[k, b] and bank.observed[w, b]:
            for n in range(BLOCK):
                bank.sound[w, b, n] += n / BLOCK * (bank.blend[k, n] - bank.sound[w, b, n])


@uncounted
def _take_aim(b, bank):  # pragma: no cover - compiled
    """Let what is driven from here on have the new weights of aimed sets."""
    modes = bank.law.shape[1]
    for k in range(len(bank.turned)):
        if bank.turned[k, b]:
            bank.turned[k, b] = 0
            for re in range(bank.body[b].start, bank.body[b].stop):
                bank.aim[2 * k, re] = bank.aim[2 * k + 1, re]
                bank.aim[2 * k, re + modes] = bank.aim[2 * k + 1, re + modes]


@uncounted
def _copy_flushed(values, out):  # pragma: no cover - compiled
    for k in range(len(out)):
        value = values[k]
        out[k] = value if abs(value) >= FLUSH else 0.0


@uncounted
def _close_block(b, bank):  # pragma: no cover - compiled
    """End a block: what was driven within it is added to the free state of the next."""
    z, driven, pole, modes = bank.z, bank.driven, bank.pole, bank.law.shape[1]
    for re in range(bank.body[b].start, bank.body[b].stop):
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
def _part_force(d, n, progress, period, force, signal):  # pragma: no cover - compiled
    """Split a force's impulses between both ends of its gains; zeros behind."""
    stride, whole = signal.shape[2], n - n % LANES
    early, late = signal[d, 0], signal[d, 1]
    drive.part_force(At(force, d * n), progress, period, whole, signal, 2 * d * stride, (2 * d + 1) * stride)
    for k in range(whole, n):
        impulse = force[d * n + k] * period
        impulse = impulse if impulse * impulse >= FLUSH**2 else 0.0
        early[k] = impulse * (1.0 - progress[k])
        late[k] = impulse * progress[k]
    for k in range(n, stride):
        early[k] = 0.0
        late[k] = 0.0


@uncounted
def list_forces(n, progress, period, bank, scratch, work):  # pragma: no cover - compiled
    """List forces by body: work.first (b+1,) where each body's begin in side, 2·drive + side each, in their order.

    scratch.body (drives, 2): -1 for nobody; force: flat (drives, n). work.signal (drives, 2, stride): impulses at both
    ends, F·period·(1 - x) and F·period·x, 0 behind the last. Gains and impulses below FLUSH become 0, the gains in
    place.
    """
    first, count, drives, drive_body = work.first, len(bank.body), scratch.count[1], scratch.body
    for b in range(count + 1):
        first[b] = 0
    for d in range(drives):
        for s in range(2):
            if drive_body[d, s] >= 0:
                first[drive_body[d, s] + 1] += 1
    for b in range(count):
        first[b + 1] += first[b]
    # counting sort: first advances to each body's end, and is shifted back afterwards
    for d in range(drives):
        for s in range(2):
            b = drive_body[d, s]
            if b >= 0:
                work.side[first[b]] = 2 * d + s
                first[b] += 1
                _flush(scratch.gain0[d, s], bank.body[b].columns)
                _flush(scratch.gain1[d, s], bank.body[b].columns)
        _part_force(d, n, progress, period, scratch.force, work.signal)
    for b in range(count, 0, -1):
        first[b] = first[b - 1]
    first[0] = 0


@uncounted
def _add_strikes(b, stretch, column, keep, used, bank, work):  # pragma: no cover - compiled
    """Add body b's strikes to COLUMNS lanes, or what is left, from ``column`` on; return 1 where impulse is in use.

    used: 1 where impulse is in use already. keep: their phasors advance, and with the last lanes they themselves.
    """
    impulse, due = work.flat[:IMPULSE_SCRATCH], work.flat[DRIVE_SCRATCH - MOST_DUE : DRIVE_SCRATCH]
    left, width, strikes = bank.body[b].stop - bank.body[b].start - column, bank.rows.shape[2], bank.strikes
    lanes, final, sample = min(COLUMNS, left), keep and left <= COLUMNS, stretch.at + stretch.i
    slot = bank.ringing[b].strike
    while slot >= 0:
        if strikes[slot].modal and strikes[slot].first < sample + stretch.count:
            if not used:
                drive.clear(impulse, lanes, stretch.count)
                used = 1
            begin, end = plan_nodes(slot, sample, stretch.count, bank, work.plan, due, final)
            rows, plan = At(bank.rows, slot * 8 * width + column), drive.NodePlan(work.plan, due, begin, end)
            drive.strike_nodes(impulse, rows, width, lanes, plan, keep)
        slot = strikes[slot].next
    return used


@uncounted
def _drive(b, stretch, bank, scratch, work):  # noqa: PLR0912 - a loop a set  # pragma: no cover - compiled
    """Advance body b by a stretch within one of the DRIVEN; sum driven and free part."""
    modes, ringing, count = bank.law.shape[1], bank.ringing[b], stretch.count
    start, stop, f0, f1 = bank.body[b].start, bank.body[b].stop, work.first[b], work.first[b + 1]
    impulse, partial = work.flat[:IMPULSE_SCRATCH], work.flat[IMPULSE_SCRATCH : IMPULSE_SCRATCH + DRIVEN * LANES]
    total = work.flat[IMPULSE_SCRATCH + DRIVEN * LANES : IMPULSE_SCRATCH + DRIVEN * LANES + DRIVEN]
    forces = drive.Forces(work.side, f0, f1, work.signal, work.signal.shape[2])
    ringing.driven = 1
    sets, last = len(bank.observed), transmission.last_set(b, bank)
    for w in range(last + 1):  # each active weight set in turn: the state advances with the last
        j, v = w // sets - 1, w % sets  # of partner j, where it is 0 or above
        if w > 0 and not (bank.observed[v, b] if j < 0 else transmission.sounds(bank.transmissions[b, j].phase)):
            continue
        keep = w == last
        for k in range(count * LANES):
            partial[k] = 0.0
        for lo in range(start, stop, COLUMNS):
            lanes, column, used = Lanes(modes, lo, min(COLUMNS, stop - lo)), lo - start, 0
            if f1 > f0:
                used = 1
                gains = drive.Gains(scratch.gain0, scratch.gain1, scratch.gain0.shape[2], column)
                drive.project_forces(
                    impulse, gains, forces, stretch.i, At(bank.law, 2 * modes + lo), lanes.count, count
                )
            if ringing.strike >= 0:
                used = _add_strikes(b, stretch, column, keep, used, bank, work)
            if not used:
                for k in range(drive.SAMPLE_NUMBERS):
                    impulse[k] = 0.0
            weight = At(bank.weight if j < 0 else bank.transmission_weight, 2 * (w if j < 0 else w - sets) * modes + lo)
            if j < 0 and bank.aims[w] >= 0:
                weight = At(bank.aim, 4 * bank.aims[w] * modes + lo)
            motion = drive.DrivenModes(bank.driven, bank.pole)
            drive.run(motion, lanes, weight, drive.LaneImpulses(impulse, used), count, partial, keep)
        if j >= 0 or bank.observed[w, b]:
            drive.across(partial, count, total)
            free, place = (
                bank.sound[w, b] if j < 0 else bank.transmission_sound[w - sets, b],
                (stretch.at + stretch.i) % BLOCK,
            )
            for k in range(count if ringing.tiled else 0):
                total[k] += free[place + k]
            if j < 0:
                _copy_flushed(total, scratch.source[w, b, stretch.i : stretch.i + count])
            else:
                transmission.transmit(b, j, v, stretch, total, bank, scratch.transmitted)


@uncounted
def _sound_free(b, stretch, bank, scratch):  # pragma: no cover - compiled
    """Compute a stretch of a body that only rings, or is silent."""
    sets, i, end = len(bank.observed), stretch.i, stretch.i + stretch.count
    place, ringing = (stretch.at + i) % BLOCK, bank.ringing[b]
    for w in range(sets):
        if bank.observed[w, b]:
            if ringing.tiled:
                _copy_flushed(bank.sound[w, b, place : place + end - i], scratch.source[w, b, i:end])
            else:
                scratch.source[w, b, i:end] = 0.0
    for j in range(bank.transmissions.shape[1] if ringing.transmissions and ringing.tiled else 0):
        if transmission.sounds(bank.transmissions[b, j].phase):
            for w in range(sets):
                free = bank.transmission_sound[j * sets + w, b, place : place + end - i]
                transmission.transmit(b, j, w, stretch, free, bank, scratch.transmitted)


@uncounted
def _open_block(b, bank, scratch):  # pragma: no cover - compiled
    """Begin a block: take new poles and those that depend on the level, and compute its free sound."""
    body, ringing = bank.body[b], bank.ringing[b]
    poles.take_coming(b, body.start, body.stop, bank.ringing, bank.law, bank.pole, bank.block, bank.coming)
    transmission.move_on(b, bank)
    if body.bent and ringing.ringing:
        poles.bend_poles(b, np.int64(BLOCK), bank)
    alive = ringing.ringing != 0 and _ring(b, bank, scratch)
    ringing.tiled = ringing.ringing = 1 if alive else 0
    _take_aim(b, bank)


@uncounted
def _advance_modes(at, n, b, bank, scratch, work):  # pragma: no cover - compiled
    """Compute samples at … at + n - 1 of body b's modes into scratch.source (W, b, n or more)."""
    ringing, forced = bank.ringing[b], work.first[b + 1] > work.first[b]
    i = np.int64(0)  # a literal has its own type, and its callees would be compiled twice
    while i < n:
        place = (at + i) % BLOCK
        if place == 0:
            _open_block(b, bank, work.flat)
        end = min(n, i + BLOCK - place)
        if ringing.driven or forced or ringing.strike >= 0:
            end = min(end, i + DRIVEN - (at + i) % DRIVEN)
        stretch = Stretch(at, i, end - i)
        if ringing.driven or forced or begins(b, at + end, bank):
            # driven motion begins with the poles of the free ringing
            if bank.body[b].bent and (not ringing.driven or (at + i) % DRIVEN == 0):
                poles.bend_poles(b, np.int64(DRIVEN), bank)
            _drive(b, stretch, bank, scratch, work)
        else:
            _sound_free(b, stretch, bank, scratch)
        if place + end - i == BLOCK:
            ringing.tiled = 0
            if ringing.driven:
                _close_block(b, bank)
                ringing.ringing = 1
                ringing.driven = 0
        i = end


@uncounted
def advance(at, n, sr, progress, bank, scratch, work):  # pragma: no cover - compiled
    """Compute samples at … at + n - 1 into scratch: source (W, b, n or more) and dipole (b, 3, n or more).

    scratch.sounds (b, 2): 1 where a body's rows of source, of dipole are not zero. On entry it must hold for the rows
    transmitted in: rows that stay silent are cleared only where it is 1. progress (n,): where between its gains each
    sample of a drive lies. See layout.py for the tables; all in place.
    """
    sounds = scratch.sounds
    list_forces(n, progress, 1.0 / sr, bank, scratch, work)
    for b in range(len(bank.body)):
        body, ringing = bank.body[b], bank.ringing[b]
        loud = ringing.ringing or ringing.driven or ringing.tiled or work.first[b + 1] > work.first[b]
        loud = body.columns > 0 and (loud or begins(b, at + n, bank))
        if loud:
            _advance_modes(at, n, b, bank, scratch, work)
        elif sounds[b, 0]:
            for w in range(len(bank.observed)):
                scratch.source[w, b, :] = 0.0
        sounds[b, 0] = 1 if loud else 0
        moves = body.rigid != 0 and translate(at, n, b, bank, scratch, work)
        if not moves and sounds[b, 1]:
            scratch.dipole[b, :, :] = 0.0
        sounds[b, 1] = 1 if moves else 0
        if ringing.strike >= 0:
            release_done(b, bank)
    if bank.transmissions.shape[1]:
        transmission.add_passed(n, bank, scratch)
