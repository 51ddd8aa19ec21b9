"""The bank's inner loop as vector instructions: free ringing of a chunk of modes over one block of 256 samples.

    y[16 q + r] = Σ_modes Re(u p^(16 q) p^r) = Σ Re(u s^q)·Re(p^r) - Im(u s^q)·Im(p^r),    u = w z,  s = p^16,  q, r in 0 … 15

an outer product of two short geometric rows per mode: two multiply-adds a sample, accumulators in registers. numba has no
vector type and its loop vectoriser keeps accumulators in memory, so these five functions are written in LLVM's own
language; all sums have a fixed order and every multiply-add is stated, so the bits are the same on every call.
Arrays are float64, contiguous; a body's modes fill whole groups of LANES (spare lanes are zero).
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 8
ROW = 16
ROWS = 16
BLOCK = ROW * ROWS
CHUNK = 32

_F64, _I64, _I32 = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_VEC = ir.VectorType(_F64, LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)
_TILE_ROWS = 8 if binding.get_host_cpu_features().get("avx512f", False) else 2  # accumulators that fit the registers

Value = Any
Pair = tuple[Value, Value]


class _Emit:
    """Writes vector instructions; arguments arrive as data pointers (arrays) or values (scalars)."""

    def __init__(self, context: Any, builder: Any, signature: Any, args: Any) -> None:
        self.builder = builder
        self.args = [
            cgutils.create_struct_proxy(kind)(context, builder, value=arg).data if isinstance(kind, types.Array) else arg
            for kind, arg in zip(signature.args, args, strict=True)
        ]
        self._fma = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_VEC, [_VEC] * 3), "llvm.fma.v8f64")

    def index(self, value: int) -> Value:
        return ir.Constant(_I64, value)

    def shifted(self, base: Value, offset: int) -> Value:
        return self.builder.add(base, self.index(offset)) if offset else base

    def _place(self, array: Value, offset: Value) -> Value:
        return self.builder.bitcast(self.builder.gep(array, [offset]), _VEC.as_pointer())

    def load(self, array: Value, offset: Value) -> Value:
        return self.builder.load(self._place(array, offset), align=8)

    def store(self, value: Value, array: Value, offset: Value) -> None:
        self.builder.store(value, self._place(array, offset), align=8)

    def spread(self, scalar: Value) -> Value:
        """The scalar in all lanes."""
        none = ir.Constant(_VEC, ir.Undefined)
        first = self.builder.insert_element(none, scalar, ir.Constant(_I32, 0))
        return self.builder.shuffle_vector(first, none, ir.Constant(ir.VectorType(_I32, LANES), [0] * LANES))

    def broadcast(self, array: Value, offset: Value) -> Value:
        return self.spread(self.builder.load(self.builder.gep(array, [offset])))

    def fma(self, a: Value, b: Value, c: Value) -> Value:
        return self.builder.call(self._fma, [a, b, c])

    def product(self, a: Pair, b: Pair) -> Pair:
        """Complex a·b."""
        real = self.fma(a[0], b[0], self.builder.fneg(self.builder.fmul(a[1], b[1])))
        return real, self.fma(a[0], b[1], self.builder.fmul(a[1], b[0]))

    def loop(self, count: Value, step: int, carried: list[Value], body: Any) -> list[Value]:
        """``for k in range(0, count, step): carried = body(k, carried)``; the last values."""
        b = self.builder
        before, inside, after = b.block, b.append_basic_block("each"), b.append_basic_block("after")
        b.cbranch(b.icmp_signed(">", count, self.index(0)), inside, after)
        b.position_at_end(inside)
        k = b.phi(_I64)
        k.add_incoming(self.index(0), before)
        phis = []
        for value in carried:
            phis.append(b.phi(value.type))
            phis[-1].add_incoming(value, before)
        new = body(k, phis)
        following = b.add(k, self.index(step))
        k.add_incoming(following, inside)
        for phi, value in zip(phis, new, strict=True):
            phi.add_incoming(value, inside)
        b.cbranch(b.icmp_signed("<", following, count), inside, after)
        b.position_at_end(after)
        last = []
        for first, value in zip(carried, new, strict=True):
            last.append(b.phi(value.type))
            last[-1].add_incoming(first, before)
            last[-1].add_incoming(value, inside)
        return last


@intrinsic  # type: ignore[untyped-decorator]
def turn(typingctx, z, pole, block, modes, start, count, floor, now, powers):  # type: ignore[no-untyped-def]
    """Take the state at a block's start: now = z (0 where |z|² < floor), z <- now·p^256, powers = p, p², p⁴, p⁸, p¹⁶. Returns lanes alive.

    z, pole, block: flat (2·modes), real parts first; now (2·CHUNK); powers (10·CHUNK). start, count: the chunk, count a multiple of LANES.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = _Emit(context, builder, signature, args)
        z, pole, block, modes, start, count, floor, now, powers = e.args
        floors = e.spread(floor)

        def body(k: Value, carried: list[Value]) -> list[Value]:
            re = builder.add(start, k)
            im = builder.add(re, modes)
            x, y = e.load(z, re), e.load(z, im)
            alive = builder.fcmp_ordered(">=", e.fma(x, x, builder.fmul(y, y)), floors)
            zero = ir.Constant(_VEC, [0.0] * LANES)
            x, y = builder.select(alive, x, zero), builder.select(alive, y, zero)
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

        (alive,) = e.loop(count, LANES, [ir.Constant(_BITS, [0] * LANES)], body)
        return builder.zext(builder.bitcast(alive, ir.IntType(LANES)), _I64)

    return types.int64(z, pole, block, modes, start, count, floor, now, powers), codegen


