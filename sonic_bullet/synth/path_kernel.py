"""The sound path's compiled loop: what each body emits, delayed by r/c and divided by r, read off by a moving
fractional delay.

    emitted at sample m:   a[m] = (s[m] + K n̂·j[m])/r[m],  arriving at m + D[m], D = r sr/c
    heard at sample n:     a(u), where u + D(u) = n, D linear between samples
        (retarded time: Doppler shift is exact)
    a(u) = Σ_k a[k] h(u - k),  h: 16 taps of a Kaiser-windowed sinc
        [Laakso et al. 1996, IEEE SPM 13(1), sec. 3.2]

A line is one body, one place and one microphone. It sleeps until something is emitted and again when the last of it has
arrived; that is decided sample by sample, so frames do not matter. Taps as polynomials in the fraction [Farrow 1988].
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array
from sonic_bullet.synth.vector import LANES, Emit

TAPS = 16
AHEAD = TAPS // 2
LEAST_DELAY = float(AHEAD)
HALF_DEGREE = 4
KAISER_BETA = 6.0
FLUSH = 1e-30
LEAST_ADVANCE = 1.0 / 16.0
"""Sound emitted one sample later arrives at least this much later: a source at or above the speed of sound is not
overtaken by its own sound.
"""

_HISTORY = 3 * AHEAD


@lru_cache(maxsize=1)
def tap_polynomials() -> Array:
    """(HALF_DEGREE + 1, 2, 8): of taps 0 … 7 the even and the odd part in t = fraction - ½, as polynomials in t²,
    lowest power first.

    Tap k weighs sample floor(u) - 7 + k; tap 15 - k at t is tap k at -t: h = even ± t·odd serves both. Fitted to 1e-8.
    """
    t = 0.5 * np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    distance = np.arange(TAPS) - (AHEAD - 1) - (t[:, None] + 0.5)
    window = np.i0(KAISER_BETA * np.sqrt(np.maximum(0, 1 - (distance / AHEAD) ** 2))) / np.i0(KAISER_BETA)
    taps = np.sinc(distance) * window
    taps /= taps.sum(axis=1, keepdims=True)
    here, mirrored = taps[:, :AHEAD], taps[:, : AHEAD - 1 : -1]
    powers = np.vander(t**2, HALF_DEGREE + 1, increasing=True)
    even = np.linalg.lstsq(powers, (here + mirrored) / 2, rcond=None)[0]
    odd = np.linalg.lstsq(powers, (here - mirrored) / (2 * t[:, None]), rcond=None)[0]
    fit = np.ascontiguousarray(np.stack([even, odd], axis=1))
    fit.setflags(write=False)
    return fit


@intrinsic
def _interpolate(typingctx, ring, at, taps, t):
    """Σ_k ring[at + k] h_k(t) over the 16 taps: even·(a_k + a_{15-k}) + t·odd·(a_k - a_{15-k}) over eight."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        ring, at, taps, t = e.args
        fraction = e.spread(t)
        square = builder.fmul(fraction, fraction)
        parts = []
        for part in range(2):
            value = e.load(taps, e.index((2 * HALF_DEGREE + part) * LANES))
            for power in range(HALF_DEGREE - 1, -1, -1):
                value = e.fma(value, square, e.load(taps, e.index((2 * power + part) * LANES)))
            parts.append(value)
        low, high = e.load(ring, at), e.reversed(e.load(ring, e.shifted(at, LANES)))
        even = builder.fmul(parts[0], builder.fadd(low, high))
        return e.total(e.fma(builder.fmul(parts[1], fraction), builder.fsub(low, high), even))

    return types.float64(ring, at, taps, t), codegen


@njit(nogil=True, error_model="numpy")
def _listen(line, at, emitted, delay, observed, ring, delays, awake, cursor, last, taps):  # pragma: no cover - compiled
    """Run one line, its ring and delays (a power of two long, the ring TAPS longer), over emitted (n,), adding to
    observed (n,).
    """
    size = len(delays)
    mask = np.uintp(size - 1)  # unsigned indices: numba checks no wrap-around
    running, m, newest = awake[line], cursor[line], last[line]
    before = delays[np.uintp(at - 1) & mask]
    for i in range(len(emitted)):
        n = at + i
        value, new = emitted[i], delay[i]
        if not running:
            if value == 0.0:
                continue
            running = True
            for k in range(n - _HISTORY, n):
                place = np.uintp(k) & mask
                ring[place] = 0.0
                delays[place] = new
                if place < TAPS:
                    ring[place + np.uintp(size)] = 0.0
            m = n - AHEAD - 1
        else:
            new = max(new, before - (1.0 - LEAST_ADVANCE))
        before = new
        place = np.uintp(n) & mask
        ring[place] = value
        delays[place] = new
        if place < TAPS:
            ring[place + np.uintp(size)] = value  # mirrored, so that 16 taps are always contiguous
        if value != 0.0:
            newest = n
        here = delays[np.uintp(m) & mask]
        if (m - n) + here > 0.0:
            continue
        there = delays[np.uintp(m + 1) & mask]
        while (m + 1 - n) + there <= 0.0:
            m += 1
            here = there
            there = delays[np.uintp(m + 1) & mask]
        if m - (AHEAD - 1) > newest:
            running = False
            continue
        fraction = ((n - m) - here) / (1.0 + there - here)
        observed[i] += _interpolate(ring, np.int64(np.uintp(m - (AHEAD - 1)) & mask), taps, fraction - 0.5)
    awake[line], cursor[line], last[line] = running, m, newest


