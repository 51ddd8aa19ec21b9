"""Pairs of surfaces that rub, without bodies: the table of pairs and the oscillators, for tests and studies."""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import FASTEST_M_S, OCTAVES, VOICE, gained_heights, height_octaves, sound_voices
from sonic_bullet.engine.runtime.tables import PAIR
from sonic_bullet.records import Array


def octave_heights(roughness_m: float, hurst: float) -> Array:
    """A_j (octaves,) in m."""
    out = np.zeros(OCTAVES)
    height_octaves(roughness_m, hurst, out)
    return out


def octave_gains(speed_m_s: float, patch_radius_m: float, sr: float, touching: float = 0.0) -> Array:
    """g_j (octaves,)."""
    out = np.zeros(OCTAVES)
    gained_heights(np.ones(OCTAVES), speed_m_s, patch_radius_m, touching, 0.0, sr, out)
    return out


def surface_pairs(
    mass_kg: Array, modulus_pa: Array, radius_m: Array, zeta: Array, roughness_m: Array, hurst: Array, seed: Array
) -> Array:
    """(p,) of PAIR at rest: m*, E*, R*, ζ (p,); of either surface (p, 2) rms height, Hurst exponent and seed."""
    pairs = np.zeros(len(mass_kg), PAIR)
    pairs["mass_kg"], pairs["modulus_pa"], pairs["radius_m"] = mass_kg, modulus_pa, radius_m
    pairs["damping_ratio"], pairs["seed"] = zeta, seed
    for p, side in np.ndindex(len(pairs), 2):
        pairs["height_m"][p, side] = octave_heights(float(roughness_m[p, side]), float(hurst[p, side]))
    return pairs


def advance(pairs: Array, load_n: Array, sweep_m_s: Array, x: Array, sr: int, tracks: Array | None = None) -> Array:
    """Force f - N (p, n) in newton at the shares ``x`` (n,) of one step; the pairs (p,) move on.

    load_n (2, p), sweep_m_s (2, p, 2): at the step's ends.
    """
    voices, force = np.zeros(len(pairs), VOICE), np.zeros((len(pairs), len(x)))
    voices["slot"], voices["load_n"] = np.arange(len(pairs)), np.maximum(np.transpose(load_n), 0)
    voices["sweep_m_s"] = np.minimum(np.transpose(sweep_m_s, (1, 0, 2)), FASTEST_M_S)
    slopes = np.zeros(0) if tracks is None else np.ascontiguousarray(tracks, float).ravel()
    sound_voices(pairs, voices, np.ascontiguousarray(x, float), float(sr), slopes, force)
    return force
