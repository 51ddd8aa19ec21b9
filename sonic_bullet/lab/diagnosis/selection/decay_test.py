"""Test of candidate effects by lines' decays where strikes do not decide.

With a room by lines left out, and between two effects that strikes do not separate by all lines.

    2 Δ ln L = Σ_k ρ(z_k without) − ρ(z_k with),   z_k = ln(d_k / d of its modes) / spread,
        ρ Cauchy's, over the lines that a fold had left out, each counted once

A room's response has a tap for every sample. Identified from the strikes, it takes up what a law of damping does to
every line, on strikes that were left out as well: a line is as narrow as what a response can bend. But lines are
dereverberated, each by its own baseband (lab/effects/common/reverberant_tail.py), before there is any response; a law
fitted to three lines in four must hold for the fourth.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.protocol import Dereverberates, Effect, Stage
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, moves_itself
from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions
from sonic_bullet.lab.effects.common.line_likelihood import decay_misfit
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.records import Array


def of_decays(h: Hypothesis, effect: Effect) -> bool:
    """Decide whether an effect changes decays, and leaves modes where they are."""
    return effect.stage is Stage.MODES and not moves_itself(h, effect)


def parameter_count(effect: Effect) -> int:
    """Count the numbers that an effect adds to a model: a law in Rayleigh's place removes α and β."""
    return effect.freedom() - 2 * effect.traits.replaces_rayleigh


def tells(h: Hypothesis, effect: Effect) -> bool:
    """Decide whether lines are used instead of strikes: for what changes decays, with a room."""
    return any(isinstance(e, Dereverberates) for e in h.effects) and of_decays(h, effect)


def misfit(made: Predictions, effect: Effect, evidence: Evidence) -> float:
    """Compute twice −ln likelihood of all lines' decays by a model, plus ln n a number of its effect [Schwarz 1978]."""
    total, count = 0.0, 0
    for one in evidence.observed:
        good = _has_decay(one)
        total += float(_cost(made, one)[good].sum())
        count += int(good.sum())
    return total + parameter_count(effect) * float(np.log(max(count, 1)))


def _has_decay(one: ObjectEvidence) -> Array:
    """Decide which lines (k,) have a decay."""
    return np.asarray(np.isfinite(one.decay_per_s) & (one.decay_per_s > 0) & ~np.isposinf(one.decay_sd_per_s))


def likelier(without: Predictions, augmented: Predictions, every: Evidence, training: Evidence) -> float:
    """Compute twice the gain in ln likelihood of the decays that were left out.

    Parameters
    ----------
    without, augmented : Predictions
        By the hypotheses without the effect and with it.
    every, training : Evidence
        The whole, and that to which both were fitted.
    """
    total = 0.0
    for one in every.observed:
        seen = next((h.freq_hz for h in training.observed if h.source is one.source), one.freq_hz[:0])
        out = ~np.isin(one.freq_hz, seen) & _has_decay(one)
        total += float(_cost(without, one)[out].sum() - _cost(augmented, one)[out].sum())
    return total


def _cost(made: Predictions, one: ObjectEvidence) -> Array:
    """Compute ρ (k,) of lines' decays (k,) against those of their modes."""
    per_s = next(p.model.decay_per_s for body, p in made.items() if body.recorded is one.source)
    model = np.array([per_s[m].mean() for m in one.mode])
    return decay_misfit(one.decay_per_s, one.decay_sd_per_s, model)
