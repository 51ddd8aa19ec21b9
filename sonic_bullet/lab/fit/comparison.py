"""Recording and synthesis at the fitted parameters, compared over the fitted strikes by log spectra.

D in dB, where either stands above the noise                            [log_spectral.py]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.fit.case_fit import ObjectFit
from sonic_bullet.lab.fit.prediction_of_lines import lines_sound, predict_sound
from sonic_bullet.signal.log_spectral import floor_of, log_spectral_db, with_noise


def log_spectral_of(objects: tuple[ObjectFit, ...], gain: float) -> float:
    """Return the mean distance in dB of recording and synthesis over the fitted strikes; -1 with nothing to compare."""
    found = []
    for o in objects:
        e = o.evidence
        if e.signals is None or e.seen is None:
            continue
        for i in np.flatnonzero(e.seen.known):
            made = predict_sound(o, o.pattern[i], gain, e.signals.shape[1], e.sr)
            floor = floor_of(e.signals[i] - lines_sound(e.lines, int(i), len(made), e.sr))
            found.append(log_spectral_db(e.signals[i], with_noise(made, floor, int(i)), floor))
    found = [f for f in found if np.isfinite(f)]
    return float(np.mean(found)) if found else -1.0
