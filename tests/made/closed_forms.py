"""Natural frequencies of bodies that have a closed form: reference values for the solvers.

All isotropic, free, SI units, Hz ascending.

beam    Timoshenko: EI w'''' + ρA ẅ − ρI(1 + E/κG) ẅ'' + ρ²I/(κG) w⁗ = 0     [Timoshenko 1921, eq. 11; ends: Huang 1961]
plate   f = λ/(2πa²) √(D/ρh), λ by Ritz' method
    [Leissa 1969, NASA SP-160, table 4.64; here converged]
sphere  torsional and spheroidal multiplets
    [Lamb 1882; Eringen & Suhubi 1975, ch. 8.13-8.14]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import ModalError

# ω a² √(ρh/D) of a thin free square plate, ν = 0.3, converged Ritz values with a degenerate pair's two entries each.
FREE_SQUARE_PLATE = (13.468, 19.596, 24.270, 34.801, 34.801, 61.093, 61.093, 63.69, 69.27, 77.17)


def bar_bending_hz(
    length_m: float, width_m: float, depth_m: float, youngs_pa: float, poisson: float, density_kg_m3: float, count: int
) -> Array:
    """Compute the bending frequencies (count,) of a free rectangular Timoshenko bar that bends along depth_m.

    κ = 10(1+ν)/(12+11ν) [Cowper 1966]. Solved exactly: one sign change of the free ends' determinant per mode. Valid
    below the shear cutoff, √(κGA/ρI)/2π.

    Raises
    ------
    ModalError
        Fewer than ``count`` modes lie below the cutoff.
    """
    from scipy.optimize import brentq

    area, second = width_m * depth_m, width_m * depth_m**3 / 12
    kappa_g = 10 * (1 + poisson) / (12 + 11 * poisson) * youngs_pa / (2 * (1 + poisson))

    def determinant(omega: float) -> float:
        # w = exp(kx), ψ = g(k) w; moment ψ' and shear w' − ψ vanish at ±L/2; even and odd motions part
        r, s = density_kg_m3 * omega**2 / youngs_pa, density_kg_m3 * omega**2 / kappa_g
        root = np.sqrt((r - s) ** 2 / 4 + density_kg_m3 * area * omega**2 / (youngs_pa * second))
        a, b = np.sqrt(root - (r + s) / 2), np.sqrt(root + (r + s) / 2)  # cosh(ax), cos(bx)
        p, q = a + s / a, -b + s / b  # ψ = p sinh(ax) for w = cosh(ax); ψ = q sin(bx) for w = cos(bx)
        x = length_m / 2
        even = p * a * (-b * np.sin(b * x) - q * np.sin(b * x)) - q * b * np.cos(b * x) * np.tanh(a * x) * (a - p)
        # odd: w = sinh(ax), ψ = p cosh(ax); w = sin(bx), ψ = −q cos(bx)
        odd = p * a * np.tanh(a * x) * (b + q) * np.cos(b * x) - q * b * np.sin(b * x) * (a - p)
        return float(even * odd)

    cutoff = np.sqrt(kappa_g * area / (density_kg_m3 * second))
    base = np.sqrt(youngs_pa * second / (density_kg_m3 * area)) / length_m**2
    grid = np.minimum(base * np.linspace(2, np.pi * (count + 1.5), 40 * (count + 2)) ** 2, 0.999999 * cutoff)
    value = np.array([determinant(float(w)) for w in grid])
    change = np.flatnonzero(np.sign(value[1:]) * np.sign(value[:-1]) < 0)
    roots = [brentq(determinant, grid[k], grid[k + 1], rtol=1e-13) for k in change[:count]]
    if len(roots) < count:
        raise ModalError(f"only {len(roots)} of {count} bending modes lie below the shear cutoff", "ask for fewer")
    return np.asarray(np.array(roots) / (2 * np.pi))


def bar_longitudinal_hz(
    length_m: float, width_m: float, depth_m: float, youngs_pa: float, poisson: float, density_kg_m3: float, count: int
) -> Array:
    """Compute the longitudinal frequencies (count,) of a free bar.

    n c/2L with Rayleigh's correction for lateral inertia [Rayleigh 1894, § 157].
    """
    k = np.arange(1, count + 1) * np.pi / length_m
    polar = (width_m**2 + depth_m**2) / 12
    return np.asarray(k * np.sqrt(youngs_pa / density_kg_m3) / (2 * np.pi * np.sqrt(1 + poisson**2 * polar * k**2)))


def square_bar_torsion_hz(
    length_m: float, side_m: float, youngs_pa: float, poisson: float, density_kg_m3: float, count: int
) -> Array:
    """Compute the torsional frequencies (count,) of a free square bar.

    n/2L √(GJ/ρI_p), J = 0.140577 a⁴ [Timoshenko & Goodier 1970, art. 109].
    """
    speed = np.sqrt(youngs_pa / (2 * (1 + poisson)) * 0.1405770 * 6 / density_kg_m3)
    return np.asarray(np.arange(1, count + 1) * speed / (2 * length_m))


def free_square_plate_hz(side_m: float, thickness_m: float, youngs_pa: float, density_kg_m3: float) -> Array:
    """Compute the first ten frequencies (10,) of a thin free square plate of Poisson's ratio 0.3."""
    bending = youngs_pa * thickness_m**3 / (12 * (1 - 0.3**2))
    hz: Array = np.array(FREE_SQUARE_PLATE) / (2 * np.pi * side_m**2) * np.sqrt(bending / (density_kg_m3 * thickness_m))
    return hz


