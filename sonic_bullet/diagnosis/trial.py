"""Suspects on trial: each fitted without one strike and a part of the lines, judged on that strike; null effects alike.

    for every strike s:  evidence − s − some lines (none, where a suspect has numbers of single lines) -> propose -> refit α, β, σ -> D(s)    against the same without the effect
    null: as many numbers, spent on directions drawn at random in the modes' decays and levels, fitted to the same evidence

an effect earns its keep where its mean drop is over LEAST_DB (where nothing is found yet: FAINT_DB if that is MOST of the gap, CERTAIN_DB if lines are sure of it and that is SAID of the gap) and LEAST_SHARE of the gap,
    SURE standard errors above zero and above the null effect's by as much; of more than MANY strikes that gain much one may be odd; what goes with level may be told by the loudest alone

Leaving out lines matters: decays and shapes belong to the body, so every strike shows them, and a pattern fitted to them by chance would pass.
Corrections of frequencies, and the axes of twins that glide or choke, only mend what a mesh leaves to chance: all fitted strikes tell those, once, and the null has no numbers
for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from sonic_bullet.diagnosis.bodies import Struck
from sonic_bullet.diagnosis.by_lines import likelier, tells
from sonic_bullet.diagnosis.evidence import evidence_of, thinned
from sonic_bullet.diagnosis.judge import Judged, Take
from sonic_bullet.diagnosis.listed import Listed
from sonic_bullet.diagnosis.null import Null
from sonic_bullet.diagnosis.play import TURNS, Hypothesis, bends, moves
from sonic_bullet.diagnosis.refit import refitted, retold
from sonic_bullet.diagnosis.rest import at_rest
from sonic_bullet.effects.values import Effect, Evidence, Stage
from sonic_bullet.side_by_side import side_by_side

KEPT = 0.75  # of the lines, in every fold
DRAWS = 2  # of the null effect
LEAST_DB, LEAST_SHARE = 0.4, 0.08  # of a drop, and of it in the gap
FAINT_DB, MOST = 0.2, 0.5  # of a drop that is as much of the gap: then less than LEAST_DB will do
CERTAIN_DB, SAID = 0.1, 0.25  # of a drop that is as much of the gap, where lines have told of an effect, each by its own baseband
LOUDEST = 2  # strikes, of which what goes with level must gain most
LOST = 0.15  # of what the loudest gains: all that others may lose by what goes with level
SURE, MANY = 2.0, 4  # standard errors; strikes of which none may lose, beside one
NOISE_DB = 0.03  # of a distance, by noise alone
FIRST = 2  # strikes left out, after which a suspect is let go that could not earn its keep if all the others gained all there is
ENOUGH = 2  # names: what little is left beside them is worth no search of half a minute
PLAIN = 0.6  # of the gap: where a cheap suspect says as much, costly ones wait


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A suspect after its trial. effect: fitted to all evidence. drop_db (s,): of each left-out strike's distance, less what corrections learnt again would gain
    alone where the suspect moves modes; of the FIRST alone where those lose more than all the others could gain. whole_db: mean with that in it, which speaks for a name's turn. null_db: mean over strikes and draws.

    Its axes of twins, if it has any, all fitted strikes told. spread: of each number in its parameters over the folds (jackknife). lines: by how much lines left
    out are likelier with it (by_lines.py). impulse_n_s (s,): of the strikes.
    """

    id: str
    effect: Effect
    hypothesis: Hypothesis
    drop_db: np.ndarray[Any, Any]
    whole_db: float
    null_db: float
    spread: dict[str, Any]
    lines: float = 0.0
    impulse_n_s: np.ndarray[Any, Any] = field(default_factory=lambda: np.zeros(0))

    @property
    def mean_db(self) -> float:
        return _mean(self.drop_db)

    @property
    def certain(self) -> bool:
        """Whether its lines are sure of it (see needed)."""
        return getattr(self.effect, "certain", False)

    @property
    def loud(self) -> bool:
        """Whether the strike that gains most is one of the LOUDEST."""
        return len(self.impulse_n_s) == len(self.drop_db) and int(self.drop_db.argmax()) in np.argsort(-self.impulse_n_s)[:LOUDEST]

    @property
    def sd_db(self) -> float:
        """Standard error of the mean."""
        return float(self.drop_db.std(ddof=1) / np.sqrt(len(self.drop_db))) if len(self.drop_db) > 1 else float("inf")


