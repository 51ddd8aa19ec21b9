"""Impacts of soft contacts, which brake a body over many steps, collected to one strike.

    CONTACT rows of a step -> a pair that meets faster than gravity explains: pass the load before, or the weight of the
                              lighter body, as its support; hold the rest
                           -> it parts, its load or its speed has settled: one row a contact point, all that was held
    all other rows pass as they are

A soft constraint spreads an impact over its time constant, 10 ms and more, where real ones last microseconds. Taken
step by step it would be a support (contact.load_splitting). No impulse is lost or made: what is held is given out
later, so that the sums balance momentum over each impact. The strike comes as the impact ends.

The load has settled: what exceeds the support is below 3 % of its peak. The speed has: it is below 5 % of
the first and, at its present rate, would not have changed by more than twice that since the impact began; at the
turning point of an elastic impact, where the speed is 0 as well, that is π/2 of it.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import CONTACT

LONGEST_IMPACT_S = 0.1
"""Longest impact: what brakes a body for longer is a cushion, which is silent."""

SOFT_IMPACT = np.dtype(
    [
        ("key", "i8"),  # lower body << 32 | higher body
        ("approach_m_s", "f8"),  # largest closing speed so far
        ("latest_m_s", "f8"),
        ("meets_s", "f8"),  # gap over approach as it began: after the start of its first step; 0: not known
        ("support_n", "f8"),  # load before it began, or the weight
        ("peak_n", "f8"),  # largest load so far
        ("steps", "i8"),
        ("elapsed_s", "f8"),
        ("over", "i8"),
    ],
    align=True,
)
HELD_POINT = np.dtype(
    [
        ("key", "i8"),
        ("row", CONTACT),  # sums so far: impulse; points and normal weighted by load; slip, sweep of the first
        ("latest_m", "f8", (3,)),  # its point in the frame of the body a
        ("weight_n_s", "f8"),
        ("taken", "i8"),
    ],
    align=True,
)
LOAD = np.dtype(
    [("key", "i8"), ("force_n", "f8"), ("weight_n", "f8"), ("approach_m_s", "f8"), ("gap_m", "f8"), ("impact", "i8")],
    align=True,
)
"""A pair in one step. impact: its place among the impacts, or -1."""


class _Counts(NamedTuple):
    """Places in the counts of an `ImpactTables`."""

    impacts: int = 0
    held: int = 1
    pairs: int = 2
    rows: int = 3


COUNT = _Counts()


class ImpactTables(NamedTuple):
    """Tables of one step: impacts and points held, pairs of the step before and of this one, rows that it gives out."""

    impact: Array
    held: Array
    before: Array
    now: Array
    out: Array
    counts: Array


class SoftImpacts:
    """Impacts under way in one world."""

    def __init__(self) -> None:
        self._impact: Array = np.zeros(0, SOFT_IMPACT)
        self._held: Array = np.zeros(0, HELD_POINT)
        self._before: Array = np.zeros(0, LOAD)

    def collect(self, row: Array, dt_s: float, gravity_m_s2: tuple[float, ...], mass_kg: Array) -> Array:
        """Return the rows of CONTACT that a step gives out.

        Parameters
        ----------
        row : Array of CONTACT, shape (k,)
            Its contacts.
        dt_s, gravity_m_s2
            Of the step: an approach that gravity makes in one step begins no impact.
        mass_kg : Array, shape (k,)
            Of the lighter body of each row.
        """
        k = len(row)
        if not k and not len(self._impact):
            self._before = self._before[:0]
            return row
        impact = np.concatenate([self._impact, np.zeros(k, SOFT_IMPACT)])
        held = np.concatenate([self._held, np.zeros(k, HELD_POINT)])
        out, now = np.zeros(k + len(held), CONTACT), np.zeros(k, LOAD)
        counts = np.array([len(self._impact), len(self._held), 0, 0])
        g = float(np.linalg.norm(gravity_m_s2))
        collect_rows(row, g * mass_kg, dt_s, 1.1 * g * dt_s, ImpactTables(impact, held, self._before, now, out, counts))
        self._impact, self._held = impact[: counts[COUNT.impacts]].copy(), held[: counts[COUNT.held]].copy()
        self._before = now[: counts[COUNT.pairs]]
        return out[: counts[COUNT.rows]]


@njit(nogil=True, error_model="numpy")
def place_of(table, count, key):
    """Find the first row of a key, or -1."""
    for i in range(count):
        if table[i].key == key:
            return i
    return -1


@njit(nogil=True, error_model="numpy")
def pair_key(row):
    """Return the key of a row's pair."""
    return np.int64(min(row.a, row.b)) << 32 | np.int64(max(row.a, row.b))


