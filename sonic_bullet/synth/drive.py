"""The bank's driven state, one sample at a time, as vector instructions (`vector`): turn, push, strike, listen.

    f <- f p;   f <- f + (1 + i d/ω) (a0 g0 + a1 g1);   f <- f + r Σ_k J_k D^(K-k);   Σ Re(w f)

State, poles and weights are flat (2·modes), real parts first; ``start`` and ``count`` name a body's lanes, whole groups
of 8.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic

from sonic_bullet.synth.vector import LANES, Emit, Value, constant


@intrinsic
def turn_driven(typingctx, state, pole, modes, start, count):
    """State one sample on: state <- state·pole."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        state, pole, modes, start, count = e.args

        def body(k: Value, carried: list[Value]) -> list[Value]:
            re = builder.add(start, k)
            im = builder.add(re, modes)
            turned = e.product((e.load(state, re), e.load(state, im)), (e.load(pole, re), e.load(pole, im)))
            e.store(turned[0], state, re)
            e.store(turned[1], state, im)
            return []

        e.loop(count, LANES, [], body)
        return context.get_dummy_value()

    return types.void(state, pole, modes, start, count), codegen


@intrinsic
def push(typingctx, state, quadrature, modes, start, count, gain0, gain1, at, a0, a1):
    """A force's impulse at the sample: a0·gain0 + a1·gain1 (from ``at`` on) onto the real part, times d/ω onto the
    imaginary.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        state, quadrature, modes, start, count, gain0, gain1, at, a0, a1 = e.args
        both = e.spread(a0), e.spread(a1)

        def body(k: Value, carried: list[Value]) -> list[Value]:
            re, here = builder.add(start, k), builder.add(at, k)
            im = builder.add(re, modes)
            impulse = e.fma(both[1], e.load(gain1, here), builder.fmul(both[0], e.load(gain0, here)))
            e.store(builder.fadd(e.load(state, re), impulse), state, re)
            e.store(e.fma(impulse, e.load(quadrature, re), e.load(state, im)), state, im)
            return []

        e.loop(count, LANES, [], body)
        return context.get_dummy_value()

    return types.void(state, quadrature, modes, start, count, gain0, gain1, at, a0, a1), codegen


@intrinsic
def strike_nodes(typingctx, state, modes, start, count, rows, at, width, multiplier, impulse, node, nodes):
    """A strike's ``nodes`` impulses since the last sample: r <- r·E, state += r·Horner(impulse, D).

    rows: flat (8, width), phasors r, D, E0, E1 from column ``at`` on, real and imaginary rows in turn; multiplier: 0
    for E0, 1 for E1, -1 for none.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        state, modes, start, count, rows, at, width, multiplier, impulse, node, nodes = e.args
        stay = builder.icmp_signed("<", multiplier, e.index(0))
        chosen = builder.mul(
            width, builder.add(e.index(4), builder.mul(e.index(2), builder.select(stay, e.index(0), multiplier)))
        )
        last = builder.add(node, nodes)

        def body(k: Value, carried: list[Value]) -> list[Value]:
            here = builder.add(at, k)
            below = builder.add(here, width)
            spot = builder.add(here, chosen)
            factor = (
                builder.select(stay, constant(1), e.load(rows, spot)),
                builder.select(stay, constant(0), e.load(rows, builder.add(spot, width))),
            )
            r = e.product((e.load(rows, here), e.load(rows, below)), factor)
            e.store(r[0], rows, here)
            e.store(r[1], rows, below)
            step_at = builder.add(below, width)
            step = e.load(rows, step_at), e.load(rows, builder.add(step_at, width))

            def horner(j: Value, total: list[Value]) -> list[Value]:
                turned = e.product((total[0], total[1]), step)
                return [builder.fadd(turned[0], e.broadcast(impulse, builder.add(node, j))), turned[1]]

            total = e.loop(nodes, 1, [constant(0), constant(0)], horner)
            hit = e.product((total[0], total[1]), r)
            re = builder.add(start, k)
            im = builder.add(re, modes)
            e.store(builder.fadd(e.load(state, re), hit[0]), state, re)
            e.store(builder.fadd(e.load(state, im), hit[1]), state, im)
            return []

        e.loop(count, LANES, [], body)
        return last

    return types.int64(state, modes, start, count, rows, at, width, multiplier, impulse, node, nodes), codegen


@intrinsic
def observed(typingctx, state, start, weight, at, modes, count):
    """Σ Re(weight·state), the body's weights from ``at`` on: lane by lane, then across lanes in pairs."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        state, start, weight, at, modes, count = e.args

        def body(k: Value, total: list[Value]) -> list[Value]:
            re, here = builder.add(start, k), builder.add(at, k)
            real = e.fma(e.load(state, re), e.load(weight, here), total[0])
            return [
                real,
                e.fma(e.load(state, builder.add(re, modes)), e.load(weight, builder.add(here, modes)), total[1]),
            ]

        real, imag = e.loop(count, LANES, [constant(0), constant(0)], body)
        return e.total(builder.fsub(real, imag))

    return types.float64(state, start, weight, at, modes, count), codegen
