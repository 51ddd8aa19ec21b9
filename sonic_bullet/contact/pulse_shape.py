"""Force pulse of a strike: its length, its shape, and the reduction of its impulse by compliant bodies.

    1/m* = Σ [1/m + (r×n)·I⁻¹(r×n)]            effective mass at the contact
        [Johnson 1985, Contact Mechanics, sec. 11.1]
    τ = τ(m*, E*, R*, v) of curved faces, τ(m*, E*, A) of flat ones                `hertz`
    δ'' = -δ^(3/2),  F ∝ δ^(3/2)               the Hertz pulse's own shape; flat: F ∝ sin(πt/τ)

All reads use the table of the cumulated force Q(s) = ∫F over the fraction s of the pulse in [0, 1] (Q(1) = 1). For the
Hertz pulse Q = (1 - δ'/v)/2, because the force is what changes the velocity.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from functools import lru_cache
from math import gamma, pi, sqrt

import numpy as np

from sonic_bullet.contact.hertz import ball_stiffness, impact_duration_s, punch_duration_s
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

SHORTEST_S, LONGEST_S = 1e-6, 50e-3
"""A pulse of 1 µs has its -3 dB point at 600 kHz: no rate resolves a shorter one; above 50 ms nothing audible is
struck."""

_CELLS = 1024


def pulse_spectrum(f_tau: Array, *, flat: bool = False) -> Array:
    """Compute |F̂(f)/F̂(0)| at the products f·τ, by fine quadrature (flat: |cos(πfτ)/(1-4f²τ²)|)."""
    s = (np.arange(4096) + 0.5) / 4096
    force = _force(s, flat)
    return np.asarray(
        np.abs(np.exp(-2j * np.pi * np.multiply.outer(np.asarray(f_tau, float), s)) @ force) / force.sum()
    )


SPECTRUM_CELLS_PER_F_TAU = 40
"""The table of pulse spectra: linear between its points, 0 beyond the last one."""


@lru_cache(maxsize=1)
def spectrum_table() -> Array:
    """Tabulate |F̂(f)/F̂(0)| (2, 321) of the Hertz and the flat pulse, at equidistant products f·τ from 0 to 8."""
    spectrum_to = 8
    f_tau = np.linspace(0.0, spectrum_to, spectrum_to * SPECTRUM_CELLS_PER_F_TAU + 1)
    return np.ascontiguousarray([pulse_spectrum(f_tau, flat=flat) for flat in (False, True)])


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def pulse_length(mass_kg, modulus_pa, relative_curvature_per_m, flat_area_m2, approach_m_s):
    """Compute the length τ in s of a pulse, and 1 where it is flat (a half-sine), 0 where it is Hertz'.

    A contact is never stiffer than the flat punch that its area allows, so the longer τ counts. Without area Hertz
    decides alone, without curvature the punch. With neither, with infinite mass or at no speed τ is LONGEST_S. Clamped
    to SHORTEST_S … LONGEST_S.

    Parameters
    ----------
    relative_curvature_per_m : κ1+κ2, zero or below where the faces conform
    flat_area_m2 : nominal contact area, 0 where none is known
    """
    curvature, area = relative_curvature_per_m, flat_area_m2
    if not curvature > 0 and not area > 0:
        return LONGEST_S, 0
    curved = impact_duration_s(mass_kg, modulus_pa, curvature, approach_m_s) if curvature > 0 else 0.0
    punch = punch_duration_s(mass_kg, modulus_pa, area) if area > 0 else 0.0
    longer = curved if curved >= punch or np.isnan(punch) else punch
    return min(max(LONGEST_S if np.isnan(longer) else longer, SHORTEST_S), LONGEST_S), 1 if punch >= curved else 0


@njit(nogil=True, error_model="numpy")
def rough_share(mass_kg, modulus_pa, relative_curvature_per_m, approach_m_s, layer_m):
    """Compute how many times as long Hertz' pulse is on rough faces: by as much as its peak force is smaller.

    The rough layer of stiffness f/u₀ [Persson 2007, PRL 99, 125502] lies in series with the bulk and takes u₀f of
    energy: 2/5 k^(-2/3) f^(5/3) + u₀ f = ½ m* v². Impulse and shape are kept. layer_m: u₀.
    """
    k = ball_stiffness(modulus_pa, 1.0 / relative_curvature_per_m)
    energy = 0.5 * mass_kg * approach_m_s * approach_m_s
    peak = (2.5 * energy * k ** (2.0 / 3.0)) ** 0.6
    b, y = layer_m * peak / energy, 1.0
    for _ in range(30):  # Newton's from above on a convex rising function: it falls to the root
        root = y ** (2.0 / 3.0)
        y -= (y * root + b * y - 1.0) / (5.0 / 3.0 * root + b)
    return 1.0 / y


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def compliance(modal_impulse, frequency_hz, first, modes, tau_s, spectrum):
    """Compute Σ (Uᵀj |F̂(fτ)|)² over one body's modes.

    The first contact of compliant bodies transmits 1/(1 + m*/j² · this sum, of both bodies) of a rigid body's impulse.
    A mode's motion within the pulse reduces the approach as if its 1/g², g = Uᵀj/j, were one more mass in series with
    m* [1/m = 1/m* + Σ g²: the module's first equation, with the modes as further motions of the bodies, e.g. Stronge
    2000, Impact Mechanics, sec. 7.1]. So the modes' energy is bounded by m*v²/2·((1+e)/2)². The rest of the simulator's
    impulse comes later, softly: it is rendered as support.

    Parameters
    ----------
    modal_impulse : (m, …) Uᵀj of the whole impulse j
    frequency_hz : of the modes, from ``first`` on
    spectrum : (cells + 1,) a row of `spectrum_table`
    """
    total = 0.0
    for m in range(modes):
        cell = frequency_hz[first + m] * tau_s * SPECTRUM_CELLS_PER_F_TAU
        at = int(cell)
        if at < len(spectrum) - 1:
            moved = modal_impulse[m] * (spectrum[at] + (cell - at) * (spectrum[at + 1] - spectrum[at]))
            total += moved * moved
    return total


def _force(s: Array, flat: bool) -> Array:
    """Compute the force at the fractions s, mean 1."""
    if flat:
        return np.asarray(np.pi / 2 * np.sin(np.pi * np.clip(s, 0, 1)))
    table = pulse_table()
    return np.asarray(np.interp(s, np.linspace(0, 1, _CELLS + 1), table[1], left=0, right=0))


@lru_cache(maxsize=1)
def pulse_table() -> Array:
    """Tabulate Q and F (2, cells + 1) of the Hertz pulse at equidistant fractions.

    δ'' = -δ^(3/2) from δ = 0, δ' = 1, by the classical Runge-Kutta method. The pulse is symmetric, so half of it is
    solved (to δ' = 0) and mirrored: Q(s) + Q(1-s) = 1.
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
def cumulated(s, table, flat):
    """Interpolate Q at the fraction s of the pulse: 0 before it, 1 after. table: `pulse_table`; flat: half-sine."""
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
