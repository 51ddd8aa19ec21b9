"""Stepwise selection: try all candidate effects, add the best that is accepted, look again; fit them to each other; then say what is known and what is not.

    one by one -> fitted to each other, exchanged, pruned -> verdict
    two at once (pairwise.py) where every one leaves most of the gap open, or all of them did at the end; a room identified anew beside what moves modes

gap = before − floor on left-out strikes; which effect is accepted is said in acceptance.py
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from sonic_bullet.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.diagnosis.evidence.mesh_limits import beyond, of_the_mesh
from sonic_bullet.diagnosis.evidence.refit import refitted, reidentified
from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis, mixes_neighbours, moves_itself
from sonic_bullet.diagnosis.prediction.score import Comparable, Compared, Incomparable, Judged, LeftOut, comparable, least_db, mean_db
from sonic_bullet.diagnosis.prediction.struck_bodies import Struck
from sonic_bullet.diagnosis.selection.acceptance import Candidate, accepted
from sonic_bullet.diagnosis.selection.band_levels import BandOff, bands_off
from sonic_bullet.diagnosis.selection.coherent_residual import of_no_body
from sonic_bullet.diagnosis.selection.cross_validation import cross_validated
from sonic_bullet.diagnosis.selection.exchange import chosen, exchanged, rivals
from sonic_bullet.diagnosis.selection.pairwise import in_a_room, pairwise
from sonic_bullet.diagnosis.selection.simplest import by_lines, helps, pruned, simplest
from sonic_bullet.diagnosis.selection.thresholds import RULES
from sonic_bullet.effects.protocol import Alternatives, Dereverberates, Effect, Evidence, Stage


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """How the selection ended. added: the candidate of each round that is still there at the end. tried: every candidate effect in the last round in
    which it was asked and had something to say. mesh_off: of a frequency, what the mesh is off by where that is why the verdict stands.

    bands: where what is played is not as loud as what was recorded, which is why the verdict is not `none`. judged, left_out: what the
    hypotheses were held against, and what could not be compared.
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


@dataclass(frozen=True, slots=True, eq=False)
class NothingCompared:
    """A selection that never began: no distance is known, so nothing is. left_out: what could not be compared, and why; empty where nothing was measured."""

    before: Hypothesis
    left_out: tuple[LeftOut, ...]
    verdict: ClassVar[str] = "unexplained"
    added: ClassVar[tuple[Candidate, ...]] = ()
    tried: ClassVar[tuple[Candidate, ...]] = ()

    @property
    def after(self) -> Hypothesis:
        return self.before


