"""Vector instructions for numba kernels, which have no vector type: a thin writer of LLVM code.

Every multiply-add is stated and every sum has a fixed order: the bits are the same on each call, whatever the caller's
loops. Vectors are eight doubles (two or four registers where the machine has narrower ones; the bits are the same).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.core import cgutils

LANES = 8

f64, i64, i32 = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
f64x8 = ir.VectorType(f64, LANES)
i1x8 = ir.VectorType(ir.IntType(1), LANES)

Value = Any
Pair = tuple[Value, Value]


class At(NamedTuple):
    """An array, read or written as if it were flat, from an element on."""

    array: Any
    at: int


def _flat(context: Any, builder: Any, kind: Any, value: Value) -> list[Value]:
    """Return the data pointer of an array, the value of a scalar; of a tuple those of its parts."""
    if isinstance(kind, types.Array):
        return [cgutils.create_struct_proxy(kind)(context, builder, value=value).data]
    if isinstance(kind, types.BaseTuple):
        parts = zip(kind.types, cgutils.unpack_tuple(builder, value, len(kind)), strict=True)
        return [one for part_kind, part in parts for one in _flat(context, builder, part_kind, part)]
    return [value]


class Emit:
    """Writer of vector instructions; arguments arrive as data pointers (arrays) or values (scalars), tuples flat."""

    def __init__(self, context: Any, builder: Any, signature: Any, args: Any) -> None:
        self.builder = builder
        pairs = zip(signature.args, args, strict=True)
        self.args = [one for kind, arg in pairs for one in _flat(context, builder, kind, arg)]
        kind = ir.FunctionType(f64x8, [f64x8] * 3)
        self._fma = cgutils.get_or_insert_function(builder.module, kind, "llvm.fma.v8f64")

    def index(self, value: int) -> Value:
        """Return a 64-bit integer constant."""
        return ir.Constant(i64, value)

    def shifted(self, base: Value, offset: int) -> Value:
        """Return the index base + offset."""
        return self.builder.add(base, self.index(offset)) if offset else base

    def _place(self, array: Value, offset: Value) -> Value:
        return self.builder.bitcast(self.builder.gep(array, [offset]), f64x8.as_pointer())

    def load(self, array: Value, offset: Value) -> Value:
        """Load eight doubles of an array from an offset."""
        return self.builder.load(self._place(array, offset), align=8)

    def store(self, value: Value, array: Value, offset: Value) -> None:
        """Store eight doubles to an array at an offset."""
        self.builder.store(value, self._place(array, offset), align=8)

    def spread(self, scalar: Value) -> Value:
        """Copy the scalar to all lanes."""
        none = ir.Constant(f64x8, ir.Undefined)
        first = self.builder.insert_element(none, scalar, ir.Constant(i32, 0))
        return self.builder.shuffle_vector(first, none, ir.Constant(ir.VectorType(i32, LANES), [0] * LANES))

    def broadcast(self, array: Value, offset: Value) -> Value:
        """Load one double and copy it to all lanes."""
        return self.spread(self.builder.load(self.builder.gep(array, [offset])))

    def reversed(self, vector: Value) -> Value:
        """Reverse the order of the lanes."""
        return self.builder.shuffle_vector(
            vector, ir.Constant(f64x8, ir.Undefined), ir.Constant(ir.VectorType(i32, LANES), list(range(LANES))[::-1])
        )

    def fma(self, a: Value, b: Value, c: Value) -> Value:
        """Multiply and add, a·b + c, rounded once."""
        return self.builder.call(self._fma, [a, b, c])

    def product(self, a: Pair, b: Pair) -> Pair:
        """Multiply complex numbers, a·b."""
        real = self.fma(a[0], b[0], self.builder.fneg(self.builder.fmul(a[1], b[1])))
        return real, self.fma(a[0], b[1], self.builder.fmul(a[1], b[0]))

    def loop(self, count: Value, step: int, carried: list[Value], body: Any) -> list[Value]:
        """Run ``for k in range(0, count, step): carried = body(k, carried)`` and return the last values."""
        b = self.builder
        before, inside, after = b.block, b.append_basic_block("each"), b.append_basic_block("after")
        b.cbranch(b.icmp_signed(">", count, self.index(0)), inside, after)
        b.position_at_end(inside)
        k = b.phi(i64)
        k.add_incoming(self.index(0), before)
        phis = []
        for value in carried:
            phis.append(b.phi(value.type))
            phis[-1].add_incoming(value, before)
        new = body(k, phis)
        following = b.add(k, self.index(step))
        ends = b.block  # a loop within the body ends in a block of its own
        k.add_incoming(following, ends)
        for phi, value in zip(phis, new, strict=True):
            phi.add_incoming(value, ends)
        b.cbranch(b.icmp_signed("<", following, count), inside, after)
        b.position_at_end(after)
        last = []
        for first, value in zip(carried, new, strict=True):
            last.append(b.phi(value.type))
            last[-1].add_incoming(first, before)
            last[-1].add_incoming(value, ends)
        return last

    def total(self, vector: Value) -> Value:
        """Sum across the lanes: halves added until one is left."""
        width = LANES
        while width > 1:
            width //= 2
            none = ir.Constant(vector.type, ir.Undefined)
            low, high = (
                ir.Constant(ir.VectorType(i32, width), list(range(first, first + width))) for first in (0, width)
            )
            vector = self.builder.fadd(
                self.builder.shuffle_vector(vector, none, low), self.builder.shuffle_vector(vector, none, high)
            )
        return self.builder.extract_element(vector, ir.Constant(i32, 0))


def constant(value: float) -> Value:
    """Return the number in all lanes."""
    return ir.Constant(f64x8, [float(value)] * LANES)