@njit(nogil=True, error_model="numpy")
def load_of(row):
    """Return the normal impulse of a row, 0 or more."""
    j, n = row.impulse_n_s, row.normal
    return max(j[0] * n[0] + j[1] * n[1] + j[2] * n[2], 0.0)


@njit(nogil=True, error_model="numpy")
def copy_row(source, to, fraction):
    """Write a row with a fraction of its impulse."""
    to.a, to.b, to.approach_m_s, to.gap_m = source.a, source.b, source.approach_m_s, source.gap_m
    for x in range(3):
        to.point_a_m[x], to.point_b_m[x], to.normal[x] = source.point_a_m[x], source.point_b_m[x], source.normal[x]
        to.impulse_n_s[x], to.slip_m_s[x] = fraction * source.impulse_n_s[x], source.slip_m_s[x]
    for x in range(2):
        to.sweep_m_s[x] = source.sweep_m_s[x]


@njit(nogil=True, error_model="numpy")
def hold(row, key, fraction, held, counts):
    """Add a fraction of a row to the nearest point held of its pair that no other row of this step was added to."""
    best, nearest = -1, np.inf
    for i in range(counts[COUNT.held]):
        one = held[i]
        if one.key != key or one.taken != 0 or one.row.a != row.a:
            continue
        p, q = one.latest_m, row.point_a_m
        off = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
        if off < nearest:
            best, nearest = i, off
    load = fraction * load_of(row)
    if best < 0:
        best = counts[COUNT.held]
        counts[COUNT.held] += 1
        held[best].key, held[best].weight_n_s = key, 0.0
        copy_row(row, held[best].row, 0.0)
        for x in range(3):
            held[best].row.point_a_m[x] = held[best].row.point_b_m[x] = held[best].row.normal[x] = 0.0
    one = held[best]
    one.taken = 1
    one.weight_n_s += load
    for x in range(3):
        one.latest_m[x] = row.point_a_m[x]
        one.row.impulse_n_s[x] += fraction * row.impulse_n_s[x]
        one.row.point_a_m[x] += load * row.point_a_m[x]
        one.row.point_b_m[x] += load * row.point_b_m[x]
        one.row.normal[x] += load * row.normal[x]


@njit(nogil=True, error_model="numpy")
def give_out(one, impact, to):
    """Write a held point as a row of a strike, as far into the step as the surfaces met in the impact's first."""
    copy_row(one.row, to, 1.0)
    to.approach_m_s, to.gap_m = impact.approach_m_s, impact.meets_s * impact.approach_m_s
    length = 0.0
    for x in range(3):
        length += to.normal[x] ** 2
    for x in range(3):
        to.point_a_m[x], to.point_b_m[x] = to.point_a_m[x] / one.weight_n_s, to.point_b_m[x] / one.weight_n_s
        to.normal[x] /= np.sqrt(length)


@njit(nogil=True, error_model="numpy")
def collect_rows(row, weight, dt, fall, tables):
    """Fill the tables' out; update impact, held, now.

    weight (k,): of the lighter body of each row (k,), in N. fall: closing speed in m/s that begins no impact.
    """
    impact, held, now, counts = tables.impact, tables.held, tables.now, tables.counts
    for i in range(counts[COUNT.held]):
        held[i].taken = 0
    for i in range(counts[COUNT.impacts]):
        impact[i].over = 1  # unless the pair is loaded
    sum_loads(row, weight, dt, now, counts)
    for i in range(counts[COUNT.pairs]):
        if now[i].force_n > 0:
            now[i].impact = follow(now[i], dt, fall, tables)
    for i in range(len(row)):
        pass_row(row[i], now[place_of(now, counts[COUNT.pairs], pair_key(row[i]))], tables)
    for i in range(counts[COUNT.pairs]):  # what passed is the support of the next step
        if now[i].impact >= 0 and impact[now[i].impact].over == 0:
            now[i].force_n = min(now[i].force_n, impact[now[i].impact].support_n)
    finish(impact, held, tables.out, counts)


