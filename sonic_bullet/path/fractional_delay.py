"""Emission of a moving point and its fractionally delayed arrival, eight samples at a time.

    emitted at sample m:   a[m] = (s[m] + n̂·j[m])/r[m],  arriving at m + D[m], D = r sr/c
    heard at sample n:     a(u), where u + D(u) = n, D linear between samples: m + D[m] ≤ n < m + 1 + D[m + 1],
        u = m + (n - m - D[m])/(1 + D[m+1] - D[m])                          (retarded time: Doppler shift is exact)
    a(u) = Σ_k a[k] h(u - k),  h: 24 taps of a Kaiser-windowed sinc
        [Laakso et al. 1996, IEEE SPM 13(1), sec. 3.2]

Taps are polynomials in the fraction [Farrow 1988]. Each lane is one sample, and its result depends on that sample
alone: groups may begin anywhere. Samples of equal fraction share their taps (a body that stands still), with the same
bits as if each had computed its own.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from sonic_bullet.machine.vector import LANES, Emit, Value, constant, f64, f64x8, i1x8, i32, i64
from sonic_bullet.records import Array

TAPS = 24
AHEAD = TAPS // 2
LEAST_DELAY = float(AHEAD)
HALF_DEGREE = 4
LEAST_PA = 1e-30
MOST_FALL = 1.0 - 1.0 / 16.0
"""Sound emitted one sample later arrives at least 1/16 sample later: a source at or above the speed of sound is not
overtaken by its own sound.
"""
INFINITE = 0x7FF << 52
"""Bits of the double that is infinite; those of a NaN are above."""
KEPT = (TAPS + 1) * LANES
"""Doubles of scratch that `read` uses: the taps it made last, a vector each, and the fraction they belong to."""


@lru_cache(maxsize=1)
def tap_polynomials() -> Array:
    """Fit polynomials in t², t = fraction - ½, lowest power first, to the even and odd parts of taps 0 … 11.

    Shape (HALF_DEGREE + 1, 2, AHEAD). Tap k weighs sample floor(u) - 11 + k; tap 23 - k at t is tap k at -t: h = even ±
    t·odd serves both. Fitted to 1e-8.
    """
    t = 0.5 * np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    distance = np.arange(TAPS) - (AHEAD - 1) - (t[:, None] + 0.5)
    # with 24 taps what a glide adds is below -94 dB up to 0.3 and below -84 dB up to 0.375 of the rate, 18 kHz at 48
    kaiser_beta = 9.5
    window = np.i0(kaiser_beta * np.sqrt(np.maximum(0, 1 - (distance / AHEAD) ** 2))) / np.i0(kaiser_beta)
    taps = np.sinc(distance) * window
    taps /= taps.sum(axis=1, keepdims=True)
    here, mirrored = taps[:, :AHEAD], taps[:, : AHEAD - 1 : -1]
    powers = np.vander(t**2, HALF_DEGREE + 1, increasing=True)
    even = np.linalg.lstsq(powers, (here + mirrored) / 2, rcond=None)[0]
    odd = np.linalg.lstsq(powers, (here - mirrored) / (2 * t[:, None]), rcond=None)[0]
    fit = np.ascontiguousarray(np.stack([even, odd], axis=1))
    fit.setflags(write=False)
    return fit


def _called(e: Emit, name: str, kind: Any, *values: Value) -> Value:
    """Call an LLVM intrinsic."""
    declared = ir.FunctionType(kind, [value.type for value in values])
    return e.builder.call(cgutils.get_or_insert_function(e.builder.module, declared, name), values)


def _greater(e: Emit, a: Value, b: Value) -> Value:
    return e.builder.select(e.builder.fcmp_ordered(">", a, b), a, b)


def _all(e: Emit, lanes: Value) -> Value:
    """Test whether the condition holds in all lanes."""
    bits = e.builder.bitcast(lanes, ir.IntType(LANES))
    return e.builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(LANES), 2**LANES - 1))


@intrinsic
def move(typingctx, values, start, memory, at, count):
    """Copy memory[at:][:count] = values[start:][:count] without a check for wrapped indices."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        values, start, memory, at, count = e.args
        cgutils.raw_memcpy(builder, builder.gep(memory, [at]), builder.gep(values, [start]), count, e.index(8))
        return context.get_dummy_value()

    return types.void(values, start, memory, at, count), codegen


