"""Rolling and sliding: one voice a touching pair, excited by the height profiles its two surfaces sweep.

    dz/dt = dh_a/dt + dh_b/dt - u
        z: penetration beyond the resting one, u: how fast the body is lifted
    m* du/dt = f - N
    δ = δ0(N) + z,   f = k δ^(3/2) (1 + c(dh/dt - u)),  never below 0
        [Hunt & Crossley 1975, eq. 12; clamped: micro-collisions]
    k = (4/3) E* √R*,   N = k δ0^(3/2),   a = (3 N R*/4E*)^(1/3)            [Johnson 1985, eq. 4.22-4.24]
    c = 2ζ √(m* dN/dδ0)/N                                                   ζ: damping ratio of the resting contact

The voice gives f - N in newton: along the normal as it is; times the friction direction and coefficient for slip.
Rolling (both surfaces sweep), sliding (one does) and anything between differ in the two sweep speeds only: no switch. A
contact at rest is an exact equilibrium (z = u = 0 gives f = N to the bit) whatever N does, so support at rest and a
load that drifts are silent; a new pair starts there, without a click. Within a step δ0, c, speeds and gains run
linearly from the step's start to its end.

Time: semi-implicit Euler, the damping implicit, 1 … 8 substeps a sample by the contact's resonance at the step's loads.
Beyond the penetration at which the contact's own stiffness would pass m*/h² (substep h: a resonance of sr·substeps/2π)
the law goes on as a straight line, so ωh ≤ 1 everywhere and the scheme is stable for any stiffness, mass and load
[Hairer, Lubich, Wanner 2006, I.1.4]. All that a sample needs hangs on the sample before it and on its step: any split
into blocks gives the same bits. p pairs, sides 0 = a and 1 = b, n samples.
"""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array, frozen_array
from sonic_bullet.synth.profile import octave_gains, octave_heights, sweep

MOST_SUBSTEPS = 8
FASTEST_M_S = 50.0
_STILL = 1e-9
"""Below this share of the resting penetration, on surfaces that stand, the contact is at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePairs:
    """What does not change while a pair touches; p pairs.

    mass_kg: m*. modulus_pa: E*, finite. radius_m: R*, finite (`contact_radius_m`). damping_ratio: ζ (`damping_ratio`).
    roughness_m, hurst (p, 2): of either surface, see profile.py. seed (p, 2): of either surface's profile.
    height_m (p, 2, octaves): follows from roughness and Hurst exponent.
    """

    mass_kg: Array
    modulus_pa: Array
    radius_m: Array
    damping_ratio: Array
    roughness_m: Array
    hurst: Array
    seed: Array
    height_m: Array = field(init=False)

    def __post_init__(self) -> None:
        p = len(np.atleast_1d(self.mass_kg))
        for x in _given(self):
            shape = (p, 2) if x.name in ("roughness_m", "hurst", "seed") else (p,)
            object.__setattr__(
                self,
                x.name,
                frozen_array(
                    getattr(self, x.name), np.int64 if x.name == "seed" else float, shape, f"surface {x.name}"
                ),
            )
        object.__setattr__(self, "height_m", octave_heights(self.roughness_m, self.hurst))

    def __len__(self) -> int:
        return len(self.mass_kg)

    def take(self, rows: Array) -> SurfacePairs:
        """The pairs ``rows``, in that order."""
        return SurfacePairs(**{x.name: getattr(self, x.name)[rows] for x in _given(self)})

    def append(self, other: SurfacePairs) -> SurfacePairs:
        """These pairs, then the other's."""
        return SurfacePairs(
            **{x.name: np.concatenate([getattr(self, x.name), getattr(other, x.name)]) for x in _given(self)}
        )


