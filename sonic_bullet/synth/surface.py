"""Rolling and sliding: one voice a touching pair, excited by the height profiles its two surfaces sweep.

    dz/dt = dh_a/dt + dh_b/dt - u                    z: penetration beyond the resting one, u: how fast the body is lifted
    m* du/dt = f - N
    δ = δ0(N) + z,   f = k δ^(3/2) (1 + c(dh/dt - u)),  never below 0      [Hunt & Crossley 1975, eq. 12; clamped: micro-collisions]
    k = (4/3) E* √R*,   N = k δ0^(3/2),   a = (3 N R*/4E*)^(1/3)            [Johnson 1985, eq. 4.22-4.24]
    c = 2ζ √(m* dN/dδ0)/N                                                   ζ: damping ratio of the resting contact

The voice gives f - N in newton: along the normal as it is; times the friction direction and coefficient for slip. Rolling (both
surfaces sweep), sliding (one does) and anything between differ in the two sweep speeds only: no switch. A contact at rest is an
exact equilibrium (z = u = 0 gives f = N to the bit) whatever N does, so support at rest and a load that drifts are silent; a new pair
starts there, without a click. Within a step δ0, c, speeds and gains run linearly from the step's start to its end.

Time: semi-implicit Euler, the damping implicit, 1 … 8 substeps a sample by the contact's resonance at the step's loads. Beyond the
penetration at which the contact's own stiffness would pass m*/h² (substep h: a resonance of sr·substeps/2π) the law goes on as a
straight line, so ωh ≤ 1 everywhere and the scheme is stable for any stiffness, mass and load [Hairer, Lubich, Wanner 2006, I.1.4].
All that a sample needs hangs on the sample before it and on its step: any split into blocks gives the same bits.
p pairs, sides 0 = a and 1 = b, n samples.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numba
import numpy as np

from sonic_bullet.records import Array, frozen_array
from sonic_bullet.synth.profile import _WAVE_M, LATTICE, octave_gains, octave_slopes, sweep

MOST_SUBSTEPS = 8
_STILL = 1e-9
"""Below this share of the resting penetration, on surfaces that stand, the contact is at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfacePairs:
    """What does not change while a pair touches; p pairs.

    mass_kg: m*. modulus_pa: E*, finite. radius_m: R*, finite (`contact_radius_m`). damping_ratio: ζ (`damping_ratio`).
    roughness_m, hurst (p, 2): of either surface, see profile.py. seed (p, 2): of either surface's profile.
    """

    mass_kg: Array
    modulus_pa: Array
    radius_m: Array
    damping_ratio: Array
    roughness_m: Array
    hurst: Array
    seed: Array

    def __post_init__(self) -> None:
        p = len(np.atleast_1d(self.mass_kg))
        for x in fields(self):
            shape = (p, 2) if x.name in ("roughness_m", "hurst", "seed") else (p,)
            object.__setattr__(self, x.name, frozen_array(getattr(self, x.name), np.int64 if x.name == "seed" else float, shape, f"surface {x.name}"))

    def __len__(self) -> int:
        return len(self.mass_kg)

    def take(self, rows: Array) -> SurfacePairs:
        """The pairs ``rows``, in that order."""
        return SurfacePairs(**{x.name: getattr(self, x.name)[rows] for x in fields(self)})

    def append(self, other: SurfacePairs) -> SurfacePairs:
        """These pairs, then the other's."""
        return SurfacePairs(**{x.name: np.concatenate([getattr(self, x.name), getattr(other, x.name)]) for x in fields(self)})


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceState:
    """Where the pairs are: depth_m z (p,), lift_m_s u (p,), swept_m (p, 2) distance each surface has swept."""

    depth_m: Array
    lift_m_s: Array
    swept_m: Array

    def __post_init__(self) -> None:
        p = len(np.atleast_1d(self.depth_m))
        for name, shape in (("depth_m", (p,)), ("lift_m_s", (p,)), ("swept_m", (p, 2))):
            object.__setattr__(self, name, frozen_array(getattr(self, name), float, shape, f"surface state {name}"))

    @classmethod
    def at_rest(cls, p: int) -> SurfaceState:
        """p new contacts in equilibrium."""
        return cls(np.zeros(p), np.zeros(p), np.zeros((p, 2)))

    def take(self, rows: Array) -> SurfaceState:
        """The pairs ``rows``, in that order."""
        return SurfaceState(self.depth_m[rows], self.lift_m_s[rows], self.swept_m[rows])

    def append(self, other: SurfaceState) -> SurfaceState:
        """These pairs, then the other's."""
        return SurfaceState(*(np.concatenate([getattr(self, x.name), getattr(other, x.name)]) for x in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceLoads:
    """What drives the pairs at one instant: support load_n N ≥ 0 (p,) in newton, sweep_m_s (p, 2) over a's and over b's surface."""

    load_n: Array
    sweep_m_s: Array

    def __post_init__(self) -> None:
        p = len(np.atleast_1d(self.load_n))
        object.__setattr__(self, "load_n", np.maximum(frozen_array(self.load_n, float, (p,), "surface load"), 0))
        object.__setattr__(self, "sweep_m_s", frozen_array(self.sweep_m_s, float, (p, 2), "surface sweep"))


def damping_ratio(restitution: Array) -> Array:
    """ζ of the linear oscillator that rebounds with this coefficient of restitution: -ln e/√(π² + ln² e), within 0.02 … 1."""
    log = np.log(np.clip(np.asarray(restitution, float), 1e-9, 1))
    return np.asarray(np.clip(-log / np.sqrt(np.pi**2 + log**2), 0.02, 1))


def contact_radius_m(relative_curvature_per_m: Array, flat_area_m2: Array) -> Array:
    """R* = 1/(κ1+κ2), at most the radius √(A/π) of the nominal area of touching (1 m where A is 0: none known).

    A flat face rests on its highest spots; each is taken for a cap as blunt as the face is wide.
    """
    area = np.asarray(flat_area_m2, float)
    blunt = np.where(area > 0, np.sqrt(np.maximum(area, 0) / np.pi), 1.0)
    curvature = np.asarray(relative_curvature_per_m, float)
    return np.asarray(np.where(curvature > 0, np.minimum(1 / np.where(curvature > 0, curvature, 1), blunt), blunt))


def advance(pairs: SurfacePairs, state: SurfaceState, start: SurfaceLoads, end: SurfaceLoads, x: Array, sr: int) -> tuple[Array, SurfaceState]:
    """Force f - N (p, n) in newton at the n samples that lie at the shares ``x`` (n,) in [0, 1) of one physics step, and the state after them.

    start, end: loads and speeds at the step's ends. Call again with the rest of the step's x for its other samples.
    """
    x = np.ascontiguousarray(x, float)
    out = np.zeros((len(pairs), len(x)))
    moving = (start.sweep_m_s != 0).any(1) | (end.sweep_m_s != 0).any(1) | (state.depth_m != 0) | (state.lift_m_s != 0)
    loaded = (start.load_n > 0) | (end.load_n > 0)
    depth, lift, swept = np.where(loaded, state.depth_m, 0), np.where(loaded, state.lift_m_s, 0), state.swept_m.copy()
    rows = np.flatnonzero(moving & loaded)
    if len(rows) and len(x):
        k = 4 / 3 * pairs.modulus_pa[rows] * np.sqrt(pairs.radius_m[rows])
        mass, zeta, load = pairs.mass_kg[rows], pairs.damping_ratio[rows], np.stack([start.load_n[rows], end.load_n[rows]])
        speed = np.stack([start.sweep_m_s[rows], end.sweep_m_s[rows]])
        substeps, limit, depth0 = _law(k, mass, load, sr)
        damping = 2 * zeta * np.sqrt(mass * 1.5 * k ** (2 / 3)) * np.maximum(load, 1e-3 * 9.81 * mass) ** (-5 / 6)
        width = 2 * np.cbrt(0.75 * load * pairs.radius_m[rows] / pairs.modulus_pa[rows])
        slope = octave_slopes(pairs.roughness_m[rows], pairs.hurst[rows]) * octave_gains(speed, width[..., None], sr)
        rate = _rates(swept, rows, speed, x, pairs.seed, slope, 1 / (_WAVE_M * LATTICE), float(sr))
        still = np.ascontiguousarray((speed == 0).all((0, 2)))
        _oscillate(depth, lift, rows, rate, x, k, 1 / mass, depth0, damping, limit, substeps, still, float(sr), out)
    return out, SurfaceState(depth, lift, swept)


def _law(k: Array, mass: Array, load: Array, sr: int) -> tuple[Array, Array, Array]:
    """Substeps (p,), the penetration (p,) at which the law becomes a straight line, and the resting penetrations (2, p)."""
    resonance = np.sqrt(1.5 * k ** (2 / 3) * np.cbrt(load.max(0)) / mass)
    # half a radian a substep at rest leaves room for collisions four times (√δ twice) as stiff
    substeps = np.clip(np.ceil(2 * resonance / sr), 1, MOST_SUBSTEPS).astype(np.int64)
    h = 1 / (sr * substeps)
    limit = (mass / (1.5 * k * h**2)) ** 2
    at_limit = k * limit**1.5
    depth = np.where(load <= at_limit, (load / k) ** (2 / 3), limit + (load - at_limit) * h**2 / mass)
    return substeps, limit, depth


@numba.njit(cache=True, nogil=True)
def _rates(swept, rows, speed, x, seed, slope, scale, sr):  # type: ignore[no-untyped-def]
    """dh/dt (rows, n) in m/s of both sides together; moves ``swept`` (p, 2) on."""
    n = len(x)
    rate, place = np.zeros((len(rows), n)), np.empty(n)
    for r in range(len(rows)):
        for side in range(2):
            v0, v1 = speed[0, r, side], speed[1, r, side]
            if v0 == 0.0 and v1 == 0.0:
                continue
            row = rows[r]
            swept[row, side] = sweep(swept[row, side], v0, v1, x, seed[row, side], slope[0, r, side], slope[1, r, side], scale, sr, rate[r], place)
    return rate


@numba.njit(cache=True, nogil=True)
def _oscillate(depth, lift, rows, rate, x, k, inverse_mass, depth0, damping, limit, substeps, still, sr, out):  # type: ignore[no-untyped-def]
    n = len(x)
    for r in range(len(rows)):
        row = rows[r]
        z, u = depth[row], lift[row]
        kr, stiff, lim, count = k[r], 1.5 * k[r] * np.sqrt(limit[r]), limit[r], substeps[r]
        h = 1.0 / (sr * count)
        hm = h * inverse_mass[r]
        for i in range(n):
            d0 = depth0[0, r] + (depth0[1, r] - depth0[0, r]) * x[i]
            c = damping[0, r] + (damping[1, r] - damping[0, r]) * x[i]
            dh = rate[r, i]
            low = min(d0, lim)
            load = kr * low * np.sqrt(low) + stiff * (d0 - low)
            total = 0.0
            for _ in range(count):
                z += h * (dh - u)
                d = max(d0 + z, 0.0)
                low = min(d, lim)
                elastic = kr * low * np.sqrt(low) + stiff * (d - low)
                g = hm * elastic * c
                f = (elastic + elastic * c * (dh - u) + hm * elastic * c * load) / (1.0 + g)
                f = max(f, 0.0)
                u += hm * (f - load)
                total += f - load
            if still[r] and abs(z) <= 1e-9 * d0 and abs(u) * h <= 1e-9 * d0:
                z, u, total = 0.0, 0.0, 0.0
            out[row, i] = total / count
        depth[row], lift[row] = z, u
