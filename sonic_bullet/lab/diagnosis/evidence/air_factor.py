"""Factor on what a case's bodies lose to the air by their shapes: one for all, from the lines' decays."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.robust import cauchy_weight

RADIATED_SD = 0.2
"""Relative: how far what a body radiates is computed off, median 0.5 dB of boundary elements and 2 dB at most where it
counts (docs/measured/radiation.md), with what dimensions and modes' frequencies are off by."""


def air_factor(lam: Array, decay: Array, sd: Array, radiated: Array) -> float:
    """Fit decays (k,) by α, β and a factor on what modes radiate, 1 ± `RADIATED_SD`; Cauchy's weights.

    d = ½α + ½βλ + s Δd
    """
    from scipy.optimize import nnls

    good = np.isfinite(decay) & np.isfinite(radiated) & np.isfinite(sd) & (sd > 0)
    if not good.any():
        return 1.0
    column = np.stack([np.full(good.sum(), 0.5), 0.5 * lam[good], radiated[good]], axis=1) / sd[good, None]
    scale = np.append(1 / np.maximum(np.linalg.norm(column[:, :2], axis=0), 1e-300), 1.0)
    prior, y, weight = np.array([[0.0, 0.0, 1 / RADIATED_SD]]), decay[good] / sd[good], np.ones(good.sum())
    value = scale
    for _ in range(20):
        root = np.sqrt(weight)
        value, _ = nnls(np.vstack([column * scale * root[:, None], prior]), np.append(y * root, 1 / RADIATED_SD))
        weight = cauchy_weight(((y - column @ (value * scale)) / 2) ** 2)
    return float(np.clip(value[2], 1 - 3 * RADIATED_SD, 1 + 3 * RADIATED_SD))
