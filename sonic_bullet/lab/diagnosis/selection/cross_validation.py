"""Candidate effects under cross-validation: fitted without one strike and a part of the lines, compared on that strike.

    for every strike s:  evidence − s − some lines (none, where an effect has numbers of single lines) -> propose ->
        refit α, β, σ -> D(s)    against the same without the effect
    control effect: as many numbers, spent on directions drawn at random in the modes' decays and levels, fitted to the
        same evidence

Leaving out lines matters: decays and shapes belong to the body, so every strike shows them, and a pattern fitted to
them by chance would pass. Corrections of frequencies, and the axes of amplitude-dependent pairs, only mend what a mesh
leaves to chance: all fitted strikes determine those, once, and the control has no numbers for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from sonic_bullet.effects.protocol import Cost, Dereverberates, Effect, RotatesPairs, Stage
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.diagnosis.evidence.mesh_limits import finer_mesh_db
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, reidentify_room
from sonic_bullet.lab.diagnosis.evidence.small_amplitude import at_rest
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, bends, mixes_neighbours, moves
from sonic_bullet.lab.diagnosis.prediction.line_score import LineObservation
from sonic_bullet.lab.diagnosis.prediction.prediction import predict, predict_each
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, ScoredObservation
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, is_accepted, jackknife, mean
from sonic_bullet.lab.diagnosis.selection.control_effect import ControlEffect
from sonic_bullet.lab.diagnosis.selection.decay_test import likelier, tells
from sonic_bullet.lab.diagnosis.selection.pitch_ratios import modes_off_lines
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.lab.effects.searches import propose
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.machine.progress import report_progress


def cross_validated(
    h: Hypothesis, problem: DiagnosisProblem, evidence: Evidence, *, costly: bool = True
) -> list[Candidate]:
    """Cross-validate every candidate that the whole evidence suggests; best first.

    Parameters
    ----------
    h : Hypothesis
        Without the candidates.
    problem : DiagnosisProblem
        Strikes, candidates, seed.
    evidence : Evidence
        The whole.
    costly : bool
        Whether to ask those that take long.
    """
    found: list[Candidate] = []
    if len(problem.takes) < 2:
        return found  # nothing can be left out
    folds = _folds(h, problem, evidence)
    if not folds:
        return found
    observed = any(isinstance(take, AudioObservation) for take in problem.takes)  # else no lines are left out
    whole_lines = cache(lambda: _folds(h, problem, evidence, keep=1.0) if observed else folds)
    anew = cache(lambda: refit_material(h, problem.bodies, anew=True) if observed else h)
    fair = cache(lambda by_line: _learnt_anew(anew(), whole_lines() if by_line else folds))
    still = cache(lambda by_line: _at_rest_folds(whole_lines() if by_line else folds))
    gap = mean([f.before - f.noise for f in folds])
    dry = any(one.dry for one in evidence.observed)
    kinds = [kind for kind in problem.effects if kind.id not in evidence.found]
    for group in _groups(kinds, late=dry and costly):
        if any(isinstance(c.effect, Dereverberates) and is_accepted(c, gap) for c in found):
            break  # what others say of lines that a room has made is hearsay: in the next round they are dereverberated
        if (
            dry
            and mixes_neighbours(group[0])
            and len(kinds) > len(group)
            and any(c.effect.stage is Stage.MATERIAL for c in found)
        ):
            continue  # lines that were paired with another material's modes tell little of what mixes these
        if group[0].traits.cost is Cost.COSTLY:
            if not costly or any(c.mean_db > RULES.most_share * gap for c in found):
                continue  # something cheap says most of it: what is left may ask for more in the next round
            if group[0].stage is Stage.MATERIAL and not any(map(modes_off_lines, evidence.observed)):
                continue  # loud modes are where lines are: no other elasticity moves them
            report_progress(f"searching for {group[0].id}")
        proposed = _propose_effects(group, evidence)
        for kind in group:
            if (whole := proposed[kind]) is None:
                continue
            report_progress(f"trying {kind.id}")
            alone = replace(h, effects=(whole,))
            by_line = kind.traits.by_line
            plain = whole_lines() if by_line else folds
            known = (
                fair(by_line)
                if moves(alone) and not moves(h)
                else still(by_line)
                if bends(alone) and not bends(h)
                else plain
            )
            found.append(_cross_validated(kind, whole, h, problem.bodies, evidence, known))
    return sorted(found, key=lambda c: -c.whole_db)


def _propose_effects(group: list[type[Effect]], evidence: Evidence) -> dict[type[Effect], Effect | None]:
    """Let each candidate propose from the evidence; those that use all processors by themselves, one after another."""
    rest = [kind for kind in group if kind.traits.cost is not Cost.SEARCHES]
    return {kind: propose(kind, evidence) for kind in group if kind not in rest} | dict(
        zip(rest, parallel_map(lambda kind: propose(kind, evidence), rest), strict=True)
    )


def _groups(kinds: list[type[Effect]], *, late: bool) -> list[list[type[Effect]]]:
    """Order candidates: rooms, which would mislead the others; cheap ones; costly ones, one by one; then late ones."""
    rooms: list[type[Effect]] = [k for k in kinds if issubclass(k, Dereverberates)]
    last = [k for k in kinds if late and mixes_neighbours(k)]
    dear = [k for k in kinds if k not in rooms + last and k.traits.cost is Cost.COSTLY]
    plain = [k for k in kinds if k not in rooms + last + dear]
    alone: list[list[type[Effect]]] = [[k] for k in (*dear, *last)]
    return [group for group in (rooms, plain, *alone) if group]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """What is left to learn from once a take is left out.

    Attributes
    ----------
    take : Judged
        What is left out.
    bodies : tuple of StruckBody
        Without what was learnt from it.
    evidence : Evidence
        The rest.
    base : Hypothesis
        Refitted to it.
    before : float
        Its distance to the take.
    least : float
        The same, or a smaller distance by corrections alone where they are learnt again.
    noise : float
        Distance by noise alone, and what a finer mesh would take away: no effect closes that.
    """

    take: ScoredObservation
    bodies: tuple[StruckBody, ...]
    evidence: Evidence
    base: Hypothesis
    before: float
    least: float
    noise: float


def _folds(
    h: Hypothesis, problem: DiagnosisProblem, evidence: Evidence, *, keep: float = RULES.kept_lines_share
) -> list[Fold]:
    """Leave out every strike once, and lines but for the fraction ``keep``.

    All lines stay for an effect with numbers of single lines, which other lines do not determine and other strikes do.
    """
    rng = np.random.default_rng([problem.seed, 1])
    made = []
    for take, mesh_db in zip(problem.takes, finer_mesh_db(h, problem), strict=True):
        if isinstance(take, LineObservation):
            mine, start = take.rest(problem.bodies, h)
            less = evidence_of(start, mine, evidence.band_hz, seed=problem.seed)
            base = refit_material(start, mine)
        elif isinstance(take, AudioObservation):
            mine, less = problem.bodies, thin_evidence(evidence, take.place, keep, rng)
            base = refit_material(h, problem.bodies, less.observed)
        p = predict(base, take.body)
        before = take.distance(p)
        if np.isfinite(before):  # of the others alone a model may come that cannot be played
            made.append(Fold(take, mine, less, base, before, before, take.least(p) + mesh_db))
    return made


def _learnt_anew(every: Hypothesis, folds: list[Fold]) -> list[Fold]:
    """Add to folds what corrections alone gain, learnt as with effects that move modes: that is no effect's gain.

    every is the hypothesis with these corrections, by all strikes.
    """
    made = predict_each(every, (f.take.body for f in folds if not isinstance(f.take, LineObservation)))

    def least(f: Fold) -> float:
        if isinstance(f.take, LineObservation):
            return min(f.before, f.take.distance(predict(refit_material(f.base, f.bodies, anew=True), f.take.body)))
        return min(f.before, f.take.distance(made[f.take.body]))

    return [replace(f, least=least(f)) for f in folds]


def _at_rest_folds(folds: list[Fold]) -> list[Fold]:
    """Add to folds what corrections alone gain, learnt at small amplitude as with effects of amplitude."""

    def least(f: Fold) -> float:
        rested = at_rest(f.base, f.bodies, f.evidence.observed, every=True)
        return min(f.before, f.take.distance(predict(rested, f.take.body)))

    return [replace(f, least=least(f)) if isinstance(f.take, AudioObservation) else f for f in folds]


@dataclass(frozen=True, slots=True, eq=False)
class Gain:
    """Gains on one left-out strike by an effect fitted without it, if there was one, as in `Candidate`."""

    effect: Effect | None = None
    drop_db: float = 0.0
    whole_db: float = 0.0
    control_db: float | None = None
    lines: float = 0.0


def _cross_validated(
    kind: type[Effect],
    whole: Effect,
    h: Hypothesis,
    bodies: tuple[StruckBody, ...],
    evidence: Evidence,
    folds: list[Fold],
) -> Candidate:
    """Cross-validate one candidate."""

    def judged(i: int) -> Gain:
        fold = folds[i]
        less = fold.evidence
        effect = propose(kind, replace(less, known=whole, held_out=True))
        if effect is None:
            return Gain()
        asks_lines = isinstance(fold.take, AudioObservation) and tells(h, effect)
        lined = [b for b in bodies if b.recorded is not None] if asks_lines else []
        # such axes are whole's (Evidence.held_out)
        free = effect.freedom() - (effect.angles() if isinstance(effect, RotatesPairs) else 0)
        control = ControlEffect.fitted(less, free, i)
        body = fold.take.body
        made = predict_each(_add_effect(fold, effect), (body, *lined))
        after = fold.take.distance(made[body])
        chance = (
            None if control is None else fold.before - fold.take.distance(predict(_add_effect(fold, control), body))
        )
        lines = likelier(predict_each(fold.base, lined), made, evidence, less) if lined else 0.0
        return Gain(effect, fold.least - after, fold.before - after, chance, lines)

    loud = np.argsort(-np.nan_to_num(_levels(folds)), kind="stable")[
        :2
    ].tolist()  # the fewest that have a standard error
    gains = dict(zip(loud, parallel_map(judged, loud), strict=True))
    if any(g.drop_db > 0 for g in gains.values()) or tells(h, whole):  # lines may speak for what strikes do not
        rest = [i for i in range(len(folds)) if i not in gains]
        gains |= dict(zip(rest, parallel_map(judged, rest), strict=True))
    asked = sorted(gains)
    found = [gains[i] for i in asked]
    added = refit_material(replace(h, effects=(*h.effects, whole)), bodies, evidence.observed)
    drop, whole_db, control_db = (
        np.array([g.drop_db for g in found]),
        mean([g.whole_db for g in found]),
        mean([g.control_db for g in found if g.control_db is not None]),
    )
    # each line is left out in so many of the folds
    lines = mean([g.lines for g in found]) / (1 - RULES.kept_lines_share)
    return Candidate(
        kind.id,
        whole,
        added,
        drop,
        whole_db,
        control_db,
        jackknife([g.effect.parameters() for g in found if g.effect is not None]),
        lines,
        np.array([folds[i].before - folds[i].noise for i in asked]),
    )


def _levels(folds: Sequence[Fold]) -> np.ndarray[Any, Any]:
    """Return the levels of the folds' strikes."""
    return np.array(
        [f.take.body.level_n_s[f.take.strike] if isinstance(f.take, AudioObservation) else np.nan for f in folds]
    )


def _add_effect(fold: Fold, effect: Effect) -> Hypothesis:
    """Add an effect to a fold's hypothesis, fitted to its evidence."""
    h = replace(fold.base, effects=(*fold.base.effects, effect))
    if isinstance(fold.take, LineObservation):
        return refit_material(h, fold.bodies)
    fitted = refit_material(h, fold.bodies, fold.evidence.observed)
    return (
        reidentify_room(fitted, fold.bodies, fold.evidence.observed) if isinstance(effect, Dereverberates) else fitted
    )
