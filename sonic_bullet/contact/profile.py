"""Height profile of a surface, read at the distance it has swept: endless self-affine noise.

    PSD(κ) ∝ κ^-(1+2H)  for wavelengths from LONGEST_M down to LONGEST_M / 2^(OCTAVES-1),  flat above
        [Mandelbrot; Persson 2005]
    h(x) = Σ_j g_j A_j n_j(x/Δ_j),   A_j ∝ Δ_j^H,  Σ A_j² = rms²,  Δ_j = LONGEST_M·LATTICE / 2^j
    n_j: cubic B-spline (C²) on hashed lattice values of unit variance

The rms height of a Material is that of a 100 mm long trace. The Rq of a stylus instrument with a cut-off of 0.8 mm is
(0.8/100)^H of it: 1/37 at H = 0.75. So smooth glass has some 0.1 µm, a sanded board 20 µm.

Gains g_j (an octave's wavelength is λ_j):
    contact patch
        (1 + a/λ)^(-1/2), a: Hertz' radius: a rough contact rests on about 1 + a/λ independent spots and follows their
        mean;
                    -3 dB at λ = a, that is at v/a. (Remington's filter, [1987] and [Thompson 2003], averages full,
                        smooth contact and falls
                    three times as steeply. With it the level grows with speed to the power 1.1 … 1.6: measured, 0.5 …
                        0.96.)
    anti-aliasing   1 below 0.2 sr at v/λ, falling to 0 at 0.4 sr
    slow waves      1 above 16 Hz, falling to 0 at 8 Hz: they only lift the body, inaudibly
Where the fraction c of the patch is in contact, the patch averages that part as a smooth one:
    (1 - c)(1 + a/λ)^(-1/2) + c (1 + π/4 (2πa/λ)³)^(-1/2),   c = erf(√π p/(E* h'))    h': rms slope, p: mean pressure
        [Remington 1987, J. Acoust. Soc. Am. 81, 1805; Pastewka & Robbins 2016, Appl. Phys. Lett. 108, 221601]

A round body's profile closes on itself: the lattice is stretched so that a whole number of points goes round, and the
last is followed by the first.

The contact oscillator needs dh/dt alone: Σ g A n'(x/Δ)·v/Δ. So a changing gain never moves a surface at rest, and v = 0
is exactly 0.

Data flow: octave_heights once a pair, gained_heights once a step and side, sweep_profile: dh/dt of every sample. The
lattices nest, so the octaves are summed from coarse to fine on the lattice points that the samples pass (a cubic
B-spline on Δ is one on Δ/2 with the coefficients [1 4 6 4 1]/8; `_refine`) and read once a sample (`_read`: the
derivative is the quadratic B-spline of the differences). A coefficient depends on its place alone, so where a block
begins makes no difference. Coefficients and their growth until the step's end stand in two arrays, ``change`` apart.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from sonic_bullet.contact.octave_heights import OCTAVE_LATTICE, reach_of_ball
from sonic_bullet.machine.compiled import njit
from sonic_bullet.machine.vector import LANES, Emit, Value, constant, f64, f64x8, i32, i64
from sonic_bullet.records.roughness import LONGEST_M, OCTAVES, WAVE_M


@njit(nogil=True, error_model="numpy")
def gained_heights(height_m, speed_m_s, patch, sr, out):
    """Write g_j A_j into out (OCTAVES,) at a sweep speed in m/s, not negative.

    patch: its radius in m; the fraction c of it that is in contact, 0 where only spots are; R* of a ball that follows
    no more of the waves than it can, 0 where that is not asked.
    """
    slowest_hz = 8.0
    patch_radius_m, touching, ball_m = patch
    for j in range(OCTAVES):
        f = speed_m_s / WAVE_M[j]
        fine, slow = (0.4 - f / sr) / 0.2, f / slowest_hz - 1.0
        fine, slow = 0.0 if fine < 0.0 else fine, 0.0 if slow < 0.0 else slow
        fine, slow = 1.0 if fine > 1.0 else fine, 1.0 if slow > 1.0 else slow
        height = height_m[j]
        if ball_m > 0.0:
            most = reach_of_ball(WAVE_M[j], patch_radius_m, ball_m)
            height = most if height > most else height
        out[j] = height * (fine * slow / np.sqrt(1.0 + patch_radius_m / WAVE_M[j]))
        if touching > 0.0:
            turn = 2.0 * np.pi * patch_radius_m / WAVE_M[j]
            smooth = height * (fine * slow / np.sqrt(1.0 + 0.25 * np.pi * (turn * turn * turn)))
            out[j] += touching * (smooth - out[j])


class _Lattice(NamedTuple):
    """Coefficients work[at] …, the first at the lattice point ``origin``, a whole number.

    Their growth until the step's end lies ``change`` further on. inverse: lattice points a metre.
    """

    at: int
    change: int
    origin: float
    inverse: float


@intrinsic
def _refine(typingctx, work, coarse, fine, change, pairs, place, heights):
    """Compute 2·pairs coefficients from work[fine] on: those of work[coarse] … on half the lattice, plus noise.

    They take work[coarse] … work[coarse + pairs + 1], plus heights[0] times this octave's noise from point
    place[1] on, points being counted round place[2] of them (0: endless) and place[0] naming the surface and octave;
    and the same ``change`` further on, plus heights[1] times it. place[3]: 1/place[2], or 0. Noise: values on ±1 by a
    32-bit integer mix [Wellons 2018, "lowbias32"]. Up to 14 values more are written.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        work, coarse, fine, change, pairs, key, low, points, inverse, height, growth = e.args
        whole = ir.VectorType(i32, LANES)
        start, low = builder.trunc(key, i32), builder.trunc(low, i32)
        floor = cgutils.get_or_insert_function(builder.module, ir.FunctionType(f64x8, [f64x8]), "llvm.floor.v8f64")

        def number(value: int) -> Value:
            return ir.Constant(whole, [value] * LANES)

        def noise(at: Value, offset: int) -> Value:
            none = ir.Constant(whole, ir.Undefined)

            def spread(value: Value) -> Value:
                one = builder.insert_element(none, value, ir.Constant(i32, 0))
                return builder.shuffle_vector(one, none, ir.Constant(whole, [0] * LANES))

            h = spread(builder.add(low, builder.trunc(at, i32)))
            h = builder.add(h, ir.Constant(whole, list(range(offset, offset + LANES))))
            point = builder.sitofp(h, f64x8)
            turns = builder.fmul(builder.fadd(point, constant(0.5)), e.spread(inverse))
            turns = builder.call(floor, [turns])
            h = builder.fptosi(builder.fsub(point, builder.fmul(turns, e.spread(points))), whole)
            h = builder.add(h, spread(start))
            h = builder.mul(builder.xor(h, builder.lshr(h, number(16))), number(0x7FEB352D))
            h = builder.mul(builder.xor(h, builder.lshr(h, number(15))), number(0x846CA68B))
            h = builder.xor(h, builder.lshr(h, number(16)))
            return builder.fmul(builder.sitofp(h, f64x8), constant(1.0 / 2147483648.0))

        def body(i: Value, carried: list[Value]) -> list[Value]:
            at = builder.mul(i, e.index(2))
            own = noise(at, 0), noise(at, LANES)
            for scale, apart in ((height, e.index(0)), (growth, change)):
                here = builder.add(builder.add(coarse, apart), i)
                a, b, c = (e.load(work, e.shifted(here, k)) for k in range(3))
                even = builder.fmul(constant(0.125), builder.fadd(e.fma(constant(6.0), b, a), c))
                odd = builder.fmul(constant(0.5), builder.fadd(b, c))
                there = builder.add(builder.add(fine, apart), at)
                for half in (0, 1):
                    lanes = [k // 2 + 4 * half + (LANES if k % 2 else 0) for k in range(LANES)]
                    both = builder.shuffle_vector(even, odd, ir.Constant(whole, lanes))
                    e.store(e.fma(e.spread(scale), own[half], both), work, e.shifted(there, LANES * half))
            return []

        e.loop(pairs, LANES, [], body)
        return context.get_dummy_value()

    return types.void(work, coarse, fine, change, pairs, place, heights), codegen


@intrinsic
def _read(typingctx, work, samples, lattice, pace, rate):
    """Add dh/dt of samples to ``rate``, an `At`.

    samples: (where, share, count), a multiple of 8 of them: places work[where] … in m, fractions of the step
    work[share] …. lattice: `_Lattice`. pace: speed at the step's start, and its growth until the end.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        work, where, share, count, lattice, change, origin, inverse, speed, gain, rate, out = e.args
        four = ir.VectorType(f64, 4)
        nothing = ir.Constant(four, ir.Undefined)

        def mixed(a: Value, b: Value, *lanes: int) -> Value:
            return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(i32, len(lanes)), lanes))

        def four_of(at: Value) -> Value:
            return builder.load(builder.bitcast(builder.gep(work, [at]), four.as_pointer()), align=8)

        def body(i: Value, carried: list[Value]) -> list[Value]:
            x = e.load(work, builder.add(share, i))
            u = builder.fsub(builder.fmul(e.load(work, builder.add(where, i)), e.spread(inverse)), e.spread(origin))
            cell = builder.fptosi(u, ir.VectorType(i32, LANES))
            t = builder.fsub(u, builder.sitofp(cell, f64x8))
            halves = []
            for first in (0, 4):
                c = []
                for k in range(first, first + 4):
                    lane = ir.Constant(i32, k)
                    at = builder.add(lattice, builder.sext(builder.extract_element(cell, lane), i64))
                    own = builder.insert_element(nothing, builder.extract_element(x, lane), ir.Constant(i32, 0))
                    more = builder.fmul(mixed(own, nothing, 0, 0, 0, 0), four_of(builder.add(at, change)))
                    c.append(builder.fadd(four_of(at), more))
                low = mixed(c[0], c[1], 0, 4, 2, 6), mixed(c[0], c[1], 1, 5, 3, 7)
                high = mixed(c[2], c[3], 0, 4, 2, 6), mixed(c[2], c[3], 1, 5, 3, 7)
                halves.append(
                    [mixed(low[k % 2], high[k % 2], *((0, 1, 4, 5) if k < 2 else (2, 3, 6, 7))) for k in range(4)]
                )
            p = [mixed(a, b, *range(LANES)) for a, b in zip(*halves, strict=True)]
            d = [builder.fsub(p[k + 1], p[k]) for k in range(3)]
            s = builder.fsub(constant(1.0), t)
            half_s, half_t = builder.fmul(constant(0.5), s), builder.fmul(constant(0.5), t)
            slope = builder.fmul(builder.fmul(half_s, s), d[0])
            slope = e.fma(e.fma(t, s, constant(0.5)), d[1], slope)
            slope = e.fma(builder.fmul(half_t, t), d[2], slope)
            pace = builder.fadd(e.spread(speed), builder.fmul(e.spread(gain), x))
            here = builder.add(out, i)
            moved = builder.fmul(builder.fmul(slope, e.spread(inverse)), pace)
            e.store(builder.fadd(e.load(rate, here), moved), rate, here)
            return []

        e.loop(count, LANES, [], body)
        return context.get_dummy_value()

    return types.void(work, samples, lattice, pace, rate), codegen


@njit(nogil=True, error_model="numpy")
def sweep_profile(swept, speed, x, surface, heights, per_sample_s, work, rate):
    """Add dh/dt of one side of one pair to n samples of ``rate``, an `At`, in m/s.

    Returns the distance swept after the n samples, and the scratch, longer where it was too short.

    Parameters
    ----------
    swept : distance before
    speed : two, at the step's ends
    x : (n,) fraction of the step
    heights : two (OCTAVES,), g·A at the step's ends
    surface : its key, and as of `close_round` points of the coarsest lattice round it, 0 where it is endless, and the
        stretch
    rate : as long as if n were the next multiple of 8
    """
    (speed0, speed1), (height0, height1), (key, around, stretch) = speed, heights, surface
    n, gain = len(x), speed1 - speed0
    whole = (n + LANES - 1) & -LANES
    if len(work) < 2 * whole:
        work = np.empty(2 * whole)
    for i in range(n):
        work[whole + i] = x[i]
        swept += (speed0 + gain * x[i]) * per_sample_s
        work[i] = swept
    for i in range(n, whole):
        work[whole + i], work[i] = x[n - 1], swept
    finest, coarsest = OCTAVES - 1, 0
    while finest >= 0 and height0[finest] == 0.0 and height1[finest] == 0.0:
        finest -= 1
    if finest < 0:
        return swept, work
    while height0[coarsest] == 0.0 and height1[coarsest] == 0.0:
        coarsest += 1
    inverse = 2.0**finest / (LONGEST_M * OCTAVE_LATTICE) * (1.0 + stretch)
    first, last = (int(work[0] * inverse) - 1) & -2, (int(swept * inverse) + 2) | 1
    size = last - first + 1 + 4 * LANES  # with room for values written beyond the end
    if len(work) < 2 * whole + 4 * size:
        longer = np.empty(2 * whole + 4 * size)
        for i in range(2 * whole):
            longer[i] = work[i]
        work = longer
    now, new, change = 2 * whole, 2 * whole + size, 2 * size
    # neighbouring seeds must start far apart in the 2^32 values of the mix
    place = np.int64((np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(33))
    begin, end = _lattice(first, last, finest - coarsest + 1)
    for i in range(end - begin + 1):
        work[now + i], work[now + change + i] = 0.0, 0.0
    for j in range(coarsest, finest + 1):
        low, high = _lattice(first, last, finest - j)
        coarse, pairs = now + (low >> 1) - begin - 1, (high - low + 1) >> 1
        height = height0[j], height1[j] - height0[j]
        points = around * 2.0**j
        round_it = place + 0x3C6EF372 * j, low, points, 1.0 / points if points > 0.0 else 0.0
        _refine(work, coarse, new, change, pairs, round_it, height)
        now, new, begin = new, now, low
    # never below 0: a place less its origin then has no more digits than the place, and is exact
    origin = begin + 1 if begin >= 0 else 0
    lattice = _Lattice(now + origin - begin - 1, change, float(origin), inverse)
    _read(work, (np.int64(0), whole, whole), lattice, (speed0, gain), rate)
    return swept, work


@njit(nogil=True, error_model="numpy")
def _lattice(first, last, halvings):
    """Return the first and last coefficient, ``halvings`` octaves coarser, for those first (even) … last (odd)."""
    for _ in range(halvings):
        first, last = ((first >> 1) - 1) & -2, ((last >> 1) + 1) | 1
    return first, last
