"""How `foreign-mode` is looked for.

Identified by lines that belong to no mode and whose amplitude goes with the impulse, not with a mode shape.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.lab.effects.common.reverberant_tail import FRAME_S
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.records import Array

LOUD_FOREIGN = 0.02  # of the strongest line's amplitude
APART_FROM_MODES = 0.004  # of a frequency, relative: from a mode of the body


def propose_foreign_mode(evidence: Evidence) -> ForeignMode | None:
    """Take the strongest lines that are no modes and follow the impulse; None where there are none."""
    most = 8
    rows = [row for h in evidence.observed for row in _steady(h)]
    rows.sort(key=lambda r: -r[2])
    if not rows:
        return None
    kept = sorted(rows[:most])
    return ForeignMode(*(tuple(float(r[i]) for r in kept) for i in range(4)))


def _steady(h: ObjectEvidence) -> list[tuple[float, float, float, float]]:
    """Find the lines (f, d, a, φ) that follow the impulse alone."""
    steady = 0.12  # relative scatter of |A|/J over the strikes, rms
    if len(h.foreign_hz) == 0 or len(h.impulse_n_s) < 2 or h.signal is None:
        return []
    level = h.level_n_s
    per = h.foreign_amplitude / level[:, None]
    size = np.abs(per)
    weight = (level[:, None] / np.maximum(h.foreign_sd, 1e-12)) ** 2
    mean = (weight * size).sum(axis=0) / weight.sum(axis=0)
    sd = h.foreign_sd / level[:, None]
    loose = np.sqrt(
        (np.maximum((size - mean) ** 2 - 9 * sd**2, 0) * weight).sum(axis=0) / weight.sum(axis=0)
    ) / np.maximum(mean, 1e-300)
    lean = _against_level(size, sd, level)
    strongest = max(float(np.abs(h.amplitude).max(initial=0.0)), 1e-300)
    loud = (mean * level.max() > LOUD_FOREIGN * strongest) & (mean * level.max() > 30 * np.median(h.foreign_sd))
    coherent = (
        np.abs((weight * per).sum(axis=0)) / np.maximum((weight * size).sum(axis=0), 1e-300)
        if h.signed
        else np.ones(len(mean))
    )
    apart = np.ones(len(mean), bool)
    if h.model is not None and len(h.freq_hz):
        apart = np.abs(np.log(h.foreign_hz[:, None] / h.freq_hz)).min(axis=1) > APART_FROM_MODES
    good = loud & apart & (loose < steady) & (coherent > 0.9) & (np.abs(lean) < 0.25)
    if h.dry:  # a room makes several lines of one, and read outside it, in short frames, each is that one
        good &= _alone(h.foreign_hz, np.where(good, mean, 0.0))
    phase = np.angle((weight * per).sum(axis=0))
    return [(h.foreign_hz[k], max(h.foreign_decay_per_s[k], 0.0), mean[k], phase[k]) for k in np.flatnonzero(good)]


def _alone(freq_hz: Array, size: Array) -> Array:
    """Select the lines (k,) that represent their neighbours: the loudest first, none within reach of a selected one."""
    found = np.zeros(len(freq_hz), bool)
    for k in np.argsort(-size, kind="stable"):
        found[k] = not (found & (np.abs(freq_hz - freq_hz[k]) < max(APART_FROM_MODES * freq_hz[k], 1 / FRAME_S))).any()
    return found


def _against_level(size: Array, sd: Array, level: Array) -> Array:
    """Compute the slope (k,) of ln |A|/J against ln J; 0 where the strikes have one strength."""
    x = np.log(level) - np.log(level).mean()
    if np.ptp(x) < 0.3:
        return np.zeros(size.shape[1])
    y = np.log(np.maximum(size, 1e-300))
    w = 1 / (np.maximum(sd / np.maximum(size, 1e-300), 0.01) ** 2)
    xm = (w * x[:, None]).sum(axis=0) / w.sum(axis=0)
    ym = (w * y).sum(axis=0) / w.sum(axis=0)
    return np.asarray(
        (w * (x[:, None] - xm) * (y - ym)).sum(axis=0) / np.maximum((w * (x[:, None] - xm) ** 2).sum(axis=0), 1e-300)
    )
