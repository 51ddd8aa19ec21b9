"""Loads of touching pairs, split into what is silent, what strikes and what rubs.

    impulses of each step -> load F (pairs, steps) -> support N = opening of F -> strike = top-hat F - N over a rising
        edge

A physics step tells only a force averaged over it. Fed to a mode as it is, a resting weight would be a comb at the step
rate [van den Doel, Kry, Pai 2001, sec. 5 discuss the same of recorded forces]. The split is a morphological opening of
the load over `SPAN` steps [Serra 1982, ch. II]: what lasts that long carries weight and is silent (it loads the surface
model instead), what is shorter is an impact. Impacts of up to SPAN - 1 steps become one strike: simulators spread one
impact over 2-3 steps.

An impact needs a cause. A solver's flicker between the corners of a resting box looks like an impact but nothing
approached: a pair's strike is bounded by 2·m*·v (an elastic impact at the approach speed v before the step), or by what
a struck neighbour hands on (`accepted_impulse`). Where a mobile body of the pair carried load within the last SPAN - 1
steps, v counts above the speed that gravity gives along the normal in one step: below it, leaving and landing cannot be
distinguished from resting, nor a roll from one support on to the next from a fall.

Surfaces that overlap when a step starts have met in the step before (with `contactProcessingThreshold=0`, Bullet sees a
contact only then): strikes are looked for one step ahead of the step being rendered, so that they can be dated back.
What cannot be distinguished from support that early (the last step of an impact of SPAN - 1 steps is the last one
known) follows when the step itself is rendered.

p pairs; column `NOW` of the load history is the step being rendered, later columns are the look-ahead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Contacts

SPAN = 4
NOW = SPAN - 1
LOOKAHEAD = SPAN - 1


@dataclass(frozen=True, slots=True, eq=False)
class LoadHistory:
    """key (p,) sorted pair keys; force_n (p, 2·SPAN-1) their normal loads; struck_n (p, 2·SPAN-1) what of them
    strikes have used up.
    """

    key: Array
    force_n: Array
    struck_n: Array

    @classmethod
    def empty(cls) -> LoadHistory:
        return cls(np.zeros(0, np.int64), np.zeros((0, 2 * SPAN - 1)), np.zeros((0, 2 * SPAN - 1)))


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """The loads of one step, by kind.

    key (p,). support_n (p, 2): silent load at the step's start and end. strike (q,): rows of the pairs that are struck
    in the step that was asked for. share (q, j): part of the normal impulse of that and the next known steps, SPAN - 1
    at most, that belongs to each strike. loaded (p,): whether each pair carried load within the SPAN - 1 steps before.
    """

    key: Array
    support_n: Array
    strike: Array
    share: Array
    loaded: Array


def pair_key(contacts: Contacts) -> Array:
    """(k,) one number per pair of bodies, the same in either order."""
    low, high = np.minimum(contacts.a, contacts.b).astype(np.int64), np.maximum(contacts.a, contacts.b).astype(np.int64)
    return (low << 32) | high


def key_bodies(key: Array) -> tuple[Array, Array]:
    """The two body indices (p,), (p,) of pair keys, lower first."""
    return (key >> 32).astype(np.int64), (key & 0xFFFFFFFF).astype(np.int64)


def normal_load_n(contacts: Contacts, dt_s: float) -> tuple[Array, Array]:
    """Pair keys (p,) of one step, sorted, and their normal loads (p,) in newton."""
    key, row = np.unique(pair_key(contacts), return_inverse=True)
    impulse = np.einsum("ki,ki->k", contacts.impulse_n_s, contacts.normal)
    return key, np.bincount(row, np.maximum(impulse, 0.0), minlength=len(key)) / dt_s


def push(history: LoadHistory, contacts: Contacts, dt_s: float) -> LoadHistory:
    """The history one step later: the newest loads enter the last column, pairs long without load leave."""
    key, load = normal_load_n(contacts, dt_s)
    alive = history.force_n[:, 1:].any(axis=1)
    union = np.union1d(history.key[alive], key)
    force, struck = np.zeros((2, len(union), 2 * SPAN - 1))
    old = np.searchsorted(union, history.key[alive])
    force[old, :-1] = history.force_n[alive, 1:]
    struck[old, :-1] = history.struck_n[alive, 1:]
    force[np.searchsorted(union, key), -1] = load
    return LoadHistory(union, force, struck)


def _opening(force: Array, column: int) -> Array:
    """Opening of the load at a column: the best of the windows of SPAN steps around it, cut where the future is not
    known.
    """
    last = force.shape[1]
    windows = [force[:, i : min(i + SPAN, last)].min(axis=1) for i in range(max(column - SPAN + 1, 0), column + 1)]
    return np.max(windows, axis=0) if len(force) else np.zeros(0)


def split(history: LoadHistory, ahead: int = 1) -> tuple[Split, LoadHistory]:
    """Support of the step in column NOW and strikes of the one ``ahead`` steps after it, and the history with those
    marked as used.

    Ask with ahead = 0 first. An opening that the future could still lower is taken as high as it may be, so nothing is
    struck that may be support; asked again when more is known, a strike gives what it lacked.
    """
    force, column = history.force_n, NOW + ahead
    stop = min(column + SPAN - 1, force.shape[1])
    opening = np.stack([_opening(force, i) for i in range(NOW, stop)], axis=1).reshape(len(force), stop - NOW)
    load = force[:, column:stop]
    excess = np.maximum(load - opening[:, ahead:] - history.struck_n[:, column:stop], 0.0)
    excess[excess <= 1e-9 * load] = 0.0  # rounding of the sums is no impact
    strike = np.flatnonzero((excess[:, 0] > 0) & (force[:, column] > force[:, column - 1]))
    connected = np.cumprod(excess[strike] > 0, axis=1).astype(bool)
    used = np.where(connected, excess[strike], 0.0)
    struck = history.struck_n.copy()
    struck[strike, column:stop] += used
    loaded = np.asarray((force[:, column - SPAN + 1 : column] > 0).any(axis=1))
    share = used / np.where(load[strike] > 0, load[strike], 1.0)
    return Split(history.key, opening[:, :2], strike, share, loaded), LoadHistory(history.key, force, struck)


def causing_approach_m_s(
    approach_m_s: Array, a: Array, b: Array, normal: Array, steps: Array, fall_m_s: Array
) -> Array:
    """Approach speed (q,) that can cause an impact. normal (q, 3) of the pairs with bodies a, b (q,); steps (bodies,):
    for how many steps gravity may have moved each without its falling (`unheld_steps`); fall_m_s (3,): the velocity
    that it gives in one. A tenth is added for what a solver leaves over, and a hundredth of the whole in every
    direction: wedged bodies turn a little of it sideways (a settled pile creeps at 0.1 mm/s, 0.003 g·dt).
    """
    fall = 1.1 * np.abs(normal @ fall_m_s) + 0.01 * np.linalg.norm(fall_m_s)
    return np.asarray(np.maximum(approach_m_s - np.maximum(steps[a], steps[b]) * fall, 0.0))


def unheld_steps(split_: Split, mobile: Array, placed: Array) -> Array:
    """(bodies,) steps for which gravity may have moved each mobile body although it rests: 1 where it carried load on
    any pair within the last steps, SPAN where it was just put where it is (placed): Bullet finds the corners on which
    a box stands one a step, and it tilts meanwhile.
    """
    low, high = key_bodies(split_.key[split_.loaded])
    out = np.zeros(len(mobile))
    out[low] = out[high] = 1.0
    return np.asarray(np.where(placed, float(SPAN), out) * mobile)


def accepted_impulse(raw_n_s: Array, budget_n_s: Array, a: Array, b: Array, mobile: Array, rounds: int = 8) -> Array:
    """Strike impulses (q,) that a cause explains: the own budget, or that of a neighbour struck in the same step.

    raw_n_s, budget_n_s (q,): wanted and self-caused. a, b (q,): body indices. mobile (bodies,): False for what never
    moves: a floor hands nothing on. The largest neighbour counts, not the sum: solver noise of a pile must not add up
    to an impact. An impact travels at most ``rounds`` bodies far in one physics step.
    """
    accepted = np.minimum(raw_n_s, budget_n_s)
    for _ in range(rounds):
        through = np.zeros(len(mobile))
        np.maximum.at(through, a, accepted)
        np.maximum.at(through, b, accepted)
        handed = np.maximum(np.where(mobile[a], through[a], 0.0), np.where(mobile[b], through[b], 0.0))
        grown = np.minimum(raw_n_s, np.maximum(budget_n_s, handed))
        if np.array_equal(grown, accepted):
            break
        accepted = grown
    return accepted