def _mean(x: Sequence[float] | np.ndarray[Any, Any]) -> float:
    return float(np.mean(x)) if len(x) else 0.0


def needed(gap_db: float, *, first: bool, certain: bool = False) -> float:
    """Of a drop, in dB: LEAST_DB; less where that is most of what has ever been open (first: nothing is found yet), more where much is.

    certain: lines agreed on it, each by its own frames, before it was proposed; then strikes left out need only say the same.

    What little a name leaves of a wide gap may be its own fit's.
    """
    faint, share = (CERTAIN_DB, SAID) if certain else (FAINT_DB, MOST)
    return max(min(LEAST_DB, max(faint, share * gap_db)) if first else LEAST_DB, LEAST_SHARE * gap_db)


def earns(c: Candidate, gap_db: float, *, first: bool) -> bool:
    """Whether a suspect explains enough, surely enough, and more than chance. first: see needed."""
    if len(c.drop_db) == 0:
        return False
    need = needed(gap_db, first=first, certain=c.certain)
    if not (c.mean_db > need and np.isfinite(c.sd_db)):
        return False
    more = c.whole_db - max(c.null_db, 0.0)  # a null effect is not held against corrections either
    drop = np.sort(c.drop_db)
    if c.certain and c.loud and -np.minimum(drop, 0).sum() < LOST * drop[-1]:
        return more > 0.5 * need  # what goes with level is for the loudest to tell, which these others were fitted without
    if len(drop) > MANY and drop[1:].mean() > 3 * max(need, needed(gap_db, first=first)):
        drop = drop[1:]  # one strike may be odd: what it alone tells, none of the others did
    sd = float(drop.std(ddof=1) / np.sqrt(len(drop)))
    if len(drop) >= MANY and drop[0] > -max(0.1 * drop.mean(), NOISE_DB) and (drop[-2] > need or (first and c.certain and c.loud)):
        return more > 0.5 * need  # no strike speaks against it, though loud ones may gain far more than soft ones
    return bool(drop.mean() > SURE * sd) and more > max(SURE * sd, 0.5 * need)


def trials(
    h: Hypothesis,
    bodies: tuple[Struck, ...],
    takes: Sequence[Judged],
    evidence: Evidence,
    effects: Sequence[type[Effect]],
    *,
    seed: int,
    say: Any,
    costly: bool = True,
) -> list[Candidate]:
    """Every suspect that the whole evidence suggests, after its trial; best first. costly: whether those that take long are asked, and that search once ENOUGH have been found."""
    found: list[Candidate] = []
    if len(takes) < 2:
        return found  # nothing can be left out
    folds = _folds(h, bodies, takes, evidence, seed)
    heard = any(isinstance(take, Take) for take in takes)  # else no lines are left out
    whole_lines = cache(lambda: _folds(h, bodies, takes, evidence, seed, keep=1.0) if heard else folds)
    anew = cache(lambda: refitted(h, bodies, anew=True) if heard else h)
    fair = cache(lambda by_line: _learnt_anew(anew(), whole_lines() if by_line else folds))
    still = cache(lambda by_line: _rested(whole_lines() if by_line else folds))
    gap = _mean([f.before - f.noise for f in folds])
    idle = not costly and len(evidence.found) >= ENOUGH
    dry = any(one.dry for one in evidence.heard)
    kinds = [kind for kind in effects if kind.id not in evidence.found and not (idle and getattr(kind, "searches", False))]
    for group in _groups(kinds, last=TURNS if dry and costly else frozenset()):
        if any(hasattr(c.effect, "dried") and earns(c, gap, first=not evidence.found) for c in found):
            break  # what others say of lines that a room has made is hearsay: in the next round they are told dry
        if dry and group[0].id in TURNS and len(kinds) > len(group) and any(c.effect.stage is Stage.MATERIAL for c in found):
            continue  # lines that were paired with another material's modes tell little of what mixes these
        if getattr(group[0], "costly", False) and (not costly or any(c.mean_db > PLAIN * gap for c in found)):
            continue  # something cheap says most of it: what is left may ask for more in the next round
        proposed = _proposed(group, evidence)
        for kind in group:
            if (whole := proposed[kind]) is None:
                continue
            say(f"trying {kind.id}")
            alone = replace(h, effects=(whole,))
            by_line = bool(getattr(kind, "by_line", False))
            plain = whole_lines() if by_line else folds
            known = fair(by_line) if moves(alone) and not moves(h) else still(by_line) if bends(alone) and not bends(h) else plain
            found.append(_tried(kind, whole, h, bodies, evidence, known))
    return sorted(found, key=lambda c: -c.whole_db)


