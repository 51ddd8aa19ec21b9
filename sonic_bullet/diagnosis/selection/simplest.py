"""Choice of the accepted candidate that is added, and of the added ones that are still needed at the end.

every candidate of a round -> why it is not accepted, if it is not; on all strikes together it helps, too -> the best,
    or the simplest of those that strikes cannot separate from it -> phases, where two are nearly the same
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sonic_bullet.diagnosis.evidence.refit import refitted, reidentified, with_effects
from sonic_bullet.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis, moves, moves_itself
from sonic_bullet.diagnosis.prediction.prediction import predict_fitted
from sonic_bullet.diagnosis.prediction.score import Score
from sonic_bullet.diagnosis.prediction.struck_bodies import Struck
from sonic_bullet.diagnosis.selection.acceptance import Candidate, needed, refusal
from sonic_bullet.diagnosis.selection.decay_test import misfit as decays
from sonic_bullet.diagnosis.selection.decay_test import numbers, of_decays, tells
from sonic_bullet.diagnosis.selection.phase_test import misfit
from sonic_bullet.diagnosis.selection.thresholds import RULES
from sonic_bullet.effects.protocol import Evidence


def examined(
    found: Sequence[Candidate], problem: DiagnosisProblem, now: Score, full: Score, *, first: bool
) -> list[Candidate]:
    """Return a round's candidates, each with why it is not accepted; else lines may favour one. full: a room anew."""

    def why_not(c: Candidate) -> str:
        why = refusal(c, max(now.gap_db, 0.0), first=first)
        return why or ("" if helps(c, problem, now, full, first=first) else "all strikes together come no nearer")

    made = [replace(c, why_not=why_not(c)) for c in found]
    if all(c.why_not for c in made):
        by = max((c for c in made if by_lines(c, problem, full)), key=lambda c: c.lines, default=None)
        made = [replace(c, why_not="") if c is by else c for c in made]
    return made


def helps(c: Candidate, problem: DiagnosisProblem, now: Score, full: Score, *, first: bool) -> bool:
    """Decide whether all strikes together gain, and lose nothing of what a room's response alone explains.

    A response, identified again without the candidate (full), takes up echoes, and some of what stray modes leave, so
    what moves modes must gain on that. A filter or a slow law it takes up whole: then both are equal. Without a mesh
    nothing distinguishes modes among a room's lines, and what changes decays would be fitted to all of them.
    """
    if tells(c.hypothesis, c.effect) and not problem.has_meshes:
        return False
    before, after = (
        full if moves(c.hypothesis) else now,
        problem.distance_db(reidentified(c.hypothesis, problem.bodies)),
    )
    if after >= full.distance_db + RULES.same_share * max(full.gap_db, 0.0):
        return False
    return before.distance_db - after > RULES.most_share * needed(
        max(before.gap_db, 0.0), first=first, certain=c.certain
    )


def by_lines(c: Candidate, problem: DiagnosisProblem, full: Score) -> bool:
    """Decide whether lines left out favour a candidate (decay_test.py), and a room's response is as near with it.

    Without a mesh nothing distinguishes modes among a room's lines.
    """
    if not (problem.has_meshes and c.lines > RULES.strong_evidence):
        return False
    return problem.distance_db(reidentified(c.hypothesis, problem.bodies)) < full.distance_db + RULES.same_share * max(
        full.gap_db, 0.0
    )


def simplest(able: Sequence[Candidate], bodies: tuple[Struck, ...], evidence: Evidence) -> Candidate:
    """Select the best, or the one with the fewest numbers of those that strikes cannot separate from it.

    That is by two standard errors of the difference, and alike_share of its gain. Where another with no more numbers is
    nearly as near (phases_decide_share), the lines' phases may decide (phase_test.py): by clear_phases, or by
    strong_evidence where it is alike_share. Between two that only change decays the lines' own decays decide, by BIC.
    Effects that move modes are not compared: corrections are learnt anew with them, and are numbers too.
    """
    best = able[0]
    # by lines alone one may be accepted that strikes speak against
    if moves_itself(best.hypothesis, best.effect) or len(able) == 1:
        return best

    def close(c: Candidate, share: float) -> bool:
        more = best.drop_db - c.drop_db
        return bool(
            more.mean() <= RULES.standard_errors * more.std(ddof=1) / np.sqrt(len(more))
            and more.mean() < share * best.mean_db
        )

    rivals = [c for c in able if not moves_itself(c.hypothesis, c.effect)]
    first = min((c for c in rivals if close(c, RULES.alike_share)), key=lambda c: (numbers(c.effect), -c.mean_db))
    if of_decays(first.hypothesis, first.effect):
        alike = [
            c
            for c in rivals
            if of_decays(c.hypothesis, c.effect)
            and (best.drop_db - c.drop_db).mean() < RULES.phases_decide_share * best.mean_db
        ]
        first = min(alike, key=lambda c: decays(predict_fitted(c.hypothesis, bodies), c.effect, evidence))
    others = [
        c
        for c in rivals
        if c is not first
        and numbers(c.effect) <= numbers(first.effect)
        and (best.drop_db - c.drop_db).mean() < RULES.phases_decide_share * best.mean_db
    ]
    if not others or moves(best.hypothesis):
        return first  # phases are held against lines as they were fitted
    own = misfit(first.hypothesis, bodies)  # the less strikes say, the less phases need to
    off = np.array(
        [
            misfit(c.hypothesis, bodies)
            + (RULES.strong_evidence if close(c, RULES.alike_share) else RULES.clear_phases)
            for c in others
        ]
    )
    return others[int(off.argmin())] if np.isfinite(own) and off.min() < own else first


def pruned(
    h: Hypothesis, added: list[Candidate], problem: DiagnosisProblem, gap_db: float
) -> tuple[Hypothesis, list[Candidate]]:
    """Remove effects that later ones have made needless."""
    for candidate in added[:-1]:
        if candidate.lines > RULES.strong_evidence:
            continue  # strikes need not speak for it
        rest = [e for e in h.effects if e.id != candidate.id]
        without = refitted(with_effects(h, tuple(rest), problem.bodies), problem.bodies)
        if problem.distance_db(without) - problem.distance_db(h) < needed(gap_db, first=False):
            h, added = without, [c for c in added if c is not candidate]
    return h, added
