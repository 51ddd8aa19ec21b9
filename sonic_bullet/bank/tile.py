"""Inner loop of the bank as vector instructions: free ringing of a chunk of modes over one block of 256 samples.

    y[16 q + r] = Σ_modes Re(u p^(16 q) p^r) = Σ Re(u s^q)·Re(p^r) - Im(u s^q)·Im(p^r),    u = w z,  s = p^16,
        q, r in 0 … 15

It is an outer product of two short geometric rows per mode: two multiply-adds a sample, accumulators in registers.
numba has no vector type and its loop vectoriser keeps accumulators in memory, so these four functions are written in
LLVM's own language. All sums have a fixed order and every multiply-add is stated, so the bits are the same on every
call. Arrays are float64, contiguous; a body's modes fill whole groups of LANES (spare lanes are zero).
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding, ir
from numba import types
from numba.extending import intrinsic

from sonic_bullet.machine.vector import LANES, Emit, Pair, Value, constant, i1x8, i64

TILE_ROW = 16
ROWS = 16
BLOCK = TILE_ROW * ROWS
CHUNK = 32


@intrinsic
def turn(typingctx, z, pole, block, lanes, floor, now, powers):  # type: ignore[no-untyped-def]
    """Take the state at a block's start: now = z (0 where |z|² < floor), z <- now·p^256, powers = p, p², p⁴, p⁸, p¹⁶.

    Returns the active lanes. z, pole, block: flat (2·modes), real parts first; now (2·CHUNK); powers (10·CHUNK). lanes:
    the chunk, `layout.Lanes`, its count a multiple of LANES.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        z, pole, block, modes, start, count, floor, now, powers = e.args
        floors = e.spread(floor)

        def body(k: Value, carried: list[Value]) -> list[Value]:
            re = builder.add(start, k)
            im = builder.add(re, modes)
            x, y = e.load(z, re), e.load(z, im)
            alive = builder.fcmp_ordered(">=", e.fma(x, x, builder.fmul(y, y)), floors)
            x, y = builder.select(alive, x, constant(0)), builder.select(alive, y, constant(0))
            e.store(x, now, k)
            e.store(y, now, e.shifted(k, CHUNK))
            turned = e.product((x, y), (e.load(block, re), e.load(block, im)))
            e.store(turned[0], z, re)
            e.store(turned[1], z, im)
            p = (e.load(pole, re), e.load(pole, im))
            for i in range(5):
                e.store(p[0], powers, e.shifted(k, 2 * i * CHUNK))
                e.store(p[1], powers, e.shifted(k, (2 * i + 1) * CHUNK))
                p = e.product(p, p)
            return [builder.or_(carried[0], alive)]

        (alive,) = e.loop(count, LANES, [ir.Constant(i1x8, [0] * LANES)], body)
        return builder.zext(builder.bitcast(alive, ir.IntType(LANES)), i64)

    return types.int64(z, pole, block, lanes, floor, now, powers), codegen


@intrinsic
def rows(typingctx, powers, count, table):  # type: ignore[no-untyped-def]
    """Fill table (CHUNK, 2·TILE_ROW) with Re p^r, then Im p^r, r = 0 … 15, of each mode.

    p^r is the product of p, p², p⁴, p⁸ where r has that bit.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        powers, count, table = e.args
        one, zero = constant(1), constant(0)

        def body(k: Value, carried: list[Value]) -> list[Value]:
            power = [
                (
                    e.broadcast(powers, e.shifted(k, 2 * i * CHUNK)),
                    e.broadcast(powers, e.shifted(k, (2 * i + 1) * CHUNK)),
                )
                for i in range(4)
            ]
            low: Pair | None = None
            for bit in range(3):
                mask = ir.Constant(i1x8, [(lane >> bit) & 1 for lane in range(LANES)])
                factor = builder.select(mask, power[bit][0], one), builder.select(mask, power[bit][1], zero)
                low = factor if low is None else e.product(low, factor)
            high = e.product(low, power[3])  # type: ignore[arg-type]
            base = builder.mul(k, e.index(2 * TILE_ROW))
            for i, value in enumerate((low[0], high[0], low[1], high[1])):  # type: ignore[index]
                e.store(value, table, e.shifted(base, i * LANES))
            return []

        e.loop(count, 1, [], body)
        return context.get_dummy_value()

    return types.void(powers, count, table), codegen


@intrinsic
def columns(typingctx, now, weight, lanes, powers, column):  # type: ignore[no-untyped-def]
    """Fill column (2·ROWS, CHUNK) with Re u s^q, then -Im u s^q, q = 0 … 15, u = weight·now. weight: flat (2·modes)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        now, weight, modes, start, count, powers, column = e.args

        def body(k: Value, carried: list[Value]) -> list[Value]:
            re = builder.add(start, k)
            state = e.load(now, k), e.load(now, e.shifted(k, CHUNK))
            u = [e.product(state, (e.load(weight, re), e.load(weight, builder.add(re, modes))))]
            s = e.load(powers, e.shifted(k, 8 * CHUNK)), e.load(powers, e.shifted(k, 9 * CHUNK))
            s2 = e.product(s, s)
            s4 = e.product(s2, s2)
            u += [e.product(u[0], s), e.product(u[0], s2)]
            u += [e.product(u[1], s2)]
            for q in range(ROWS):  # four chains side by side: the latency of one product is hidden by three others
                if q >= 4:
                    u.append(e.product(u[q - 4], s4))
                e.store(u[q][0], column, e.shifted(k, q * CHUNK))
                e.store(builder.fneg(u[q][1]), column, e.shifted(k, (ROWS + q) * CHUNK))
            return []

        e.loop(count, LANES, [], body)
        return context.get_dummy_value()

    return types.void(now, weight, lanes, powers, column), codegen


@intrinsic
def outer(typingctx, column, table, count, sound):  # type: ignore[no-untyped-def]
    """Add Σ over the chunk's modes of column ⊗ table to sound (BLOCK,), mode after mode."""
    tile_rows = 8 if binding.get_host_cpu_features().get("avx512f", False) else 2  # accumulators that fit the registers

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        column, table, count, sound = e.args
        halves = TILE_ROW // LANES
        for first in range(0, ROWS, tile_rows):
            places = [
                e.index((first + q) * TILE_ROW + half * LANES) for q in range(tile_rows) for half in range(halves)
            ]

            def body(k: Value, total: list[Value], first: int = first) -> list[Value]:
                base = builder.mul(k, e.index(2 * TILE_ROW))
                real = [e.load(table, e.shifted(base, half * LANES)) for half in range(halves)]
                imag = [e.load(table, e.shifted(base, TILE_ROW + half * LANES)) for half in range(halves)]
                new = []
                for q in range(tile_rows):
                    x, y = (
                        e.broadcast(column, e.shifted(k, (first + q) * CHUNK)),
                        e.broadcast(column, e.shifted(k, (ROWS + first + q) * CHUNK)),
                    )
                    new += [
                        e.fma(y, imag[half], e.fma(x, real[half], total[q * halves + half])) for half in range(halves)
                    ]
                return new

            for value, place in zip(
                e.loop(count, 1, [e.load(sound, place) for place in places], body), places, strict=True
            ):
                e.store(value, sound, place)
        return context.get_dummy_value()

    return types.void(column, table, count, sound), codegen
