"""Hertz's law of two elastic bodies that touch: stiffness, region, depth and duration; the flat punch beside it.

    1/E* = Σ (1 − ν²)/E,   1/R* = κ₁ + κ₂                                          [Johnson 1985, eq. 4.24]
    ball    N = k δ^{3/2},  k = (4/3) E* √R*,   a = (3NR*/4E*)^{1/3}               [Johnson 1985, eq. 4.22, 4.23]
    impact  δ_max = (5m*v²/4k)^{2/5},   τ = 2.868 (m*²/(E*²R*v))^{1/5}             [Johnson 1985, eq. 11.22, 11.24]
    point   √(ab) = (3N/4E*√(κ₁κ₂))^{1/3},  b/a = (κ₁/κ₂)^{2/3}                    [Johnson 1985, eq. 4.28]
    line    b = √(4N/πE*Lκ),  a = L/2                                              [Johnson 1985, eq. 4.43]
    punch   K = 2E*√(A/π) of a disc [Johnson 1985, eq. 3.36],  π E* a/𝐊(e), e² = 1 − (b/a)², of an ellipse
            [Green & Sneddon 1950];   τ = π √(m*/K)

All that knows these equations is here: strikes (`pulse_shape`, `strike_forces`), rolling and sliding (`surface_kernel`)
and springs of bodies at rest (`coupling.springs`) call it.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import math

import numpy as np

from sonic_bullet.machine.compiled import njit


@njit(nogil=True, error_model="numpy")
def contact_modulus(low_pa, high_pa):
    """Compute E* in Pa of two moduli E/(1-ν²); infinite where both are rigid partners."""
    return 1 / (1 / low_pa + 1 / high_pa)


@njit(nogil=True, error_model="numpy")
def ball_stiffness(modulus_pa, radius_m):
    """Compute k in N/m^{3/2} of a ball of R* on a plane of E*."""
    return 4.0 / 3.0 * modulus_pa * np.sqrt(radius_m)


@njit(nogil=True, error_model="numpy")
def ball_patch_m(load_n, modulus_pa, radius_m):
    """Compute the patch's radius a in m under a load."""
    return (0.75 * load_n * radius_m / modulus_pa) ** (1.0 / 3.0)


@njit(nogil=True, error_model="numpy")
def impact_depth_m(mass_kg, stiffness, approach_m_s):
    """Compute the greatest depth of an impact. stiffness: k of `ball_stiffness`."""
    return (1.25 * mass_kg * approach_m_s * approach_m_s / stiffness) ** 0.4


@njit(nogil=True, error_model="numpy")
def impact_duration_s(mass_kg, modulus_pa, relative_curvature_per_m, approach_m_s):
    """Compute τ of an impact of curved faces; infinite at no speed."""
    return (
        2.868
        * (mass_kg * mass_kg * relative_curvature_per_m / (modulus_pa * modulus_pa * max(approach_m_s, 0.0))) ** 0.2
    )


@njit(nogil=True, error_model="numpy")
def punch_duration_s(mass_kg, modulus_pa, area_m2):
    """Compute τ of an impact of flat faces of an area, at any speed."""
    return np.pi * np.sqrt(mass_kg / (2 * modulus_pa * np.sqrt(area_m2 / np.pi)))


def point_half_axes_m(curvature_per_m: tuple[float, float], modulus_pa: float, load_n: float) -> tuple[float, float]:
    """Compute a >= b in m of the ellipse in which curved bodies touch under a load."""
    small, large = sorted(curvature_per_m)
    mean = (3 * load_n / (4 * modulus_pa * math.sqrt(small * large))) ** (1 / 3)
    longer = (large / small) ** (1 / 3)
    return mean * longer, mean / longer


def line_half_width_m(half_length_m: float, curvature_per_m: float, modulus_pa: float, load_n: float) -> float:
    """Compute b in m of a line of contact of a half-length under a load."""
    return math.sqrt(2 * load_n / (math.pi * modulus_pa * half_length_m * curvature_per_m))


def punch_stiffness_n_m(a_m: float, b_m: float, compliance_per_pa: float) -> float:
    """Compute the stiffness of a flat ellipse with half-axes a >= b, pressed in. compliance_per_pa: 1/E*.

    π a E*/K(1 - b²/a²), where K = π/2M(a, b)·a of the arithmetic-geometric mean M [Abramowitz & Stegun 17.6.3].
    """
    larger, smaller = a_m, b_m
    while larger - smaller > 1e-15 * larger:  # each step doubles the digits
        larger, smaller = (larger + smaller) / 2, math.sqrt(larger * smaller)
    return 2 * larger / compliance_per_pa
