"""The height profile of a surface, read at the distance it has swept: self-affine noise without end.

    PSD(κ) ∝ κ^-(1+2H)  for wavelengths from LONGEST_M down to LONGEST_M / 2^(OCTAVES-1),  flat above
        [Mandelbrot; Persson 2005]
    h(x) = Σ_j g_j A_j n_j(x/Δ_j),   A_j ∝ Δ_j^H,  Σ A_j² = rms²,  Δ_j = LONGEST_M·LATTICE / 2^j
    n_j: cubic B-spline (C²) on hashed lattice values of unit variance

The rms height of a Material is that of a 100 mm long trace. What a stylus instrument with a cut-off of 0.8 mm calls Rq
is (0.8/100)^H of it: 1/37 at H = 0.75. So smooth glass has some 0.1 µm, a sanded board 20 µm.

Gains g_j (an octave's wavelength is λ_j):
    contact patch
        (1 + a/λ)^(-1/2), a: Hertz' radius: a rough contact rides on about 1 + a/λ independent spots and feels their
        mean;
                    -3 dB at λ = a, that is at v/a. (Remington's filter, [1987] and [Thompson 2003], averages full,
                        smooth contact and falls
                    three times as steeply. With it the level grows with speed to the power 1.1 … 1.6: measured, 0.5 …
                        0.96.)
    anti-aliasing   1 below 0.2 sr at v/λ, falling to 0 at 0.4 sr
    slow waves      1 above 16 Hz, falling to 0 at 8 Hz: they only lift the body, inaudibly

The voice needs dh/dt alone: Σ g A n'(x/Δ)·v/Δ. So a changing gain never moves a surface that stands, and v = 0 is
exactly 0.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

OCTAVES = 14
LONGEST_M = 0.1
LATTICE = 0.30
"""An octave on a lattice Δ carries most of the self-affine spectrum at λ = Δ/0.30: there x^2.5 sinc(x)^8 peaks."""
SLOWEST_HZ = 8.0

_WAVE_M = LONGEST_M / 2.0 ** np.arange(OCTAVES)
_UNIT_RMS = np.sqrt(3.0 * 315 / 151)
"""Makes n_j unit variance: lattice values uniform on ±1 have 1/3, the mean square of the B-spline is 151/315."""


def octave_heights(roughness_m: Array, hurst: Array) -> Array:
    """A_j (…, OCTAVES) in m, scaled for lattice values on ±1, from rms height in m and Hurst exponent (…)."""
    weight = _WAVE_M ** np.asarray(hurst, float)[..., None]
    weight = weight / np.sqrt((weight**2).sum(-1, keepdims=True))
    return np.asarray(np.asarray(roughness_m, float)[..., None] * weight * _UNIT_RMS)


def octave_gains(speed_m_s: Array, patch_radius_m: Array, sr: int) -> Array:
    """g_j (…, OCTAVES) at sweep speeds (…) in m/s, of either sign, with contact radius (…) in m."""
    f = np.abs(np.asarray(speed_m_s, float))[..., None] / _WAVE_M
    patch = 1 / np.sqrt(1 + np.asarray(patch_radius_m, float)[..., None] / _WAVE_M)
    return np.asarray(patch * np.clip((0.4 - f / sr) / 0.2, 0, 1) * np.clip(f / SLOWEST_HZ - 1, 0, 1))


@njit(nogil=True, error_model="numpy")
def _noise(first, out):  # type: ignore[no-untyped-def]
    """Values on ±1 of the lattice points from ``first`` (uint32) on: a 32-bit integer mix [Wellons 2018, "lowbias32"],
    kept in 32 bits so that it vectorises.
    """
    for i in range(len(out)):
        h = np.uint32(first + np.uint32(i))
        h = np.uint32(np.uint32(h ^ (h >> np.uint32(16))) * np.uint32(0x7FEB352D))
        h = np.uint32(np.uint32(h ^ (h >> np.uint32(15))) * np.uint32(0x846CA68B))
        out[i] = np.float64(np.int32(h ^ (h >> np.uint32(16)))) * (1.0 / 2147483648.0)


@njit(nogil=True, error_model="numpy")
def _refine(coarse, fine, height, noise, count):  # type: ignore[no-untyped-def]
    """2·count B-spline coefficients on half the lattice, from coarse[0] … coarse[count + 1], and this octave's own
    noise.
    """
    for i in range(count):
        fine[2 * i] = 0.125 * (coarse[i] + 6.0 * coarse[i + 1] + coarse[i + 2]) + height * noise[2 * i]
        fine[2 * i + 1] = 0.5 * (coarse[i + 1] + coarse[i + 2]) + height * noise[2 * i + 1]


@njit(nogil=True, error_model="numpy")
def sweep(swept, speed, x, key, height0, height1, sr, rate):  # type: ignore[no-untyped-def]
    """Add dh/dt of one side of one pair to ``rate`` (n,) in m/s; returns the distance swept after the n samples.

    swept: distance before; speed (2,): at the step's ends; x (n,): share of the step; height0, height1 (octaves,): g·A
    at the step's ends; key: of this surface. The lattices nest, so the octaves are summed from coarse to fine on the
    lattice points that the samples pass (a cubic B-spline on Δ is one on Δ/2 with the coefficients [1 4 6 4 1]/8) and
    read once a sample. A coefficient hangs on its place alone, so where a block begins makes no difference.
    """
    n, octaves = len(x), len(height0)
    v0, dv = speed[0], speed[1] - speed[0]
    where, pace, per_sample = np.empty(n), np.empty(n), 1.0 / sr
    for i in range(n):
        pace[i] = v0 + dv * x[i]
        swept += pace[i] * per_sample
        where[i] = swept
    finest = octaves - 1
    while finest >= 0 and height0[finest] == 0.0 and height1[finest] == 0.0:
        finest -= 1
    if finest < 0:
        return swept
    inverse = 2.0**finest / (LONGEST_M * LATTICE)
    first, last = np.empty(octaves, np.int64), np.empty(octaves, np.int64)
    first[finest], last[finest] = (
        (np.int64(np.floor(where[0] * inverse)) - 1) & -2,
        (np.int64(np.floor(where[n - 1] * inverse)) + 2) | 1,
    )
    for j in range(finest - 1, -1, -1):
        first[j], last[j] = ((first[j + 1] >> 1) - 1) & -2, ((last[j + 1] >> 1) + 1) | 1
    size = last[finest] - first[finest] + 32
    # neighbouring seeds must start far apart in the 2^32 values of the mix
    place = np.int64((np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(33))
    now0, now1, new0, new1, noise = np.zeros(size), np.zeros(size), np.empty(size), np.empty(size), np.empty(size)
    for j in range(finest + 1):
        count = last[j] - first[j] + 1
        _noise(np.uint32(place + 0x3C6EF372 * j + first[j]), noise[:count])
        if j > 0:
            begin = (first[j] >> 1) - first[j - 1] - 1
            _refine(now0[begin:], new0, height0[j], noise, count >> 1)
            _refine(now1[begin:], new1, height1[j], noise, count >> 1)
            now0, now1, new0, new1 = new0, new1, now0, now1
        else:
            for i in range(count):
                now0[i], now1[i] = height0[0] * noise[i], height1[0] * noise[i]
    # derivative of the cubic B-spline on each cell: start of the step, then what it gains until its end
    cells = last[finest] - first[finest] - 2
    curve = np.empty((cells, 6))
    for i in range(cells):
        a, b, c, d = now0[i], now0[i + 1], now0[i + 2], now0[i + 3]
        curve[i, 0], curve[i, 1], curve[i, 2] = 0.5 * (c - a), a - 2.0 * b + c, 0.5 * (d - 3.0 * c + 3.0 * b - a)
        a, b, c, d = now1[i] - a, now1[i + 1] - b, now1[i + 2] - c, now1[i + 3] - d
        curve[i, 3], curve[i, 4], curve[i, 5] = 0.5 * (c - a), a - 2.0 * b + c, 0.5 * (d - 3.0 * c + 3.0 * b - a)
    begin = first[finest] + 1
    for i in range(n):
        u = where[i] * inverse
        cell = np.int64(u)  # places are never negative
        t, share, at = u - cell, x[i], np.uint64(cell - begin)
        slope = (
            curve[at, 0]
            + curve[at, 3] * share
            + t * (curve[at, 1] + curve[at, 4] * share + t * (curve[at, 2] + curve[at, 5] * share))
        )
        rate[i] += slope * inverse * pace[i]
    return swept
