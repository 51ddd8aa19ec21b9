"""Whether takes of two states are the same strikes, recorded twice.

    γ²_p = |Σ_i A_i* B_p(i)|²/(Σ |A_i|² Σ |B_p(i)|²),  of thirds of octaves, over partnerships p of the takes
        [Bendat & Piersol 2010, eq. 5.51: coherence, of segments that are takes]

Of the same strikes one filter makes every B of its A, so that partners by name cohere more than any others, in nearly
every band. Of different strikes partners by name are as good as others: each band's best is theirs by chance once in p.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.states.recorded_states import State


def are_same_strikes(before: State, after: State) -> bool:
    """Say whether takes of equal names are recordings of the same strikes."""
    heard_s, chance = 1.0, 1e-4
    from scipy.stats import binom

    names = [take.name for take in before.takes]
    if len(names) < 3 or sorted(names) != sorted(take.name for take in after.takes):
        return False
    by_name = {take.name: take for take in after.takes}
    n = min(min(len(take.signal) for take in (*before.takes, *after.takes)), round(heard_s * before.sr))
    fade = np.hanning(2 * n)[n:]
    a = np.array([np.fft.rfft(take.signal[:n] * fade) for take in before.takes])
    b = np.array([np.fft.rfft(by_name[name].signal[:n] * fade) for name in names])
    freq = np.fft.rfftfreq(n, 1 / before.sr)
    shuffled = [p for p in permutations(range(min(len(names), 6))) if p != tuple(range(len(p)))][:119]
    best = seen = 0
    for middle in 100.0 * 2.0 ** (np.arange(22) / 3):
        inside = (freq > middle * 2 ** (-1 / 6)) & (freq < middle * 2 ** (1 / 6))
        if inside.sum() < 8:
            continue
        seen += 1
        own = _coherence(a[:, inside], b[:, inside])
        best += all(own > _coherence(a[: len(p), inside], b[list(p)][:, inside]) for p in shuffled)
    others = len(shuffled) + 1
    return bool(seen and binom.sf(best - 1, seen, 1 / others) < chance and best > seen / 2)


def _coherence(a: Array, b: Array) -> float:
    """Coherence over takes (s, f), its mean over frequency weighed by power."""
    cross = np.abs((np.conj(a) * b).sum(axis=0)) ** 2
    whole = (np.abs(a) ** 2).sum(axis=0) * (np.abs(b) ** 2).sum(axis=0)
    return float(cross.sum() / max(float(whole.sum()), 1e-300))
