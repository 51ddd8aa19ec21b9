"""The loop: try all suspects, add the best that earns its keep, look again; fit them to each other; then say what is known and what is not.

gap = before − floor on left-out strikes; which effect earns its keep is said in trial.py
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.diagnosis.bodies import Struck
from sonic_bullet.diagnosis.evidence import evidence_of
from sonic_bullet.diagnosis.exchange import ALIKE, chosen, exchanged, rivals
from sonic_bullet.diagnosis.judge import Judged, Take, least_db, mean_db
from sonic_bullet.diagnosis.play import Hypothesis, moves, play
from sonic_bullet.diagnosis.refit import ROUGH, refitted, retold, with_effects
from sonic_bullet.diagnosis.ties import misfit
from sonic_bullet.diagnosis.trial import FAINT_DB, LEAST_DB, SURE, Candidate, earns, needed, trials
from sonic_bullet.effects.values import Effect
from sonic_bullet.estimator.distance import with_noise

ROUNDS = 4
MESH = 1e-3  # of a frequency: what a good mesh gets wrong
SUFFICES_DB = 1.5  # a gap below this is the mesh's and the shapes' own
EXPLAINED = 0.5  # of the gap; part of it is the mesh's and the shapes' own
NEARLY = 0.2  # of what a name says: between two that differ by less, phases may decide
CLEAR, HINT = 25.0, 5.0  # twice the ln likelihood of phases that this takes; where the two are ALIKE
HELPS = 0.5  # of what a name must gain on strikes left out, on all of them together: a model of few lines may be saved by chance once one is left out
SAME = 0.1  # of what a room's response leaves open: two that differ by less say the same
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
    h = refitted(base, bodies)
    before = mean_db(takes, h) or 0.0
    floor = least_db(takes, h) or 0.0
    start, now = h, before
    added: list[Candidate] = []
    passed: list[tuple[Candidate, ...]] = []
    last: dict[str, Candidate] = {}
    for turn in range(ROUNDS):
        say(f"round {turn + 1}: {now:.2f} dB from the recordings, noise alone {floor:.2f} dB")
        if now - floor < (LEAST_DB if added else FAINT_DB):
            break  # so little is what a mesh gets wrong
        evidence = evidence_of(h, bodies, band_hz, seed=seed)
        full = retold(h, bodies)  # a room's response is the lines' so far, which leaves open more than there is
        told = now if full is h else mean_db(takes, full) or 0.0
        found = trials(h, bodies, takes, evidence, effects, seed=seed + turn, say=say, costly=told - floor > OPEN * (before - floor))
        for candidate in found:
            last[candidate.id] = candidate
        gap = max(now - floor, 0.0)
        able = [c for c in found if earns(c, gap, first=not added) and _helps(c, bodies, takes, now, told, floor, first=not added)]
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
        h, added = _pruned(h, added, bodies, takes, before - floor)
        now = mean_db(takes, h) or 0.0
    again = retold(h, bodies)
    if again is not h and (closer := mean_db(takes, again) or 0.0) < now:
        h, now = again, closer
    gap, left = before - floor, now - floor
    verdict = "explained" if added else "none" if gap < SUFFICES_DB or gap < of_the_mesh(h, bodies, takes, seed) else "unexplained"
    if (
        added and left > max((1 - EXPLAINED) * gap, SUFFICES_DB) and left > of_the_mesh(h, bodies, takes, seed)
    ):  # a name for less of what is seen would be a guess
        verdict, h, now, added = "unexplained", start, before, []
    return Closed(start, h, tuple(added), tuple(last.values()), verdict, before, now, floor)


def _helps(c: Candidate, bodies: tuple[Struck, ...], takes: Sequence[Judged], now: float, told: float, floor: float, *, first: bool) -> bool:
    """Whether all strikes together gain, and lose nothing of what a room's response, told again without it, says as well (told): that takes up echoes, and
    some of what stray modes leave, so what moves modes must gain on that. A filter or a slow law it takes up whole: then both say the same."""
    before, after = told if moves(c.hypothesis) else now, mean_db(takes, retold(c.hypothesis, bodies)) or 0.0
    return after < told + SAME * max(told - floor, 0.0) and before - after > HELPS * needed(max(before - floor, 0.0), first=first)


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


def _pruned(h: Hypothesis, added: list[Candidate], bodies: tuple[Struck, ...], takes: Sequence[Judged], gap_db: float) -> tuple[Hypothesis, list[Candidate]]:
    """Without the effects that those found after them have made needless."""
    for candidate in added[:-1]:
        rest = [e for e in h.effects if e.id != candidate.id]
        without = refitted(with_effects(h, tuple(rest), bodies), bodies)
        if (mean_db(takes, without) or 0.0) - (mean_db(takes, h) or 0.0) < needed(gap_db, first=False):
            h, added = without, [c for c in added if c is not candidate]
    return h, added


def _numbers(c: Candidate) -> int:
    """How many more a model has with an effect than without: a law in Rayleigh's place takes α and β away."""
    return c.effect.freedom() - 2 * (c.id == "damping-law")


def simplest(able: Sequence[Candidate], bodies: tuple[Struck, ...]) -> Candidate:
    """The best, or the one with the fewest numbers of those that strikes cannot tell from it: SURE standard errors of the difference, ALIKE of what it says.

    Where another with no more numbers says nearly as much (NEARLY), the lines' phases may speak for that one (ties.py): by CLEAR, or by HINT where it is ALIKE.
    Effects that move modes stand aside: corrections are learnt anew beside them, and are numbers too.
    """
    best = able[0]
    if moves(best.hypothesis):
        return best

    def close(c: Candidate, share: float) -> bool:
        more = best.drop_db - c.drop_db
        return bool(more.mean() <= SURE * more.std(ddof=1) / np.sqrt(len(more)) and more.mean() < share * best.mean_db)

    rivals = [c for c in able if not moves(c.hypothesis)]
    first = min((c for c in rivals if close(c, ALIKE)), key=lambda c: (_numbers(c), -c.mean_db))
    others = [c for c in rivals if c is not first and _numbers(c) <= _numbers(first) and (best.drop_db - c.drop_db).mean() < NEARLY * best.mean_db]
    if not others:
        return first
    own = misfit(first.hypothesis, bodies)  # the less strikes say, the less phases need to
    off = np.array([misfit(c.hypothesis, bodies) + (HINT if close(c, ALIKE) else CLEAR) for c in others])
    return others[int(off.argmin())] if np.isfinite(own) and off.min() < own else first


def described(candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """For JSON."""
    return [{"id": c.id, "cv_error_drop_db": c.mean_db, "null_drop_db": c.null_db, "parameters": c.effect.parameters()} for c in candidates]