@intrinsic
def greatest(typingctx, source, source_at, dipole, dipole_at, stride, count):
    """Find the greatest magnitude of ``count`` values of a source and its three rigid axes, as the bits of a double.

    0 where all are zero, from INFINITE on where one is not finite. Arrays as in `emit`.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        source, source_at, dipole, dipole_at, stride, count = e.args
        integers = ir.VectorType(i64, LANES)
        whole = builder.and_(count, e.index(-LANES))

        def more(bits: Value, kind: Any, most: Value) -> Value:
            mask = [2**63 - 1] * LANES if kind is integers else 2**63 - 1
            size = builder.and_(builder.bitcast(bits, kind), ir.Constant(kind, mask))
            return builder.select(builder.icmp_signed(">", size, most), size, most)

        def row(r: Value, carried: list[Value]) -> list[Value]:
            axis = builder.add(dipole_at, builder.mul(builder.sub(r, e.index(1)), stride))
            values = builder.select(
                builder.icmp_signed("==", r, e.index(0)),
                builder.gep(source, [source_at]),
                builder.gep(dipole, [axis]),
            )
            groups = e.loop(whole, LANES, [carried[0]], lambda k, now: [more(e.load(values, k), integers, now[0])])
            single = e.loop(
                builder.sub(count, whole),
                1,
                [carried[1]],
                lambda k, now: [more(builder.load(builder.gep(values, [builder.add(whole, k)])), i64, now[0])],
            )
            return [groups[0], single[0]]

        most, single = e.loop(e.index(4), 1, [ir.Constant(integers, [0] * LANES), e.index(0)], row)
        lanes = _called(e, "llvm.vector.reduce.smax.v8i64", i64, most)
        return builder.select(builder.icmp_signed(">", lanes, single), lanes, single)

    return types.int64(source, source_at, dipole, dipole_at, stride, count), codegen


@intrinsic
def clear(typingctx, out, at, count):
    """Set out[at:][:count] = 0."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        out, at, count = e.args
        cgutils.memset(builder, builder.gep(out, [at]), builder.mul(count, e.index(8)), 0)
        return context.get_dummy_value()

    return types.void(out, at, count), codegen


def _each(e: Emit, count: Value, body: Any) -> None:
    """Run body(k, load, store, one) for whole groups of 8 and then for the rest; ``one`` puts a number in all lanes."""
    b = e.builder
    whole = b.and_(count, e.index(-LANES))

    def group(k: Value, carried: list[Value]) -> list[Value]:
        body(k, e.load, e.store, constant)
        return []

    def single(k: Value, carried: list[Value]) -> list[Value]:
        body(
            b.add(whole, k),
            lambda array, at: b.load(b.gep(array, [at])),
            lambda value, array, at: b.store(value, b.gep(array, [at])),
            lambda value: ir.Constant(f64, value),
        )
        return []

    e.loop(whole, LANES, [], group)
    e.loop(b.sub(count, whole), 1, [], single)


