"""Choice of the accepted candidate that is added, and of the added ones that are still needed at the end.

every candidate of a round -> why it is not accepted, if it is not; on all strikes together it helps, too -> score by
    strikes, decays and phases -> the simplest of those that strong_evidence does not separate from the best
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, reidentify_room, with_effects
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, moves, moves_itself
from sonic_bullet.lab.diagnosis.prediction.prediction import predict_fitted
from sonic_bullet.lab.diagnosis.prediction.score import Score
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, evidence_between, gain_needed_db, refusal
from sonic_bullet.lab.diagnosis.selection.decay_test import misfit as decays
from sonic_bullet.lab.diagnosis.selection.decay_test import of_decays, parameter_count, tells
from sonic_bullet.lab.diagnosis.selection.phase_test import misfit
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.evidence import Evidence


def examine_candidates(
    found: Sequence[Candidate], problem: DiagnosisProblem, now: Score, full: Score, whole_db: float
) -> list[Candidate]:
    """Return a round's candidates, each with why it is not accepted; else lines may favour one. full: a room anew.

    Where one is accepted, something acts on the sound. Which, is asked of those, too, that come nearer than it but say
    too little by themselves, as their gains go with the strike. whole_db: what was open before anything was added.
    """

    def why_not(c: Candidate, **least: float) -> str:
        why = refusal(c, whole_db, now.gap_db, **least)
        return why or ("" if helps(c, problem, now, full) else "all strikes together come no nearer")

    made = [replace(c, why_not=why_not(c)) for c in found]
    nearest_db = max((c.mean_db for c in made if not c.why_not), default=np.inf)
    made = [
        replace(c, why_not=why_not(c, least_evidence=0.0))
        if c.mean_db > nearest_db and not moves_itself(c.hypothesis, c.effect)
        else c
        for c in made
    ]
    if all(c.why_not for c in made):
        by = max((c for c in made if by_lines(c, problem, full)), key=lambda c: c.lines, default=None)
        made = [replace(c, why_not="") if c is by else c for c in made]
    return made


def helps(c: Candidate, problem: DiagnosisProblem, now: Score, full: Score) -> bool:
    """Decide whether all strikes together gain, and lose nothing of what a room's response alone explains.

    A response, identified again without the candidate (full), takes up echoes, and some of what stray modes leave, so
    what moves modes must gain on that. A filter or a slow law it takes up whole: then both are equal. Without a mesh
    nothing distinguishes modes among a room's lines, and what changes decays would be fitted to all of them.
    """
    if tells(c.hypothesis, c.effect) and not problem.has_meshes:
        return False
    before, after = (
        full if moves(c.hypothesis) else now,
        problem.distance_db(reidentify_room(c.hypothesis, problem.bodies)),
    )
    if after >= full.distance_db + RULES.same_share * max(full.gap_db, 0.0):
        return False
    return before.distance_db - after > RULES.most_share * gain_needed_db(max(before.gap_db, 0.0))


def by_lines(c: Candidate, problem: DiagnosisProblem, full: Score) -> bool:
    """Decide whether lines left out favour a candidate (decay_test.py), and a room's response is as near with it.

    Without a mesh nothing distinguishes modes among a room's lines.
    """
    if not (problem.has_meshes and c.lines > RULES.strong_evidence):
        return False
    return problem.distance_db(
        reidentify_room(c.hypothesis, problem.bodies)
    ) < full.distance_db + RULES.same_share * max(full.gap_db, 0.0)


def simplest(able: Sequence[Candidate], bodies: tuple[StruckBody, ...], known: Evidence) -> Candidate:
    """Select the one with the fewest numbers of those that strong_evidence does not separate from the likeliest.

    The score is 2 Δ ln L of strikes, of the lines' decays between two that only change decays, and of their phases,
    which no spectrum in dB has (phase_test.py). Effects that move modes are not compared: corrections are learnt anew
    with them, and are numbers too. Nor is what leaves more than little_share of the best one's gain.
    """
    best = able[0]
    # by lines alone one may be accepted that strikes speak against
    if moves_itself(best.hypothesis, best.effect) or len(able) == 1:
        return best
    rivals = [
        c
        for c in able
        if not moves_itself(c.hypothesis, c.effect) and c.mean_db >= (1 - RULES.little_share) * best.mean_db
    ]
    off = {c.id: -evidence_between(c.drop_db - best.drop_db, best.gap_db, best.mean_db) for c in rivals}
    lost = {
        c.id: decays(predict_fitted(c.hypothesis, bodies), c.effect, known)
        for c in rivals
        if of_decays(c.hypothesis, c.effect)
    }
    off |= {name: off[name] + value - min(lost.values()) for name, value in lost.items()}
    if not moves(best.hypothesis):  # phases are held against lines as they were fitted
        phases = {c.id: misfit(c.hypothesis, bodies) for c in rivals}
        if np.isfinite(list(phases.values())).all():
            off = {name: value + phases[name] for name, value in off.items()}
    least = min(off.values())
    near = [c for c in rivals if off[c.id] <= least + RULES.strong_evidence]
    return min(near, key=lambda c: (parameter_count(c.effect), off[c.id]))


def prune_effects(
    h: Hypothesis, added: list[Candidate], problem: DiagnosisProblem, gap_db: float
) -> tuple[Hypothesis, list[Candidate]]:
    """Remove effects that later ones have made needless."""
    for candidate in added[:-1]:
        if candidate.lines > RULES.strong_evidence:
            continue  # strikes need not speak for it
        rest = [e for e in h.effects if e.id != candidate.id]
        without = refit_material(with_effects(h, tuple(rest), problem.bodies), problem.bodies)
        if problem.distance_db(without) - problem.distance_db(h) < gain_needed_db(gap_db):
            h, added = without, [c for c in added if c is not candidate]
    return h, added