def _proposed(group: list[type[Effect]], evidence: Evidence) -> dict[type[Effect], Effect | None]:
    """What each makes of the evidence; one that searches side by side would only do so in turn beside others."""
    rest = [kind for kind in group if not getattr(kind, "searches", False)]
    return {kind: kind.propose(evidence) for kind in group if kind not in rest} | dict(
        zip(rest, side_by_side(lambda kind: kind.propose(evidence), rest), strict=True)
    )


def _groups(kinds: list[type[Effect]], last: frozenset[str]) -> list[list[type[Effect]]]:
    """Rooms, whose echoes others would be told of; what is cheap; and what takes long, one by one; then those that come last."""
    rooms = [k for k in kinds if hasattr(k, "dried")]
    late = [k for k in kinds if k.id in last]
    dear = [k for k in kinds if k not in rooms + late and getattr(k, "costly", False)]
    plain = [k for k in kinds if k not in rooms + late + dear]
    return [group for group in (rooms, plain, *([k] for k in (*dear, *late))) if group]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """What is left to learn from once ``take`` is left out: bodies, evidence, the hypothesis refitted to it, and its distance to the take.

    least: the same distance, or a lesser one that corrections alone come to where they are learnt again. noise: what noise alone makes, of the other takes where this one
    is silent.
    """

    take: Judged
    bodies: tuple[Struck, ...]
    evidence: Evidence
    base: Hypothesis
    before: float
    least: float
    noise: float


def _folds(h: Hypothesis, bodies: tuple[Struck, ...], takes: Sequence[Judged], evidence: Evidence, seed: int, keep: float = KEPT) -> list[Fold]:
    """Without one strike each, and with a part of the lines, keep of them: all for an effect with numbers of single lines, which other lines cannot tell and other strikes can."""
    rng = np.random.default_rng([seed, 1])
    made = []
    for take in takes:
        if isinstance(take, Listed):
            mine, start = take.rest(bodies, h)
            less = evidence_of(start, mine, evidence.band_hz, seed=seed)
            base = refitted(start, mine)
        elif isinstance(take, Take):
            mine, less = bodies, thinned(evidence, take.place, keep, rng)
            base = refitted(h, bodies, less.heard)
        before = take.distance(base)
        if np.isfinite(before):
            made.append(Fold(take, mine, less, base, before, before, take.least(base)))
    usual = [f.noise for f in made if np.isfinite(f.noise)]
    return [f if np.isfinite(f.noise) else replace(f, noise=_mean(usual) if usual else f.before) for f in made]


def _learnt_anew(every: Hypothesis, folds: list[Fold]) -> list[Fold]:
    """Folds that know what is gained by corrections alone, learnt again as they are beside whatever moves modes: that is no effect's gain. every: by all strikes."""

    def least(f: Fold) -> float:
        again = refitted(f.base, f.bodies, anew=True) if isinstance(f.take, Listed) else every
        return min(f.before, f.take.distance(again))

    return [replace(f, least=least(f)) for f in folds]


def _rested(folds: list[Fold]) -> list[Fold]:
    """Folds that know what is gained by corrections alone, learnt from what modes ring down to as they are beside whatever makes them glide."""
    return [
        replace(f, least=min(f.before, f.take.distance(at_rest(f.base, f.bodies, f.evidence.heard, every=True)))) if isinstance(f.take, Take) else f
        for f in folds
    ]


