"""The height profile of a surface, read at the distance it has swept: self-affine noise without end.

    PSD(κ) ∝ κ^-(1+2H)  for wavelengths from LONGEST_M down to LONGEST_M / 2^(OCTAVES-1),  flat above      [Mandelbrot; Persson 2005]
    h(x) = Σ_j g_j A_j n_j(x/Δ_j),   A_j ∝ Δ_j^H,  Σ A_j² = rms²,  Δ_j = LONGEST_M·LATTICE / 2^j
    n_j: cubic B-spline (C²) on hashed lattice values of unit variance

The rms height of a Material is that of a 100 mm long trace. What a stylus instrument with a cut-off of 0.8 mm calls Rq is
(0.8/100)^H of it: 1/37 at H = 0.75. So smooth glass has some 0.1 µm, a sanded board 20 µm.

Gains g_j (an octave's wavelength is λ_j):
    contact patch   (1 + (w/λ)³)^(-1/2), w = 2a: waves shorter than the contact width average out   [Remington 1987; Thompson 2003, eq. 3]
    anti-aliasing   1 below 0.2 sr at v/λ, falling to 0 at 0.4 sr
    slow waves      v/λ ÷ 8 Hz below 8 Hz: they only lift the body, inaudibly

The voice needs dh/dt alone: Σ g A n'(x/Δ)·v/Δ. So a changing gain never moves a surface that stands, and v = 0 is exactly 0.
"""

from __future__ import annotations

import numba
import numpy as np

from sonic_bullet.records import Array

OCTAVES = 14
LONGEST_M = 0.1
LATTICE = 0.30
"""An octave on a lattice Δ carries most of the self-affine spectrum at λ = Δ/0.30: there x^2.5 sinc(x)^8 peaks."""
SLOWEST_HZ = 8.0

_WAVE_M = LONGEST_M / 2.0 ** np.arange(OCTAVES)
_UNIT_RMS = np.sqrt(3.0 * 315 / 151)
"""Makes n_j unit variance: lattice values uniform on ±1 have 1/3, the mean square of the B-spline is 151/315."""


def octave_slopes(roughness_m: Array, hurst: Array) -> Array:
    """A_j/Δ_j (…, OCTAVES), the slope scale of every octave, from rms height in m and Hurst exponent (…)."""
    weight = _WAVE_M ** np.asarray(hurst, float)[..., None]
    weight = weight / np.sqrt((weight**2).sum(-1, keepdims=True))
    return np.asarray(np.asarray(roughness_m, float)[..., None] * weight * _UNIT_RMS / (_WAVE_M * LATTICE))


def octave_gains(speed_m_s: Array, patch_width_m: Array, sr: int) -> Array:
    """g_j (…, OCTAVES) at sweep speeds (…) in m/s, of either sign, with contact width (…) in m."""
    f = np.abs(np.asarray(speed_m_s, float))[..., None] / _WAVE_M
    patch = 1 / np.sqrt(1 + (np.asarray(patch_width_m, float)[..., None] / _WAVE_M) ** 3)
    return np.asarray(patch * np.clip((0.4 - f / sr) / 0.2, 0, 1) * np.clip(f / SLOWEST_HZ, 0, 1))


@numba.njit(cache=True, nogil=True, inline="always")
def _lattice(i):  # type: ignore[no-untyped-def]
    """Hash of a lattice point to ±1: the finaliser of a 32-bit integer mix, in 64-bit lanes so that it vectorises."""
    m = 0xFFFFFFFF
    i = i & m
    i = i ^ (i >> 16)
    i = (i * 0x7FEB352D) & m
    i = i ^ (i >> 15)
    i = (i * 0x846CA68B) & m
    i = i ^ (i >> 16)
    return np.float64(i) * (2.0 / 4294967296.0) - 1.0


@numba.njit(cache=True, nogil=True)
def sweep(swept, v0, v1, x, key, slope0, slope1, scale, sr, rate, place):  # type: ignore[no-untyped-def]
    """Add dh/dt of one side of one pair to ``rate`` (n,) in m/s; returns the distance swept after the n samples.

    swept: distance before; v0, v1: speeds at the step's ends, x (n,) share of the step; slope0, slope1 (octaves,): gain times
    A/Δ at the step's ends; scale (octaves,) 1/Δ; key: of this surface; place (n,): scratch.
    """
    n = len(x)
    for i in range(n):
        swept += (v0 + (v1 - v0) * x[i]) / sr
        place[i] = swept
    for j in range(len(scale)):
        if slope0[j] == 0.0 and slope1[j] == 0.0:
            continue
        inverse, s0, ds, offset = scale[j], slope0[j], slope1[j] - slope0[j], key + 0x3C6EF372 * (j + 1)
        for i in range(n):
            u = place[i] * inverse
            cell = np.floor(u)
            t = u - cell
            base = np.int64(cell) + offset
            a, b, c, d = _lattice(base), _lattice(base + 1), _lattice(base + 2), _lattice(base + 3)
            # derivative of the cubic B-spline through a, b, c, d
            rate[i] += (0.5 * (c - a) + t * ((a - 2.0 * b + c) + t * 0.5 * (d - 3.0 * c + 3.0 * b - a))) * (s0 + ds * x[i]) * (v0 + (v1 - v0) * x[i])
    return swept
