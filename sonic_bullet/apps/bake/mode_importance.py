"""Importance of a body's modes to a listener, and which are not worth a resonator.

    E = <|φ·n|²> |p|²/4d                                      energy at 1 m after one impulse, mean over the surface
    masked:  L < 10 log₁₀ Σ_j 10^{(L_j + S(z - z_j) - 14.5 - z_j)/10}      over j that ring at least as long
    S(Δz) = 15.81 + 7.5 (Δz + 0.474) - 17.5 √(1 + (Δz + 0.474)²)  dB       [Schroeder, Atal, Hall 1979, eq. 1]
    14.5 + z dB: a tone masks a narrow band that far below itself          [Jayant, Johnston, Safranek 1993, sec. III]
    z = 6 asinh(f/600)  Bark

A mode that outlasts its masker is not masked by it, so only maskers that decay no faster count.

How many are kept is chosen by what is heard over a second of strikes of several hardnesses: a bar's high modes have the
most energy of an ideal impulse, and its pitch is the low one that rings on.

    P(b, t, τ) = Σ_m over octave b  E_m |F̂(f_m τ)|² A(f_m)² (e^{-2 d_m t} - e^{-2 d_m (t + 50 ms)})
    loss = 10 log₁₀ P / P_kept, at most 10 log₁₀ P + 60 dB over the loudest octave of the strike's begin: then nobody
           hears it;  of the modes that are left the next is the one that leaves the least Σ loss²

A: weighting of the ear by frequency [IEC 61672-1:2013, annex E.4].
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.engine.contact.pulse_shape import pulse_spectrum
from sonic_bullet.geometry import face_areas_m2, outward_normals
from sonic_bullet.records import Array

CONTACT_S = (1e-4, 5e-4, 2e-3)
"""Of strikes: of steel on steel, of wood, of a soft mallet."""
HEARD_AT_S, WINDOW_S = (0.0, 0.25, 0.5, 1.0), 0.05
"""When a strike is listened to, and for how long: about what the ear takes in at once."""
AUDIBLE_DB = 60.0
"""Below the loudest octave of the strike's begin: T60's own 60 dB."""
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


def weigh_frequency(freq_hz: Array) -> Array:
    """Compute A(f) (m,), 1 at 1 kHz."""
    f2 = np.asarray(freq_hz, float) ** 2
    low, high = (f2 + 20.6**2) * np.sqrt((f2 + 107.7**2) * (f2 + 737.9**2)), f2 + 12194.0**2
    return np.asarray(1.2589 * 12194.0**2 * f2**2 / np.maximum(low * high, 1e-300))


def audible_order(freq_hz: Array, decay_per_s: Array, energy: Array) -> tuple[Array, Array]:
    """Order modes (m,) by what the ear loses without them.

    Returns
    -------
    Array of int, shape (m,)
        The modes, the one that matters most first.
    Array, shape (m + 1,)
        The largest loss in dB, by octave, with the first 0 … m of them.
    """
    m = len(freq_hz)
    if not m:
        return np.zeros(0, np.int64), np.zeros(1)
    decay = np.maximum(decay_per_s, SLOWEST_PER_S)
    band = np.floor(np.log2(np.maximum(freq_hz, 1.0) / 1000) + 0.5).astype(int)
    band -= band.min()
    at = np.array(HEARD_AT_S)
    rings = np.exp(-2 * np.outer(decay, at)) - np.exp(-2 * np.outer(decay, at + WINDOW_S))
    struck = np.stack([pulse_spectrum(freq_hz * tau) for tau in CONTACT_S], axis=1)
    heard = energy * weigh_frequency(freq_hz) ** 2
    power = heard[:, None, None] * struck[:, :, None] ** 2 * rings[:, None, :]  # mode, strike, time
    full = np.zeros((band.max() + 1, *power.shape[1:]))
    np.add.at(full, band, power)
    loudest = np.maximum(full[:, :, :1].max(axis=0, keepdims=True), 1e-300)
    least = loudest * 10 ** (-AUDIBLE_DB / 10)
    kept, order = np.zeros_like(full), []
    left = np.arange(m)
    error = [_loss_db(full, kept, least).max()]
    for _ in range(m):
        now = _loss_db(full, kept, least)
        with_it = _loss_db(full[band[left]], kept[band[left]] + power[left], least)
        gain = (now[band[left]] ** 2 - with_it**2).sum(axis=(1, 2))
        best = int(np.argmax(gain)) if gain.max() > 0 else int(np.argmax(heard[left]))  # the rest by its energy
        kept[band[left[best]]] += power[left[best]]
        order.append(int(left[best]))
        left = np.delete(left, best)
        error.append(_loss_db(full, kept, least).max())
    return np.array(order, np.int64), np.array(error)


def _loss_db(full: Array, kept: Array, least: Array) -> Array:
    """Compute how far what is kept lies below the whole, down to where nobody hears either."""
    return np.asarray(10 * np.log10(np.maximum(full, least) / np.maximum(np.minimum(kept, full), least)))


def important_modes(
    freq_hz: Array, decay_per_s: Array, energy: Array, *, most: int | None = None, below_db: float | None = None
) -> Array:
    """Return the indices of the modes to keep, the most important first.

    In `audible_order`, so that the first N are the N to play.

    Parameters
    ----------
    freq_hz, decay_per_s, energy : (m,) arrays
        Of all modes; energy by `mode_energy`.
    most : int, optional
        How many to keep at most.
    below_db : float, optional
        Leave out masked modes, and those so many dB below the strongest.
    """
    order = audible_order(freq_hz, decay_per_s, energy)[0]
    if below_db is not None and len(order):
        weak = energy < energy.max() * 10 ** (-below_db / 10)
        order = order[~(weak | masked_modes(freq_hz, decay_per_s, energy))[order]]
    return np.asarray(order[:most])
