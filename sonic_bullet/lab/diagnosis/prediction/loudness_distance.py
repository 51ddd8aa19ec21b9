"""Psychoacoustic distance: by how much each band is louder or softer, in sone.

    Σ over bands |N'_recorded − N'_played|, mean over frames in which the recording is audible
        [N': estimator.loudness, ISO 226; bands: Bark]

Full scale stands for FULL_SCALE dB SPL: recordings have no level of their own.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, Comparable
from sonic_bullet.records.errors import RecordError
from sonic_bullet.signal.log_spectral import with_noise
from sonic_bullet.signal.perceptual.image import loudness_levels


def sone_distance(takes: Comparable, made: Predictions) -> float | None:
    """Compute the mean distance of the takes from a prediction in sone; None where none is audible."""
    levels = 2
    found = []
    full_scale = 90.0
    observed_sone = 0.05  # sone
    for take in (t for t in takes if isinstance(t, AudioObservation)):
        played = with_noise(take.synthesize(made[take.body]), take.floor, take.strike)
        try:
            a, b = (
                loudness_levels(x, take.sr, 0.0, full_scale, levels=levels, bark_step=1.0)
                for x in (take.sample, played)
            )
        except RecordError:
            continue
        for one, two in zip(a, b, strict=False):
            observed = one.loud.sum(axis=1) > observed_sone
            if observed.any():
                found.append(float(np.abs(one.loud - two.loud).sum(axis=1)[observed].mean()))
    return float(np.mean(found)) if found else None