@intrinsic
def add(typingctx, values, out, at, count):
    """Add out[at:][:count] += values[:count]."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        values, out, at, count = e.args

        def body(k: Value, load: Any, store: Any, one: Any) -> None:
            place = builder.add(at, k)
            store(builder.fadd(load(out, place), load(values, k)), out, place)

        _each(e, count, body)
        return context.get_dummy_value()

    return types.void(values, out, at, count), codegen


@intrinsic
def flush(typingctx, out, at, count):
    """Set values of out[at:][:count] below FLUSH to 0: they mean nothing in pascal, and are subnormal as float32."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        out, at, count = e.args

        def body(k: Value, load: Any, store: Any, one: Any) -> None:
            place = builder.add(at, k)
            value = load(out, place)
            above = builder.fcmp_ordered(">=", value, one(LEAST_PA))
            below = builder.fcmp_ordered("<=", value, one(-LEAST_PA))
            store(builder.select(builder.or_(above, below), value, one(0.0)), out, place)

        _each(e, count, body)
        return context.get_dummy_value()

    return types.void(out, at, count), codegen


@intrinsic
def emit(typingctx, arrays, stride, tail, count, geometry, emitted, delay):
    """Compute a and D of ``count`` samples into emitted and delay, whole groups of 8.

    Returns 0 where no delay falls by more than MOST_FALL from one to the next.

    Parameters
    ----------
    arrays : source, dipole and x, each an `At`, the axes of dipole ``stride`` elements apart
    tail : (5, 8) flat, source, dipole and x after the last whole group
    geometry : (8,) microphone - start, end - start (m), samples per metre, 1/radius
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        source, source_at, dipole, dipole_at, x, x_at, stride, tail, count, geometry, emitted, delay = e.args
        known = [e.broadcast(geometry, e.index(k)) for k in range(8)]
        axes = [dipole_at, builder.add(dipole_at, stride), builder.add(dipole_at, builder.add(stride, stride))]

        def body(k: Value, carried: list[Value]) -> list[Value]:
            last = builder.icmp_signed(">", builder.add(k, e.index(LANES)), count)

            def given(number: int, array: Value, at: Value) -> Value:
                rest = builder.gep(tail, [e.index(number * LANES)])
                return e.load(builder.select(last, rest, builder.gep(array, [builder.add(at, k)])), e.index(0))

            between = given(4, x, x_at)
            from_here = [e.fma(builder.fneg(known[3 + axis]), between, known[axis]) for axis in range(3)]
            along = [given(1 + axis, dipole, axes[axis]) for axis in range(3)]
            square, dot = builder.fmul(from_here[0], from_here[0]), builder.fmul(from_here[0], along[0])
            for axis in (1, 2):
                square = e.fma(from_here[axis], from_here[axis], square)
                dot = e.fma(from_here[axis], along[axis], dot)
            r = _called(e, "llvm.sqrt.v8f64", f64x8, square)
            inverse = builder.fdiv(constant(1.0), _greater(e, r, constant(1e-12)))
            spread = builder.select(builder.fcmp_ordered("<", inverse, known[7]), inverse, known[7])
            value = builder.fmul(e.fma(dot, inverse, given(0, source, source_at)), spread)
            audible = builder.fcmp_ordered(">=", _called(e, "llvm.fabs.v8f64", f64x8, value), constant(LEAST_PA))
            e.store(builder.select(audible, value, constant(0.0)), emitted, k)
            late = _greater(e, builder.fmul(r, known[6]), constant(LEAST_DELAY))
            e.store(late, delay, k)
            shifted = ir.Constant(ir.VectorType(i32, LANES), list(range(LANES - 1, 2 * LANES - 1)))
            previous = builder.shuffle_vector(carried[0], late, shifted)
            falls = builder.fcmp_ordered("<", late, builder.fsub(previous, constant(MOST_FALL)))
            return [late, builder.or_(carried[1], falls)]

        none = ir.Constant(i1x8, [False] * LANES)
        falls = e.loop(count, LANES, [constant(-np.inf), none], body)[1]
        return builder.zext(builder.bitcast(falls, ir.IntType(LANES)), i64)

    return types.int64(arrays, stride, tail, count, geometry, emitted, delay), codegen


@intrinsic
def leading(typingctx, memory, late_at, gone):
    """Count how many of eight samples n, n + 1, … read m, m + 1, …, one sample of the history each.

    memory[late_at + k]: D[m + k], gone: m - n.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        memory, late_at, gone = e.args
        after = builder.add(gone, e.index(1))
        here = builder.fadd(e.spread(builder.sitofp(gone, f64)), e.load(memory, late_at))
        there = builder.fadd(e.spread(builder.sitofp(after, f64)), e.load(memory, e.shifted(late_at, 1)))
        arrived = builder.fcmp_ordered("<=", here, constant(0.0))
        newest = builder.fcmp_ordered(">", there, constant(0.0))
        bits = builder.bitcast(builder.and_(arrived, newest), ir.IntType(LANES))
        others = builder.xor(builder.zext(bits, i64), ir.Constant(i64, 2 ** (LANES + 1) - 1))
        return builder.cttz(others, ir.Constant(ir.IntType(1), 1))

    return types.int64(memory, late_at, gone), codegen


