"""The modal bank's compiled loops. Strict IEEE arithmetic outside `tile`: bits do not depend on how a loop is vectorised.

    block start:  tile[n] = Σ Re(w z p^n),  z <- z p^256           all modes of a ringing body at once (tile.py)
    each sample:  f <- f p + (strikes + forces) (1 + i d/ω),  y = tile[n] + Σ Re(w f)      driven bodies only
    block end:    z <- z + f p,  f <- 0

Blocks lie on a fixed grid of absolute samples, and f runs sample by sample: where a frame ends changes nothing.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from sonic_bullet.synth import tile
from sonic_bullet.synth.tile import BLOCK, CHUNK, LANES, ROW, ROWS

FLUSH = 1e-30
"""Output samples below this become 0: they have no meaning in pascal or m/s, and their float32 would be subnormal."""


@njit(cache=True, nogil=True, inline="always")
def _aligned(size):  # pragma: no cover - compiled
    raw = np.empty(size + LANES)
    skip = (-(raw.ctypes.data // 8)) % LANES
    return raw[skip : skip + size]


@njit(cache=True, nogil=True)
def strike_rows(pole_log, quadrature, gain, modes, start, delta, phase, whole, rows):  # pragma: no cover - compiled
    """Fill rows (8, m): r = g (1 + i d/ω) e^{s φ}, D = e^{s δ}, E0 = p D^-whole, E1 = E0/D, real and imaginary parts in turn."""
    for k in range(len(gain)):
        re, im = pole_log[start + k], pole_log[modes + start + k]
        size = gain[k] * np.exp(re * phase)
        x, y = size * np.cos(im * phase), size * np.sin(im * phase)
        rows[0, k], rows[1, k] = x - quadrature[start + k] * y, y + quadrature[start + k] * x
        size = np.exp(re * delta)
        rows[2, k], rows[3, k] = size * np.cos(im * delta), size * np.sin(im * delta)
        for row, left in ((4, 1.0 - whole * delta), (6, 1.0 - (whole + 1) * delta)):
            size = np.exp(re * left)
            rows[row, k], rows[row + 1, k] = size * np.cos(im * left), size * np.sin(im * left)


@njit(cache=True, nogil=True)
def _ring(b, z, pole, block, weight, modes, start, stop, heard, floor, sound, now, powers, table, column):  # pragma: no cover - compiled
    """Tile of body b for the block that starts: sound (W, b, BLOCK). Turns z to the next block. False where all modes are below the floor."""
    ringing = False
    for lo in range(start, stop, CHUNK):
        count = min(CHUNK, stop - lo)
        if tile.turn(z, pole, block, modes, lo, count, floor, now, powers) == 0:
            continue
        if not ringing:
            ringing = True
            for w in range(len(heard)):
                if heard[w, b]:
                    sound[w, b, :] = 0.0
        tile.rows(powers, count, table)
        for w in range(len(heard)):
            if heard[w, b]:
                tile.columns(now, weight[w], modes, lo, powers, count, column)
                tile.outer(column, table, count, sound[w, b])
    return ringing


@njit(cache=True, nogil=True)
def _strike(j, n, state, count, whole, delta, phase, upcoming, first, impulse, impulse_at, rows, rows_at, sum_re, sum_im, quadrature, modes, start, stop):  # pragma: no cover - compiled
    """Add strike j's nodes in (n-1, n] to the driven state: Horner in D over the nodes, then one turn r to the sample."""
    m = stop - start
    at = rows_at[j]
    r_re, r_im, d_re, d_im = rows[at : at + m], rows[at + m : at + 2 * m], rows[at + 2 * m : at + 3 * m], rows[at + 3 * m : at + 4 * m]
    if n == first[j]:
        k = upcoming[j]
        upcoming[j] = 0
    else:
        k = min(max(int(np.floor((phase[j] + 1.0) / delta[j])), whole[j]), whole[j] + 1)
        phase[j] += 1.0 - k * delta[j]
        e = at + (4 + 2 * (k - whole[j])) * m
        e_re, e_im = rows[e : e + m], rows[e + m : e + 2 * m]
        for i in range(m):
            x = r_re[i] * e_re[i] - r_im[i] * e_im[i]
            r_im[i] = r_re[i] * e_im[i] + r_im[i] * e_re[i]
            r_re[i] = x
    if k == 0:
        return False
    for node in range(upcoming[j], upcoming[j] + k):
        push = impulse[impulse_at[j] + node] if node < count[j] else 0.0
        if node == upcoming[j]:
            for i in range(m):
                sum_re[i] = push
                sum_im[i] = 0.0
        else:
            for i in range(m):
                x = sum_re[i] * d_re[i] - sum_im[i] * d_im[i] + push
                sum_im[i] = sum_re[i] * d_im[i] + sum_im[i] * d_re[i]
                sum_re[i] = x
    upcoming[j] += k
    for i in range(m):
        state[start + i] += sum_re[i] * r_re[i] - sum_im[i] * r_im[i]
        state[modes + start + i] += sum_re[i] * r_im[i] + sum_im[i] * r_re[i]
    return upcoming[j] >= count[j]


