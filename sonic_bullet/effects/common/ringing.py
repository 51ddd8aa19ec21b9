"""Sums of modes, sample by sample: linear ones by recursion, level-dependent ones in closed form.

    linear             x_m(t) = Re A e^{(−d + iω)t}
    growth c           ȧ = −d a (1 + c (a/a₀)^p)      ->  a(t)/a₀ = ((1 + c) e^{pdt} − c)^{−1/p}, p = 1, 2
        (Bernoulli's equation)
    bend b             ω(t) = ω (1 + b a²(t))         ->  phase ω(t + b ∫a²dt)

a is the mode's level (peak velocity at the surface); ∫a² dt = a₀² (1 − e^{−2dt})/2d without damping growth; a₀² ln(1 +
c − c e^{−2dt})/2dc with p = 2; and with p = 1,
u = e^{dt}, k = c/(1 + c):
    ∫ a² dt = a₀²/(d (1 + c)²) ∫₁ᵘ dv/(v (v − k)²) = a₀²/(d (1 + c)²) [ln(v/(v − k))/k² − 1/(k (v − k))]₁ᵘ.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.effects.protocol import Impact, ObjectEvidence, Ring
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

RINGING_STEP = 1024  # samples between two exact phasors


class _Modes(NamedTuple):
    """Modes (m,) that depend on their level.

    bend, damping_growth: relative changes at the level the mode starts with, bend·level² and
    (damping_growth·level)^power.
    """

    omega: Array
    decay: Array
    amplitude: Array
    bend: Array
    damping_growth: Array
    power: float


@njit(nogil=True)
def _linear(out, start, pole, amplitude, length):
    """Add Re A z^(n − start) to out, n from ceil(start)."""
    for k in range(len(pole)):
        first = int(np.ceil(start))
        last = min(len(out), first + length[k])
        z = np.exp(pole[k])
        for block in range(first, last, RINGING_STEP):
            power = amplitude[k] * np.exp(pole[k] * (block - start))
            for n in range(block, min(block + RINGING_STEP, last)):
                out[n] += power.real
                power *= z


@njit(nogil=True)
def _level(out, start, sr, modes, length):
    """Add modes with ω(t) and d(t) that depend on the mode's level."""
    omega, decay, amplitude, bend, damping_growth, power = modes
    for k in range(len(omega)):
        first = int(np.ceil(start))
        last = min(len(out), first + length[k])
        c, d = damping_growth[k], decay[k]
        share = c / (1.0 + c)
        size, angle = abs(amplitude[k]), np.angle(amplitude[k])
        for block in range(first, last, RINGING_STEP):
            fall, step = np.exp(-d * (block - start) / sr), np.exp(-d / sr)
            for n in range(block, min(block + RINGING_STEP, last)):
                t = (n - start) / sr
                if abs(share) < 1e-4:
                    level = fall
                    area = (1.0 - fall * fall) / (2.0 * d) if d > 0 else t
                elif power == 2.0:
                    rest = 1.0 + c - c * fall * fall
                    level = fall / np.sqrt(rest)
                    area = np.log(rest) / (2.0 * d * c)
                else:
                    u = 1.0 / fall
                    level = 1.0 / ((1.0 + c) * u - c)
                    area = (
                        np.log(u * (1.0 - share) / (u - share)) / share**2
                        - 1.0 / (share * (u - share))
                        + 1.0 / (share * (1.0 - share))
                    ) / (d * (1.0 + c) ** 2)
                out[n] += size * level * np.cos(angle + omega[k] * (t + bend[k] * area))
                fall *= step


def sounded(ring: Ring, impact: Impact, n: int, sr: int) -> Array:
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
            _linear(out, delay * sr, pole[~bent], (share * a)[~bent].astype(complex), length[~bent])
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
            _level(out, delay * sr, float(sr), modes, length[bent])
    return out


def direct_as_expected(observed: ObjectEvidence) -> Array:
    """Synthesize single hits (s, n) of the lines' own frequencies and decays, and the model's amplitudes."""
    return single_hits(observed, observed.freq_hz, np.nan_to_num(observed.decay_per_s), observed.expected)


def single_hits(observed: ObjectEvidence, freq_hz: Array, decay_per_s: Array, amplitude: Array) -> Array:
    """Synthesize the strikes (s, n) as single hits, of modes (m,) of amplitudes (s, m)."""
    assert observed.signal is not None
    none, n = np.zeros(len(freq_hz)), observed.signal.shape[1]
    once = Impact(1.0, np.zeros(1), np.ones(1))
    rings = (Ring(freq_hz, decay_per_s, row, none, none, none) for row in amplitude)
    return np.stack([sounded(ring, once, n, observed.sr) for ring in rings])
