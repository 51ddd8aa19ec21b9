"""A signal's next sample from those before it: x̂(t) = −Σ_j a_j x(t − j), by Burg's method, whose recursion is stable.

A sum of k ringing modes obeys such a recursion of 2k terms exactly [Prony 1795], and steady noise stays steady when it
is filtered. References: J. P. Burg, Maximum Entropy Spectral Analysis (1975); Kay & Marple, Proc. IEEE 69 (1981), eq.
2.70–2.74.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def prediction_error_filter(signal: Array, order: int) -> Array:
    """Coefficients (order + 1,), the first 1, of the filter that leaves of a signal (n,) what was not predictable."""
    forward, backward, found = signal[1:].astype(float), signal[:-1].astype(float), np.ones(1)
    for _ in range(min(order, len(signal) - 1)):
        power = float(forward @ forward + backward @ backward)
        if power <= 0:
            break
        k = -2 * float(forward @ backward) / power
        found = np.concatenate([found, [0.0]]) + k * np.concatenate([[0.0], found[::-1]])
        forward, backward = (forward + k * backward)[1:], (backward + k * forward)[:-1]
    return found


def predicted_on(signal: Array, order: int, count: int) -> Array:
    """Predict what follows (count,) a signal (n,) by its own recursion."""
    terms = prediction_error_filter(signal, order)[:0:-1]
    known = len(terms)
    if not known or not count:
        return np.zeros(count)
    found = np.concatenate([signal[-known:], np.zeros(count)])
    # step by step: powers of the recursion grow beyond what rounding leaves of tones; scipy.signal takes 0.5 s to load
    for at in range(count):
        found[at + known] = -(terms @ found[at : at + known])
    return found[known:]
