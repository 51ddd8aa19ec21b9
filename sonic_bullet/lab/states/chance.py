"""How often takes of one state differ as much as those of two: by exchange of takes, or by their scatter.

    T_r = (mean B − mean A)/(s_r √(1/a + 1/b)),   s_r² = (d₀ s₀² + d s²)/(d₀ + d)                       [Smyth 2004]
    by exchange: the share of labellings of the takes whose largest |T| is as large     [Westfall & Young 1993, ch. 2.6]
        step by step: what is certain is set aside, and the rest held against the largest of the rest
    by scatter:  Student's law of T with d₀ + d degrees of freedom, times the number of values looked at  [Bonferroni]
        and LONG_TAILS
        takes have longer tails than a normal law, so no other labelling may make as much, of this value or of any:
        of the 35 ways to divide eight takes in halves, one at most can make a statement
    in pairs, of strikes that both states recorded: what a strike has of its own cancels, and half of the degrees of
        freedom with it;  d = B − A,  s² = Σ (d − <d>)²/(2 (n − 1));  labellings exchange the two of a pair

s₀²: what values of the same kind scatter by, in units of their own measurement's spread.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from sonic_bullet.records import Array

CERTAIN = 0.01
"""A statement is made where takes of one state would make any one at all in one comparison of a hundred."""
SHARED_DEGREES = 4.0
"""d₀: as much as five takes tell, kinds of values tell each other."""
LONG_TAILS = 10 / 3
"""Times as often as normal takes do takes of four and four differ, that scatter as Student's law of 3 degrees and share
a part of it: at 0.01 of 250 made comparisons 2.8 % made a statement, at 0.003 0.4 %."""
MOST_LABELLINGS = 3000
FEWEST_DEGREES = 5
"""Below that, takes tell too little of their scatter: of three and three one lies near enough by chance to hide it."""


@dataclass(frozen=True, slots=True, eq=False)
class Verdicts:
    """What each of r values says: change, its spread, T and the probability that chance makes any as large.

    method: "exchange", "scatter" or "too few takes". NaN where a value could not be compared.
    """

    change: Array
    change_sd: Array
    t: Array
    chance: Array
    method: str

    @property
    def certain(self) -> Array:
        """Which values (r,) changed beyond takes."""
        return np.asarray(self.chance <= CERTAIN)


FEWEST_PAIRS = 4
"""Of strikes recorded twice: of 250 made comparisons of four, as above, none made a statement."""


def labelling_count(a: int, b: int, *, paired: bool = False) -> int:
    """Count the ways to divide takes into states that differ from each other."""
    if paired:
        return int(2 ** (a - 1))
    return comb(a + b, a) // (2 if a == b else 1)


def judge(
    values: Array,
    after: Array,
    kind: Array,
    own_sd: Array,
    elsewhere: tuple[Array, Array] | None = None,
    *,
    paired: bool = False,
) -> Verdicts:
    """Hold the takes of two states against chance.

    Parameters
    ----------
    values : (r, t)
        Of each take; NaN where it could not be measured.
    after : (t,) bool
        Which takes are of the second state.
    kind : (r,)
        Values of one kind share their scatter.
    own_sd : (r,)
        Spread of the measurement alone.
    elsewhere : (r,), (r,)
        Sum of squares within other states, and its degrees of freedom.
    paired : bool
        Whether the states are as many takes of the same strikes, in their order.
    """
    values = clip_outliers(_without_strikes(values, after) if paired else values)
    squares, degrees = elsewhere if elsewhere is not None else (np.zeros(len(values)), np.zeros(len(values)))
    if paired:  # a strike's own is taken off, and a degree of freedom each; others' takes are no pairs and tell nothing
        squares, degrees = np.zeros(len(values)), 1.0 - np.isfinite(values[:, after]).sum(axis=1)
    a, b = int((~after).sum()), int(after.sum())
    change, spread, t, freedom = _statistics(values, after[None], kind, own_sd, squares, degrees)
    change, spread, t, freedom = change[0], spread[0], t[0], freedom[0]
    seen = np.isfinite(t)
    chance = np.full(len(values), np.nan)
    if labelling_count(a, b, paired=paired) * CERTAIN >= 1:
        parts = [part[seen] for part in (values, kind, own_sd, squares, degrees)]
        chance[seen] = _by_exchange(parts, _labels(after, paired), np.abs(t[seen]))
        return Verdicts(change, spread, t, chance, "exchange")
    enough = seen & (freedom >= (FEWEST_PAIRS - 1 if paired else FEWEST_DEGREES))
    if not enough.any():
        return Verdicts(change, spread, t, chance, "too few takes")
    from scipy.stats import t as student

    tails = 2 * LONG_TAILS * student.sf(np.abs(t[enough]), freedom[enough] + SHARED_DEGREES)
    chance[enough] = np.minimum(1.0, tails * enough.sum())
    parts = [part[enough] for part in (values, kind, own_sd, squares, degrees)]
    chance[enough] = np.maximum(chance[enough], _share_of_exchanges(parts, _labels(after, paired), np.abs(t[enough])))
    return Verdicts(change, spread, t, chance, "scatter")


def _share_of_exchanges(parts: list[Array], labels: Array, observed: Array) -> Array:
    """Share of labellings (r,) that make as much of each value, or of any; 0 where the takes' own, the first, does."""
    values, kind, own_sd, squares, degrees = parts
    other = labels[(labels != labels[0]).any(axis=1) & (labels == labels[0]).any(axis=1)]
    if not len(other):
        return np.zeros(len(values))
    t = np.nan_to_num(np.abs(_statistics(values, other, kind, own_sd, squares, degrees)[2]))
    any_as_large = (t.max(axis=1) >= observed.max()).sum()
    each_as_large = (t >= observed).sum(axis=0)
    return np.asarray(np.maximum(each_as_large, any_as_large) / (1 + len(other)))


