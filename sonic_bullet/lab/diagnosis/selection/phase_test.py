"""Choice between two effects that strikes do not separate: the one whose lines agree in phase, too.

    A_sk ≈ σ E_sk e^{−iω_k t₀}
        E: onset amplitudes of the modes under a hypothesis, its pulse and sound path included; σ, t₀ free

A distance of spectra in dB does not depend on phases, and a pulse and a low-pass filter of its width have the same
magnitudes below its first zero. But a pulse is symmetric about its middle, so all it does to phases is a delay, and a
filter's phase bends [Oppenheim & Schafer 2010, ch. 5.1: generalized linear phase].
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.diagnosis.evidence.effect_evidence import object_evidence
from sonic_bullet.lab.diagnosis.evidence.refit import ROUGH_LINES
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, predict_fitted
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.lab.effects.common.line_likelihood import fit_gain

DELAYS_S = np.arange(-4e-4, 4.01e-4, 1e-5)


def misfit(h: Hypothesis, bodies: tuple[StruckBody, ...]) -> float:
    """Compute twice the negative log likelihood (Cauchy) of all objects' onset amplitudes, with true phases.

    Infinite where a strike hits more than once.
    """
    return sum(_misfit(p) for p in predict_fitted(h, bodies).values())


def _misfit(p: Prediction) -> float:
    """Compute the same of one object."""
    one = object_evidence(p, sounds=False)
    expected, seen = one.expected, one.amplitude
    if any(len(p.impact(i).delay_s) > 1 for i in p.body.fitted):
        return np.inf  # a line's amplitude at the onset is of one hit
    # whatever is expected there, so that all effects are held against the same
    good = np.isfinite(seen) & np.isfinite(one.amplitude_sd)
    expected = np.nan_to_num(expected)
    if not good.any() or not np.abs(expected[good]).any():
        return 0.0
    rough = np.broadcast_to(ROUGH_LINES * np.abs(expected).max(axis=0, keepdims=True), expected.shape)[good]
    omega = np.broadcast_to(one.omega, expected.shape)[good]
    x, y, sd = expected[good], seen[good], one.amplitude_sd[good]
    if not one.signed:
        return fit_gain(np.abs(y), np.abs(x), sd, rough, 1.0).misfit

    def at(delay_s: float) -> float:
        return fit_gain(y, x * np.exp(-1j * omega * delay_s), sd, rough, 1.0).misfit

    return search_number(at, DELAYS_S)[0]
