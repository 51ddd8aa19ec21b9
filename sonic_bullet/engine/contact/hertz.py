"""Hertz's law of two elastic bodies at rest: half-axes of the region in which they touch; the flat punch beside it.

    1/E* = Σ (1 − ν²)/E                                                            [Johnson 1985, eq. 4.24]
    point   √(ab) = (3N/4E*√(κ₁κ₂))^{1/3},  b/a = (κ₁/κ₂)^{2/3}                    [Johnson 1985, eq. 4.28]
    line    b = √(4N/πE*Lκ),  a = L/2                                              [Johnson 1985, eq. 4.43]
    punch   π E* a/𝐊(e), e² = 1 − (b/a)², of an ellipse                            [Green & Sneddon 1950]

`coupling.springs` calls it. Of a ball, and of impacts: src/contact/hertz.hpp.
"""

from __future__ import annotations

import math

from sonic_bullet.signal.elementary import cbrt


def point_half_axes_m(curvature_per_m: tuple[float, float], modulus_pa: float, load_n: float) -> tuple[float, float]:
    """Compute a >= b in m of the ellipse in which curved bodies touch under a load."""
    small, large = sorted(curvature_per_m)
    mean = float(cbrt(3 * load_n / (4 * modulus_pa * math.sqrt(small * large))))
    longer = float(cbrt(large / small))
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