def _by_exchange(parts: list[Array], labels: Array, observed: Array) -> Array:
    """Probability (r,) of each |T|, step by step."""
    values, kind, own_sd, squares, degrees = parts
    t = np.abs(_statistics(values, labels, kind, own_sd, squares, degrees)[2])
    t = np.nan_to_num(t)
    chance = np.ones(len(values))
    left = np.arange(len(values))
    slack = 1 + 1e-9  # labellings of equal T are equal
    while len(left):
        largest = t[:, left].max(axis=1)
        now = (largest[None] * slack >= observed[left, None]).mean(axis=1)
        chance[left] = now
        if (now > CERTAIN).all() or (now <= CERTAIN).all():
            break
        left = left[now > CERTAIN]
    return chance


def clip_outliers(values: Array) -> Array:
    """Return values (r, t) with those far outside the middle half of all, whatever their state, at its bound.

    Blind to the states, so that exchange stays exact; one take in which a decay could not be told no longer hides all.
    """
    far = 1.5  # interquartile ranges: Tukey's fences                                        [Tukey 1977, ch. 2]
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of rows without a value
        low, high = np.nanquantile(values, [0.25, 0.75], axis=1)[:, :, None]
    reach = far * (high - low)
    return np.asarray(np.clip(values, low - reach, high + reach))


def _without_strikes(values: Array, after: Array) -> Array:
    """Return values (r, t) of strikes that two states recorded less each strike's mean; NaN where either is."""
    one, other = values[:, ~after], values[:, after]
    made = np.empty(values.shape)
    made[:, ~after], made[:, after] = (one - other) / 2, (other - one) / 2
    return made


def _labels(after: Array, paired: bool) -> Array:
    """Return which takes are of the second state, (p, t): as they are, then otherwise, pair by pair or all ways."""
    if not paired:
        every = labellings(after)
        return np.concatenate([after[None], every[(every != after).any(axis=1)]])
    turned = labellings_of_pairs(int(after.sum()))
    made = np.empty((len(turned), len(after)), bool)
    made[:, ~after], made[:, after] = turned, ~turned
    return made


def labellings_of_pairs(count: int) -> Array:
    """Return which of so many pairs are exchanged (p, count), none first: all ways, or many."""
    if 2**count <= MOST_LABELLINGS:
        return np.asarray((np.arange(2**count)[:, None] >> np.arange(count)) % 2 == 1)
    drawn = np.random.default_rng(0).random((MOST_LABELLINGS - 1, count)) < 0.5
    return np.concatenate([np.zeros((1, count), bool), drawn])


def labellings(after: Array) -> Array:
    """Return which takes are of the second state, (p, t): as they are, and otherwise divided: all ways, or many."""
    t, b = len(after), int(after.sum())
    if comb(t, b) <= MOST_LABELLINGS:
        made = np.zeros((comb(t, b), t), bool)
        for row, chosen in zip(made, combinations(range(t), b), strict=True):
            row[list(chosen)] = True
        return made
    rng = np.random.default_rng(0)
    made = np.array([after, *(rng.permutation(after) for _ in range(MOST_LABELLINGS - 1))])
    return made


def _statistics(
    values: Array, labels: Array, kind: Array, own_sd: Array, squares: Array, degrees: Array
) -> tuple[Array, Array, Array, Array]:
    """Change, its spread, T and degrees of freedom (p, r) of values (r, t) under labellings (p, t)."""
    seen = np.isfinite(values)
    filled = np.where(seen, values, 0.0)
    middle = filled.sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    filled = np.where(seen, values - middle[:, None], 0.0)  # against rounding
    second = labels.astype(float)
    first = 1 - second
    count_a, count_b = first @ seen.T, second @ seen.T
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_a, mean_b = first @ filled.T / count_a, second @ filled.T / count_b
        within = (filled**2).sum(axis=1) - count_a * mean_a**2 - count_b * mean_b**2
    single = len(values.T) == 2
    usable = (count_a >= 1) & (count_b >= 1) if single else (count_a >= 2) & (count_b >= 2)
    if (degrees > 0).any():
        usable = (count_a >= 1) & (count_b >= 1)
    freedom = np.where(usable, count_a + count_b - 2 + degrees, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.maximum(within + squares, 0.0) / freedom
        relative = variance / own_sd**2
        shared = np.full(relative.shape, np.nan)
        for one in np.unique(kind):
            of = kind == one
            middle_of = np.array([_median(row) for row in relative[:, of]])
            shared[:, of] = middle_of[:, None] * own_sd[of] ** 2
        shared = np.maximum(shared, own_sd**2)
        pooled = (SHARED_DEGREES * shared + np.nan_to_num(freedom) * np.nan_to_num(variance)) / (
            SHARED_DEGREES + np.nan_to_num(freedom)
        )
        spread = np.sqrt(pooled * (1 / count_a + 1 / count_b))
        change = np.where(usable, mean_b - mean_a, np.nan)
        t = np.where(usable, change / spread, np.nan)
    return change, spread, t, freedom


def _median(row: Array) -> float:
    good = row[np.isfinite(row)]
    return float(np.median(good)) if len(good) else 1.0
