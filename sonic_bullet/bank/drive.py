"""Driven modes of the bank, some tens of samples at a time, as vector instructions (`vector`).

    forces      impulse[n] = (1 + i d/ω) Σ (a0 g0 + a1 g1)                 a0 = F·period·(1 - x), a1 = F·period·x
    strikes     impulse[n] += r Σ_k J_k D^(K-k),   r <- r E                `strike_pool`
    modes       f <- f p + impulse[n],   partial[n] += Re(w f)             state in registers, 16 modes side by side
    sound       y[n] = Σ over lanes of partial[n]

State, poles and weights are flat (2·modes), real parts first. A body's lanes come in whole groups of 16. impulse: of
each 16 lanes ROOM samples of four vectors, real parts of both halves, then imaginary ones. partial (samples, 8).
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import Any, NamedTuple

from llvmlite import binding, ir
from numba import types
from numba.extending import intrinsic

from sonic_bullet.bank.layout import FLUSH, LANE_PAIR, ROOM
from sonic_bullet.machine.vector import LANES, Emit, Value, constant

VECTORS = 4
SAMPLE_NUMBERS = VECTORS * LANES  # numbers a sample and pair
TILE = 8 if binding.get_host_cpu_features().get("avx512f", False) else 2  # samples whose sums fit the registers


class Forces(NamedTuple):
    """Forces of a body: side[first … last - 1], 2·drive + side of each, in order.

    signal: flat (drives, 2, stride), impulses a0 and a1.
    """

    side: Any
    first: int
    last: int
    signal: Any
    stride: int


class Gains(NamedTuple):
    """Gains at both ends of a step, flat (2·drives, columns), read from ``column`` on."""

    gain0: Any
    gain1: Any
    columns: int
    column: int


class DrivenModes(NamedTuple):
    """State and poles, flat (2·modes)."""

    state: Any
    pole: Any


class LaneImpulses(NamedTuple):
    """Impulses by lane and sample; filled 0: one sample of zeros stands for all."""

    impulse: Any
    filled: int


class NodePlan(NamedTuple):
    """Nodes of a strike at the samples first … last - 1; plan, due: see `strike_pool.plan_nodes`."""

    plan: Any
    due: Any
    first: int
    last: int


def _halves(e: Emit, array: Value, place: Value) -> list[Value]:
    return [e.load(array, place), e.load(array, e.shifted(place, LANES))]


@intrinsic
def part_force(typingctx, force, progress, period, count, signal, early, late):
    """Compute a0 and a1 of ``count`` samples, whole vectors: force·period·(1 - progress), force·period·progress.

    force: `At`, in newton; signal: flat, a0 from early and a1 from late on. Impulses below FLUSH are 0.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        force_n, at, progress, period, count, signal, early, late = e.args
        scale = e.spread(period)

        def vector(k: Value, _: list[Value]) -> list[Value]:
            impulse, x = builder.fmul(e.load(force_n, builder.add(at, k)), scale), e.load(progress, k)
            large = builder.fcmp_ordered(">=", builder.fmul(impulse, impulse), constant(FLUSH**2))
            impulse = builder.select(large, impulse, constant(0))
            e.store(builder.fmul(impulse, builder.fsub(constant(1), x)), signal, builder.add(early, k))
            e.store(builder.fmul(impulse, x), signal, builder.add(late, k))
            return []

        e.loop(count, LANES, [], vector)
        return context.get_dummy_value()

    return types.void(force, progress, period, count, signal, early, late), codegen