@intrinsic  # type: ignore[untyped-decorator]
def rows(typingctx, powers, count, table):  # type: ignore[no-untyped-def]
    """table (CHUNK, 2·ROW): Re p^r, then Im p^r, r = 0 … 15, of each mode: p^r as the product of p, p², p⁴, p⁸ where r has that bit."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = _Emit(context, builder, signature, args)
        powers, count, table = e.args
        one, zero = ir.Constant(_VEC, [1.0] * LANES), ir.Constant(_VEC, [0.0] * LANES)

        def body(k: Value, carried: list[Value]) -> list[Value]:
            power = [(e.broadcast(powers, e.shifted(k, 2 * i * CHUNK)), e.broadcast(powers, e.shifted(k, (2 * i + 1) * CHUNK))) for i in range(4)]
            low: Pair | None = None
            for bit in range(3):
                mask = ir.Constant(_BITS, [(lane >> bit) & 1 for lane in range(LANES)])
                factor = builder.select(mask, power[bit][0], one), builder.select(mask, power[bit][1], zero)
                low = factor if low is None else e.product(low, factor)
            high = e.product(low, power[3])  # type: ignore[arg-type]
            base = builder.mul(k, e.index(2 * ROW))
            for i, value in enumerate((low[0], high[0], low[1], high[1])):  # type: ignore[index]
                e.store(value, table, e.shifted(base, i * LANES))
            return []

        e.loop(count, 1, [], body)
        return context.get_dummy_value()

    return types.void(powers, count, table), codegen


@intrinsic  # type: ignore[untyped-decorator]
def columns(typingctx, now, weight, modes, start, powers, count, column):  # type: ignore[no-untyped-def]
    """column (2·ROWS, CHUNK): Re u s^q, then -Im u s^q, q = 0 … 15, with u = weight·now. weight: flat (2·modes)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = _Emit(context, builder, signature, args)
        now, weight, modes, start, powers, count, column = e.args

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

    return types.void(now, weight, modes, start, powers, count, column), codegen


@intrinsic  # type: ignore[untyped-decorator]
def outer(typingctx, column, table, count, sound):  # type: ignore[no-untyped-def]
    """sound (BLOCK,) += Σ over the chunk's modes of column ⊗ table, mode after mode."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = _Emit(context, builder, signature, args)
        column, table, count, sound = e.args
        halves = ROW // LANES
        for first in range(0, ROWS, _TILE_ROWS):
            places = [e.index((first + q) * ROW + half * LANES) for q in range(_TILE_ROWS) for half in range(halves)]

            def body(k: Value, total: list[Value], first: int = first) -> list[Value]:
                base = builder.mul(k, e.index(2 * ROW))
                real = [e.load(table, e.shifted(base, half * LANES)) for half in range(halves)]
                imag = [e.load(table, e.shifted(base, ROW + half * LANES)) for half in range(halves)]
                new = []
                for q in range(_TILE_ROWS):
                    x, y = e.broadcast(column, e.shifted(k, (first + q) * CHUNK)), e.broadcast(column, e.shifted(k, (ROWS + first + q) * CHUNK))
                    new += [e.fma(y, imag[half], e.fma(x, real[half], total[q * halves + half])) for half in range(halves)]
                return new

            for value, place in zip(e.loop(count, 1, [e.load(sound, place) for place in places], body), places, strict=True):
                e.store(value, sound, place)
        return context.get_dummy_value()

    return types.void(column, table, count, sound), codegen


@intrinsic  # type: ignore[untyped-decorator]
def heard(typingctx, state, weight, modes, start, count):  # type: ignore[no-untyped-def]
    """Σ Re(weight·state) over ``count`` modes from ``start``: lane by lane, then across lanes in pairs. state, weight: flat (2·modes)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = _Emit(context, builder, signature, args)
        state, weight, modes, start, count = e.args

        def body(k: Value, total: list[Value]) -> list[Value]:
            re = builder.add(start, k)
            im = builder.add(re, modes)
            real = e.fma(e.load(state, re), e.load(weight, re), total[0])
            return [real, e.fma(e.load(state, im), e.load(weight, im), total[1])]

        zero = ir.Constant(_VEC, [0.0] * LANES)
        real, imag = e.loop(count, LANES, [zero, zero], body)
        value = builder.fsub(real, imag)
        lanes = [builder.extract_element(value, ir.Constant(_I32, lane)) for lane in range(LANES)]
        while len(lanes) > 1:
            lanes = [builder.fadd(lanes[i], lanes[i + 1]) for i in range(0, len(lanes), 2)]
        return lanes[0]

    return types.float64(state, weight, modes, start, count), codegen
