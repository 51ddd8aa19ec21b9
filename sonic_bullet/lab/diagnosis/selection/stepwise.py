"""Stepwise selection: try all candidate effects, add the best accepted one, repeat; fit all to each other; verdict.

    one by one -> fitted to each other, exchanged, pruned -> verdict
    two at once (pairwise.py) where every one leaves most of the gap open, or all of them did at the end; a room
        identified anew with what moves modes

gap = before − floor on left-out strikes; acceptance.py decides which effect is accepted
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Dereverberates, Effect, Stage
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.mesh_limits import of_the_mesh, with_unmatched_modes_moved
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, reidentify_room
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, mixes_neighbours, moves_itself
from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions, predict_each
from sonic_bullet.lab.diagnosis.prediction.score import (
    AudioObservation,
    Comparable,
    Incomparable,
    LeftOut,
    Score,
    ScoredObservation,
    comparable,
    mean_db,
    predict_takes,
)
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate, is_open
from sonic_bullet.lab.diagnosis.selection.band_levels import BandOff, bands_off
from sonic_bullet.lab.diagnosis.selection.coherent_residual import incoherent_fraction
from sonic_bullet.lab.diagnosis.selection.cross_validation import cross_validated
from sonic_bullet.lab.diagnosis.selection.exchange import exchange_effects, rivals
from sonic_bullet.lab.diagnosis.selection.pairwise import in_a_room, pairwise
from sonic_bullet.lab.diagnosis.selection.simplest import examine_candidates, prune_effects, simplest
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.machine.progress import report_progress


@dataclass(frozen=True, slots=True, eq=False)
class SelectionEnd:
    """End of a selection.

    Attributes
    ----------
    before, after, added : Hypothesis, Hypothesis, tuple of Candidate
        Without effects and with them; the candidate of each round that is still there at the end.
    tried : tuple of Candidate
        Every candidate in the last round in which it made a proposal.
    verdict, before_db, after_db, floor_db : str, float, float, float
        "explained", "none" or "unexplained", and mean distances.
    mesh_off : float
        Relative error of the mesh's frequencies that the verdict allows for, else 0.
    bands : tuple of BandOff
        Where levels are off, which is why the verdict is not `none`.
    judged, left_out : Comparable, tuple of LeftOut
        What the hypotheses were compared with, and what could not be compared.
    withheld : tuple of str, str
        Ids of accepted effects that the verdict does not name, and why not; empty of others.
    """

    before: Hypothesis
    after: Hypothesis
    added: tuple[Candidate, ...]
    tried: tuple[Candidate, ...]
    verdict: str
    before_db: float
    after_db: float
    floor_db: float
    mesh_off: float
    bands: tuple[BandOff, ...]
    judged: Comparable
    left_out: tuple[LeftOut, ...]
    withheld: tuple[tuple[str, ...], str] = ((), "")


@dataclass(frozen=True, slots=True, eq=False)
class NothingCompared:
    """A selection that never began, as no distance is known; left_out is empty where nothing was measured."""

    before: Hypothesis
    left_out: tuple[LeftOut, ...]
    verdict: ClassVar[str] = "unexplained"
    added: ClassVar[tuple[Candidate, ...]] = ()
    tried: ClassVar[tuple[Candidate, ...]] = ()

    @property
    def after(self) -> Hypothesis:
        """Return the hypothesis without effects."""
        return self.before


@dataclass(frozen=True, slots=True, eq=False)
class WorseThanSilence(NothingCompared):
    """A selection whose end is no nearer to the recordings than silence: its gains mean nothing."""

    end_db: float
    silence_db: float
    verdict: ClassVar[str] = "worse-than-silence"


def select_effects(
    base: Hypothesis,
    bodies: tuple[StruckBody, ...],
    takes: Sequence[ScoredObservation],
    effects: Sequence[type[Effect]],
    band_hz: tuple[float, float],
    *,
    seed: int = 0,
    against_silence: Sequence[AudioObservation] = (),
) -> SelectionEnd | NothingCompared:
    """Select effects on fitted strikes alone, those that can be compared.

    Parameters
    ----------
    base, bodies : Hypothesis, tuple of StruckBody
        Without effects, and the objects.
    takes, effects : sequence of Judged, sequence of types
        Fitted strikes and candidates.
    band_hz, seed : (2,), int
        Of the recordings; of control effects and folds.
    against_silence : sequence of Take
        Takes by which the end is compared with silence; the fitted ones where there are none.
    """
    start = refit_material(base, bodies)
    made = predict_each(start, (take.body for take in takes))
    found = comparable(takes, made)
    if isinstance(found, Incomparable):
        return NothingCompared(start, found.left_out)
    own = [take for take in found.takes if isinstance(take, AudioObservation)]
    problem = DiagnosisProblem(bodies, found.takes, band_hz, tuple(effects), seed)
    end = _close_gap(start, made, problem, found.left_out)
    return _worse_than_silence(start, end.after, against_silence or own, found.left_out) or end


def _worse_than_silence(
    start: Hypothesis, end: Hypothesis, takes: Sequence[AudioObservation], left_out: tuple[LeftOut, ...]
) -> WorseThanSilence | None:
    """Return the verdict that the end is no nearer to the takes with a distance than silence is, if it is."""
    made = predict_takes(end, takes)
    held = comparable(takes, made)
    if isinstance(held, Incomparable):
        return None
    end_db = mean_db(held.takes, made)
    silence = float(
        np.mean([t.apart_db(np.zeros(len(t.sample))) for t in held.takes if isinstance(t, AudioObservation)])
    )
    return WorseThanSilence(start, left_out, end_db, silence) if end_db >= silence else None


def _close_gap(
    start: Hypothesis, made: Predictions, problem: DiagnosisProblem, left_out: tuple[LeftOut, ...]
) -> SelectionEnd:
    """Select effects on what can be compared; made: the start's prediction."""
    scored = problem.score_predictions(made)
    before, one = scored.distance_db, _one_by_one(start, scored, problem)
    h, added, now, last = one.h, one.added, one.now, dict(one.last)
    verdict, off, bare = _verdict(start, h, added, before, now, problem)
    if verdict == "unexplained" and not one.pairwise and (pair := pairwise(start, one.first, problem)):
        h, added = pair
        last |= {c.id: c for c in added}
        now = problem.score(h)
        verdict, off, bare = _verdict(start, h, added, before, now, problem)
    bands: tuple[BandOff, ...] = ()
    if verdict == "none":
        bands = bands_off(problem.takes, made if bare is start else problem.predict(bare))
    if bands:
        verdict, off = "unexplained", 0.0
    withheld: tuple[tuple[str, ...], str] = ((), "")
    if verdict != "explained":
        if added:
            closes = 1 - now.gap_db / max(before - now.floor_db, 1e-9)
            withheld = tuple(c.id for c in added), f"they close {100 * closes:.0f} % of the gap, which is too little"
        h, now, added = start, replace(now, distance_db=before), []
    tried = tuple(last.values())
    return SelectionEnd(
        start,
        h,
        tuple(added),
        tried,
        verdict,
        before,
        now.distance_db,
        now.floor_db,
        off,
        bands,
        problem.takes,
        left_out,
        withheld,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Rounds:
    """End of the rounds.

    Attributes
    ----------
    h, now, added : Hypothesis, Score, list of Candidate
        The last, its distance over the floor of the last round, and one candidate a round.
    first, last : list of Candidate, dict of Candidate
        All of the first round, and each as it was when asked last.
    pairwise : bool
        Whether pairs were tried.
    """

    h: Hypothesis
    now: Score
    added: list[Candidate]
    first: list[Candidate]
    last: dict[str, Candidate]
    pairwise: bool


def _one_by_one(start: Hypothesis, now: Score, problem: DiagnosisProblem) -> Rounds:
    """Add the best of every round, until nothing is accepted; then fit them to each other."""
    h, before_db = start, now.distance_db
    added: list[Candidate] = []
    passed: list[tuple[Candidate, ...]] = []
    first: list[Candidate] = []
    last: dict[str, Candidate] = {}
    weak = False
    for turn in range(len(problem.effects)):
        report_progress(
            f"round {turn + 1}: {now.distance_db:.2f} dB from the recordings, noise alone {now.floor_db:.2f} dB"
        )
        whole_db = max(before_db - now.floor_db, 0.0)
        if not is_open(now.gap_db, whole_db):
            break
        drawn = replace(problem, seed=problem.seed + turn)
        evidence = evidence_of(h, problem.bodies, problem.band_hz, seed=problem.seed)
        # a room's response is the lines' so far, which leaves open more than there is
        other = reidentify_room(h, problem.bodies)
        full = now if other is h else replace(now, distance_db=problem.distance_db(other))
        costly = full.gap_db > RULES.little_share * whole_db
        found = examine_candidates(cross_validated(h, drawn, evidence, costly=costly), problem, now, full, whole_db)
        last |= {c.id: c for c in found}
        pair, acceptable = None, [c for c in found if not c.why_not]
        if not added:
            first, weak = (
                found,
                all(
                    problem.distance_db(c.hypothesis) - now.floor_db > RULES.most_share * max(now.gap_db, 0.0)
                    for c in found
                ),
            )
            pair = pairwise(start, found, problem) if weak else None
        pair = pair or _room_anew(h, acceptable, found, problem)
        if not (pair or acceptable) and costly and (late := _list_deferred(found, evidence, problem.effects)):
            late_ones = cross_validated(h, drawn.only(*late), evidence, costly=costly)
            found = examine_candidates(late_ones, problem, now, full, whole_db)
            last |= {c.id: c for c in found}
            acceptable = [c for c in found if not c.why_not]
            pair = _room_anew(h, acceptable, found, problem)
        if pair:
            (h, added), passed = pair, [(), ()]
            last |= {c.id: c for c in added}
            now = problem.score(h)
            continue
        if not acceptable:
            break
        best = simplest(acceptable, problem.bodies, evidence)
        last |= {c.id: replace(c, why_not=f"{best.id} was taken first") for c in acceptable if c is not best}
        h, added, passed = best.hypothesis, [*added, best], [*passed, rivals(acceptable, best)]
        if isinstance(best.effect, Dereverberates) and problem.distance_db(h) > now.distance_db:
            h = reidentify_room(
                h, problem.bodies
            )  # a room's response by lines so far off that it sounds worse than none
        now = problem.score(h)
    if len(added) > 1:
        h, added = exchange_effects(h, added, passed, problem)
        h, added = prune_effects(h, added, problem, before_db - now.floor_db)
        now = replace(now, distance_db=problem.distance_db(h))
    again = reidentify_room(h, problem.bodies, fully=True)
    if again is not h and (distance_db := problem.distance_db(again)) < now.distance_db:
        h, now = again, replace(now, distance_db=distance_db)
    return Rounds(h, now, added, first, last, weak)


def _room_anew(
    h: Hypothesis, acceptable: Sequence[Candidate], found: Sequence[Candidate], problem: DiagnosisProblem
) -> tuple[Hypothesis, list[Candidate]] | None:
    """Identify a room found alone anew with what moves modes (pairwise.py), unless something else is accepted."""
    alone = len(h.effects) == 1 and all(moves_itself(h, c.effect) for c in acceptable)
    return in_a_room(h, found, problem) if alone else None


def _list_deferred(
    found: Sequence[Candidate], evidence: Evidence, effects: Sequence[type[Effect]]
) -> list[type[Effect]]:
    """Return the candidates that waited in a room for a tensor (cross_validation.py), if that came to nothing."""
    tensor = any(c.effect.stage is Stage.MATERIAL for c in found) and any(one.dry for one in evidence.observed)
    return [k for k in effects if mixes_neighbours(k) and tensor and k.id not in {c.id for c in found}]


def _verdict(
    start: Hypothesis,
    h: Hypothesis,
    added: Sequence[Candidate],
    before_db: float,
    now: Score,
    problem: DiagnosisProblem,
) -> tuple[str, float, Hypothesis]:
    """Decide the verdict by what a finer mesh would leave: effects must close most of that, or all but its errors.

    Returns it, the largest move of a mode that it allows for, and the start with its modes so moved.
    """
    bare, off = with_unmatched_modes_moved(start, problem)
    ideal = problem.score(bare) if off else replace(now, distance_db=before_db)
    gap, whole = min(ideal.distance_db, before_db) - ideal.floor_db, before_db - now.floor_db
    if not added:
        excused = whole < RULES.suffices_db or (
            (gap < RULES.suffices_db or whole < of_the_mesh(h, problem))
            and incoherent_fraction(problem.takes, problem.predict(h)) < RULES.most_share
        )
        return ("none", off, bare) if excused else ("unexplained", 0.0, bare)
    left = problem.distance_db(with_unmatched_modes_moved(h, problem)[0]) - ideal.floor_db if off else now.gap_db
    # whose response takes up what a mesh gets wrong, too: that is no excuse
    room = any(isinstance(e, Dereverberates) for e in h.effects)
    most = max((RULES.little_share if room else 1 - RULES.most_share) * gap, RULES.suffices_db)
    explained = left <= most or (not room and left <= of_the_mesh(h, problem))
    return ("explained", off, bare) if explained else ("unexplained", 0.0, bare)