@njit(nogil=True, error_model="numpy")
def _emit(
    source, jerk, coefficient, radius, from_m, to_m, fade, progress, microphone, samples_per_m, emitted, delay
):  # pragma: no cover - compiled
    """a and D of the module's equations for one body, place and microphone.

    fade: 0 none, 1 in, -1 out, 2 nothing any more.
    """
    for i in range(len(progress)):
        x = progress[i]
        d0 = microphone[0] - (from_m[0] + (to_m[0] - from_m[0]) * x)
        d1 = microphone[1] - (from_m[1] + (to_m[1] - from_m[1]) * x)
        d2 = microphone[2] - (from_m[2] + (to_m[2] - from_m[2]) * x)
        r = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        value = source[i] + coefficient * ((d0 * jerk[0, i] + d1 * jerk[1, i] + d2 * jerk[2, i]) / max(r, 1e-12))
        if fade == 1:
            value *= x
        elif fade == -1:
            value *= 1.0 - x
        elif fade == 2:
            value = 0.0
        value /= max(r, radius)
        emitted[i] = value if abs(value) >= FLUSH else 0.0
        delay[i] = max(r * samples_per_m, LEAST_DELAY)


@njit(nogil=True, error_model="numpy")
def farthest(from_m, to_m, microphone, out):  # pragma: no cover - compiled
    """Greatest distance (t,) of each place's ends from any microphone: on a straight way it lies at an end."""
    for t in range(len(out)):
        square = 0.0
        for c in range(len(microphone)):
            start, stop = 0.0, 0.0
            for axis in range(3):
                start += (from_m[t, axis] - microphone[c, axis]) ** 2
                stop += (to_m[t, axis] - microphone[c, axis]) ** 2
            square = max(square, start, stop)
        out[t] = np.sqrt(square)


@njit(nogil=True, error_model="numpy")
def _judged(values):  # pragma: no cover - compiled
    """Whether any of the values is not zero, and whether any is not finite."""
    some, bad = 0, 0
    for k in range(len(values)):
        some |= 1 if values[k] != 0.0 else 0
        bad |= 0 if abs(values[k]) < np.inf else 1
    return some != 0, bad != 0


@njit(nogil=True, error_model="numpy")
def survey(source, jerk, coefficient, loud):  # pragma: no cover - compiled
    """Mark the bodies that emit anything (b,). False where a number is not finite."""
    for b in range(len(source)):
        sounds, bad = _judged(source[b])
        for axis in range(3):
            pushed, broken = _judged(jerk[b, axis])
            sounds |= pushed and coefficient[b] != 0.0
            bad |= broken
        if bad:
            return False
        loud[b] = sounds
    return True


@njit(nogil=True, error_model="numpy")
def propagate(at, out, source, jerk, coefficient, radius, order, body, from_m, to_m, fade, progress, microphone,
              samples_per_m, ring, ring_at, delays, delays_at, size, awake, cursor, last, taps,
              loud):  # fmt: skip  # pragma: no cover - compiled
    """Samples at … at + n - 1 into out (c, n), the places summed in ``order``; see path.py for the arrays."""
    channels, n = out.shape
    emitted, delay = np.empty(n), np.empty(n)
    for place in order:
        b = body[place]
        for c in range(channels):
            line = place * channels + c
            if not awake[line] and (fade[place] == 2 or not loud[b]):
                continue
            _emit(
                source[b],
                jerk[b],
                coefficient[b],
                radius[b],
                from_m[place],
                to_m[place],
                fade[place],
                progress,
                microphone[c],
                samples_per_m,
                emitted,
                delay,
            )
            history = ring[ring_at[line] : ring_at[line] + size[line] + TAPS]
            late = delays[delays_at[line] : delays_at[line] + size[line]]
            _listen(line, at, emitted, delay, out[c], history, late, awake, cursor, last, taps)
    for c in range(channels):
        for i in range(n):
            if abs(out[c, i]) < FLUSH:
                out[c, i] = 0.0
