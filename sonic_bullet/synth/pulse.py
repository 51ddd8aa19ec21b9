"""A strike is a finite force pulse: how long it lasts, and its shape as micro-impulses and as rigid-body jerk.

    1/m* = Σ [1/m + (r×n)·I⁻¹(r×n)]            effective mass at the contact
        [Johnson 1985, Contact Mechanics, sec. 11.1]
    1/E* = Σ (1-ν²)/E,  1/R* = κ1 + κ2         Hertz                               [Johnson 1985, eq. 4.24]
    τ = 2.868 (m*²/(E*² R* v))^(1/5)           curved faces, approach speed v
        [Johnson 1985, eq. 11.24; = 2.94 δmax/v]
    τ = π √(m*/k),  k = 2 E* √(A/π)            flat faces of area A, any speed
        [Sneddon 1965; Johnson 1985, eq. 3.36]
    δ'' = -δ^(3/2),  F ∝ δ^(3/2)               the Hertz pulse's own shape; flat: F ∝ sin(πt/τ)

The cumulated force Q(s) = ∫F over the pulse's share s in [0, 1] (Q(1) = 1) is the table everything reads: for the Hertz
pulse Q = (1 - δ'/v)/2, because the force is what changes the velocity. k strikes, b bodies, n samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import gamma, pi, sqrt

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array
from sonic_bullet.records.errors import RecordError

SHORTEST_S, LONGEST_S = 20e-6, 50e-3
"""A pulse below 20 µs has its -3 dB point above 30 kHz and sounds like an impulse; above 50 ms nothing audible is
struck.
"""

_CELLS = 1024
_NODES_PER_PULSE = 24


def effective_mass_kg(
    mass_a: Array, inertia_a: Array, r_a: Array, mass_b: Array, inertia_b: Array, r_b: Array, normal: Array
) -> Array:
    """Mass (k,) in kg that a strike along ``normal`` (k, 3) feels; mass 0 (k,) means immovable and adds nothing.

    inertia (k, 3, 3) in kg·m² about the centre of mass, r (k, 3) from there to the contact in m, all in the world
    frame. Raises RecordError where both partners are immovable. Source: the module's first equation.
    """
    inverse = np.zeros(len(normal))
    for mass, inertia, r in ((mass_a, inertia_a, r_a), (mass_b, inertia_b, r_b)):
        moves = np.asarray(mass) > 0
        if moves.any():
            arm = np.cross(np.asarray(r)[moves], normal[moves])
            turn = _solve_inertia(np.asarray(inertia, float)[moves], arm)
            inverse[moves] += 1 / np.asarray(mass, float)[moves] + np.einsum("ki,ki->k", arm, turn)
    if (inverse <= 0).any():
        raise RecordError(
            "a strike between two bodies that cannot move", "give one of them a mass, or drop the contact"
        )
    return np.asarray(1 / inverse)


def _solve_inertia(inertia: Array, arm: Array) -> Array:
    """I⁻¹·arm (k, 3); a body without inertia (PyBullet's point masses) does not turn."""
    turns = np.abs(np.linalg.det(inertia)) > 0
    out = np.zeros_like(arm)
    if turns.any():
        out[turns] = np.linalg.solve(inertia[turns], arm[turns][..., None])[..., 0]
    return out


def contact_modulus_pa(plane_strain_a: Array, plane_strain_b: Array) -> Array:
    """E* (k,) in Pa of two plane-strain moduli E/(1-ν²) in Pa; inf for a rigid partner, inf if both are rigid."""
    with np.errstate(divide="ignore"):
        return np.asarray(1 / (1 / np.asarray(plane_strain_a, float) + 1 / np.asarray(plane_strain_b, float)))


def contact_time_s(
    mass_kg: Array, modulus_pa: Array, relative_curvature_per_m: Array, flat_area_m2: Array, approach_m_s: Array
) -> tuple[Array, Array]:
    """Length τ (k,) in s of each pulse, and whether it is flat (k,) bool: flat pulses are half-sines, the others
    Hertz'.

    relative_curvature κ1+κ2 in 1/m: zero or below where the faces conform. flat_area_m2: nominal area of touching, 0
    where none is known. A contact is never stiffer than the flat punch that its area allows, so the longer of both τ
    wins; without area Hertz decides alone, without curvature the punch; with neither, with infinite mass or at no speed
    τ is LONGEST_S. Clamped to SHORTEST_S … LONGEST_S. Source: the module's τ equations.
    """
    mass, modulus, curvature, area, speed = (
        np.asarray(x, float)
        for x in np.broadcast_arrays(mass_kg, modulus_pa, relative_curvature_per_m, flat_area_m2, approach_m_s)
    )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        hertz = np.where(
            curvature > 0, 2.868 * (mass**2 * np.maximum(curvature, 0) / (modulus**2 * np.maximum(speed, 0))) ** 0.2, 0
        )
        punch = np.where(area > 0, np.pi * np.sqrt(mass / (2 * modulus * np.sqrt(np.maximum(area, 0) / np.pi))), 0)
    neither = ~(curvature > 0) & ~(area > 0)
    tau = np.where(neither, LONGEST_S, np.fmax(hertz, punch))
    return np.clip(np.where(np.isnan(tau), LONGEST_S, tau), SHORTEST_S, LONGEST_S), (punch >= hertz) & ~neither


def pulse_nodes(tau_s: float, sr: int, *, flat: bool = False) -> tuple[float, float, Array]:
    """The pulse as equidistant micro-impulses: time of the first after the strike's start in s, spacing in s, weights
    (count,), sum 1.

    A mode then gets Σ w·e^{-su} for ∫F e^{-su} du. Midpoints of at least 24 cells, none longer than half a sample: what
    the sum folds down from beyond 1/spacing stays below 1e-3 of the impulse at every f ≤ 20 kHz (measured in the
    tests).
    """
    count = max(_NODES_PER_PULSE, int(np.ceil(2 * sr * tau_s)))
    s = (np.arange(count) + 0.5) / count
    force = _force(s, flat)
    return tau_s / count / 2, tau_s / count, force / force.sum()


def pulse_cells(start: float, tau_s: float, sr: int, least: int, *, flat: bool = False) -> tuple[float, float, Array]:
    """The pulse as forces that are even over cells of the sample grid: centre of the first and spacing in samples,
    impulses (count,), sum 1.

    start: of the pulse, in samples, any fraction. least: cells a sample, more where the pulse is short. For modes that
    decay within a sample or so: what they hear of a slow pulse is its slope, and cells that no sample cuts through keep
    that exact.
    """
    cells = max(least, int(np.ceil(_NODES_PER_PULSE / (sr * tau_s))))
    first = int(np.floor(start * cells))
    edges = np.arange(first, int(np.ceil((start + tau_s * sr) * cells)) + 1) / cells
    return (first + 0.5) / cells, 1 / cells, np.diff(cumulated_force((edges - start) / (tau_s * sr), flat=flat))


def pulse_spectrum(f_tau: Array, *, flat: bool = False) -> Array:
    """|F̂(f)/F̂(0)| at the products f·τ, by fine quadrature (flat: |cos(πfτ)/(1-4f²τ²)|)."""
    s = (np.arange(4096) + 0.5) / 4096
    force = _force(s, flat)
    return np.asarray(
        np.abs(np.exp(-2j * np.pi * np.multiply.outer(np.asarray(f_tau, float), s)) @ force) / force.sum()
    )


@lru_cache(maxsize=2)
def _spectrum_table(flat: bool) -> tuple[Array, Array]:
    f_tau = np.linspace(0.0, _SPECTRUM_TO, _SPECTRUM_TO * SPECTRUM_CELLS_PER_F_TAU + 1)
    return f_tau, pulse_spectrum(f_tau, flat=flat)


def compliant_share(
    mass_kg: float, impulse_n_s: float, pushed: Sequence[tuple[Array, Array]], tau_s: float, flat: bool
) -> float:
    """Which share of a rigid body's impulse a first contact can hand over where the bodies give way: 1/(1 + m*·Σ
    g²|F̂(fτ)|²).

    pushed: per body the frequencies (m,) in Hz and Uᵀj (m,) of the whole impulse, so that g = Uᵀj/impulse_n_s. What a
    mode moves within the pulse it takes from the approach, as if its 1/g² were one more mass in series with m* [1/m =
    1/m* + Σ g²: the module's first equation, with the modes as further motions of the bodies, e.g. Stronge 2000, Impact
    Mechanics, sec. 7.1]. The modes' energy is then at most m*v²/2·((1+e)/2)², and not without bound. The rest of the
    simulator's impulse comes later, softly: it is heard as support.
    """
    square = impulse_n_s**2
    if square == 0:  # an impulse below 1e-162 N·s, which only a forged log has: nothing of it is heard
        return 1.0
    f_tau, power = _spectrum_table(flat)
    given = sum(
        float(np.sum((push * np.interp(freq_hz * tau_s, f_tau, power, right=0.0)) ** 2)) for freq_hz, push in pushed
    )
    return 1.0 / (1.0 + mass_kg * given / square)


SPECTRUM_CELLS_PER_F_TAU, _SPECTRUM_TO = 40, 8
"""The table of pulse spectra: linear between its points, 0 beyond the last one."""


@lru_cache(maxsize=1)
def spectrum_table() -> Array:
    """(2, 321): |F̂(f)/F̂(0)| of the Hertz pulse and of the flat one, at equidistant products f·τ from 0 to 8."""
    return np.ascontiguousarray([_spectrum_table(flat)[1] for flat in (False, True)])


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def pulse_length(mass_kg, modulus_pa, relative_curvature_per_m, flat_area_m2, approach_m_s):  # type: ignore[no-untyped-def]
    """`contact_time_s` of one pulse: τ in s, and 1 where it is flat, else 0."""
    curvature, area = relative_curvature_per_m, flat_area_m2
    if not curvature > 0 and not area > 0:
        return LONGEST_S, 0
    hertz, punch = 0.0, 0.0
    if curvature > 0:
        hertz = 2.868 * (mass_kg * mass_kg * curvature / (modulus_pa * modulus_pa * max(approach_m_s, 0.0))) ** 0.2
    if area > 0:
        punch = np.pi * np.sqrt(mass_kg / (2 * modulus_pa * np.sqrt(area / np.pi)))
    longer = hertz if hertz >= punch or np.isnan(punch) else punch
    return min(max(LONGEST_S if np.isnan(longer) else longer, SHORTEST_S), LONGEST_S), 1 if punch >= hertz else 0


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def compliance(push, frequency_hz, first, modes, tau_s, spectrum):  # type: ignore[no-untyped-def]
    """Σ (Uᵀj |F̂(fτ)|)² of one body, the sum in `compliant_share`: push (m, …) is Uᵀj, its modes have the frequencies
    from ``first`` on; spectrum (cells + 1,): a row of `spectrum_table`.
    """
    total = 0.0
    for m in range(modes):
        cell = frequency_hz[first + m] * tau_s * SPECTRUM_CELLS_PER_F_TAU
        at = int(cell)
        if at < len(spectrum) - 1:
            moved = push[m] * (spectrum[at] + (cell - at) * (spectrum[at + 1] - spectrum[at]))
            total += moved * moved
    return total


def cumulated_force(s: Array, *, flat: bool = False) -> Array:
    """Q(s): the share of the impulse handed over by the share s of the pulse; 0 before, 1 after."""
    return np.asarray(_cumulated_many(np.ascontiguousarray(s, float), pulse_table(), flat))


def add_jerk(
    out: Array, body: Array, t0_s: Array, tau_s: Array, flat: Array, impulse_n_s: Array, sr: int, first_sample: int
) -> None:
    """Add dF/dt of k pulses to ``out`` (b, 3, n) in N/s, at absolute samples first_sample … first_sample + n - 1 (time
    = sample/sr).

    body (k,) row of out; t0_s (k,) start, absolute; tau_s, flat (k,); impulse_n_s (k, 3). Each sample holds the mean of
    dF/dt under a triangle one sample to either side, (Q(t+h) - 2Q(t) + Q(t-h))/h²: no pulse is too short to be seen,
    and the sum over all samples is exactly 0, the sum of its sum J·sr. Each value hangs on the absolute sample only:
    any split gives the same bits.
    """
    _add_jerk(
        out,
        np.ascontiguousarray(body, np.int64),
        np.ascontiguousarray(t0_s, float),
        np.ascontiguousarray(tau_s, float),
        np.ascontiguousarray(flat, np.bool_),
        np.ascontiguousarray(impulse_n_s, float),
        float(sr),
        int(first_sample),
        pulse_table(),
    )


def _force(s: Array, flat: bool) -> Array:
    """Force at the shares s, mean 1."""
    if flat:
        return np.asarray(np.pi / 2 * np.sin(np.pi * np.clip(s, 0, 1)))
    table = pulse_table()
    return np.asarray(np.interp(s, np.linspace(0, 1, _CELLS + 1), table[1], left=0, right=0))


@lru_cache(maxsize=1)
def pulse_table() -> Array:
    """(2, cells + 1): Q and F of the Hertz pulse at equidistant shares. δ'' = -δ^(3/2) from δ = 0, δ' = 1, by the
    classical Runge-Kutta method.

    The pulse is symmetric, so half of it is solved (to δ' = 0) and mirrored: Q(s) + Q(1-s) = 1.
    """
    fine = 16
    # Energy gives δmax = (5/4)^(2/5); half the duration is δmax ∫du/√(1-u^(5/2)) = δmax √π Γ(2/5)/Γ(9/10) · 2/5.
    half = 1.25**0.4 * 0.4 * sqrt(pi) * gamma(0.4) / gamma(0.9)
    steps = _CELLS // 2 * fine
    h = half / steps
    x, v = 0.0, 1.0
    q, f = np.empty(_CELLS + 1), np.empty(_CELLS + 1)
    q[0], f[0] = 0.0, 0.0
    for step in range(1, steps + 1):
        k1x, k1v = v, -(max(x, 0.0) ** 1.5)
        k2x, k2v = v + h / 2 * k1v, -(max(x + h / 2 * k1x, 0.0) ** 1.5)
        k3x, k3v = v + h / 2 * k2v, -(max(x + h / 2 * k2x, 0.0) ** 1.5)
        k4x, k4v = v + h * k3v, -(max(x + h * k3x, 0.0) ** 1.5)
        x, v = x + h / 6 * (k1x + 2 * k2x + 2 * k3x + k4x), v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
        if step % fine == 0:
            q[step // fine], f[step // fine] = (1 - v) / 2, x**1.5 * half
    middle = _CELLS // 2
    q[middle] = 0.5
    q[middle + 1 :], f[middle + 1 :] = 1 - q[:middle][::-1], f[:middle][::-1]
    table = np.stack([q, f])
    table.setflags(write=False)
    return table


@njit(nogil=True)
def _cumulated(s, table, flat):  # type: ignore[no-untyped-def]
    if s <= 0.0:
        return 0.0
    if s >= 1.0:
        return 1.0
    if flat:
        return 0.5 - 0.5 * np.cos(np.pi * s)
    cells = table.shape[1] - 1
    i = min(int(s * cells), cells - 1)
    t = s * cells - i
    q0, q1, f0, f1 = table[0, i], table[0, i + 1], table[1, i] / cells, table[1, i + 1] / cells
    return q0 + t * (f0 + t * (3.0 * (q1 - q0) - 2.0 * f0 - f1 + t * (2.0 * (q0 - q1) + f0 + f1)))


@njit(nogil=True)
def _cumulated_many(s, table, flat):  # type: ignore[no-untyped-def]
    out = np.empty(s.size)
    for i, value in enumerate(s.ravel()):
        out[i] = _cumulated(value, table, flat)
    return out.reshape(s.shape)


@njit(nogil=True)
def _add_jerk(out, body, t0, tau, flat, impulse, sr, first, table):  # type: ignore[no-untyped-def]
    n = out.shape[2]
    for k in range(len(body)):
        start = t0[k] * sr
        length = tau[k] * sr
        lo = max(int(np.floor(start)) - 1, first)
        hi = min(int(np.ceil(start + length)) + 2, first + n)
        for sample in range(lo, hi):
            before = _cumulated((sample - 1 - start) / length, table, flat[k])
            here = _cumulated((sample - start) / length, table, flat[k])
            after = _cumulated((sample + 1 - start) / length, table, flat[k])
            jerk = (after - 2.0 * here + before) * sr * sr
            for axis in range(3):
                out[body[k], axis, sample - first] += jerk * impulse[k, axis]
