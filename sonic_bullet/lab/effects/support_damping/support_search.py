"""Search for places of dashpots: weak ones all at once, then one after another beside those that are there.

data · ln left + j (3 ln data + 6) -> min over the number j of dashpots       [Schwarz 1978]
each step: the best few of a grid of places, strengths and directions; each refined (fitting.py)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet.lab.effects.common.fitting import search_places
from sonic_bullet.lab.effects.support_damping.dashpot_fit import Dashpot, DashpotFit, Dashpots
from sonic_bullet.lab.effects.support_damping.support_subsets import subsets
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.records import Array

# vertices where another dashpot is looked for; and where the first is: of one alone a basin may lie between the points
# of a coarse grid
NEXT_SPOTS = 90
FIRST_SPOTS = 500
# of the grid, looked at closer; refined
GRID_LOOKED_AT = 40
STARTS_REFINED = 4
STARTS_REFINED_CLOSER = 2  # of these, by the second reach
REACHES = (0.1, 0.03)  # of a turn each, in sizes of the body
STRENGTH_STEP = 0.4  # of ln c
SUBSETS_KEPT = 2  # of each number of dashpots to first order
EXPLAINED_RATIO = 2.0  # of the spreads' own misfit: no more is asked
# in BIC, for another dashpot; of what one costs: one that explains less ends the search
NEXT_DASHPOT_BIC = 6.0
LAST_GAIN_SHARE = 0.5

Refined = tuple[float, Dashpots]  # what is left, and the dashpots


def search_dashpots(t: DashpotFit) -> Dashpots:
    """Find the dashpots that are accepted.

    The least Bayes information criterion decides how many, with NEXT_DASHPOT_BIC for each on top.
    """
    most = 4
    data = 3 * len(t.freq_hz)  # a decay, a pattern and a level each
    apiece = 3 * np.log(data) + NEXT_DASHPOT_BIC
    least = float(t.worth.sum())  # what is left within the spreads asks for nothing

    def priced(d: Dashpots) -> Refined:
        return float(data * np.log(max(t.left(d), least)) + len(d) * apiece), d

    def best(tried: list[Refined]) -> Dashpots:
        found = min(tried, key=_cost)
        for _ in found[1]:  # one that has helped the others to their places may say nothing there any more
            found = min([found, *(priced(_remove_dashpot(found[1], i)) for i in range(len(found[1])))], key=_cost)
        return found[1]

    if t.left(()) < least:
        return ()
    spots = _select_spread_vertices(t, FIRST_SPOTS)
    tried = [
        priced(()),
        *(priced(d) for _, d in _refined_each(t, subsets(t, spots[:NEXT_SPOTS], SUBSETS_KEPT), REACHES)),
    ]
    if t.left(min(tried, key=_cost)[1]) < EXPLAINED_RATIO * least:
        return best(tried)
    starts: list[Dashpots] = [()]
    while len(starts[0]) < most:
        ends = _with_one_more(t, starts, spots[:NEXT_SPOTS] if starts[0] else spots)
        first = ends[0][1]
        if len(first) > 1:  # on round bodies one may have ended on the wrong side
            ends += [
                e for i in range(len(first)) for e in _with_one_more(t, [_remove_dashpot(first, i)], spots[:NEXT_SPOTS])
            ]
        found = refine_dashpots(t, min(ends, key=_cost)[1], REACHES[-1:], t.wide)[1]
        tried.append(priced(found))
        if tried[-1][0] > min(tried, key=_cost)[0] + LAST_GAIN_SHARE * apiece:
            break  # of two as strong as each other, one alone may not pay
        # other single ones are gone on from: the best one alone may be no member of the best two
        starts = [found, *(d for _, d in ends[1:] if len(found) == 1)]
    return best(tried)


def refine_dashpots(t: DashpotFit, start: Dashpots, reaches: tuple[float, ...], runs: tuple[Array, ...]) -> Refined:
    """Refine places, strengths and directions, one dashpot after another.

    Parameters
    ----------
    t : DashpotFit
        The object.
    start : tuple of Dashpot
        Dashpots to start from.
    reaches : sequence of float
        Reach of each turn, in sizes of the body.
    runs : tuple of (r,)
        Modes that couple.
    """
    size = float(np.linalg.norm(np.ptp(t.model.vertex_m[t.body], axis=0)))
    best = (t.left(start, runs, 1), start)
    for reach in reaches:
        for i in range(len(start)):
            best = _nearby(t, best, i, reach * size, runs)
    return best


def _nearby(t: DashpotFit, best: Refined, i: int, reach_m: float, runs: tuple[Array, ...]) -> Refined:
    """Search about one of several dashpots, over its place, strength and direction."""
    found = best[1]

    def trial(place: tuple[int, ...], ln_c: Array, along: str = found[i].along) -> Refined:
        d = (*found[:i], Dashpot(place[0], float(np.exp(ln_c[0])), along), *found[i + 1 :])
        return t.left(d, runs, 1), d

    step = np.array([STRENGTH_STEP])
    best = min(best, search_places(trial, t.model, (found[i].vertex,), np.log([found[i].c]), step, reach_m), key=_cost)
    one = best[1][i]
    other = "every" if one.along == "normal" else "normal"
    return min(best, trial((one.vertex,), np.log([one.c]), other), key=_cost)


def _refined_each(t: DashpotFit, starts: list[Dashpots], reaches: tuple[float, ...]) -> list[Refined]:
    """Refine several starts: the best first."""
    return sorted(parallel_map(lambda d: refine_dashpots(t, d, reaches, t.runs), starts), key=_cost)


def _with_one_more(t: DashpotFit, starts: list[Dashpots], spots: Array) -> list[Refined]:
    """Find sets with one dashpot more, the best first, by a grid of all strengths and directions at some vertices."""
    grid = [Dashpot(int(v), c, along) for v in spots for c in _strengths(t).tolist() for along in ("normal", "every")]
    few: list[Dashpots] = []
    for chosen in starts:
        trials = [(*chosen, d) for d in grid]
        few += _best(
            _of_each(lambda part: [t.price(*one) for one in t.poles(part, t.runs)], trials), trials, GRID_LOOKED_AT
        )
    left = _of_each(lambda part: [t.misfit(*one, 1) for one in t.poles(part, t.runs)], few)
    near = _refined_each(t, _best(left, few, STARTS_REFINED), REACHES[:1])
    closer = _refined_each(t, [d for _, d in near[:STARTS_REFINED_CLOSER]], REACHES[1:])
    return sorted([*closer, *near[STARTS_REFINED_CLOSER:]], key=_cost)


def _remove_dashpot(d: Dashpots, i: int) -> Dashpots:
    """Return the dashpots but one."""
    return d[:i] + d[i + 1 :]


def _cost(pair: Refined) -> float:
    """Return the cost of a pair (cost, dashpots)."""
    return pair[0]


def _of_each(price: Callable[[list[Dashpots]], list[float]], trials: list[Dashpots]) -> list[float]:
    """Compute the prices of many trials, in two processes."""
    parts = [trials[: len(trials) // 2], trials[len(trials) // 2 :]]
    return [one for part in parallel_map(price, parts) for one in part]


def _best(price: list[float], trials: list[Dashpots], count: int) -> list[Dashpots]:
    """Select the few trials at the least price, the last dashpot of each at a vertex of its own."""
    found: dict[int, Dashpots] = {}
    for i in np.argsort(price, kind="stable"):
        found.setdefault(trials[i][-1].vertex, trials[i])
    return list(found.values())[:count]


def _select_spread_vertices(t: DashpotFit, count: int) -> Array:
    """Select surface vertices (p,) where dashpots have different effects.

    Each is the farthest, in n·φ of all modes, from those before it [Gonzalez 1985].
    """
    body = t.body
    motion = np.einsum("vxm,vx->vm", t.model.shape[body].astype(float), t.normal[body])
    motion /= np.maximum(np.sqrt((motion**2).mean(axis=0)), 1e-300)
    square = (motion**2).sum(axis=1)
    selected = [int(square.argmax())]
    gap = np.full(len(body), np.inf)
    for _ in range(min(count, len(body)) - 1):
        last = selected[-1]
        gap = np.minimum(gap, square + square[last] - 2 * np.abs(motion @ motion[last]))  # a mode's sign is nobody's
        selected.append(int(gap.argmax()))
    return np.asarray(body[selected])


def _strengths(t: DashpotFit) -> Array:
    """Return steps times the strength in N·s/m that doubles the typical decay."""
    steps = (0.06, 0.25, 1.0, 4.0, 16.0)  # of the strength that doubles the typical decay
    square = float((t.model.shape[t.body].astype(float) ** 2).sum(axis=1).mean()) / 3
    return np.array(steps) * 2 * float(np.median(t.decay_per_s)) / max(square, 1e-300)
