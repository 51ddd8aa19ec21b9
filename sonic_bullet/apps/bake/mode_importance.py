"""Importance of a body's modes to a listener, and which are not worth a resonator.

    E = <|φ·n|²> |p|²/4d                                      energy at 1 m after one impulse, mean over the surface
    masked:  L < 10 log₁₀ Σ_j 10^{(L_j + S(z - z_j) - 14.5 - z_j)/10}      over j that ring at least as long
    S(Δz) = 15.81 + 7.5 (Δz + 0.474) - 17.5 √(1 + (Δz + 0.474)²)  dB       [Schroeder, Atal, Hall 1979, eq. 1]
    14.5 + z dB: a tone masks a narrow band that far below itself          [Jayant, Johnston, Safranek 1993, sec. III]
    z = 6 asinh(f/600)  Bark

A mode that outlasts its masker is not masked by it, so only maskers that decay no faster count.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.geometry import face_areas_m2, outward_normals
from sonic_bullet.records import Array

SLOWEST_PER_S = 1e-3
"""A decay of zero counts as this one: 10^4 s."""


def mode_energy(vertex_m: Array, face: Array, shape: Array, pressure_pa_m: Array, decay_per_s: Array) -> Array:
    """Compute E (m,) in Pa²·s per (N·s)² by the module's first equation."""
    area, normal = face_areas_m2(vertex_m, face), outward_normals(vertex_m, face)
    along = np.einsum("fx,fxm->fm", normal, shape[face].mean(axis=1, dtype=float))
    square = area @ along**2 / area.sum()
    return np.asarray(square * np.abs(pressure_pa_m) ** 2 / (4 * np.maximum(decay_per_s, SLOWEST_PER_S)))


def masked_modes(freq_hz: Array, decay_per_s: Array, energy: Array) -> Array:
    """Find the modes (m,) that others mask, by the module's equations."""
    bark = 6 * np.arcsinh(freq_hz / 600)
    with np.errstate(divide="ignore"):
        level = 10 * np.log10(energy)
    gap = bark[:, None] - bark[None, :] + 0.474
    spread = 15.81 + 7.5 * gap - 17.5 * np.sqrt(1 + gap**2)
    threshold = level[None, :] + spread - 14.5 - bark[None, :]
    hides = (decay_per_s[None, :] <= decay_per_s[:, None]) & (energy[None, :] > energy[:, None])
    return np.asarray(energy < np.where(hides, 10 ** (threshold / 10), 0.0).sum(axis=1))


def important_modes(
    freq_hz: Array, decay_per_s: Array, energy: Array, *, most: int | None = None, below_db: float | None = None
) -> Array:
    """Return the indices of the modes to keep, the most important first.

    Parameters
    ----------
    freq_hz, decay_per_s, energy : (m,) arrays
        Of all modes; energy by `mode_energy`.
    most : int, optional
        How many to keep at most.
    below_db : float, optional
        Leave out masked modes, and those so many dB below the strongest.
    """
    order = np.argsort(-energy, kind="stable")
    if below_db is not None and len(order):
        weak = energy < energy.max() * 10 ** (-below_db / 10)
        order = order[~(weak | masked_modes(freq_hz, decay_per_s, energy))[order]]
    return np.asarray(order[:most])
