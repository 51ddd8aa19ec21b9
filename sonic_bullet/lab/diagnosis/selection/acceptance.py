"""A candidate effect after cross-validation, and the decision whether it is accepted.

Gains g_s in dB of strikes s that were left out, gaps G_s that were open there; a physical effect closes one share R of
every gap, chance none:

    2 Δ ln L = n ln(Σ g² / Σ (g − R G)²),   R = Σ g G / Σ G²        (normal errors of unknown variance)

Accepted is what speaks so much for itself as strong_evidence, gains more than least_drop_db and same_share of the whole
gap, and more than a control effect of as many numbers, which means nothing. A strike is one observation, however many
cells its spectrum has: cells of one strike err together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sonic_bullet.effects.protocol import Effect
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A candidate effect after cross-validation.

    Attributes
    ----------
    id : str
        Of the effect.
    effect : Effect
        Fitted to all evidence; axes of degenerate pairs are from all fitted strikes in every fold, too.
    hypothesis : Hypothesis
        With the effect.
    drop_db : (s,)
        Gain in the distance of each left-out strike, less the gain of corrections learnt again where it moves modes; of
        the two loudest strikes alone where it gains on none of those.
    whole_db : float
        Mean with that gain, by which candidates are ordered.
    control_db : float
        Mean gain of control effects over strikes and draws.
    spread : dict
        Of each number in its parameters over the folds (jackknife).
    lines : float
        Gain in likelihood of lines left out (decay_test.py).
    gap_db : (s,)
        What was open at each strike; (1,) where that is the same.
    why_not : str
        The rule that kept it out in its last round; empty of what was accepted.
    """

    id: str
    effect: Effect
    hypothesis: Hypothesis
    drop_db: Array
    whole_db: float
    control_db: float
    spread: dict[str, Any]
    lines: float = 0.0
    gap_db: Array = field(default_factory=lambda: np.ones(1))
    why_not: str = ""

    @property
    def mean_db(self) -> float:
        """Compute the mean gain."""
        return mean(self.drop_db)

    @property
    def sd_db(self) -> float:
        """Compute the standard error of the mean gain."""
        return float(self.drop_db.std(ddof=1) / np.sqrt(len(self.drop_db))) if len(self.drop_db) > 1 else float("inf")


def mean(x: Sequence[float] | Array) -> float:
    """Compute the mean, 0 of none."""
    return float(np.mean(x)) if len(x) else 0.0


def evidence(gain: Array, gap: Array | float = 1.0) -> float:
    """Compute 2 Δ ln L of gains (s,) that are one share of each gap over gains that are nothing, signed as the share.

    That is the likelihood ratio of a regression through the origin; of equal gaps that of Student's t test, n ln(1 +
    t²/(n − 1)) [Lehmann & Romano 2005, section 5.2]. 0 of fewer than two.
    """
    gap = np.broadcast_to(gap, gain.shape)
    size = float(gap @ gap)
    if len(gain) < 2 or not np.isfinite(gain).all() or not size or not gain.any():
        return 0.0
    share = float(gain @ gap) / size
    left = max(float(((gain - share * gap) ** 2).sum()), 1e-12 * float(gain @ gain))
    return float(np.sign(share) * len(gain) * np.log(float(gain @ gain) / left))


def evidence_between(gain: Array, gap: Array | float, of_db: float) -> float:
    """Compute `evidence` for one of two by what it is nearer (s,); 0 where that is less than same_share of of_db.

    Two models fitted to the same lines err alike at all strikes, so these cannot separate what says the same.
    """
    return evidence(gain, gap) if abs(mean(gain)) > RULES.same_share * of_db else 0.0


def gain_needed_db(gap_db: float, open_db: float = np.inf) -> float:
    """Compute the gain in dB that a candidate needs where so much is open.

    Parameters
    ----------
    gap_db : float
        What was open before anything was added: a share of it says something else than what was added.
    open_db : float
        What is open now, beyond the noise. Less than that share may be a second effect: one that closes nearly all of
        it, where what an effect found before leaves of its own is closed by parts.
    """
    return max(RULES.least_drop_db, min(RULES.same_share * gap_db, (1 - RULES.little_share) * max(open_db, 0.0)))


def is_open(open_db: float, gap_db: float) -> bool:
    """Decide whether so much is open that another effect is asked: more than says the same as what was there.

    Beside a gap_db that was large, more than half of what a mesh and its shapes leave of their own.
    """
    return open_db >= min(gain_needed_db(gap_db), RULES.most_share * RULES.suffices_db)


def is_accepted(c: Candidate, gap_db: float) -> bool:
    """Decide whether a candidate explains enough, significantly, and more than chance."""
    return not refusal(c, gap_db)


def refusal(
    c: Candidate, gap_db: float, open_db: float = np.inf, *, least_evidence: float = RULES.strong_evidence
) -> str:
    """Return why a candidate is not accepted; empty where it is. gap_db, open_db: see `gain_needed_db`."""
    if len(c.drop_db) == 0:
        return "no strike could be left out"
    need = gain_needed_db(gap_db, open_db)
    if not c.mean_db > need:
        return f"strikes left out must come {need:.2f} dB nearer"
    if not evidence(c.drop_db, c.gap_db) > least_evidence:
        return f"strikes left out say less than {least_evidence:g} (2 Δ ln L)"
    # a control effect is not held against corrections either
    return "" if c.whole_db - max(c.control_db, 0.0) > RULES.most_share * c.whole_db else "chance comes as near"


def jackknife(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Compute standard errors of every number that all folds give [Efron & Tibshirani 1993, eq. 11.5].

    Numbers in lists of one length each their own.
    """
    if len(rows) < 2:
        return {}
    found: dict[str, Any] = {}
    for name in rows[0]:
        values = [row.get(name) for row in rows]
        if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values):
            found[name] = _jackknife_error(np.array(values, float))
        elif all(isinstance(v, list) for v in values):
            try:
                table = np.array(values, float)
            except (ValueError, TypeError):
                continue
            found[name] = np.apply_along_axis(_jackknife_error, 0, table).tolist()
    return found


def _jackknife_error(x: Array) -> float:
    """Compute the jackknife's standard error of values (n,)."""
    n = len(x)
    return float(np.sqrt((n - 1) / n * ((x - x.mean()) ** 2).sum()))
