"""Relative levels of strikes of unknown impulse: their lines over the model's.

ln l_s = median over k of ln |A_sk| / (σ |ψ_sk|), each line weighted by its amplitude over its spread
    over their mean where no impulse of the body is known: then l is relative
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.lab.diagnosis.prediction.prediction import pattern
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.signal.robust import weighted_median


def with_levels(body: StruckBody, gain: float) -> StruckBody:
    """Estimate the levels of a body's fitted strikes of unknown impulse; see `Struck.level_n_s`."""
    most_spreads = 100.0  # By which a line stands over its spread, and weighs more no longer
    recorded = body.recorded
    unknown = ~np.isfinite(body.impulse_n_s)
    if recorded is None or recorded.signals is None or not unknown[body.fitted].any():
        return body
    lines, rows = recorded.lines, np.abs(pattern(body, body.model))
    at = np.unique(body.line[body.line >= 0])
    level = np.full(body.strikes, np.nan)
    for i, strike in enumerate(body.fitted):
        if not unknown[strike]:
            continue
        played = gain * np.array([rows[strike, body.line == k].sum() for k in at])
        size, sd = np.abs(lines.amplitude[i, at]), np.nan_to_num(lines.amplitude_sd[i, at])
        good = (played > 0) & (size > sd)
        if good.any():
            ratio, weight = (
                np.log(size[good] / played[good]),
                np.minimum(size[good] / (sd[good] + 1e-300), most_spreads),
            )
            level[strike] = weighted_median(ratio, weight)
    if not np.isfinite(level).any():
        return body
    if unknown.all():
        level -= np.nanmean(level)
    return replace(body, relative=np.where(np.isfinite(level), np.exp(level), 1.0))
