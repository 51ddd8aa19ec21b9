"""Single hits of an object's strikes, synthesized from its lines: what a search holds recordings against."""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.common.ringing import synthesize_ring
from sonic_bullet.effects.protocol import Impact, Ring
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array


def direct_as_expected(observed: ObjectEvidence) -> Array:
    """Synthesize single hits (s, n) of the lines' own frequencies and decays, and the model's amplitudes."""
    return single_hits(observed, observed.freq_hz, np.nan_to_num(observed.decay_per_s), observed.expected)


def single_hits(observed: ObjectEvidence, freq_hz: Array, decay_per_s: Array, amplitude: Array) -> Array:
    """Synthesize the strikes (s, n) as single hits, of modes (m,) of amplitudes (s, m)."""
    assert observed.signal is not None
    none, n = np.zeros(len(freq_hz)), observed.signal.shape[1]
    once = Impact(1.0, np.zeros(1), np.ones(1))
    rings = (Ring(freq_hz, decay_per_s, row, none, none, none) for row in amplitude)
    return np.stack([synthesize_ring(ring, once, n, observed.sr) for ring in rings])
