"""Closed forms of thin walls: what CalculiX itself is held against. Free, isotropic, SI units.

round plate  λ²/2πa² √(D/ρh), λ where moment and edge shear vanish   [Kirchhoff 1850; Leissa 1969, NASA SP-160]
ring         in its plane (EI/ρAR⁴) n²(n²−1)²/(n²+1), out of it (EI/ρAR⁴) n²(n²−1)²/(n²+EI/GJ)
    [Love 1927, § 293, general section by its EI/GJ]
cylinder     ends free, no stretching; as a ring, or tilting along it   [Rayleigh 1894, § 235 c; Love 1927, § 319]
cap of a ball  without stretching, cos nφ: w ∝ (n + cos θ) tanⁿ(θ/2)     [Rayleigh 1894, § 235 f]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def bending_stiffness(youngs_pa: float, poisson: float, thickness_m: float) -> float:
    """D = Eh³/12(1−ν²), N·m."""
    return youngs_pa * thickness_m**3 / (12 * (1 - poisson**2))


def round_plate_hz(
    radius_m: float, thickness_m: float, youngs_pa: float, poisson: float, density_kg_m3: float, count: int
) -> Array:
    """First frequencies (count,) of a thin free round plate, ascending; those with n diameters, n ≥ 1, twice."""
    from scipy.optimize import brentq
    from scipy.special import iv, ivp, jv, jvp

    def determinant(x: Array, n: int) -> Array:
        loss = 1 - poisson
        moment = x**2 * jv(n, x) + loss * (x * jvp(n, x) - n**2 * jv(n, x))
        moment_i = x**2 * iv(n, x) - loss * (x * ivp(n, x) - n**2 * iv(n, x))
        shear = x**3 * jvp(n, x) + loss * n**2 * (x * jvp(n, x) - jv(n, x))
        shear_i = x**3 * ivp(n, x) - loss * n**2 * (x * ivp(n, x) - iv(n, x))
        return np.asarray((moment * shear_i - shear * moment_i) * np.exp(-2 * x))

    grid = np.linspace(0.8, 3 + 1.2 * count, 60 * count)
    found: list[float] = []
    for n in range(count):
        value = determinant(grid, n)
        for k in np.flatnonzero(np.sign(value[1:]) * np.sign(value[:-1]) < 0):
            root = float(brentq(determinant, grid[k], grid[k + 1], args=(n,), xtol=1e-12))
            found += [root] * (1 if n == 0 else 2)
    rate = np.sqrt(bending_stiffness(youngs_pa, poisson, thickness_m) / (density_kg_m3 * thickness_m))
    return np.asarray(np.sort(found)[:count] ** 2 * rate / (2 * np.pi * radius_m**2))


def ring_in_plane_hz(radius_m: float, thickness_m: float, youngs_pa: float, density_kg_m3: float, n: int) -> float:
    """Frequency of a thin ring with 2n nodes in its plane, thickness along the radius, n ≥ 2."""
    rate = youngs_pa * thickness_m**2 / (12 * density_kg_m3 * radius_m**4)
    return float(np.sqrt(rate * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)) / (2 * np.pi))


def free_cylinder_hz(
    radius_m: float,
    thickness_m: float,
    length_m: float,
    youngs_pa: float,
    poisson: float,
    density_kg_m3: float,
    n: int,
    *,
    tilting: bool,
) -> float:
    """Frequency of a thin cylinder with free ends and 2n nodes round: the same along it, or ``tilting``, its ends
    against each other.
    """
    rate = bending_stiffness(youngs_pa, poisson, thickness_m) / (density_kg_m3 * thickness_m * radius_m**4)
    square = rate * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)
    if tilting:
        slender = radius_m**2 / length_m**2
        square *= (1 + 24 * (1 - poisson) * slender / n**2) / (1 + 12 * slender / (n**2 * (n**2 + 1)))
    return float(np.sqrt(square) / (2 * np.pi))


def cap_hz(
    radius_m: float,
    thickness_m: float,
    half_angle_rad: float,
    youngs_pa: float,
    poisson: float,
    density_kg_m3: float,
    n: int,
) -> float:
    """Frequency of a thin cap of a ball, its edge free, bent without stretching, with 2n nodes round, n ≥ 2.

    ω² = (2/3)(μh²/ρa⁴)(n³−n)² ∫ t²ⁿ sin⁻³θ dθ / ∫ t²ⁿ (2 sin²θ + (n + cos θ)²) sin θ dθ, t = tan(θ/2).
    """
    from scipy.integrate import quad

    def bending(x: float) -> float:
        return float(np.tan(x / 2) ** (2 * n) / np.sin(x) ** 3)

    def motion(x: float) -> float:
        return float(np.tan(x / 2) ** (2 * n) * (2 * np.sin(x) ** 2 + (n + np.cos(x)) ** 2) * np.sin(x))

    shear = youngs_pa / (2 * (1 + poisson))
    ratio = quad(bending, 0, half_angle_rad)[0] / quad(motion, 0, half_angle_rad)[0]
    rate = 2 / 3 * shear * thickness_m**2 / (density_kg_m3 * radius_m**4)
    return float(np.sqrt(rate * (n**3 - n) ** 2 * ratio) / (2 * np.pi))
