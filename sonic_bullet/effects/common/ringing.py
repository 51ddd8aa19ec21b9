"""Sums of modes, sample by sample: linear ones, and ones whose frequency and decay depend on their level.

Equations: src/effects/ringing.hpp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet._engine import add_level_modes, add_linear_modes
from sonic_bullet.effects.protocol import Impact, Ring
from sonic_bullet.records import Array


class _Modes(NamedTuple):
    """Modes (m,) that depend on their level.

    bend, damping_growth: relative changes at the level the mode starts with, bend·level² and
    (damping_growth·level)^power.
    """

    omega_rad_s: Array
    decay_per_s: Array
    amplitude: Array
    bend: Array
    damping_growth: Array
    power: float


def synthesize_ring(ring: Ring, impact: Impact, n: int, sr: int) -> Array:
    """Synthesize the modes under every hit of an impact; modes above Nyquist are left out.

    Parameters
    ----------
    ring : Ring
        The modes.
    impact : Impact
        The hits.
    n : int
        Length in samples.
    sr : int
        Sampling rate in Hz.

    Returns
    -------
    (n,)
        The sound in units of the ring's amplitudes.
    """
    faint = 40.0  # nepers after which a mode is over
    out = np.zeros(n)
    use = (ring.freq_hz < 0.5 * sr) & (np.abs(ring.amplitude) > 0)
    if not use.any():
        return out
    f, d, a = ring.freq_hz[use], ring.decay_per_s[use], ring.amplitude[use] * impact.spectrum(ring.freq_hz[use])
    length = np.full(len(f), n, np.int64)
    alive = d * n / sr > faint
    length[alive] = (faint / d[alive] * sr).astype(np.int64)
    pole = (-d + 2j * np.pi * f) / sr
    bent = (ring.bend[use] != 0) | (ring.damping_growth[use] != 0)
    for delay, share in zip(impact.delay_s, impact.share, strict=True):
        if (~bent).any():
            add_linear_modes(pole[~bent], (share * a)[~bent].astype(complex), length[~bent], delay * sr, out)
        if bent.any():
            level = (ring.level[use] * share * np.abs(impact.spectrum(f)))[bent]
            bend, damping_growth = (
                ring.bend[use][bent] * level**2,
                (ring.damping_growth[use][bent] * level) ** ring.damping_growth_power,
            )
            modes = _Modes(
                2 * np.pi * f[bent],
                np.maximum(d[bent], 1e-6),
                (share * a)[bent].astype(complex),
                bend,
                damping_growth,
                float(ring.damping_growth_power),
            )
            add_level_modes(modes, length[bent], delay * sr, float(sr), out)
    return out