def _given(pairs: SurfacePairs) -> list[Field[Array]]:
    return [x for x in fields(pairs) if x.init]


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceState:
    """Where p pairs are: depth z and lift u in units of the last step's scheme, swept_m (p, 2) distance each surface
    has swept.

    substeps (p,): of that step, 0 before the first. The units are δ_lim and δ_lim/h (see `_oscillate`); they follow the
    substeps, and nothing is rounded twice.
    """

    depth: Array
    lift: Array
    substeps: Array
    swept_m: Array

    def __post_init__(self) -> None:
        p = len(np.atleast_1d(self.depth))
        for name, dtype, shape in (
            ("depth", float, (p,)),
            ("lift", float, (p,)),
            ("substeps", np.int64, (p,)),
            ("swept_m", float, (p, 2)),
        ):
            object.__setattr__(self, name, frozen_array(getattr(self, name), dtype, shape, f"surface state {name}"))

    @classmethod
    def at_rest(cls, p: int) -> SurfaceState:
        """p new contacts in equilibrium."""
        return cls(np.zeros(p), np.zeros(p), np.zeros(p, np.int64), np.zeros((p, 2)))

    def take(self, rows: Array) -> SurfaceState:
        """The pairs ``rows``, in that order."""
        return SurfaceState(*(getattr(self, x.name)[rows] for x in fields(self)))

    def append(self, other: SurfaceState) -> SurfaceState:
        """These pairs, then the other's."""
        return SurfaceState(*(np.concatenate([getattr(self, x.name), getattr(other, x.name)]) for x in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceLoads:
    """What drives the pairs at one instant: support load_n N (p,) in newton, sweep_m_s (p, 2) over a's and over b's
    surface.

    Loads below zero count as 0, speeds by their amount, none above FASTEST_M_S.
    """

    load_n: Array
    sweep_m_s: Array

    def __post_init__(self) -> None:
        p = len(np.atleast_1d(self.load_n))
        object.__setattr__(self, "load_n", np.maximum(frozen_array(self.load_n, float, (p,), "surface load"), 0))
        object.__setattr__(
            self,
            "sweep_m_s",
            np.minimum(np.abs(frozen_array(self.sweep_m_s, float, (p, 2), "surface sweep")), FASTEST_M_S),
        )


def damping_ratio(restitution: Array) -> Array:
    """ζ (p,) of the linear oscillator that rebounds with this coefficient of restitution: -ln e/√(π² + ln² e), within
    0.25 … 1.

    The floor is a model's choice: a rolling contact also sends waves into both bodies, which restitution of whole-body
    impacts (e = 0.95 would ring ten times) does not tell. Below it the level laws of rough, stiff, fast pairs bend
    (benchmarks/surface_law.py).
    """
    log = np.log(np.clip(np.asarray(restitution, float), 1e-9, 1))
    return np.asarray(np.clip(-log / np.sqrt(np.pi**2 + log**2), 0.25, 1))


def contact_radius_m(relative_curvature_per_m: Array, flat_area_m2: Array) -> Array:
    """R* = 1/(κ1+κ2), at most the radius √(A/π) of the nominal area of touching (1 m where A is 0: none known).

    A flat face rests on its highest spots; each is taken for a cap as blunt as the face is wide.
    """
    area = np.asarray(flat_area_m2, float)
    blunt = np.where(area > 0, np.sqrt(np.maximum(area, 0) / np.pi), 1.0)
    curvature = np.asarray(relative_curvature_per_m, float)
    return np.asarray(np.where(curvature > 0, np.minimum(1 / np.where(curvature > 0, curvature, 1), blunt), blunt))


def advance(
    pairs: SurfacePairs, state: SurfaceState, start: SurfaceLoads, end: SurfaceLoads, x: Array, sr: int
) -> tuple[Array, SurfaceState]:
    """Force f - N (p, n) in newton at the n samples that lie at the shares ``x`` (n,) in [0, 1) of one physics step,
    and the state after them.

    start, end: loads and speeds at the step's ends. Call again with the rest of the step's x for its other samples.
    """
    x = np.ascontiguousarray(x, float)
    out = np.zeros((len(pairs), len(x)))
    loaded = (start.load_n > 0) | (end.load_n > 0)
    moving = (start.sweep_m_s != 0).any(1) | (end.sweep_m_s != 0).any(1) | (state.depth != 0) | (state.lift != 0)
    depth, lift, steps, swept = (
        np.where(loaded, state.depth, 0),
        np.where(loaded, state.lift, 0),
        np.where(loaded, state.substeps, 0),
        state.swept_m.copy(),
    )
    rows = np.flatnonzero(moving & loaded)
    if len(rows) and len(x):
        k = 4 / 3 * pairs.modulus_pa[rows] * np.sqrt(pairs.radius_m[rows])
        mass, load, speed = (
            pairs.mass_kg[rows],
            np.stack([start.load_n[rows], end.load_n[rows]]),
            np.stack([start.sweep_m_s[rows], end.sweep_m_s[rows]]),
        )
        substeps, limit, depth0 = _law(k, mass, load, sr)
        h, change = 1 / (sr * substeps), steps[rows] / substeps
        depth[rows] *= change**4
        lift[rows] *= change**5
        steps[rows] = substeps
        damping = (
            2
            * pairs.damping_ratio[rows]
            * np.sqrt(mass * 1.5 * k ** (2 / 3))
            * np.maximum(load, 1e-3 * 9.81 * mass) ** (-5 / 6)
        )
        radius = np.cbrt(0.75 * load * pairs.radius_m[rows] / pairs.modulus_pa[rows])
        height = pairs.height_m[rows] * octave_gains(speed, radius[..., None], sr)
        rate = _rates(swept, rows, speed, x, pairs.seed, height, float(sr))
        fresh = change == 0  # a new contact already moves with what it rolls over
        lift[rows[fresh]] = rate[fresh, 0] * (h / limit)[fresh]
        still = (speed == 0).all((0, 2))
        rest, loss = _line(depth0 / limit), _line(damping * limit / h)
        for count in np.unique(substeps):
            g = np.flatnonzero(substeps == count)
            _oscillate(
                depth,
                lift,
                rows[g],
                g,
                rate,
                h / limit,
                k * limit**1.5,
                rest[:, g],
                loss[:, g],
                x,
                int(count),
                still[g],
                out,
            )
    return out, SurfaceState(depth, lift, steps, swept)


def _line(ends: Array) -> Array:
    """(2, p) value at the step's start and what it gains until its end."""
    return np.stack([ends[0], ends[1] - ends[0]])


def _law(k: Array, mass: Array, load: Array, sr: int) -> tuple[Array, Array, Array]:
    """Substeps (p,), the penetration (p,) at which the law becomes a straight line, and the resting penetrations (2,
    p).
    """
    resonance = np.sqrt(1.5 * k ** (2 / 3) * np.cbrt(load.max(0)) / mass)
    # half a radian a substep at rest leaves room for collisions four times (√δ twice) as stiff
    substeps = np.clip(np.ceil(2 * resonance / sr), 1, MOST_SUBSTEPS).astype(np.int64)
    h = 1 / (sr * substeps)
    limit = (mass / (1.5 * k * h**2)) ** 2
    at_limit = k * limit**1.5
    depth = np.where(load <= at_limit, (load / k) ** (2 / 3), limit + (load - at_limit) * h**2 / mass)
    return substeps, limit, depth


@njit(nogil=True)
def _rates(swept, rows, speed, x, seed, height, sr):  # type: ignore[no-untyped-def]
    """dh/dt (rows, n) in m/s of both sides together; moves ``swept`` (p, 2) on."""
    rate = np.zeros((len(rows), len(x)))
    for r in range(len(rows)):
        row = rows[r]
        for side in range(2):
            if speed[0, r, side] != 0.0 or speed[1, r, side] != 0.0:
                swept[row, side] = sweep(
                    swept[row, side],
                    speed[:, r, side],
                    x,
                    seed[row, side],
                    height[0, r, side],
                    height[1, r, side],
                    sr,
                    rate[r],
                )
    return rate


@njit(nogil=True, error_model="numpy")
def _oscillate(  # type: ignore[no-untyped-def]
    depth, lift, rows, g, rate, rate_unit, force_unit, rest, damping, x, substeps, still, out
):
    """f - N of the pairs ``rows`` (r of p), all with equal substeps, into out (p, n); depth and lift (p,) move on. g:
    their rows in rate.

    Lengths in δ_lim, forces in k·δ_lim^(3/2), u and dh/dt in δ_lim/h, damping in h/δ_lim. Then for every pair f =
    min(δ, 1)^(3/2) + 1.5(δ - 1)₊, and one substep adds (h²/m*)·k·√δ_lim = 2/3 of the force to u. Pairs innermost and
    one array a quantity: so the compiler takes four or eight of them at once.
    """
    pairs, share = len(rows), 1.0 / substeps
    z, u, dh, d0, c, load, total = (
        np.empty(pairs),
        np.empty(pairs),
        np.empty(pairs),
        np.empty(pairs),
        np.empty(pairs),
        np.empty(pairs),
        np.empty(pairs),
    )
    for r in range(pairs):
        z[r], u[r] = depth[rows[r]], lift[rows[r]]
    for i in range(len(x)):
        for r in range(pairs):
            dh[r] = rate[g[r], i] * rate_unit[g[r]]
        _rest(d0, c, load, total, rest, damping, x[i])
        for _ in range(substeps):
            _substep(z, u, dh, d0, c, load, total)
        for r in range(pairs):
            if still[r] and abs(z[r]) <= _STILL * d0[r] and abs(u[r]) <= _STILL * d0[r]:
                z[r], u[r], total[r] = 0.0, 0.0, 0.0
            out[rows[r], i] = total[r] * share * force_unit[g[r]]
    for r in range(pairs):
        depth[rows[r]], lift[rows[r]] = z[r], u[r]


@njit(nogil=True, error_model="numpy")
def _rest(d0, c, load, total, rest, damping, share):  # type: ignore[no-untyped-def]
    """Resting penetration, damping and load of all pairs (r,) at this share of the step."""
    for r in range(len(d0)):
        d0[r], c[r], total[r] = rest[0, r] + rest[1, r] * share, damping[0, r] + damping[1, r] * share, 0.0
    for r in range(len(d0)):
        low = min(d0[r], 1.0)
        load[r] = low * np.sqrt(low) + 1.5 * (d0[r] - low)


@njit(nogil=True, error_model="numpy")
def _substep(z, u, dh, d0, c, load, total):  # type: ignore[no-untyped-def]
    """One step of semi-implicit Euler of all pairs (r,); the force above the load is added to total."""
    for r in range(len(z)):
        z[r] += dh[r] - u[r]
        d = max(d0[r] + z[r], 0.0)
        low = min(d, 1.0)
        elastic = low * np.sqrt(low) + 1.5 * (d - low)
        loss = elastic * c[r]
        # f - N with the damping implicit in u: f = elastic·(1 + c(dh/dt - u_new)), u_new = u + 2/3 (f - N); exactly 0
        # at rest
        f = max((elastic - load[r] + loss * (dh[r] - u[r])) / (1.0 + 2.0 / 3.0 * loss), -load[r])
        u[r] += 2.0 / 3.0 * f
        total[r] += f
