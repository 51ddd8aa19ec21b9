"""Two effects at once, where one after another explains too little, as only both together close the gap.

    first round's candidates: A as it was found, B -> propose(evidence with A)
        -> least D(A, B) on all strikes, if it leaves little
                            B moves no modes: what does is searched for all over a body, and that takes long
    then each is cross-validated with the other: fitted without one strike at a time, against control effects, as in
        any round
    in_a_room: B is a room that was found alone, A what moves modes; the room is identified anew with A, and again
        without it

What a dashpot does to decays hides what a long pulse leaves of the high modes: with the right pulse and wrong decays, a
body is as far from its recording as with neither. Coordinate steps stop there; a step along two coordinates does not
[cf. forward selection of groups: Efroymson 1960; Yuan & Lin 2006].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.effects.protocol import Dereverberates, Effect
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, reidentify_room, with_effects
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, mixes_neighbours, moves, moves_itself
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, is_accepted
from sonic_bullet.lab.diagnosis.selection.cross_validation import cross_validated
from sonic_bullet.lab.diagnosis.selection.exchange import refit_effect
from sonic_bullet.lab.diagnosis.selection.phase_test import misfit
from sonic_bullet.lab.diagnosis.selection.simplest import helps
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.searches import propose
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.machine.progress import report_progress


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A hypothesis with two effects, the second fitted with the first, and its distance in dB."""

    h: Hypothesis
    db: float


def pairwise(
    start: Hypothesis,
    first: Sequence[Candidate],
    problem: DiagnosisProblem,
) -> tuple[Hypothesis, list[Candidate]] | None:
    """Find the two of a first round's candidates that together explain nearly all, each accepted with the other.

    Parameters
    ----------
    start : Hypothesis
        Without effects.
    first : sequence of Candidate
        The first round's.
    problem : DiagnosisProblem
        The problem.

    Returns
    -------
    (Hypothesis, list of Candidate) or None
        None where no two do.
    """
    if len(first) < 2 or not problem.has_audio:
        return None
    kinds = [type(c.effect) for c in first if not moves(c.hypothesis)]
    report_progress("trying two at once")

    pairs = _propose_pairs([c.hypothesis for c in first], kinds, problem)
    now = problem.score(start)
    if not pairs or min(pair.db for pair in pairs) - now.floor_db > RULES.little_share * now.gap_db:
        return None
    h = _likeliest(pairs, now.floor_db + now.gap_db, problem.bodies)
    # what was found alone had the other's share to explain, too
    closer = refit_effect(refit_effect(h, 0, problem, afresh=True), 1, problem)
    h = closer if problem.distance_db(closer) < problem.distance_db(h) else h
    return _accepted_together(h, problem)


def in_a_room(
    h: Hypothesis,
    found: Sequence[Candidate],
    problem: DiagnosisProblem,
) -> tuple[Hypothesis, list[Candidate]] | None:
    """Identify a room that was found alone anew with each candidate that moves modes; None where no two explain all.

    Outside the room lines are where they are, and show masses and tensors. But a response identified from modes that
    lie elsewhere contains what these lack, so that every other set of modes is farther with it: the candidate is tried
    with a response of its own.
    """
    rooms = [e for e in h.effects if isinstance(e, Dereverberates)]
    movers = [c for c in found if moves_itself(h, c.effect)]
    if len(rooms) != 1 or len(h.effects) != 1 or not movers or not problem.has_audio:
        return None
    report_progress("hearing the room anew beside what moves modes")

    floor, left = problem.score(h).floor_db, problem.distance_db(reidentify_room(h, problem.bodies, fully=True))
    for some in (
        [c for c in movers if not mixes_neighbours(c.effect)],
        [c for c in movers if mixes_neighbours(c.effect)],
    ):  # what hardly moves modes is asked where nothing else will do
        alone = [refit_material(with_effects(h, (c.effect,), problem.bodies), problem.bodies) for c in some]
        best = min(_propose_pairs(alone, [type(rooms[0])], problem), key=lambda pair: pair.db, default=None)
        if best is not None and best.db - floor <= RULES.little_share * (left - floor):
            break
    else:
        return None
    return _accepted_together(best.h, problem)


def _propose_pairs(alone: Sequence[Hypothesis], kinds: Sequence[type[Effect]], problem: DiagnosisProblem) -> list[Pair]:
    """Propose each kind beside the effect of each hypothesis; a room's response is that of both."""

    def augmented(one: Hypothesis) -> list[Pair]:
        evidence = evidence_of(one, problem.bodies, problem.band_hz, seed=problem.seed)
        found = []
        for kind in kinds:
            other = None if any(isinstance(e, kind) for e in one.effects) else propose(kind, evidence)
            if other is not None:
                h = refit_material(replace(one, effects=(*one.effects, other)), problem.bodies, evidence.observed)
                h = reidentify_room(h, problem.bodies, fully=True)
                found.append(Pair(h, problem.distance_db(h)))
        return found

    return [pair for some in parallel_map(augmented, alone) for pair in some]


def _accepted_together(h: Hypothesis, problem: DiagnosisProblem) -> tuple[Hypothesis, list[Candidate]] | None:
    """Return the two, if each is accepted with the other."""
    added: list[Candidate] = []
    for effect in h.effects[::-1]:
        rest = refit_material(
            with_effects(h, tuple(e for e in h.effects if e is not effect), problem.bodies), problem.bodies
        )
        response = problem.distance_db(reidentify_room(rest, problem.bodies))  # with a response of its own, too
        evidence = replace(evidence_of(rest, problem.bodies, problem.band_hz, seed=problem.seed), known=effect)
        now = problem.score(rest)
        full = replace(now, distance_db=response)
        candidates = cross_validated(rest, problem.only(type(effect)), evidence)
        if not candidates or not (
            is_accepted(candidates[0], max(now.gap_db, 0.0)) and helps(candidates[0], problem, now, full)
        ):
            return None
        h, added = candidates[0].hypothesis, [candidates[0], *added]
    return h, added


def _likeliest(pairs: Sequence[Pair], before_db: float, bodies: tuple[StruckBody, ...]) -> Hypothesis:
    """Select the pair nearest to the strikes, or one that phases favour (phase_test.py).

    The latter among those with the same effect that moves modes, and nearly as near.
    """
    best = min(pairs, key=lambda pair: pair.db)
    near = best.db + RULES.little_share * (before_db - best.db)
    others = [pair.h for pair in pairs if pair.db < near and _movers(pair.h) == _movers(best.h)]
    off = [misfit(h, bodies) + RULES.strong_evidence for h in others]
    own = misfit(best.h, bodies)
    return others[int(np.argmin(off))] if np.isfinite(own) and min(off) < own else best.h


def _movers(h: Hypothesis) -> set[str]:
    """Return the ids of its effects that move modes."""
    return {e.id for e in h.effects if moves_itself(h, e)}
