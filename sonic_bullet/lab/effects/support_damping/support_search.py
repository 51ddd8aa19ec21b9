"""Search for places of dashpots: all over the surface first, then about the best, one after another.

data · ln left + j (3 ln data + 6) -> min over the number j of dashpots; each step: grid, the best few of it,
    refined       [Schwarz 1978]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.lab.effects.support_damping.dashpot_fit import Dashpot, DashpotFit, Dashpots
from sonic_bullet.lab.effects.support_damping.support_subsets import subsets
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.records import Array

# vertices where another dashpot is looked for; and where the first is, or one that is moved
NEXT_SPOTS = 90
FIRST_SPOTS = 500
# of the grid, looked at closer; refined; vertices of a turn about one; spots enough to stand for all there
GRID_LOOKED_AT = 40
STARTS_REFINED = 4
NEARBY_SPOTS = 28
FEWEST_NEARBY_SPOTS = 10
REACHES = (0.12, 0.07, 0.04, 0.02)  # of a turn each, in sizes of the body
STRENGTH_STEP = 0.15  # of ln c
SUBSETS_KEPT = 2  # of each number of dashpots to first order
EXPLAINED_RATIO = 2.0  # of the spreads' own misfit: no more is asked
# in BIC, for another dashpot; of what one costs: one that explains less ends the search
NEXT_DASHPOT_BIC = 6.0
LAST_GAIN_SHARE = 0.5


def sought(t: DashpotFit) -> Dashpots:
    """Find the dashpots that are accepted, one after another.

    The least Bayes information criterion decides how many, with NEXT_DASHPOT_BIC for each on top.
    """
    most = 4
    data = 3 * len(t.freq_hz)  # a decay, a pattern and a level each
    apiece = 3 * np.log(data) + NEXT_DASHPOT_BIC
    least = float(t.worth.sum())  # what is left within the spreads asks for nothing

    def priced(d: Dashpots) -> tuple[float, Dashpots]:
        return float(data * np.log(max(t.left(d), least)) + len(d) * apiece), d

    def without_idle(best: tuple[float, Dashpots]) -> Dashpots:
        for _ in best[1]:  # one that has helped the others to their places may say nothing there any more
            best = min([best, *(priced(best[1][:i] + best[1][i + 1 :]) for i in range(len(best[1])))], key=_cost)
        return best[1]

    chosen: Dashpots = ()
    if t.left(chosen) < least:
        return chosen
    spots = _spread(t, FIRST_SPOTS)
    weak = parallel_map(
        lambda d: tuned(t, refined(t, d, REACHES[-2:])[1]),
        subsets(t, spots[:NEXT_SPOTS], SUBSETS_KEPT),
    )
    none = priced(())
    some = min([none, *(priced(d) for d in weak)], key=_cost)
    if some[1] and t.left(some[1]) < EXPLAINED_RATIO * least:
        return without_idle(some)
    tried, starts = [none], [chosen]
    while len(chosen) < most:  # of one alone a basin may lie between the points of a coarse grid
        chosen, starts = _with_one_more(t, starts, _grid(t, spots[:NEXT_SPOTS] if chosen else spots), spots)
        tried.append(priced(chosen))
        best = min(tried, key=_cost)
        if tried[-1][0] > best[0] + LAST_GAIN_SHARE * apiece or best not in tried[-2:]:
            break  # weak ones have been looked for; of two as strong as each other, one alone may not pay
    return _elsewhere(t, without_idle(min([*tried, some], key=_cost)), spots)


def _grid(t: DashpotFit, vertices: Array) -> list[Dashpot]:
    """Return dashpots of all strengths and directions at some vertices."""
    return [
        Dashpot(int(v), c, direction)
        for v in vertices
        for c in _strengths(t).tolist()
        for direction in ("normal", "every")
    ]


def _elsewhere(t: DashpotFit, found: Dashpots, spots: Array) -> Dashpots:
    """Move each dashpot far away and search from there, as on round bodies a search may end on the wrong side."""
    best = (t.left(found), found)
    for i in range(len(found)):
        moved = [(*found[:i], replace(found[i], vertex=int(v)), *found[i + 1 :]) for v in spots]
        few = _best(_left(t, moved), [(*m[:i], *m[i + 1 :], m[i]) for m in moved], STARTS_REFINED)
        ends = parallel_map(lambda one: refined(t, one, REACHES)[1], few)
        best = min([best, *((t.left(end), end) for end in ends)], key=_cost)
    return best[1]


def _cost(pair: tuple[float, Dashpots]) -> float:
    """Return the cost of a pair (cost, dashpots)."""
    return pair[0]


def _with_one_more(
    t: DashpotFit, starts: list[Dashpots], grid: list[Dashpot], spots: Array
) -> tuple[Dashpots, list[Dashpots]]:
    """Find the best set with one dashpot more, and the sets to go on from.

    Other single dashpots are kept: the best one alone may be no member of the best two.
    """
    few: list[Dashpots] = []
    for chosen in starts:
        trials = [(*chosen, d) for d in grid]
        few += _best(
            _of_each(lambda part: [t.price(*modes) for modes in t.poles(part, t.runs)], trials),
            trials,
            GRID_LOOKED_AT,
        )
    few = _best(_left(t, few), few, STARTS_REFINED)
    found, *others = (
        one
        for _, one in sorted(
            parallel_map(lambda one: refined(t, one, REACHES[:2], spots), few), key=lambda pair: pair[0]
        )
    )
    for _ in range(min(len(found), 2)):  # once all are where they should be, one may be seen to stand at a mirror image
        found = refined(t, found, (np.inf, *REACHES), spots)[1]
    found = tuned(t, min(found, refined(t, found, REACHES[-1:], whole=True)[1], key=t.left))
    return found, [found, *(others if len(found) == 1 else [])]


def _left(t: DashpotFit, trials: list[Dashpots]) -> list[float]:
    """Compute what each trial leaves, modes coupling within runs only."""
    return _of_each(lambda part: [t.misfit(*modes, 1) for modes in t.poles(part, t.runs)], trials)


def _of_each(price: Callable[[list[Dashpots]], list[float]], trials: list[Dashpots]) -> list[float]:
    """Compute the prices of many trials, in two processes where there are many."""
    many = 40  # trials that are worth a second process
    parts = [trials[: len(trials) // 2], trials[len(trials) // 2 :]] if len(trials) >= many else [trials]
    return [one for part in parallel_map(price, parts) for one in part]


def _best(price: list[float], trials: list[Dashpots], count: int) -> list[Dashpots]:
    """Select the few trials at the least price, the last dashpot of each at a vertex of its own."""
    found: dict[int, Dashpots] = {}
    for i in np.argsort(price, kind="stable"):
        found.setdefault(trials[i][-1].vertex, trials[i])
    return list(found.values())[:count]


def _spread(t: DashpotFit, count: int) -> Array:
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


def refined(
    t: DashpotFit, start: Dashpots, reaches: tuple[float, ...], spots: Array | None = None, *, whole: bool = False
) -> tuple[float, Dashpots]:
    """Refine strengths, directions and places, one dashpot after another.

    Parameters
    ----------
    t : DashpotFit
        The object.
    start : tuple of Dashpot
        Dashpots to start from.
    reaches : sequence of float
        Reach of each turn, in sizes of the body.
    spots : (p,)
        Vertices spread over the surface, for turns that reach far.
    whole : bool
        Whether all neighbours couple (`DashpotFit.wide`), not those within short runs alone.

    Returns
    -------
    float, tuple of Dashpot
        What is left, and the dashpots.
    """
    spots = t.body[:0] if spots is None else spots
    size = float(np.linalg.norm(np.ptp(t.model.vertex_m[t.body], axis=0)))
    best, least = start, np.inf
    for reach in reaches:
        for i in range(len(best)):
            trials = [(*best[:i], d, *best[i + 1 :]) for d in (best[i], *_around(t, best[i], reach * size, spots))]
            left = _of_each(lambda part: [t.left(one, t.wide) for one in part], trials) if whole else _left(t, trials)
            least, best = min(zip(left, trials, strict=True), key=lambda pair: pair[0])
    return least, best


def _around(t: DashpotFit, d: Dashpot, reach_m: float, spots: Array) -> list[Dashpot]:
    """Return variants of a dashpot: elsewhere with the same strength or loss, stronger, weaker, other direction."""
    finer, coarser = (0.6, 0.8, 0.92, 1.08, 1.25, 1.6), (0.1, 0.3, 3.0, 10.0)  # times stronger, in turns
    if not np.isfinite(reach_m):
        some = spots[: 2 * NEXT_SPOTS].tolist()
        return (
            [_moved(t, d, v) for v in some]
            + [replace(d, vertex=v) for v in some]
            + [replace(d, c=d.c * f) for f in coarser]
        )
    near = _within(t, d, reach_m, spots)
    near = near[:NEARBY_SPOTS] if len(near) >= FEWEST_NEARBY_SPOTS else _within(t, d, reach_m, t.body)
    found = [replace(d, c=d.c * f) for f in finer]
    found.append(replace(d, along="every" if d.along == "normal" else "normal"))
    some = near[:: max(1, len(near) // NEARBY_SPOTS)].tolist()
    return found + [_moved(t, d, v) for v in some] + [replace(d, vertex=v) for v in some]


def _within(t: DashpotFit, d: Dashpot, reach_m: float, some: Array) -> Array:
    """Select the vertices within reach of a dashpot."""
    return np.asarray(some[((t.model.vertex_m[some] - t.model.vertex_m[d.vertex]) ** 2).sum(axis=1) < reach_m**2])


def _moved(t: DashpotFit, d: Dashpot, vertex: int) -> Dashpot:
    """Move a dashpot, with the strength that takes as much of all modes together, to first order."""
    power = [float(((t.normal[v] @ t.model.shape[v].astype(float)) ** 2).sum()) for v in (d.vertex, vertex)]
    return Dashpot(vertex, d.c * float(np.clip(power[0] / max(power[1], 1e-300), 0.1, 10)), d.along)


def tuned(t: DashpotFit, found: Dashpots) -> Dashpots:
    """Refine the strengths one after another, within STRENGTH_STEP in their logarithms."""
    for i in range(len(found)):

        def with_strength(c: float, i: int = i, found: Dashpots = found) -> Dashpots:
            return (*found[:i], replace(found[i], c=c), *found[i + 1 :])

        def left(c: float, of: Callable[[float], Dashpots] = with_strength) -> float:
            return t.left(of(c), t.wide)

        grid = found[i].c * np.exp(STRENGTH_STEP * np.array([-1.0, 0.0, 1.0]))
        c = search_number(left, grid, 0.01)[1]
        found = min(found, with_strength(c), key=t.left)
    return found