@dataclass(frozen=True, slots=True, eq=False)
class Gain:
    """On one left-out strike, of an effect fitted without it, if any came of that: as Candidate has them; null_db (n,): of every draw."""

    effect: Effect | None = None
    drop_db: float = 0.0
    whole_db: float = 0.0
    null_db: tuple[float, ...] = ()
    lines: float = 0.0


def _tried(kind: type[Effect], whole: Effect, h: Hypothesis, bodies: tuple[Struck, ...], evidence: Evidence, folds: list[Fold]) -> Candidate:
    def judged(i: int) -> Gain:
        fold = folds[i]
        less = fold.evidence
        effect = kind.propose(replace(less, known=whole, on_trial=True))
        if effect is None:
            return Gain()
        free = effect.freedom() - (len(getattr(effect, "turn_rad", ())) if hasattr(effect, "turned") else 0)  # such axes are whole's (Evidence.on_trial)
        random = [Null.fitted(less, min(free, 8), 10 * i + draw) for draw in range(DRAWS)]
        beside = _beside(fold, effect)
        after = _after(fold, beside)
        chance = tuple(fold.before - _after(fold, _beside(fold, none)) for none in random if none is not None)
        lines = likelier(fold.base, beside, evidence, less, bodies) if isinstance(fold.take, Take) and tells(h, effect) else 0.0
        return Gain(effect, fold.least - after, fold.before - after, chance, lines)

    found = side_by_side(judged, range(min(FIRST, len(folds))))
    if _hopeful(kind.id, whole, h, found, folds) or tells(h, whole):  # lines may speak for what strikes do not
        found += side_by_side(judged, range(len(found), len(folds)))
    added = refitted(replace(h, effects=(*h.effects, whole)), bodies, evidence.heard)
    drop, whole_db, null_db = np.array([g.drop_db for g in found]), _mean([g.whole_db for g in found]), _mean([x for g in found for x in g.null_db])
    lines = _mean([g.lines for g in found]) / (1 - KEPT)  # each line is left out in so many of the folds
    level = _levels(folds[: len(found)])
    return Candidate(kind.id, whole, added, drop, whole_db, null_db, jackknife([g.effect.parameters() for g in found if g.effect is not None]), lines, level)


def _hopeful(name: str, whole: Effect, h: Hypothesis, asked: Sequence[Gain], folds: Sequence[Fold]) -> bool:
    """Whether a suspect would earn its keep if it were the recordings themselves on every strike that has not been asked."""
    drop = np.array([*(g.drop_db for g in asked), *(f.least - f.noise for f in folds[len(asked) :])])
    best = Candidate(name, whole, h, drop, _mean([f.before - f.noise for f in folds]), 0.0, {}, impulse_n_s=_levels(folds))
    return earns(best, _mean([f.before - f.noise for f in folds]), first=True)


def _levels(folds: Sequence[Fold]) -> np.ndarray[Any, Any]:
    return np.array([f.take.body.impulse_n_s[f.take.strike] if isinstance(f.take, Take) else np.nan for f in folds])


def _after(fold: Fold, h: Hypothesis) -> float:
    """The distance to a fold's take; what noise alone makes where neither that nor what is played stands above it any more."""
    far = fold.take.distance(h)
    return far if np.isfinite(far) else fold.noise


def _beside(fold: Fold, effect: Effect) -> Hypothesis:
    """A fold's hypothesis with one more effect, fitted to what it may learn from."""
    h = replace(fold.base, effects=(*fold.base.effects, effect))
    if isinstance(fold.take, Listed):
        return refitted(h, fold.bodies)
    fitted = refitted(h, fold.bodies, fold.evidence.heard)
    return retold(fitted, fold.bodies, fold.evidence.heard) if hasattr(effect, "told_by") else fitted


def jackknife(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Standard errors of every number that all folds give [Efron & Tibshirani 1993, eq. 11.5]; numbers in lists of one length each their own."""
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
    n = len(x)
    return float(np.sqrt((n - 1) / n * ((x - x.mean()) ** 2).sum()))
