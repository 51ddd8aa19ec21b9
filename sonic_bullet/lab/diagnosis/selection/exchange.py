"""Several effects at once: fitted to each other, and exchanged where another explains more with the rest.

    e_i -> propose(evidence of the model without e_i, known = e_i), in turns
        (backfitting [Buja, Hastie & Tibshirani 1989])
    exchange: for each added effect, what was accepted in the same round and was passed over replaces it where
        strikes left out, decays and phases together say so

A round adds what explains most of the whole gap alone, and a filter may take up what a pulse and a tilt of level do
together; with the other effect it no longer does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sonic_bullet.effects.protocol import Dereverberates
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of, thin_evidence
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, with_effects
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, moves
from sonic_bullet.lab.diagnosis.prediction.prediction import predict, predict_fitted
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, ScoredObservation
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, evidence_between
from sonic_bullet.lab.diagnosis.selection.decay_test import misfit, of_decays
from sonic_bullet.lab.diagnosis.selection.phase_test import misfit as phases
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.lab.effects.searches import propose
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records import Array

Less = Callable[[Evidence], Evidence]


def rivals(found: Sequence[Candidate], best: Candidate) -> tuple[Candidate, ...]:
    """Select a round's other accepted candidates, which the best may precede by chance, or by what the model lacks."""
    return tuple(c for c in found if c is not best and c.mean_db > RULES.most_share * best.mean_db)


def together(h: Hypothesis, problem: DiagnosisProblem, *, turns: int = 2, less: Less = lambda e: e) -> Hypothesis:
    """Fit each effect again with the others.

    Parameters
    ----------
    h : Hypothesis
        The hypothesis.
    problem : DiagnosisProblem
        The problem.
    turns : int
        How often.
    less : callable
        Selects the part of the evidence to fit to.
    """
    for _ in range(turns):
        for i in range(len(h.effects)):
            h = refit_effect(h, i, problem, less=less)
    return h


def refit_effect(
    h: Hypothesis, i: int, problem: DiagnosisProblem, *, less: Less = lambda e: e, afresh: bool = False
) -> Hypothesis:
    """Fit the i-th effect again with the others, or look for it anew.

    Parameters
    ----------
    h : Hypothesis
        The hypothesis.
    i : int
        Index of the effect.
    problem : DiagnosisProblem
        The problem.
    less : callable
        Selects the part of the evidence to fit to.
    afresh : bool
        Look for it anew.
    """
    effect, before, after = h.effects[i], h.effects[:i], h.effects[i + 1 :]
    rest = refit_material(with_effects(h, (*before, *after), problem.bodies), problem.bodies)
    evidence = less(evidence_of(rest, problem.bodies, problem.band_hz))
    found = propose(type(effect), evidence if afresh else replace(evidence, known=effect))
    return refit_material(replace(rest, effects=(*before, found or effect, *after)), problem.bodies, evidence.observed)


def choose_fit(h: Hypothesis, problem: DiagnosisProblem) -> Hypothesis:
    """Return the hypothesis, its effects fitted together where that is nearer to the fitted strikes."""
    if not problem.has_audio:
        return h
    best = together(h, problem)
    return best if problem.distance_db(best) <= problem.distance_db(h) else h


def left_out_db(h: Hypothesis, i: int, problem: DiagnosisProblem) -> Array:
    """Compute the distance (s,) of every strike where the i-th effect is fitted to the others, the rest to all.

    No lines are left out: each effect has been compared with chance already, and of two that need as many numbers
    neither gains by it.
    """

    def without(take: ScoredObservation) -> Less:
        assert isinstance(take, AudioObservation)
        place = take.place
        return lambda evidence: thin_evidence(evidence, place, 1.0, np.random.default_rng(0))

    def distance_db(take: ScoredObservation) -> float:
        return take.distance(predict(refit_effect(h, i, problem, less=without(take)), take.body))

    return np.array(parallel_map(distance_db, problem.takes))


def exchange_effects(
    h: Hypothesis,
    added: list[Candidate],
    passed: Sequence[Sequence[Candidate]],
    problem: DiagnosisProblem,
) -> tuple[Hypothesis, list[Candidate]]:
    """Fit the effects to each other, and replace each by a rival of its round where strong_evidence says so.

    Parameters
    ----------
    h : Hypothesis
        With the effects.
    added : list of Candidate
        The effects' candidates, in order.
    passed : sequence of sequences of Candidate
        Rivals of each.
    problem : DiagnosisProblem
        The problem.
    """
    if not problem.has_audio:
        return h, added
    names = {c.id for c in added}
    best = choose_fit(h, problem)
    for i in range(len(added)):
        far: Array | None = None
        for rival in (c for c in passed[i] if c.id not in names):
            own = added[i]
            report_progress(f"trying {rival.id} in place of {own.id}")
            effects = tuple(rival.effect if e.id == own.id else e for e in best.effects)
            place = next(k for k, e in enumerate(effects) if e.id == rival.id)
            other = refit_effect(
                refit_material(with_effects(best, effects, problem.bodies), problem.bodies), place, problem
            )
            if problem.distance_db(other) > problem.distance_db(best) + RULES.suffices_db:
                continue  # it would have to gain by strikes it never saw
            other = together(other, problem)
            far = left_out_db(best, place, problem) if far is None else far
            now = left_out_db(other, place, problem)
            said = evidence_between(far - now, 1.0, rival.mean_db)
            said += phases_for(other, best, problem.bodies) + decays_for(other, best, place, problem)
            if said > RULES.strong_evidence:
                best, far, names = other, now, names - {own.id} | {rival.id}
                added = [*added[:i], rival, *added[i + 1 :]]
    return best, [replace(c, effect=next(e for e in best.effects if e.id == c.id)) for c in added]


def decays_for(other: Hypothesis, best: Hypothesis, i: int, problem: DiagnosisProblem) -> float:
    """Compute 2 Δ ln L of lines' decays for the i-th effect of one over another's; 0 unless both change decays only."""
    rival, own = other.effects[i], best.effects[i]
    if not (of_decays(best, own) and of_decays(other, rival)):
        return 0.0
    known = evidence_of(best, problem.bodies, problem.band_hz)
    mine, its = (predict_fitted(h, problem.bodies) for h in (best, other))
    return misfit(mine, own, known) - misfit(its, rival, known)


def phases_for(other: Hypothesis, best: Hypothesis, bodies: tuple[StruckBody, ...]) -> float:
    """Compute 2 Δ ln L of the lines' phases (phase_test.py) for one over another.

    Phases are compared on lines as they were fitted; of several hits they say nothing, and with a room lines are
    others.
    """
    dry = [any(isinstance(e, Dereverberates) for e in h.effects) for h in (best, other)]
    if moves(best) or moves(other) or dry[0] != dry[1]:
        return 0.0
    mine, its = phases(best, bodies), phases(other, bodies)
    return mine - its if np.isfinite([mine, its]).all() else 0.0