def sphere_multiplets_hz(
    radius_m: float, youngs_pa: float, poisson: float, density_kg_m3: float, count: int
) -> list[tuple[float, int, str]]:
    """Compute the first multiplets of a free ball: (Hz, number of modes = 2l+1, name such as "S2" or "T2"), ascending.

    With η = ωa/c_s, ξ = ηc_s/c_p, j the spherical Bessel functions:
    torsional   (l−1) j_l(η) − η j_{l+1}(η) = 0, l ≥ 1 (l = 1: j₂(η) = 0);   radial   tan ξ / ξ = 1 / (1 − η²/4)
    spheroidal  the 2×2 determinant of tractions of ∇(j_l(kr)Y) and ∇×∇×(r j_l(hr)Y) at r = a
    """
    from scipy.optimize import brentq
    from scipy.special import spherical_jn

    shear = np.sqrt(youngs_pa / (2 * (1 + poisson)) / density_kg_m3)
    ratio = np.sqrt((1 - 2 * poisson) / (2 * (1 - poisson)))  # c_s / c_p

    def torsional(eta: Array, order: int) -> Array:
        return np.asarray((order - 1) * spherical_jn(order, eta) - eta * spherical_jn(order + 1, eta))

    def spheroidal(eta: Array, order: int) -> Array:
        xi = eta * ratio
        jp, jp1, js, js1 = (
            spherical_jn(order, xi),
            spherical_jn(order + 1, xi),
            spherical_jn(order, eta),
            spherical_jn(order + 1, eta),
        )
        n, n1 = order, order * (order + 1)
        # tractions σ_rr, σ_rθ times r²/2G at r = a
        rr_p, rr_s = (n * n - n - eta**2 / 2) * jp + 2 * xi * jp1, n1 * ((n - 1) * js - eta * js1)
        rt_p, rt_s = (n - 1) * jp - xi * jp1, (n * n - 1 - eta**2 / 2) * js + eta * js1
        return np.asarray(rr_p if order == 0 else rr_p * rt_s - rr_s * rt_p)

    grid = np.linspace(0.05, 5 + 1.5 * count, 400 * (5 + count))
    found: list[tuple[float, int, str]] = []
    for kind, function, lowest in (("T", torsional, 1), ("S", spheroidal, 0)):
        for order in range(lowest, count + 3):
            value = function(grid, order)
            for k in np.flatnonzero(np.sign(value[1:]) * np.sign(value[:-1]) < 0)[:count]:
                eta = brentq(function, grid[k], grid[k + 1], args=(order,), xtol=1e-13)
                found.append((float(eta * shear / (2 * np.pi * radius_m)), 2 * order + 1, f"{kind}{order}"))
    return sorted(found)[:count]