def closed(
    base: Hypothesis,
    bodies: tuple[Struck, ...],
    takes: Sequence[Judged],
    effects: Sequence[type[Effect]],
    band_hz: tuple[float, float],
    *,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Closed | NothingCompared:
    """Select effects on fitted strikes alone, those that can be compared."""
    say = progress or (lambda _: None)
    start = refitted(base, bodies)
    found = comparable(takes, start)
    if isinstance(found, Incomparable):
        return NothingCompared(start, found.left_out)
    return _closed(start, bodies, found, effects, band_hz, seed=seed, say=say)


def _closed(
    start: Hypothesis,
    bodies: tuple[Struck, ...],
    found: Compared,
    effects: Sequence[type[Effect]],
    band_hz: tuple[float, float],
    *,
    seed: int,
    say: Callable[[str], None],
) -> Closed:
    """The selection over what can be compared."""
    takes = found.takes
    before = mean_db(takes, start)
    one = _one_by_one(start, bodies, takes, effects, band_hz, seed=seed, say=say)
    h, added, last = one.h, one.added, dict(one.last)
    now, floor = mean_db(takes, h), one.floor
    verdict, off, by = _verdict(h, added, before, now, floor, bodies, takes, seed), 0.0, h
    if verdict == "unexplained":
        verdict, off, by = _by_a_finer_mesh(start, h, added, before, bodies, takes, seed)
    if verdict == "unexplained" and not one.pairwise and (pair := pairwise(start, one.first, bodies, takes, band_hz, seed=seed, say=say)):
        h, added = pair
        last |= {c.id: c for c in added}
        now, floor = mean_db(takes, h), least_db(takes, h)
        verdict, off = _verdict(h, added, before, now, floor, bodies, takes, seed), 0.0
    bands = bands_off(by, takes) if verdict == "none" else ()
    if bands:
        verdict, off = "unexplained", 0.0
    if verdict != "explained":
        h, now, added = start, before, []
    return Closed(start, h, tuple(added), tuple(last.values()), verdict, before, now, floor, off, bands, takes, found.left_out)


@dataclass(frozen=True, slots=True, eq=False)
class Rounds:
    """Where round after round came to. first, last: all candidates of the first round, and each as it was when asked last. pairwise: whether pairs were tried."""

    h: Hypothesis
    added: list[Candidate]
    first: list[Candidate]
    last: dict[str, Candidate]
    floor: float
    pairwise: bool


def _one_by_one(
    start: Hypothesis,
    bodies: tuple[Struck, ...],
    takes: Comparable,
    effects: Sequence[type[Effect]],
    band_hz: tuple[float, float],
    *,
    seed: int,
    say: Callable[[str], None],
) -> Rounds:
    """The best of every round added, until nothing is accepted; then fitted to each other."""
    h = start
    before = now = mean_db(takes, h)
    floor = least_db(takes, h)
    added: list[Candidate] = []
    passed: list[tuple[Candidate, ...]] = []
    first: list[Candidate] = []
    last: dict[str, Candidate] = {}
    weak = False
    for turn in range(RULES.rounds):
        say(f"round {turn + 1}: {now:.2f} dB from the recordings, noise alone {floor:.2f} dB")
        if now - floor < (RULES.least_drop_db if added else RULES.faint_drop_db):
            break  # so little is what a mesh gets wrong
        evidence = evidence_of(h, bodies, band_hz, seed=seed)
        full = reidentified(h, bodies)  # a room's response is the lines' so far, which leaves open more than there is
        reidentified_db = now if full is h else mean_db(takes, full)
        costly = reidentified_db - floor > RULES.costly_open_share * (before - floor)
        found = cross_validated(h, bodies, takes, evidence, effects, seed=seed + turn, say=say, costly=costly)
        last |= {c.id: c for c in found}
        pair, acceptable = None, _acceptable(found, bodies, takes, now, reidentified_db, floor, first=not added)
        if not added:
            first, weak = found, all(mean_db(takes, c.hypothesis) - floor > RULES.weak_share * max(now - floor, 0.0) for c in found)
            pair = pairwise(start, found, bodies, takes, band_hz, seed=seed, say=say) if weak else None
        pair = pair or _room_anew(h, acceptable, found, bodies, takes, band_hz, seed, say)
        if not (pair or acceptable) and costly and (late := _deferred(found, evidence, effects)):
            found = cross_validated(h, bodies, takes, evidence, late, seed=seed + turn, say=say, costly=costly)
            last |= {c.id: c for c in found}
            acceptable = _acceptable(found, bodies, takes, now, reidentified_db, floor, first=not added)
            pair = _room_anew(h, acceptable, found, bodies, takes, band_hz, seed, say)
        if pair:
            (h, added), passed = pair, [(), ()]
            last |= {c.id: c for c in added}
            now, floor = mean_db(takes, h), least_db(takes, h)
            continue
        if not acceptable:
            break
        best = simplest(acceptable, bodies, evidence)
        h, added, passed = best.hypothesis, [*added, best], [*passed, rivals(acceptable, best)]
        if isinstance(best.effect, Dereverberates) and mean_db(takes, h) > now:
            h = reidentified(h, bodies)  # a room's response by lines so far off that it sounds worse than none
        if len(added) > 1 and any(isinstance(e, Alternatives) for e in h.effects):
            h = chosen(h, bodies, takes, band_hz)  # or a third effect is found for what only the other choice would say
        now = mean_db(takes, h)
        floor = least_db(takes, h)
    if len(added) > 1:
        h, added = exchanged(h, added, passed, bodies, takes, band_hz, say)
        h, added = pruned(h, added, bodies, takes, before - floor)
        now = mean_db(takes, h)
    again = reidentified(h, bodies, fully=True)
    return Rounds(again if again is not h and mean_db(takes, again) < now else h, added, first, last, floor, weak)


def _acceptable(
    found: Sequence[Candidate], bodies: tuple[Struck, ...], takes: Comparable, now: float, reidentified_db: float, floor: float, *, first: bool
) -> list[Candidate]:
    """Those that strikes left out speak for; or, where they speak for none, the one that lines do."""
    acceptable = [c for c in found if accepted(c, max(now - floor, 0.0), first=first) and helps(c, bodies, takes, now, reidentified_db, floor, first=first)]
    return acceptable or sorted((c for c in found if by_lines(c, bodies, takes, reidentified_db, floor)), key=lambda c: -c.lines)[:1]


def _room_anew(
    h: Hypothesis,
    acceptable: Sequence[Candidate],
    found: Sequence[Candidate],
    bodies: tuple[Struck, ...],
    takes: Comparable,
    band_hz: tuple[float, float],
    seed: int,
    say: Callable[[str], None],
) -> tuple[Hypothesis, list[Candidate]] | None:
    """A room that stands alone identified anew beside what moves modes (pairwise.py), unless something else is accepted."""
    return (
        in_a_room(h, found, bodies, takes, band_hz, seed=seed, say=say) if all(moves_itself(h, c.effect) for c in acceptable) and len(h.effects) == 1 else None
    )


def _deferred(found: Sequence[Candidate], evidence: Evidence, effects: Sequence[type[Effect]]) -> list[type[Effect]]:
    """The candidates that had to wait in a room for a tensor (cross_validation.py), if that came to nothing."""
    tensor = any(c.effect.stage is Stage.MATERIAL for c in found) and any(one.dry for one in evidence.observed)
    return [k for k in effects if mixes_neighbours(k) and tensor and k.id not in {c.id for c in found}]


def _verdict(
    h: Hypothesis, added: Sequence[Candidate], before: float, now: float, floor: float, bodies: tuple[Struck, ...], takes: Comparable, seed: int
) -> str:
    """What is known: an effect that closes less than explained_share of the gap would be a guess, unless what is left is what a mesh gets wrong."""
    gap, left = before - floor, now - floor
    if not added:
        excused = gap < RULES.suffices_db or (gap < of_the_mesh(h, bodies, takes, seed) and of_no_body(h, takes) < RULES.no_body_share)
        return "none" if excused else "unexplained"
    room = any(isinstance(e, Dereverberates) for e in h.effects)  # whose response takes up what a mesh gets wrong, too: that is no excuse
    enough = left <= max((1 - (RULES.explained_by_room_share if room else RULES.explained_share)) * gap, RULES.suffices_db) or (
        not room and left <= of_the_mesh(h, bodies, takes, seed)
    )
    return "explained" if enough else "unexplained"


def _by_a_finer_mesh(
    start: Hypothesis, h: Hypothesis, added: Sequence[Candidate], before: float, bodies: tuple[Struck, ...], takes: Comparable, seed: int
) -> tuple[str, float, Hypothesis]:
    """What would be known with upper modes where their lines are, how far off the mesh has them, and with them there; unexplained and 0 where that helps nobody."""
    verdict, (far, off) = "unexplained", beyond(start, bodies, takes)
    if not off:
        return verdict, 0.0, start
    ideal, floor = min(mean_db(takes, far), before), least_db(takes, far)
    if ideal - floor < RULES.suffices_db and of_no_body(start, takes) < RULES.no_body_share:
        verdict = "none"
    elif added:
        both, _ = beyond(h, bodies, takes)
        verdict = _verdict(both, added, ideal, mean_db(takes, both), floor, bodies, takes, seed)
    return verdict, off if verdict != "unexplained" else 0.0, far


def described(candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """For JSON."""
    return [{"id": c.id, "cv_error_drop_db": c.mean_db, "null_drop_db": c.null_db, "parameters": c.effect.parameters()} for c in candidates]
