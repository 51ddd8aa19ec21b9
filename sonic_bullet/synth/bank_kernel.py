"""The modal bank's compiled loops.

Strict IEEE arithmetic, and stated multiply-adds in `tile` and `drive`: one set of bits.

    block start:  tile[n] = Σ Re(w z p^n),  z <- z p^256           all modes of a ringing body at once (tile.py)
    each sample:  f <- f p + (strikes + forces) (1 + i d/ω),  y = tile[n] + Σ Re(w f)      driven bodies only
    block end:    z <- z + f p,  f <- 0
    bent bodies:  p of each block by |z| at its start, and of what is driven within it every 32 samples (bend_poles)

Blocks lie on a fixed grid of absolute samples, and f runs sample by sample: where a frame ends changes nothing.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.synth import drive, tile
from sonic_bullet.synth.tile import BLOCK, CHUNK, ROW, ROWS
from sonic_bullet.synth.vector import LANES

DRIVEN = 32
"""Samples for which what is driven keeps its bent poles."""
FLUSH = 1e-30
"""Output samples below this become 0: they have no meaning in pascal or m/s, and their float32 would be subnormal."""


@njit(nogil=True, inline="always")
def _aligned(size):  # pragma: no cover - compiled
    raw = np.empty(size + LANES)
    skip = (-(raw.ctypes.data // 8)) % LANES
    return raw[skip : skip + size]


@njit(nogil=True)
def _ring(
    b, z, pole, block, weight, modes, start, stop, size, observed, floor, sound, now, powers, table, column
):  # pragma: no cover - compiled
    """Tile of body b for the block that starts: sound (W, b, BLOCK). Turns z to the next block. False where all modes
    are below the floor.
    """
    ringing = False
    for lo in range(start, stop, CHUNK):
        count = min(CHUNK, stop - lo)
        if tile.turn(z, pole, block, modes, lo, count, floor, now, powers) == 0:
            continue
        if not ringing:
            ringing = True
            for w in range(len(observed)):
                if observed[w, b]:
                    sound[w, b, :] = 0.0
        real = min(count, start + size - lo)  # spare lanes need no table
        tile.rows(powers, real, table)
        for w in range(len(observed)):
            if observed[w, b]:
                tile.columns(now, weight[w], modes, lo, powers, count, column)
                tile.outer(column, table, real, sound[w, b])
    return ringing


@njit(nogil=True)
def bend_poles(
    z, driven, span, log_pole, bend, damping_growth, power, modes, start, stop, pole, block
):  # pragma: no cover - compiled
    """Poles of a level-dependent body for the ``span`` samples to come: means over them of what its modes do if nothing
    strikes them.

    a = |z|:  ȧ = −d a (1 + (ca)^p)  ->  a(T)/a = ((1 + (ca)^p) e^{pdT} − (ca)^p)^{−1/p};   ω <- ω (1 + b ⟨a²⟩),
        ⟨a²⟩ = a² (1 − e^{−2d'T})/2d'T
    (Nayfeh & Mook 1979, eq. 2.3.35 and section 3.3), d' the block's mean decay; exact in amplitude, and in phase for c
    = 0.
    """
    for m in range(start, stop):
        if bend[m] == 0.0 and damping_growth[m] == 0.0:
            continue
        d, w = -log_pole[m] * span, log_pole[modes + m]
        level = np.sqrt(z[m] ** 2 + z[modes + m] ** 2 + driven[m] ** 2 + driven[modes + m] ** 2)
        c = (damping_growth[m] * level) ** power[m]
        fall = np.log(max((1.0 + c) * np.exp(power[m] * d) - c, 1.0)) / power[m]
        mean = -np.expm1(-2.0 * fall) / (2.0 * fall) if fall > 1e-9 else 1.0
        turn = min(max(w * (1.0 + bend[m] * level * level * mean), 0.0), 3.141)
        p = np.exp(-fall / span)
        pole[m], pole[modes + m] = p * np.cos(turn), p * np.sin(turn)
        if span == BLOCK:
            q = np.exp(-fall)
            block[m], block[modes + m] = q * np.cos(turn * BLOCK), q * np.sin(turn * BLOCK)


@njit(nogil=True)
def _strike(
    j,
    n,
    state,
    modes,
    start,
    lanes,
    count,
    whole,
    delta,
    phase,
    upcoming,
    first,
    impulse,
    impulse_at,
    rows,
    rows_at,
    width,
):  # pragma: no cover - compiled
    """Add strike j's nodes in (n-1, n] to the driven state. True when it was the last of them."""
    multiplier = -1
    if n == first[j]:
        nodes = upcoming[j]
        upcoming[j] = 0
    else:
        nodes = min(max(int(np.floor((phase[j] + 1.0) / delta[j])), whole[j]), whole[j] + 1)
        phase[j] += 1.0 - nodes * delta[j]
        multiplier = nodes - whole[j]
    upcoming[j] = (
        drive.strike_nodes(
            state, modes, start, lanes, rows, rows_at[j], width, multiplier, impulse, impulse_at[j] + upcoming[j], nodes
        )
        - impulse_at[j]
    )
    return upcoming[j] >= count[j]


@njit(nogil=True)
def _begins(first, done, s0, s1, end):  # pragma: no cover - compiled
    """Whether one of the strikes s0 … s1 - 1 has nodes before sample ``end``."""
    begins = False  # numba knows no any()
    for j in range(s0, s1):
        begins = begins or (not done[j] and first[j] < end)
    return begins


@njit(nogil=True)
def _copy_flushed(values, out):  # pragma: no cover - compiled
    for k in range(len(out)):
        value = values[k]
        out[k] = value if abs(value) >= FLUSH else 0.0


@njit(nogil=True)
def _close_block(b, z, driven, pole, modes, start, stop, ringing, is_driven, tiled):  # pragma: no cover - compiled
    """End of a block: what was driven within it joins the free state of the next."""
    tiled[b] = False
    if is_driven[b]:
        drive.turn_driven(driven, pole, modes, start, stop - start)
        for m in range(start, stop):
            z[m] += driven[m]
            z[modes + m] += driven[modes + m]
            driven[m] = 0.0
            driven[modes + m] = 0.0
        ringing[b] = True
        is_driven[b] = False


@njit(nogil=True)
def _drive(at, i, end, place, b, out, z, driven, is_driven, tiled, pole, block, log_pole, bend, damping_growth, power,
           bent, modes, start, stop, quadrature, weight_flat, observed, sound, s0, s1, count, whole, delta, phase,
           upcoming, first, impulse, impulse_at, rows, rows_at, done, f0, f1, force, gain0, gain1, gain_at,
           progress, period):  # fmt: skip  # pragma: no cover - compiled
    """Samples i … end - 1 of body b, sample by sample: strikes and forces enter, free and driven part are heard
    together.
    """
    width = len(rows) // 8
    for k in range(i, end):
        sample = at + k
        # what begins to be driven begins with the poles of what rings then
        if bent[b] and (not is_driven[b] or sample % DRIVEN == 0):
            bend_poles(z, driven, DRIVEN, log_pole, bend, damping_growth, power, modes, start, stop, pole, block)
        if is_driven[b]:
            drive.turn_driven(driven, pole, modes, start, stop - start)
        for j in range(s0, s1):
            if not done[j] and sample >= first[j]:
                done[j] = _strike(
                    j,
                    sample,
                    driven,
                    modes,
                    start,
                    stop - start,
                    count,
                    whole,
                    delta,
                    phase,
                    upcoming,
                    first,
                    impulse,
                    impulse_at,
                    rows,
                    rows_at,
                    width,
                )
                is_driven[b] = True
        for f in range(f0, f1):
            push = force[f, k] * period
            if abs(push) >= FLUSH:
                drive.push(
                    driven,
                    quadrature,
                    modes,
                    start,
                    stop - start,
                    gain0,
                    gain1,
                    gain_at[f],
                    push * (1.0 - progress[k]),
                    push * progress[k],
                )
                is_driven[b] = True
        for w in range(len(observed)):
            if observed[w, b]:
                value = sound[w, b, place + k - i] if tiled[b] else 0.0
                if is_driven[b]:
                    value += drive.observed(driven, start, weight_flat, 2 * w * modes + start, modes, stop - start)
                out[w, b, k] = value if abs(value) >= FLUSH else 0.0


@njit(nogil=True)
def advance(at, out, offset, size, pole, block, log_pole, bend, damping_growth, power, bent, quadrature, weight,
            observed, z, driven, sound, ringing, is_driven, tiled, floor, strike_of, count, whole, delta,
            phase, upcoming, first, impulse, impulse_at, rows, rows_at, done, force_of, force, gain0,
            gain1, gain_at, progress, period):  # fmt: skip  # pragma: no cover - compiled
    """Samples at … at + n - 1 into out (W, b, n) (zeros). See bank.py for the arrays; all in place."""
    n = out.shape[2]
    modes = len(quadrature)
    now, powers, table, column = (
        _aligned(2 * CHUNK),
        _aligned(10 * CHUNK),
        _aligned(2 * ROW * CHUNK),
        _aligned(2 * ROWS * CHUNK),
    )
    weight_flat = weight.reshape(-1)
    for b in range(len(offset) - 1):
        start, stop = offset[b], offset[b + 1]
        s0, s1 = strike_of[b], strike_of[b + 1]
        f0, f1 = force_of[b], force_of[b + 1]
        if start == stop:
            for j in range(s0, s1):
                done[j] = True
            continue
        if not (ringing[b] or is_driven[b] or tiled[b] or s1 > s0 or f1 > f0):
            continue
        i = 0
        while i < n:
            place = (at + i) % BLOCK
            end = min(n, i + BLOCK - place)
            if place == 0:
                if bent[b] and ringing[b]:
                    bend_poles(z, driven, BLOCK, log_pole, bend, damping_growth, power, modes, start, stop, pole, block)
                tiled[b] = ringing[b] and _ring(
                    b,
                    z,
                    pole,
                    block,
                    weight,
                    modes,
                    start,
                    stop,
                    size[b],
                    observed,
                    floor,
                    sound,
                    now,
                    powers,
                    table,
                    column,
                )
                ringing[b] = tiled[b]
            if not (is_driven[b] or f1 > f0 or _begins(first, done, s0, s1, at + end)):
                if tiled[b]:
                    for w in range(len(observed)):
                        if observed[w, b]:
                            _copy_flushed(sound[w, b, place : place + end - i], out[w, b, i:end])
                    tiled[b] = place + end - i < BLOCK
                i = end
                continue
            _drive(at, i, end, place, b, out, z, driven, is_driven, tiled, pole, block, log_pole, bend, damping_growth,
                   power, bent, modes, start, stop, quadrature, weight_flat, observed, sound, s0, s1, count, whole,
                   delta, phase, upcoming, first, impulse, impulse_at, rows, rows_at, done, f0, f1, force, gain0,
                   gain1, gain_at, progress, period)  # fmt: skip
            if place + end - i == BLOCK:
                _close_block(b, z, driven, pole, modes, start, stop, ringing, is_driven, tiled)
            i = end
