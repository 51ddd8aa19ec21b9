"""Octaves of a rough surface: what part of its rms height has which wavelength.

    octave j: wavelengths LONGEST_M / 2^j, √2 to either side                       j = 0 … OCTAVES - 1
    finish (σ, ℓ, p, λs): PSD(q) flat up to 1/ℓ, ∝ q^p from there to 1/λs           [KHR_audio_rigid_bodies, Surfaces]
    σ_j² = ∫ PSD dq over octave j,   Σ over all wavelengths = σ²

A self-affine surface without ℓ, of rms height and Hurst exponent, is the other description (`Material.hurst`).
Wavelengths beyond the octaves are left out, not moved into them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.records.arrays import Array

if TYPE_CHECKING:
    from sonic_bullet.records.bodies import Material

ORDINARY_ROUGHNESS_M, ORDINARY_HURST = 5e-5, 0.7
"""Surface of a floor, a table, a wall of which nobody says what it is: that of a surface cast against formwork, as of
the preset concrete, whose sources it has (ACI 318-19; EN 1992-1-1:2004, 6.2.5)."""
OCTAVES, LONGEST_M = _engine.OCTAVES, _engine.LONGEST_WAVE_M
WAVE_M = LONGEST_M / 2.0 ** np.arange(OCTAVES)
_EDGE_PER_M = np.sqrt(2.0) ** np.array([-1.0, 1.0]) / WAVE_M[:, None]


def finish_octaves(rms_m: float, correlation_m: float, slope: float, shortest_m: float) -> Array:
    """Rms heights (OCTAVES,) in m of a finish: σ, ℓ, the exponent p of its spectrum, and λs."""
    total = _variance(0.0, 1.0 / shortest_m, correlation_m, slope)
    own = [_variance(low, min(high, 1.0 / shortest_m), correlation_m, slope) for low, high in _EDGE_PER_M]
    return np.asarray(rms_m * np.sqrt(np.maximum(own, 0.0) / total))


def _variance(low: float, high: float, correlation_m: float, slope: float) -> float:
    """∫ of the spectrum between two spatial frequencies, 1/m, in units of its flat part."""
    bend = 1.0 / correlation_m
    flat = max(min(high, bend) - low, 0.0)
    first, last = max(low, bend) / bend, max(high, bend) / bend
    if slope == -1:
        return flat + bend * float(np.log(last / first))
    return flat + bend * float(last ** (slope + 1) - first ** (slope + 1)) / (slope + 1)


def track_octaves(height_m: Array, spacing_m: float) -> Array:
    """Rms heights (OCTAVES,) in m of a measured track: its periodogram, summed over each octave [Parseval]."""
    n = len(height_m)
    power = np.abs(np.fft.rfft(height_m - np.mean(height_m)) / n) ** 2
    power[1 : (n + 1) // 2] *= 2
    return octave_sums(np.fft.rfftfreq(n, spacing_m), power)


def track_slopes(height_m: Array, spacing_m: float) -> tuple[Array, float]:
    """Split a track's slope dh/dx into the octaves: (OCTAVES, n), and the distance of two of them in m.

    The track is taken for one turn of a closed one. What is finer than the octaves, or coarser, is left out; so n is
    four a wave of the finest, at most the track's own number.
    """
    count, length_m = len(height_m), len(height_m) * spacing_m
    wanted = min(count, int(np.ceil(4 * length_m * _EDGE_PER_M[-1, 1])))
    spectrum, frequency = np.fft.rfft(height_m) / count, np.fft.rfftfreq(count, spacing_m)
    spectrum = spectrum * 2j * np.pi * frequency
    keep = wanted // 2 + 1
    slopes = np.zeros((OCTAVES, wanted))
    for j, (low, high) in enumerate(_EDGE_PER_M):
        own = np.where((frequency >= low) & (frequency < high), spectrum, 0)[:keep]
        slopes[j] = np.fft.irfft(own, wanted) * wanted
    return slopes, length_m / wanted


def octave_sums(frequency_per_m: Array, variance_m2: Array) -> Array:
    """Rms heights (OCTAVES,) in m of lines at spatial frequencies, each with its share of the variance."""
    return np.array(
        [np.sqrt(variance_m2[(frequency_per_m >= low) & (frequency_per_m < high)].sum()) for low, high in _EDGE_PER_M]
    )


def with_roughness(material: Material, roughness_m: float) -> Material:
    """Give a material another rms height, each wavelength's in proportion."""
    octaves = material.octave_rms_m
    if octaves is not None:
        share = roughness_m / material.roughness_m if material.roughness_m > 0 else 0.0
        octaves = octaves * share if share or not roughness_m else None
    return replace(material, roughness_m=roughness_m, octave_rms_m=octaves)
