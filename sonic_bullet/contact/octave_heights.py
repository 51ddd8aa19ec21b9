"""Heights A_j of a rough surface's octaves, once a pair, as `profile` plays them: scaled for lattice values on ±1.

rms height and Hurst exponent, or rms heights by octave -> A_j -> + waves of manufacture
    -> what a ball follows of them, what closes round a body
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records.roughness import LONGEST_M, OCTAVES, WAVE_M

OCTAVE_LATTICE = 0.30
"""An octave on a lattice Δ carries most of the self-affine spectrum at λ = Δ/0.30: there x^2.5 sinc(x)^8 peaks."""
_UNIT_RMS = np.sqrt(3.0 * 315 / 151)
"""Makes n_j unit variance: lattice values uniform on ±1 have 1/3, the mean square of the B-spline is 151/315."""


@njit(nogil=True, error_model="numpy")
def height_octaves(roughness_m, hurst, out):
    """Write A_j into out (OCTAVES,) in m, scaled for lattice values on ±1, from rms height in m and Hurst exponent."""
    total = 0.0
    for j in range(OCTAVES):
        out[j] = WAVE_M[j] ** hurst
        total += out[j] * out[j]
    scale = np.sqrt(total)
    for j in range(OCTAVES):
        out[j] = roughness_m * (out[j] / scale) * _UNIT_RMS


@njit(nogil=True, error_model="numpy")
def given_octaves(octave_rms_m, out):
    """A_j into out (OCTAVES,) in m, scaled for lattice values on ±1, from rms heights (OCTAVES,) in m."""
    for j in range(OCTAVES):
        out[j] = octave_rms_m[j] * _UNIT_RMS


@njit(nogil=True, error_model="numpy")
def add_waves(rms_m, length_m, out):
    """Add waves of one length to heights (OCTAVES,) of `height_octaves`, in power, in the octave that it is in."""
    if rms_m > 0.0:
        j = int(np.floor(np.log2(LONGEST_M / length_m) + 0.5))
        if 0 <= j < OCTAVES:
            out[j] = np.sqrt(out[j] * out[j] + rms_m * rms_m * (_UNIT_RMS * _UNIT_RMS))


@njit(nogil=True, error_model="numpy")
def slope_squared(height_m):
    """Return the mean square slope of a trace over heights (OCTAVES,) of `height_octaves`: Σ (2πσ/λ)²."""
    total = 0.0
    for j in range(OCTAVES):
        slope = 2.0 * np.pi / WAVE_M[j] * height_m[j] / _UNIT_RMS
        total += slope * slope
    return total


@njit(nogil=True, error_model="numpy")
def reach_of_ball(wave_m, patch_radius_m, radius_m):
    """Compute the largest A, for lattice values on ±1, of waves that a ball of R* with a Hertz patch a follows.

    Over waves of amplitude A and crests sharper than the ball its centre moves on arcs about them, λ apart, that fall
    by λ²/8R [ISO 16610-41:2015, closing by a disc, of one wave]; and it sinks by Hertz' depth a²/R. So A is at most
    (λ²/16 + a²)/R.
    """
    return (wave_m * wave_m / 16.0 + patch_radius_m * patch_radius_m) / radius_m / np.sqrt(2.0) * _UNIT_RMS


@njit(nogil=True, error_model="numpy")
def close_round(length_m, out):
    """Return lattice points of the coarsest octave round a length, and how far the lattice is stretched, over 1.

    A whole number, 4 to 7, of the points of the coarsest octave that has as many; coarser heights out (OCTAVES,) are
    0 then: waves nearly as long as the body is round only carry it.
    """
    points, j = length_m / (LONGEST_M * OCTAVE_LATTICE), 0
    while points < 4.0 and j < OCTAVES - 1:
        points *= 2.0
        out[j] = 0.0
        j += 1
    whole = np.floor(points + 0.5)
    return whole / 2.0**j, whole / points - 1.0
