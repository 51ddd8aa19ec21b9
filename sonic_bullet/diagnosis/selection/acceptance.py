"""A candidate effect after cross-validation, and the decision whether it is accepted.

Accepted is what gains, on strikes left out, in the mean, each by the record of thresholds (thresholds.py):

    more than is needed
        least_drop_db, and least_drop_share of the gap; less where nothing is found yet and the gap is narrow
    significantly more than nothing         standard_errors; or none of many_strikes loses, two of them gaining as much
    significantly more than a control       an effect of as many numbers that means nothing

Of more than many_strikes strikes that gain much one may be odd. What depends on amplitude may be shown by the loudest
strikes alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.diagnosis.selection.thresholds import RULES
from sonic_bullet.effects.protocol import Effect


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
        the loudest_strikes alone where it gains on none of those.
    whole_db : float
        Mean with that gain, by which candidates are ordered.
    control_db : float
        Mean gain of control effects over strikes and draws.
    spread : dict
        Of each number in its parameters over the folds (jackknife).
    lines : float
        Gain in likelihood of lines left out (decay_test.py).
    impulse_n_s : (s,)
        Of the strikes.
    why_not : str
        The rule that kept it out in its last round; empty of what was accepted.
    """

    id: str
    effect: Effect
    hypothesis: Hypothesis
    drop_db: np.ndarray[Any, Any]
    whole_db: float
    control_db: float
    spread: dict[str, Any]
    lines: float = 0.0
    impulse_n_s: np.ndarray[Any, Any] = field(default_factory=lambda: np.zeros(0))
    why_not: str = ""

    @property
    def mean_db(self) -> float:
        """Compute the mean gain."""
        return mean(self.drop_db)

    @property
    def certain(self) -> bool:
        """Decide whether lines agreed on it before it was proposed (see needed)."""
        return self.effect.traits.certain

    @property
    def loud(self) -> bool:
        """Decide whether the strike that gains most is one of the loudest_strikes."""
        return (
            len(self.impulse_n_s) == len(self.drop_db)
            and int(self.drop_db.argmax()) in np.argsort(-self.impulse_n_s)[: RULES.loudest_strikes]
        )

    @property
    def sd_db(self) -> float:
        """Compute the standard error of the mean gain."""
        return float(self.drop_db.std(ddof=1) / np.sqrt(len(self.drop_db))) if len(self.drop_db) > 1 else float("inf")


def mean(x: Sequence[float] | np.ndarray[Any, Any]) -> float:
    """Compute the mean, 0 of none."""
    return float(np.mean(x)) if len(x) else 0.0


def needed(gap_db: float, *, first: bool, certain: bool = False) -> float:
    """Compute the gain in dB that a candidate needs.

    It is least_drop_db; less where that is most of what has ever been open, more where much is, as the little that an
    effect leaves of a wide gap may be its own fit's.

    Parameters
    ----------
    gap_db : float
        What is open.
    first : bool
        No effect is found yet.
    certain : bool
        Lines agreed on it, each by its own frames, before it was proposed; then strikes left out need only agree, too.
    """
    faint, share = (RULES.certain_drop_db, RULES.certain_share) if certain else (RULES.faint_drop_db, RULES.most_share)
    return max(
        min(RULES.least_drop_db, max(faint, share * gap_db)) if first else RULES.least_drop_db,
        RULES.least_drop_share * gap_db,
    )


def accepted(c: Candidate, gap_db: float, *, first: bool) -> bool:
    """Decide whether a candidate explains enough, significantly, and more than chance; first: see needed."""
    return not refusal(c, gap_db, first=first)


def refusal(c: Candidate, gap_db: float, *, first: bool) -> str:
    """Return why a candidate is not accepted; empty where it is. first: see needed."""
    if len(c.drop_db) == 0:
        return "no strike could be left out"
    need = needed(gap_db, first=first, certain=c.certain)
    if not (c.mean_db > need and np.isfinite(c.sd_db)):
        return f"strikes left out must come {need:.2f} dB nearer"
    more = c.whole_db - max(c.control_db, 0.0)  # a control effect is not held against corrections either
    chance = "" if more > RULES.most_share * need else "chance comes as near"
    drop = np.sort(c.drop_db)
    if c.certain and c.loud and -np.minimum(drop, 0).sum() < RULES.lost_share * drop[-1]:
        # what goes with level is for the loudest to show, which these others were fitted without
        return chance
    if len(drop) > RULES.many_strikes and drop[1:].mean() > RULES.odd_strike_factor * max(
        need, needed(gap_db, first=first)
    ):
        drop = drop[1:]  # one strike may be odd: what it alone shows, none of the others did
    sd = float(drop.std(ddof=1) / np.sqrt(len(drop)))
    if (
        len(drop) >= RULES.many_strikes
        and drop[0] > -RULES.lost_share * drop.mean()
        and (drop[-2] > need or (first and c.certain and c.loud))
    ):
        # no strike speaks against it, though loud ones may gain far more than soft ones
        return chance
    if not drop.mean() > RULES.standard_errors * sd:
        return f"less than {RULES.standard_errors:g} standard errors"
    return chance or ("" if more > RULES.standard_errors * sd else "chance comes as near")


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
            found[name] = _spread(np.array(values, float))
        elif all(isinstance(v, list) for v in values):
            try:
                table = np.array(values, float)
            except (ValueError, TypeError):
                continue
            found[name] = np.apply_along_axis(_spread, 0, table).tolist()
    return found


def _spread(x: np.ndarray[Any, Any]) -> float:
    """Compute the jackknife's standard error of values (n,)."""
    n = len(x)
    return float(np.sqrt((n - 1) / n * ((x - x.mean()) ** 2).sum()))
