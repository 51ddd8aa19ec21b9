"""Rolling and sliding: one contact oscillator a touching pair, excited by the height profiles its two surfaces sweep.

    dz/dt = dh_a/dt + dh_b/dt - u
        z: penetration beyond the resting one, u: speed of contact separation
    m* du/dt = f - N
    δ = δ0(N) + z,   f = k δ^(3/2) (1 + c(dh/dt - u)),  never below 0
        [Hunt & Crossley 1975, eq. 12; clamped: micro-collisions]
    N = k δ0^(3/2);  k, and the patch's radius a: `hertz`
    c = 2ζ √(m* dN/dδ0)/N,  at least 3/2 (1 - e) s/m      ζ = 0.25: waves into both bodies; e: restitution at 1 m/s

The oscillator gives f - N in newton: along the normal as it is; times the friction direction and coefficient for slip.
Rolling (both surfaces sweep), sliding (one does) and anything between differ in the two sweep speeds only: no switch. A
contact at rest is an exact equilibrium (z = u = 0 gives f = N to the bit) whatever N does, so support at rest and a
load that drifts are silent; a new pair starts there, without a click. Within a step δ0, c, speeds and gains run
linearly from the step's start to its end.

Time: semi-implicit Euler, the damping implicit, 1 … 8 substeps a sample by the contact's resonance at the step's loads.
Beyond the penetration at which the contact's own stiffness would pass m*/h² (substep h: a resonance of sr·substeps/2π)
the law continues as a straight line, so ωh ≤ 1 everywhere and the scheme is stable for any stiffness, mass and load
[Hairer, Lubich, Wanner 2006, I.1.4]. A sample depends on the sample before it and on its step alone: any split into
blocks gives the same bits, whatever other pairs there are.

Data flow, for the oscillators that move in a step: `_law` -> rates of eight (`profile.sweep_profile`) -> `_oscillate`:
the eight at once, one a lane -> f - N, a row each. State and constants stand in the table of pairs
(runtime.tables.PAIR), loads and speeds of the step in the scratch table VOICE. Lengths in δ_lim, forces in
k·δ_lim^(3/2), u and dh/dt in δ_lim/h, damping in h/δ_lim: then for every pair f = min(δ, 1)^(3/2) + 1.5(δ - 1)₊, and
one substep adds (h²/m*)·k·√δ_lim = 2/3 of the force to u. The units follow the substeps; nothing is rounded twice.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from sonic_bullet.contact.hertz import ball_patch_m, ball_stiffness
from sonic_bullet.contact.profile import gained_heights, sweep_profile
from sonic_bullet.contact.track import sweep_track
from sonic_bullet.machine.compiled import njit
from sonic_bullet.machine.vector import LANES, At, Emit, Value, constant, f64, f64x8, i32
from sonic_bullet.records.roughness import OCTAVES

MOST_SUBSTEPS = 8.0
FASTEST_M_S = 50.0
DAMPING_RATIO = 0.25
"""ζ, a model's choice: a rough contact sends waves into both bodies. With less, the level laws of rough, stiff, fast
pairs bend (studies/surface_law.py)."""

VOICE = np.dtype(
    [
        ("slot", "i8"),  # of its pair
        ("moves", "i8"),  # 0: it only begins
        ("fresh", "i8"),  # 1: it begins
        ("load_n", "f8", (2,)),  # at the step's start and end, as all that follows
        ("sweep_m_s", "f8", (2, 2)),  # over the lower and the higher body's surface
        ("direction", "f8", (2, 3)),  # of the force on the lower body, world frame, per newton of load
        ("begin", "i8"),  # its rows of the step that follows
        ("end", "i8"),
        ("total_n_s", "f8"),  # their load
        ("order", "i8"),  # index of the voice at this position of the order
    ],
    align=True,
)
"""A contact oscillator that moves, for one step: scratch."""


class _LawRows(NamedTuple):
    """Rows that `_law` writes for `_oscillate`, a lane each."""

    depth: int = 0
    lift: int = 1
    rest: int = 2  # as damping, patch and touching of two rows: at the step's start, and growth until its end
    damping: int = 4
    rate_unit: int = 6
    force_unit: int = 7
    substeps: int = 8
    stands: int = 9
    patch: int = 10
    touching: int = 12
    all: int = 14


LAW_ROW = _LawRows()


@njit(nogil=True, error_model="numpy")
def dissipation_s_m(restitution):
    """Compute c in s/m by the restitution of an impact at 1 m/s: c = 3/2 α, e = 1 - αv [Hunt & Crossley 1975].

    At the mm/s at which rough surfaces meet it leaves e near 1, whatever the impact's is.
    """
    return 1.5 * (1.0 - restitution) if restitution < 1.0 else 0.0


@njit(nogil=True, error_model="numpy")
def contact_radius_m(relative_curvature_per_m, flat_area_m2):
    """Compute R* = 1/(κ1+κ2), at most the radius √(A/π) of the nominal contact area (1 m where A is 0: none known).

    A flat face rests on its highest spots; each is taken for a cap as blunt as the face is wide.
    """
    blunt = np.sqrt(flat_area_m2 / np.pi) if flat_area_m2 > 0 else 1.0
    return 1.0 / relative_curvature_per_m if relative_curvature_per_m * blunt > 1.0 else blunt


@njit(nogil=True, error_model="numpy")
def _law(pair, voice, sr, constants, at):
    """Write the contact law of a voice in this step into constants[at] …, with its pair's state in that law's units."""
    mass, radius, modulus = pair.mass_kg, pair.radius_m, pair.modulus_pa
    load0, load1 = voice.load_n
    k = ball_stiffness(modulus, radius)
    soft = 1.5 * k ** (2.0 / 3.0)
    most = load0 if load0 > load1 else load1
    # half a radian a substep at rest leaves room for collisions four times (√δ twice) as stiff
    substeps = np.ceil(2.0 * np.sqrt(soft * most ** (1.0 / 3.0) / mass) / sr)
    substeps = 1.0 if substeps < 1.0 else substeps
    substeps = MOST_SUBSTEPS if substeps > MOST_SUBSTEPS else substeps
    h = 1.0 / (sr * substeps)
    limit = mass / (1.5 * k * (h * h))
    limit *= limit
    at_limit = k * limit**1.5
    for end in range(2):
        load = load1 if end else load0
        depth = (load / k) ** (2.0 / 3.0) if load <= at_limit else limit + (load - at_limit) * (h * h) / mass
        least = 1e-3 * 9.81 * mass
        loss = 2.0 * pair.damping_ratio * np.sqrt(mass * soft) * (load if load > least else least) ** (-5.0 / 6.0)
        loss = pair.dissipation_s_m if pair.dissipation_s_m > loss else loss
        constants[at + LAW_ROW.rest + end] = depth / limit
        constants[at + LAW_ROW.damping + end] = loss * limit / h
        patch = ball_patch_m(load, modulus, radius)
        constants[at + LAW_ROW.patch + end] = patch
        pressure = load / (np.pi * patch * patch) if patch > 0.0 else 0.0
        touching = math.erf(np.sqrt(np.pi) * pressure / (modulus * pair.slope)) if pair.slope > 0.0 else 0.0
        constants[at + LAW_ROW.touching + end] = touching
    constants[at + LAW_ROW.rest + 1] -= constants[at + LAW_ROW.rest]
    constants[at + LAW_ROW.damping + 1] -= constants[at + LAW_ROW.damping]
    constants[at + LAW_ROW.rate_unit], constants[at + LAW_ROW.force_unit] = h / limit, at_limit
    constants[at + LAW_ROW.substeps] = substeps
    change = pair.substeps / substeps  # 0: a new contact
    square = change * change
    constants[at + LAW_ROW.depth], constants[at + LAW_ROW.lift] = (
        pair.depth * (square * square),
        pair.separation_speed * (square * square * change),
    )
    sweep = voice.sweep_m_s
    still = sweep[0, 0] == 0.0 and sweep[0, 1] == 0.0 and sweep[1, 0] == 0.0 and sweep[1, 1] == 0.0
    constants[at + LAW_ROW.stands] = 1.0 if still else 0.0


@njit(nogil=True, error_model="numpy")
def _line_up(voices, count, constants):
    """Order the voices by substeps, so that few lanes wait for others."""
    last = 0
    for substeps in range(1, int(MOST_SUBSTEPS) + 1):
        for v in range(count):
            if constants[v * LAW_ROW.all + LAW_ROW.substeps] == substeps:
                voices[last].order = v
                last += 1


@njit(nogil=True, error_model="numpy")
def sound_voices(pairs, voices, count, x, sr, tracks, force):
    """Compute the force f - N in newton of the voices 0 … count - 1 into force (voices, n), and advance their pairs.

    x (n,): fractions in [0, 1) of one physics step at the n samples. Call again with the rest of the step's x for its
    other samples. sr: float, in Hz. tracks: slopes of measured tracks, flat.
    """
    n = len(x)
    if count == 0 or n == 0:
        return
    whole = (n + LANES - 1) & -LANES
    constants, lanes = np.empty(count * LAW_ROW.all), np.empty(LANES * LAW_ROW.all)
    work, rate, height0, height1 = np.empty(2048), np.empty(LANES * whole), np.empty(OCTAVES), np.empty(OCTAVES)
    for v in range(count):
        _law(pairs[voices[v].slot], voices[v], sr, constants, v * LAW_ROW.all)
    _line_up(voices, count, constants)
    for first in range(0, count, LANES):
        for i in range(LANES * whole):
            rate[i] = 0.0
        for lane in range(LANES):
            filled = first + lane < count
            v = voices[first + lane if filled else count - 1].order  # unused lanes repeat the last
            voice, at = voices[v], v * LAW_ROW.all
            pair = pairs[voice.slot]
            for side in range(2):
                begin, end = voice.sweep_m_s[0, side], voice.sweep_m_s[1, side]
                if filled and (begin != 0.0 or end != 0.0):
                    for last in range(2):
                        patch = (
                            constants[at + LAW_ROW.patch + last],
                            constants[at + LAW_ROW.touching + last],
                            pair.ball_m,
                        )
                        speed, height = (end, height1) if last else (begin, height0)
                        gained_heights(pair.height_m[side], speed, patch, sr, height)
                    work = _sweep(
                        pair, side, (begin, end), x, (height0, height1), 1.0 / sr, work, (tracks, rate, lane * whole)
                    )
            if pair.substeps == 0:  # a new contact starts with the profile's velocity
                constants[at + LAW_ROW.lift] = rate[lane * whole] * constants[at + LAW_ROW.rate_unit]
            for row in range(LAW_ROW.all):
                lanes[row * LANES + lane] = constants[at + row]
        _oscillate(lanes, x, n, int(lanes[LAW_ROW.substeps * LANES + LANES - 1]), rate, whole)
        for lane in range(LANES if first + LANES <= count else count - first):
            v = voices[first + lane].order
            pair = pairs[voices[v].slot]
            pair.depth, pair.separation_speed = lanes[lane], lanes[LANES + lane]
            pair.substeps = int(constants[v * LAW_ROW.all + LAW_ROW.substeps])
            for i in range(n):
                force[v, i] = rate[lane * whole + i]


@njit(nogil=True, error_model="numpy")
def _sweep(pair, side, speed, x, heights, per_sample_s, work, arrays):
    """Add dh/dt of a side to a lane's samples, by its track or its octaves; return the scratch.

    arrays: slopes of tracks, rates, and where in them the lane's begin.
    """
    tracks, rate, out = arrays
    if pair.track_count[side] > 0:
        track = tracks, pair.track_at[side], pair.track_count[side], pair.track_spacing_m[side]
        pair.swept_m[side] = sweep_track(pair.swept_m[side], speed, x, track, heights, per_sample_s, (rate, out))
        return work
    surface = pair.seed[side], pair.around[side], pair.stretch[side]
    pair.swept_m[side], work = sweep_profile(
        pair.swept_m[side], speed, x, surface, heights, per_sample_s, work, At(rate, out)
    )
    return work


@intrinsic
def _oscillate(typingctx, lanes, x, count, most, rate, apart):
    """Replace dh/dt of eight pairs at ``count`` samples by f - N: lane k's from rate[k·apart] on.

    State lanes[:16] advances. most: the largest number of substeps among them.
    """
    # below this fraction of the resting penetration, on surfaces that do not sweep, the contact is at rest
    still = 1e-9

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        e = Emit(context, builder, signature, args)
        lanes, x, count, most, rate, apart = e.args
        root = cgutils.get_or_insert_function(builder.module, ir.FunctionType(f64x8, [f64x8]), "llvm.sqrt.v8f64")
        none, one, two_thirds = constant(0.0), constant(1.0), constant(2.0 / 3.0)

        def row(number: int) -> Value:
            return e.load(lanes, e.index(number * LANES))

        def larger(a: Value, b: Value) -> Value:
            return builder.select(builder.fcmp_ordered(">", a, b), a, b)

        def hertz(d: Value) -> Value:
            low = builder.select(builder.fcmp_ordered("<", d, one), d, one)
            bent = builder.fmul(low, builder.call(root, [low]))
            return builder.fadd(bent, builder.fmul(constant(1.5), builder.fsub(d, low)))

        def within(value: Value, bound: Value) -> Value:
            return builder.and_(
                builder.fcmp_ordered("<=", value, bound), builder.fcmp_ordered(">=", value, builder.fneg(bound))
            )

        rest, rest_gain, damping, damping_gain = (row(k) for k in range(LAW_ROW.rest, LAW_ROW.rest + 4))
        rate_unit, substeps = row(LAW_ROW.rate_unit), row(LAW_ROW.substeps)
        unit = builder.fdiv(row(LAW_ROW.force_unit), substeps)
        stands = builder.fcmp_ordered("==", row(LAW_ROW.stands), one)
        places = [builder.mul(apart, e.index(lane)) for lane in range(LANES)]

        def sample(i: Value, state: list[Value]) -> list[Value]:
            spots = [builder.gep(rate, [builder.add(place, i)]) for place in places]
            dh = ir.Constant(f64x8, ir.Undefined)
            for lane, spot in enumerate(spots):
                dh = builder.insert_element(dh, builder.load(spot), ir.Constant(i32, lane))
            dh = builder.fmul(dh, rate_unit)
            share = e.broadcast(x, i)
            d0 = builder.fadd(rest, builder.fmul(rest_gain, share))
            c = builder.fadd(damping, builder.fmul(damping_gain, share))
            load = hertz(d0)

            def substep(k: Value, carried: list[Value]) -> list[Value]:
                z, u, total = carried
                runs = builder.fcmp_ordered("<", e.spread(builder.sitofp(k, f64)), substeps)
                moved = builder.fadd(z, builder.fsub(dh, u))
                elastic = hertz(larger(builder.fadd(d0, moved), none))
                loss = builder.fmul(elastic, c)
                # f - N with the damping implicit in u: f = elastic·(1 + c(dh/dt - u_new)), u_new = u + 2/3 (f - N);
                # exactly 0 at rest
                f = builder.fadd(builder.fsub(elastic, load), builder.fmul(loss, builder.fsub(dh, u)))
                f = builder.fdiv(f, builder.fadd(one, builder.fmul(two_thirds, loss)))
                f = builder.select(runs, larger(f, builder.fneg(load)), none)
                separating = builder.fadd(u, builder.fmul(two_thirds, f))
                return [builder.select(runs, moved, z), separating, builder.fadd(total, f)]

            z, u, total = e.loop(most, 1, [*state, none], substep)
            bound = builder.fmul(constant(still), d0)
            rests = builder.and_(stands, builder.and_(within(z, bound), within(u, bound)))
            z, u, total = (builder.select(rests, none, value) for value in (z, u, total))
            f = builder.fmul(total, unit)
            for lane, spot in enumerate(spots):
                builder.store(builder.extract_element(f, ir.Constant(i32, lane)), spot)
            return [z, u]

        for number, value in enumerate(e.loop(count, 1, [row(LAW_ROW.depth), row(LAW_ROW.lift)], sample)):
            e.store(value, lanes, e.index(number * LANES))
        return context.get_dummy_value()

    return types.void(lanes, x, count, most, rate, apart), codegen