@intrinsic
def project_forces(typingctx, impulse, gains, forces, at, quadrature, lanes, count):
    """Set impulse to all forces of a body on ``lanes`` lanes, ``count`` samples from ``at`` on.

    gains: `Gains`; forces: `Forces`; quadrature: `At`, d/ω of the first lane.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        (
            impulse, gain0, gain1, columns, column, side, first, last, signal, stride, at, law, quadrature_at, lanes,
            count,
        ) = e.args  # fmt: skip
        forces, both = builder.sub(last, first), builder.shl(stride, e.index(1))

        def pair(p: Value, _: list[Value]) -> list[Value]:
            quadrature = _halves(e, law, builder.add(quadrature_at, p))
            base, here = builder.mul(p, e.index(ROOM * SAMPLE_NUMBERS // LANE_PAIR)), builder.add(column, p)

            def tile(k: Value, _: list[Value]) -> list[Value]:
                def force(f: Value, total: list[Value]) -> list[Value]:
                    which = builder.load(builder.gep(side, [builder.add(first, f)]))
                    gain_at = builder.add(builder.mul(which, columns), here)
                    g0, g1 = _halves(e, gain0, gain_at), _halves(e, gain1, gain_at)
                    early = builder.add(builder.mul(builder.lshr(which, e.index(1)), both), builder.add(at, k))
                    late = builder.add(early, stride)
                    new = []
                    for i in range(TILE):
                        a0, a1 = e.broadcast(signal, e.shifted(early, i)), e.broadcast(signal, e.shifted(late, i))
                        new += [e.fma(a1, g1[h], e.fma(a0, g0[h], total[2 * i + h])) for h in range(2)]
                    return new

                total = e.loop(forces, 1, [constant(0)] * (2 * TILE), force)
                for i in range(TILE):
                    place = builder.add(base, builder.mul(e.shifted(k, i), e.index(SAMPLE_NUMBERS)))
                    for h in range(2):
                        real = total[2 * i + h]
                        e.store(real, impulse, e.shifted(place, h * LANES))
                        e.store(builder.fmul(real, quadrature[h]), impulse, e.shifted(place, (2 + h) * LANES))
                return []

            e.loop(count, TILE, [], tile)
            return []

        e.loop(lanes, LANE_PAIR, [], pair)
        return context.get_dummy_value()

    return types.void(impulse, gains, forces, at, quadrature, lanes, count), codegen


@intrinsic
def clear(typingctx, impulse, lanes, count):
    """Set impulse of ``lanes`` lanes and ``count`` samples to 0."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        impulse, lanes, count = e.args

        def pair(p: Value, _: list[Value]) -> list[Value]:
            base = builder.mul(p, e.index(ROOM * SAMPLE_NUMBERS // LANE_PAIR))

            def vector(k: Value, _: list[Value]) -> list[Value]:
                e.store(constant(0), impulse, builder.add(base, k))
                return []

            e.loop(builder.mul(count, e.index(SAMPLE_NUMBERS)), LANES, [], vector)
            return []

        e.loop(lanes, LANE_PAIR, [], pair)
        return context.get_dummy_value()

    return types.void(impulse, lanes, count), codegen


@intrinsic
def strike_nodes(typingctx, impulse, rows, width, lanes, plan, keep):
    """Add a strike's impulses of the samples of a `NodePlan`: r <- r·E, impulse += r·Horner(due, D).

    rows: `At`, phasors r, D, E0, E1 of ``lanes`` lanes, real and imaginary in turn, ``width`` apart. keep: False leaves
    r as it was.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        impulse, rows, at, width, lanes, plan, due, first, last, keep = e.args
        span = builder.sub(last, first)

        def planned(k: Value, what: int) -> Value:
            return builder.load(builder.gep(plan, [e.shifted(builder.mul(k, e.index(3)), what)]))

        def pair(p: Value, _: list[Value]) -> list[Value]:
            here, base = builder.add(at, p), builder.mul(p, e.index(ROOM * SAMPLE_NUMBERS // LANE_PAIR))
            row = [builder.add(here, builder.mul(width, e.index(i))) for i in range(8)]
            phasor = [_halves(e, rows, place) for place in row]

            def sample(j: Value, carried: list[Value]) -> list[Value]:
                k = builder.add(first, j)
                multiplier, nodes, empty = (planned(k, what) for what in range(3))
                none = builder.icmp_signed("<", multiplier, e.index(0))
                long = builder.icmp_signed("==", multiplier, e.index(0))
                node = carried[4]
                r: list[Value] = []
                for h in range(2):
                    factor = [
                        builder.select(
                            none, constant(one), builder.select(long, phasor[4 + part][h], phasor[6 + part][h])
                        )
                        for part, one in ((0, 1), (1, 0))
                    ]
                    r += e.product((carried[2 * h], carried[2 * h + 1]), (factor[0], factor[1]))

                def turned(total: list[Value]) -> list[Value]:
                    return [
                        part
                        for h in range(2)
                        for part in e.product((total[2 * h], total[2 * h + 1]), (phasor[2][h], phasor[3][h]))
                    ]

                def horner(i: Value, total: list[Value]) -> list[Value]:
                    due_now, new = e.broadcast(due, builder.add(node, i)), turned(total)
                    return [builder.fadd(new[0], due_now), new[1], builder.fadd(new[2], due_now), new[3]]

                total = e.loop(nodes, 1, [constant(0)] * 4, horner)
                total = e.loop(empty, 1, total, lambda i, total: turned(total))
                place = builder.add(base, builder.mul(k, e.index(SAMPLE_NUMBERS)))
                for h in range(2):
                    hit = e.product((total[2 * h], total[2 * h + 1]), (r[2 * h], r[2 * h + 1]))
                    for part in range(2):
                        spot = e.shifted(place, (2 * part + h) * LANES)
                        e.store(builder.fadd(e.load(impulse, spot), hit[part]), impulse, spot)
                return [*r, builder.add(node, nodes)]

            start = [phasor[0][0], phasor[1][0], phasor[0][1], phasor[1][1], e.index(0)]
            end = e.loop(span, 1, start, sample)
            for i, place in enumerate((row[0], row[1], e.shifted(row[0], LANES), e.shifted(row[1], LANES))):
                e.store(builder.select(keep, end[i], start[i]), rows, place)
            return []

        e.loop(lanes, LANE_PAIR, [], pair)
        return context.get_dummy_value()

    return types.void(impulse, rows, width, lanes, plan, keep), codegen


@intrinsic
def run(typingctx, motion, lanes, weight, used, count, partial, keep):
    """Advance lanes (`layout.Lanes`) of a `DrivenModes` by ``count`` samples: f <- f p + impulse, partial += Re(w f).

    weight: `At`, that of the first lane. used: `LaneImpulses`. keep: False leaves the state as it was.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        state, pole, modes, start, lanes, weight, weight_at, impulse, used, count, partial, keep = e.args

        def pair(p: Value, _: list[Value]) -> list[Value]:
            re, at = builder.add(start, p), builder.add(weight_at, p)
            im = builder.add(re, modes)
            f = [*_halves(e, state, re), *_halves(e, state, im)]
            p_re, p_im = _halves(e, pole, re), _halves(e, pole, im)
            w_re = _halves(e, weight, at)
            w_im = [builder.fneg(value) for value in _halves(e, weight, builder.add(at, modes))]
            base = builder.mul(builder.mul(p, used), e.index(ROOM * SAMPLE_NUMBERS // LANE_PAIR))

            def sample(k: Value, f: list[Value]) -> list[Value]:
                place = builder.add(base, builder.mul(builder.mul(k, used), e.index(SAMPLE_NUMBERS)))
                spot = builder.mul(k, e.index(LANES))
                real, imag = [], []
                total = e.load(partial, spot)
                for h in range(2):
                    x, y = f[h], f[2 + h]
                    added = [e.load(impulse, e.shifted(place, (2 * part + h) * LANES)) for part in range(2)]
                    real.append(e.fma(x, p_re[h], e.fma(builder.fneg(y), p_im[h], added[0])))
                    imag.append(e.fma(y, p_re[h], e.fma(x, p_im[h], added[1])))
                    total = e.fma(imag[h], w_im[h], e.fma(real[h], w_re[h], total))
                e.store(total, partial, spot)
                return [*real, *imag]

            new = e.loop(count, 1, f, sample)
            for i, place in enumerate((re, e.shifted(re, LANES), im, e.shifted(im, LANES))):
                e.store(builder.select(keep, new[i], f[i]), state, place)
            return []

        e.loop(lanes, LANE_PAIR, [], pair)
        return context.get_dummy_value()

    return types.void(motion, lanes, weight, used, count, partial, keep), codegen


@intrinsic
def sum_impulses(typingctx, axis_impulse, width, forces, direction0, direction1, count):
    """Sum the impulses of all forces along each axis: rows 0, 2, 4 of axis_impulse (6, width) = Σ ± (a0 d0 + a1 d1).

    In whole vectors. forces: `Forces`; direction0, direction1: flat (drives, 3), on the lower body, the
    negative on the higher.
    """
    bit = ir.IntType(1)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        axis_impulse, width, side, first, last, signal, stride, direction0, direction1, count = e.args
        forces = builder.sub(last, first)

        def vector(k: Value, _: list[Value]) -> list[Value]:
            def force(f: Value, total: list[Value]) -> list[Value]:
                which = builder.load(builder.gep(side, [builder.add(first, f)]))
                drive, higher = builder.lshr(which, e.index(1)), builder.trunc(which, bit)
                early = builder.add(builder.mul(drive, builder.shl(stride, e.index(1))), k)
                a0, a1 = (
                    builder.select(higher, builder.fneg(a), a)
                    for a in (e.load(signal, early), e.load(signal, builder.add(early, stride)))
                )
                at = builder.mul(drive, e.index(3))
                new = []
                for axis in range(3):
                    d0, d1 = (e.broadcast(direction, e.shifted(at, axis)) for direction in (direction0, direction1))
                    new.append(e.fma(a1, d1, e.fma(a0, d0, total[axis])))
                return new

            for axis, value in enumerate(e.loop(forces, 1, [constant(0)] * 3, force)):
                e.store(value, axis_impulse, builder.add(k, builder.mul(width, e.index(2 * axis))))
            return []

        e.loop(count, LANES, [], vector)
        return context.get_dummy_value()

    return types.void(axis_impulse, width, forces, direction0, direction1, count), codegen


@intrinsic
def across(typingctx, partial, count, out):
    """Sum partial over the lanes, in halves, into out (count,)."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        partial, count, out = e.args

        def sample(k: Value, _: list[Value]) -> list[Value]:
            builder.store(e.total(e.load(partial, builder.mul(k, e.index(LANES)))), builder.gep(out, [k]))
            return []

        e.loop(count, 1, [], sample)
        return context.get_dummy_value()

    return types.void(partial, count, out), codegen
