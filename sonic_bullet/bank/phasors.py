"""Phasors of a strike, eight modes at a time: complex exponentials without a library.

e^z = (Σ_k (z/8)^k / k!)^8        k ≤ 14: with |z| ≤ 3.73 (|Im s| < π, Re s > -2) the rest is below 1e-17
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from math import factorial
from typing import Any

from numba import types
from numba.extending import intrinsic

from sonic_bullet.bank.layout import FLUSH
from sonic_bullet.machine.vector import LANES, Emit, Pair, Value, constant


def _exponential(e: Emit, s: Pair, times: Value) -> Pair:
    """Compute e^{s·times}, |s·times| ≤ 3.73."""
    degree = 14
    squared = 3
    scaled = e.builder.fmul(times, constant(0.5**squared))
    z = e.builder.fmul(s[0], scaled), e.builder.fmul(s[1], scaled)
    last = constant(1 / factorial(degree))
    total = e.fma(last, z[0], constant(1 / factorial(degree - 1))), e.builder.fmul(last, z[1])
    for k in range(degree - 2, -1, -1):
        real, imag = e.product(total, z)
        total = e.builder.fadd(real, constant(1 / factorial(k))), imag
    for _ in range(squared):
        total = e.product(total, total)
    return total


@intrinsic
def fill_phasors(typingctx, rows, width, law, lanes, gain, share, times):
    """Fill rows with r = gain·share·(1 + i d/ω) e^{s·phase}, D = e^{s·delta}, E0 = e^{s·stay}, E1 = e^{s·less}.

    rows: `At`, real and imaginary parts in turn, ``width`` apart. law: flat (6, modes); lanes: `layout.Lanes` of it;
    gain: one a lane; times: (phase, delta, stay, less).
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        rows, at, width, law, modes, start, lanes, gain, share, phase, delta, stay, less = e.args
        times = [e.spread(value) for value in (phase, delta, stay, less)]
        scale = e.spread(share)

        def body(k: Value, _: list[Value]) -> list[Value]:
            lane = builder.add(start, k)
            s = e.load(law, lane), e.load(law, builder.add(lane, modes))
            quadrature = e.load(law, builder.add(lane, builder.shl(modes, e.index(1))))
            g = builder.fmul(e.load(gain, k), scale)
            large = builder.fcmp_ordered(">=", builder.fmul(g, g), constant(FLUSH**2))
            g = builder.select(large, g, constant(0))
            for i, value in enumerate(times):
                power = _exponential(e, s, value)
                if i == 0:
                    power = e.product((g, builder.fmul(g, quadrature)), power)
                for part in range(2):
                    row = builder.add(builder.add(at, k), builder.mul(width, e.index(2 * i + part)))
                    e.store(power[part], rows, row)
            return []

        e.loop(lanes, LANES, [], body)
        return context.get_dummy_value()

    return types.void(rows, width, law, lanes, gain, share, times), codegen