@njit(nogil=True, error_model="numpy")
def sum_loads(row, weight, dt, now, counts):
    """Fill now: load and fastest loaded approach of each pair."""
    for i in range(len(row)):
        key, load = pair_key(row[i]), load_of(row[i])
        at = place_of(now, counts[COUNT.pairs], key)
        if at < 0:
            at = counts[COUNT.pairs]
            counts[COUNT.pairs] += 1
            now[at].key, now[at].force_n, now[at].approach_m_s, now[at].impact = key, 0.0, -np.inf, -1
            now[at].weight_n, now[at].gap_m = weight[i], 0.0
        now[at].force_n += load / dt
        if load > 0 and row[i].approach_m_s > now[at].approach_m_s:
            now[at].approach_m_s, now[at].gap_m = row[i].approach_m_s, row[i].gap_m


@njit(nogil=True, error_model="numpy")
def pass_row(one, pair, tables):
    """Write the part of a row that passes to out, and hold the rest."""
    fraction = 1.0
    if pair.impact >= 0 and tables.impact[pair.impact].over == 0 and load_of(one) > 0:
        fraction = min(tables.impact[pair.impact].support_n / pair.force_n, 1.0)
        if fraction < 1.0:
            hold(one, pair.key, 1.0 - fraction, tables.held, tables.counts)
    if fraction > 0:
        copy_row(one, tables.out[tables.counts[COUNT.rows]], fraction)
        tables.counts[COUNT.rows] += 1


@njit(nogil=True, error_model="numpy")
def follow(one, dt, fall, tables):
    """Begin or continue the impact of a loaded pair; return its place, or -1 without one."""
    rest_speed_fraction, tail_fraction = 0.05, 0.03  # of the approach; of the peak load
    impact, before, counts = tables.impact, tables.before, tables.counts
    at = place_of(impact, counts[COUNT.impacts], one.key)
    if at < 0:
        was = place_of(before, len(before), one.key)
        support = before[was].force_n if was >= 0 else 0.0
        if not (one.approach_m_s > fall and one.force_n > support):
            return -1
        at = counts[COUNT.impacts]
        counts[COUNT.impacts] += 1
        new = impact[at]
        new.key, new.support_n, new.steps, new.elapsed_s = one.key, max(support, one.weight_n), 0, 0.0
        new.peak_n = 0.0
        new.approach_m_s = new.latest_m_s = one.approach_m_s
        new.meets_s = one.gap_m / one.approach_m_s
    it = impact[at]
    change = abs(it.latest_m_s - one.approach_m_s)
    it.approach_m_s, it.latest_m_s = max(it.approach_m_s, one.approach_m_s), one.approach_m_s
    rest = rest_speed_fraction * it.approach_m_s
    settled = it.steps > 0 and abs(one.approach_m_s) <= rest and change * it.steps <= 2 * rest
    it.peak_n = max(it.peak_n, one.force_n)
    settled = settled or one.force_n - it.support_n <= tail_fraction * (it.peak_n - it.support_n)
    it.over = 1 if settled or it.elapsed_s >= LONGEST_IMPACT_S else 0
    it.steps, it.elapsed_s = it.steps + 1, it.elapsed_s + dt
    return at


@njit(nogil=True, error_model="numpy")
def finish(impact, held, out, counts):
    """Give out what impacts held that are over, and drop them."""
    kept = 0
    for i in range(counts[COUNT.held]):
        one = impact[place_of(impact, counts[COUNT.impacts], held[i].key)]
        if one.over != 0:
            give_out(held[i], one, out[counts[COUNT.rows]])
            counts[COUNT.rows] += 1
        else:
            held[kept] = held[i]
            kept += 1
    counts[COUNT.held] = kept
    kept = 0
    for i in range(counts[COUNT.impacts]):
        if impact[i].over == 0:
            impact[kept] = impact[i]
            kept += 1
    counts[COUNT.impacts] = kept
