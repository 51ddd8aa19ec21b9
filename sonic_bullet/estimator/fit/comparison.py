"""Recording and synthesis at the fitted parameters, compared over the fitted strikes: by the paper's hybrid metric and
by log spectra.

    Π = Π_psycho/|Π_MRP|                                                    [Ren, Yeh, Lin 2013, eq. 27; metric.py]
    D in dB, where either stands above the noise                            [log_spectral.py]

Π here is taken with everything the fit found: modes corrected for the mesh, in the phase that the sensor starts them
with.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.estimator.fit.case_fit import ObjectFit
from sonic_bullet.estimator.fit.prediction_of_lines import lines_sound, predicted
from sonic_bullet.estimator.lines.joint_lines import Lines
from sonic_bullet.estimator.lines.line_values import Features
from sonic_bullet.estimator.lines.log_spectral import floor_of, log_spectral_db, with_noise
from sonic_bullet.estimator.perceptual.metric import hybrid_of_modes, target
from sonic_bullet.records.errors import RecordError


def hybrid_of(objects: tuple[ObjectFit, ...], gain: float) -> float:
    """Mean Π over the fitted strikes of known place, full scale standing for 94 dB SPL; -1 where there is nothing to
    compare.
    """
    found = []
    for o in objects:
        e = o.evidence
        if e.signals is None or e.seen is None or not len(o.freq_hz):
            continue
        start = e.seen.start(o.freq_hz, o.decay_per_s)
        for i in np.flatnonzero(e.seen.known):
            try:
                aim = target(lines_features(e.lines, int(i), e.sr), e.signals[i])
            except RecordError:  # too quiet or too short for an image
                continue
            # Re A e^{iωt} = Im iA e^{iωt}, and the metric's modes are sines
            found.append(hybrid_of_modes(aim, o.freq_hz, o.decay_per_s, 1j * gain * o.pattern[i] * start))
    return float(np.mean(found)) if found else -1.0


def lines_features(lines: Lines, i: int, sr: int) -> Features:
    """The lines of recording i as features, strongest first. Lines it does not sound are left out."""
    size = np.abs(lines.amplitude[i])
    order = np.argsort(-size, kind="stable")
    order = order[size[order] > 0]
    return Features(
        freq_hz=lines.freq_hz[order],
        decay_per_s=np.maximum(np.nan_to_num(lines.decay_per_s[order]), 0.0),
        amplitude=size[order],
        phase_rad=np.angle(lines.amplitude[i][order]) + np.pi / 2,
        freq_sd_hz=lines.freq_sd_hz[order],
        decay_sd_per_s=lines.decay_sd_per_s[order],
        amplitude_sd=lines.amplitude_sd[i][order],
        onset_s=0.0,
        noise_dbfs=float(20 * np.log10(max(float(lines.noise[i]), 1e-15))),
        sr=sr,
    )


def log_spectral_of(objects: tuple[ObjectFit, ...], gain: float) -> float:
    """Mean log-spectral distance in dB of recording and synthesis over the fitted strikes; -1 where there is nothing to
    compare.
    """
    found = []
    for o in objects:
        e = o.evidence
        if e.signals is None or e.seen is None:
            continue
        for i in np.flatnonzero(e.seen.known):
            made = predicted(o, o.pattern[i], gain, e.signals.shape[1], e.sr)
            floor = floor_of(e.signals[i] - lines_sound(e.lines, int(i), len(made), e.sr))
            found.append(log_spectral_db(e.signals[i], with_noise(made, floor, int(i)), floor))
    found = [f for f in found if np.isfinite(f)]
    return float(np.mean(found)) if found else -1.0