@njit(cache=True, nogil=True)
def _turn_driven(state, pole, modes, start, stop):  # pragma: no cover - compiled
    for m in range(start, stop):
        x, y = state[m], state[modes + m]
        state[m] = x * pole[m] - y * pole[modes + m]
        state[modes + m] = x * pole[modes + m] + y * pole[m]


@njit(cache=True, nogil=True)
def _push(state, modes, start, stop, quadrature, gain0, gain1, at, a0, a1):  # pragma: no cover - compiled
    for m in range(start, stop):
        push = a0 * gain0[at + m - start] + a1 * gain1[at + m - start]
        state[m] += push
        state[modes + m] += push * quadrature[m]


@njit(cache=True, nogil=True)
def _close_block(b, z, driven, pole, modes, start, stop, ringing, is_driven, tiled):  # pragma: no cover - compiled
    """End of a block: what was driven within it joins the free state of the next."""
    tiled[b] = False
    if is_driven[b]:
        _turn_driven(driven, pole, modes, start, stop)
        for m in range(start, stop):
            z[m] += driven[m]
            z[modes + m] += driven[modes + m]
            driven[m] = 0.0
            driven[modes + m] = 0.0
        ringing[b] = True
        is_driven[b] = False


@njit(cache=True, nogil=True)
def advance(at, out, offset, pole, block, quadrature, weight, heard, z, driven, sound, ringing, is_driven, tiled, floor,
            strike_of, count, whole, delta, phase, upcoming, first, impulse, impulse_at, rows, rows_at, done,
            force_of, force, gain0, gain1, gain_at, progress, period):  # fmt: skip  # pragma: no cover - compiled
    """Samples at … at + n - 1 into out (W, b, n) (zeros). See bank.py for the arrays; all in place."""
    n = out.shape[2]
    modes = len(quadrature)
    now, powers, table, column = _aligned(2 * CHUNK), _aligned(10 * CHUNK), _aligned(2 * ROW * CHUNK), _aligned(2 * ROWS * CHUNK)
    longest = 0
    for b in range(len(offset) - 1):
        longest = max(longest, offset[b + 1] - offset[b])
    sum_re, sum_im = np.empty(longest), np.empty(longest)
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
                tiled[b] = ringing[b] and _ring(b, z, pole, block, weight, modes, start, stop, heard, floor, sound, now, powers, table, column)
                ringing[b] = tiled[b]
            busy = is_driven[b] or f1 > f0
            for j in range(s0, s1):
                busy = busy or (not done[j] and first[j] < at + end)
            if not busy:
                if tiled[b]:
                    for w in range(len(heard)):
                        if heard[w, b]:
                            for k in range(end - i):
                                value = sound[w, b, place + k]
                                out[w, b, i + k] = value if abs(value) >= FLUSH else 0.0
                    tiled[b] = place + end - i < BLOCK
                i = end
                continue
            for k in range(i, end):
                sample = at + k
                if is_driven[b]:
                    _turn_driven(driven, pole, modes, start, stop)
                for j in range(s0, s1):
                    if not done[j] and sample >= first[j]:
                        done[j] = _strike(j, sample, driven, count, whole, delta, phase, upcoming, first, impulse, impulse_at, rows, rows_at, sum_re, sum_im, quadrature, modes, start, stop)
                        is_driven[b] = True
                for f in range(f0, f1):
                    push = force[f, k] * period
                    if abs(push) >= FLUSH:
                        _push(driven, modes, start, stop, quadrature, gain0, gain1, gain_at[f], push * (1.0 - progress[k]), push * progress[k])
                        is_driven[b] = True
                for w in range(len(heard)):
                    if heard[w, b]:
                        value = sound[w, b, place + k - i] if tiled[b] else 0.0
                        if is_driven[b]:
                            value += tile.heard(driven, weight[w], modes, start, stop - start)
                        out[w, b, k] = value if abs(value) >= FLUSH else 0.0
            if place + end - i == BLOCK:
                _close_block(b, z, driven, pole, modes, start, stop, ringing, is_driven, tiled)
            i = end
