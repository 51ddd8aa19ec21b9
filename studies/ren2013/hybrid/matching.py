"""How well two sets of damped sinusoids match, whichever belongs to whichever: the match ratio product.

    X(f) = c_z Z(f),  Y(d) = c_d/d,  D² = (X_i − X_j)² + (Y_i − Y_j)²                  [Ren, Yeh, Lin 2013, eq. 20-22]
    R(φ_i, Φ̃) = Σ_j u_ij k_ij / Σ_j u_ij,   R(Φ, Φ̃) = Σ_i w_i R(φ_i, Φ̃) / Σ_i w_i,   Π_MRP = −R R̃       [eq. 23-26]

The paper's appendix B with the forms of k, w, u and the constants is not to be had. Here, and not to be mistaken for
theirs:

    k = 1/(1 + D²),   u_ij = w_j/(D² + δ²)²,   w = (a²/4d)^p

k is 1 for coincidence and has a slope far away, where a search starts; u lets the nearest decide without a switch, so
that R is 1 to about δ⁴ where a point is met exactly; w is the mode's energy to Stevens' exponent of loudness. c_d is in
units of the recording's own energy-weighted median decay rate: one unit of Y is one of its typical durations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from sonic_bullet.lab.lines.line_values import Features, energy
from sonic_bullet.records import Array
from sonic_bullet.signal.perceptual.loudness import bark

AUDIBLE_HZ = (20.0, 20000.0)


class Points(NamedTuple):
    """The recording's side. x, y, weight (k,); per_bark c_z; per_s c_d; near δ; power p."""

    x: Array
    y: Array
    weight: Array
    per_bark: float
    per_s: float
    near: float
    power: float


def points(
    features: Features, *, per_bark: float = 4.0, per_duration: float = 1.0, near: float = 0.1, power: float = 0.3
) -> Points:
    """The recording's features in the plane of X and Y, for `match_ratio_product`."""
    weight = energy(features.decay_per_s, features.amplitude)
    order = np.argsort(features.decay_per_s)
    middle = order[np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum())]
    per_s = per_duration * max(float(features.decay_per_s[middle]), 1e-3)
    decay = np.maximum(features.decay_per_s, 1e-3)
    return Points(per_bark * bark(features.freq_hz), per_s / decay, weight**power, per_bark, per_s, near, power)


def match_ratio_product(reference: Points, freq_hz: Array, decay_per_s: Array, amplitude: Array) -> float:
    """Π_MRP in −1 … 0; modes (m,) that are mute or outside 20 Hz … 20 kHz take no part; 0 where none is left.

    Source: eq. 26.
    """
    return float(_product(reference, freq_hz, decay_per_s, amplitude))


@njit(nogil=True, error_model="numpy")
def _product(reference, freq_hz, decay_per_s, amplitude):  # type: ignore[no-untyped-def]
    x, y, weight, per_bark, per_s, near, power = reference
    near_square = near * near
    known, modes = len(x), len(freq_hz)
    top, bottom = np.zeros(known), np.zeros(known)
    there_sum, there_weight = 0.0, 0.0
    for j in range(modes):
        if amplitude[j] == 0 or freq_hz[j] < AUDIBLE_HZ[0] or freq_hz[j] > AUDIBLE_HZ[1]:
            continue
        decay = max(decay_per_s[j], 1e-3)
        own = (amplitude[j] ** 2 / (4 * decay)) ** power
        at_x, at_y = per_bark * 6 * np.arcsinh(freq_hz[j] / 600), per_s / decay
        own_top, own_bottom = 0.0, 0.0
        for i in range(known):
            apart = (x[i] - at_x) ** 2 + (y[i] - at_y) ** 2
            score = 1 / (1 + apart)
            nearness = 1 / (apart + near_square) ** 2
            top[i] += own * nearness * score
            bottom[i] += own * nearness
            own_top += weight[i] * nearness * score
            own_bottom += weight[i] * nearness
        there_sum += own * own_top / own_bottom
        there_weight += own
    if there_weight == 0:
        return 0.0
    here_sum, here_weight = 0.0, 0.0
    for i in range(known):
        here_sum += weight[i] * top[i] / bottom[i]
        here_weight += weight[i]
    return -(here_sum / here_weight) * (there_sum / there_weight)