@intrinsic
def read(typingctx, memory, ring_at, late_at, gone, taps, kept, observed):
    """Write Σ_k a[m - 11 + k] h_k of eight samples as in `leading` into observed, an `At`.

    memory[ring_at + k]: a[m - 11 + k]. kept (KEPT,): taps of the samples before, NaN at first.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        memory, ring_at, late_at, gone, taps, kept, observed, at = e.args
        here, there = e.load(memory, late_at), e.load(memory, e.shifted(late_at, 1))
        since = builder.fsub(e.spread(builder.sitofp(builder.sub(e.index(0), gone), f64)), here)
        fraction = builder.fdiv(since, builder.fsub(builder.fadd(constant(1.0), there), here))
        t = builder.fsub(fraction, constant(0.5))
        first, last = range(AHEAD), [TAPS - 1 - k for k in range(AHEAD)]

        def summed(weights: Any) -> Value:
            """Sum both halves from the outer taps to the inner; each weight is asked for once, in this order."""
            total: list[Value | None] = [None, None]
            for low, high in zip(first, last, strict=True):
                for half, tap in enumerate((low, high)):
                    sample, weight = e.load(memory, e.shifted(ring_at, tap)), weights(tap)
                    so_far = total[half]
                    total[half] = builder.fmul(weight, sample) if so_far is None else e.fma(weight, sample, so_far)
            return builder.fadd(total[0], total[1])

        square = builder.fmul(t, t)
        parts: dict[int, Value] = {}

        def made(tap: int) -> Value:
            if tap >= AHEAD:
                even, odd = parts[2 * (TAPS - 1 - tap)], builder.fneg(parts[2 * (TAPS - 1 - tap) + 1])
            else:
                for part in range(2):
                    value = e.broadcast(taps, e.index((2 * HALF_DEGREE + part) * AHEAD + tap))
                    for power in range(HALF_DEGREE - 1, -1, -1):
                        value = e.fma(value, square, e.broadcast(taps, e.index((2 * power + part) * AHEAD + tap)))
                    parts[2 * tap + part] = value
                even, odd = parts[2 * tap], parts[2 * tap + 1]
            weight[tap] = e.fma(odd, t, even)
            return weight[tap]

        weight: dict[int, Value] = {}
        equal = _all(e, builder.fcmp_ordered("==", t, e.load(kept, e.index(TAPS * LANES))))
        with builder.if_else(equal) as (then, otherwise):
            with then:
                e.store(summed(lambda tap: e.load(kept, e.index(tap * LANES))), observed, at)
            with otherwise:
                e.store(summed(made), observed, at)
                one = e.spread(builder.extract_element(t, ir.Constant(i32, 0)))
                with builder.if_then(_all(e, builder.fcmp_ordered("==", t, one))):
                    for tap in range(TAPS):
                        e.store(weight[tap], kept, e.index(tap * LANES))
                    e.store(t, kept, e.index(TAPS * LANES))
        return context.get_dummy_value()

    return types.void(memory, ring_at, late_at, gone, taps, kept, observed), codegen
