"""The loop: try all suspects, add the best that earns its keep, look again; fit them to each other; then say what is known and what is not.

    one by one -> fitted to each other, exchanged, pruned -> verdict
    two at once (twos.py) where every one leaves most of the gap open, or all of them did at the end

gap = before − floor on left-out strikes; which effect earns its keep is said in trial.py
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.diagnosis.bodies import Struck
from sonic_bullet.diagnosis.choice import helps, pruned, simplest
from sonic_bullet.diagnosis.evidence import evidence_of
from sonic_bullet.diagnosis.exchange import chosen, exchanged, rivals
from sonic_bullet.diagnosis.judge import Judged, Take, least_db, mean_db
from sonic_bullet.diagnosis.play import Hypothesis, play
from sonic_bullet.diagnosis.refit import ROUGH, refitted, retold
from sonic_bullet.diagnosis.trial import FAINT_DB, LEAST_DB, Candidate, earns, trials
from sonic_bullet.diagnosis.twos import in_twos
from sonic_bullet.effects.values import Effect
from sonic_bullet.estimator.distance import with_noise

ROUNDS = 4
MESH = 1e-3  # of a frequency: what a good mesh gets wrong
SUFFICES_DB = 1.5  # a gap below this is the mesh's and the shapes' own
EXPLAINED = 0.5  # of the gap; part of it is the mesh's and the shapes' own
WEAK = 0.5  # of the gap: where every suspect leaves more, two are tried at once
OPEN = 0.3  # of the first gap: with less left, no costly suspect is asked


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """How the loop ended. added: the candidate of each round that is still there at the end. tried: every suspect in the last round in
    which it was asked and had something to say."""

    before: Hypothesis
    after: Hypothesis
    added: tuple[Candidate, ...]
    tried: tuple[Candidate, ...]
    verdict: str
    before_db: float
    after_db: float
    floor_db: float


def closed(
    base: Hypothesis,
    bodies: tuple[Struck, ...],
    takes: Sequence[Judged],
    effects: Sequence[type[Effect]],
    band_hz: tuple[float, float],
    *,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Closed:
    """Run it on fitted strikes alone."""
    say = progress or (lambda _: None)
    start = refitted(base, bodies)
    before = mean_db(takes, start) or 0.0
    one = _one_by_one(start, bodies, takes, effects, band_hz, seed=seed, say=say)
    h, added, last = one.h, one.added, dict(one.last)
    now, floor = mean_db(takes, h) or 0.0, one.floor
    verdict = _verdict(h, added, before, now, floor, bodies, takes, seed)
    if verdict == "unexplained" and not one.in_twos and (two := in_twos(start, one.first, bodies, takes, band_hz, seed=seed, say=say)):
        h, added = two
        last |= {c.id: c for c in added}
        now, floor = mean_db(takes, h) or 0.0, least_db(takes, h) or floor
        verdict = _verdict(h, added, before, now, floor, bodies, takes, seed)
    if verdict == "unexplained":
        h, now, added = start, before, []
    return Closed(start, h, tuple(added), tuple(last.values()), verdict, before, now, floor)


@dataclass(frozen=True, slots=True, eq=False)
class Rounds:
    """Where round after round came to. first, last: all suspects of the first round, and each as it was when asked last. in_twos: whether twos were tried."""

    h: Hypothesis
    added: list[Candidate]
    first: list[Candidate]
    last: dict[str, Candidate]
    floor: float
    in_twos: bool


def _one_by_one(
    start: Hypothesis,
    bodies: tuple[Struck, ...],
    takes: Sequence[Judged],
    effects: Sequence[type[Effect]],
    band_hz: tuple[float, float],
    *,
    seed: int,
    say: Callable[[str], None],
) -> Rounds:
    """The best of every round added, until nothing earns its keep; then fitted to each other."""
    h = start
    before = now = mean_db(takes, h) or 0.0
    floor = least_db(takes, h) or 0.0
    added: list[Candidate] = []
    passed: list[tuple[Candidate, ...]] = []
    first: list[Candidate] = []
    last: dict[str, Candidate] = {}
    weak = False
    for turn in range(ROUNDS):
        say(f"round {turn + 1}: {now:.2f} dB from the recordings, noise alone {floor:.2f} dB")
        if now - floor < (LEAST_DB if added else FAINT_DB):
            break  # so little is what a mesh gets wrong
        evidence = evidence_of(h, bodies, band_hz, seed=seed)
        full = retold(h, bodies)  # a room's response is the lines' so far, which leaves open more than there is
        told = now if full is h else mean_db(takes, full) or 0.0
        found = trials(h, bodies, takes, evidence, effects, seed=seed + turn, say=say, costly=told - floor > OPEN * (before - floor))
        first = first or found
        last |= {c.id: c for c in found}
        gap = max(now - floor, 0.0)
        weak = weak or (not added and all((mean_db(takes, c.hypothesis) or 0.0) - floor > WEAK * gap for c in found))
        if weak and not added and (two := in_twos(start, found, bodies, takes, band_hz, seed=seed, say=say)):
            (h, added), passed = two, [(), ()]
            last |= {c.id: c for c in added}
            now, floor = mean_db(takes, h) or 0.0, least_db(takes, h) or floor
            continue
        able = [c for c in found if earns(c, gap, first=not added) and helps(c, bodies, takes, now, told, floor, first=not added)]
        if not able:
            break
        best = simplest(able, bodies)
        h, added, passed = best.hypothesis, [*added, best], [*passed, rivals(able, best)]
        if hasattr(best.effect, "told_by") and (mean_db(takes, h) or 0.0) > now:
            h = retold(h, bodies)  # a room's response by lines so far off that it sounds worse than none
        if len(added) > 1 and any(hasattr(e, "others") for e in h.effects):
            h = chosen(h, bodies, takes, band_hz)  # or a third name is found for what only the other choice would say
        now = mean_db(takes, h) or 0.0
        floor = least_db(takes, h) or floor
    if len(added) > 1:
        h, added = exchanged(h, added, passed, bodies, takes, band_hz, say)
        h, added = pruned(h, added, bodies, takes, before - floor)
        now = mean_db(takes, h) or 0.0
    again = retold(h, bodies)
    return Rounds(again if again is not h and (mean_db(takes, again) or 0.0) < now else h, added, first, last, floor, weak)


def _verdict(
    h: Hypothesis, added: Sequence[Candidate], before: float, now: float, floor: float, bodies: tuple[Struck, ...], takes: Sequence[Judged], seed: int
) -> str:
    """What is known: a name for less than EXPLAINED of what is seen would be a guess, unless what is left is what a mesh gets wrong."""
    gap, left = before - floor, now - floor
    if not added:
        return "none" if gap < SUFFICES_DB or gap < of_the_mesh(h, bodies, takes, seed) else "unexplained"
    enough = left <= max((1 - EXPLAINED) * gap, SUFFICES_DB) or left <= of_the_mesh(h, bodies, takes, seed)
    return "explained" if enough else "unexplained"


def of_the_mesh(h: Hypothesis, bodies: tuple[Struck, ...], takes: Sequence[Judged], seed: int) -> float:
    """What a mesh's errors would add to the distance, in dB: modes that no line could correct moved at random by as much as the others were
    corrected, and every shape at the strikes by ROUGH of its strongest there."""
    rng = np.random.default_rng([seed, 5])
    moved, other = dict(h.correction or {}), {}
    for body in bodies:
        mine = moved.get(body.name)
        if mine is None or body.gathered is None or len(mine) != len(body.line):
            continue
        paired = body.line >= 0
        size = float(np.sqrt((mine[paired] ** 2).mean())) if paired.any() else 0.0
        moved[body.name] = np.where(paired, mine, mine + max(size, MESH) * rng.standard_normal(len(mine)))
        model = body.model if h.poisson is None or body.other is None else body.other(h.poisson)
        other[body.name] = _roughened(replace(body, model=model, other=None), rng)
    far = replace(h, correction=moved)
    pairs = [(t, play(h, t.body, t.strike, len(t.sample), t.sr)) for t in takes if isinstance(t, Take)]
    twice = [replace(t, sample=with_noise(made, t.floor, 1000 + t.strike)) for t, made in pairs]
    return (mean_db([replace(t, body=other.get(t.body.name, t.body)) for t in twice], far) or 0.0) - (mean_db(twice, h) or 0.0)


def _roughened(body: Struck, rng: np.random.Generator) -> Struck:
    """The body with shapes at its strikes off by ROUGH of each mode's strongest there."""
    shape = body.model.shape.copy()
    at = slice(body.surface_count(), len(shape) - 1)
    most = np.abs(np.einsum("sxm,sx->sm", shape[at], body.way[:-1])).max(axis=0)
    shape[at] += (ROUGH * most * rng.standard_normal((body.strikes, 1, len(most))) * body.way[:-1, :, None]).astype(np.float32)
    return replace(body, model=replace(body.model, shape=shape))


def described(candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """For JSON."""
    return [{"id": c.id, "cv_error_drop_db": c.mean_db, "null_drop_db": c.null_db, "parameters": c.effect.parameters()} for c in candidates]
