"""Causes: the smallest set of inputs whose substitution in B gives A's samples, to the bit.

    one by one: is it A?  yes: that one          all substituted: is it A?  no: another input differs
    else: all but one, ever fewer, while it is A -> a set of which none can be left out

A run that is not A ends at the first frame that differs, most of them early. A single cause costs one run for each
input; a set of several costs as many again. Where every input only adds to the difference, a set of which none can be
left out is the smallest there is.

Shares of several causes, where contacts are equal: Shapley values [Shapley 1953, eq. 12] of the reduction,
v(S) = 1 − d(B with S substituted, A)/d(B, A), d the distance of log spectra. They sum to 1 − the remaining fraction.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records import Array
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.signal.short_time import short_time_power

# log spectra: samples of a frame, and floor re the loudest value of A
SPECTRUM_WINDOW = 1024
SPECTRUM_FLOOR_DB = -100.0


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """Causes among inputs, by index.

    Parameters
    ----------
    exact
        Whether their substitution gives A.
    broken
        Inputs whose substitution breaks the scene, and how.
    """

    found: tuple[int, ...] = ()
    exact: bool = False
    broken: dict[int, str] = field(default_factory=dict)
    shares: dict[int, float] = field(default_factory=dict)
    stopped: bool = False


def same_sound(a: KeptSound, b: KeptSound) -> bool:
    """Tell whether two sounds have the same samples, to the bit."""
    return a.shape == b.shape and all(
        np.array_equal(x.view(np.int64), y.view(np.int64)) for x, y in zip(a.blocks(), b.blocks(), strict=True)
    )


def find_causes(count: int, sounds_as_a: Callable[[Sequence[int]], bool]) -> Causes:
    """Find the causes among ``count`` inputs; when interrupted, return those known."""
    broken: dict[int, str] = {}

    def is_a(chosen: Sequence[int]) -> bool:
        try:
            return sounds_as_a(chosen)
        except SonicBulletError as error:
            broken[chosen[0] if len(chosen) == 1 else -1] = str(error)
            return False

    found: tuple[int, ...] = ()
    try:
        for i in range(count):
            if is_a((i,)):
                return Causes((i,), True, broken)
        found = tuple(range(count))
        if count < 2 or not is_a(found):
            return Causes((), False, broken)
        for i in range(count):
            fewer = tuple(x for x in found if x != i)
            if len(fewer) > 1 and is_a(fewer):
                found = fewer
    except KeyboardInterrupt:
        return Causes(found, bool(found), broken, stopped=True)
    return Causes(found, True, broken)


def shapley_shares(
    found: Sequence[int], a: KeptSound, b: KeptSound, substitute: Callable[[Sequence[int]], KeptSound]
) -> dict[int, float]:
    """Compute the share of each cause; none for too many causes, or sounds of different lengths."""
    most_shared = 4  # most causes whose shares are determined: 2^4 runs
    n = len(found)
    if not 1 < n <= most_shared or a.shape != b.shape:
        return {}
    reference = a.samples()
    whole = log_distance(reference, b.samples())
    if whole == 0:
        return {}
    closed: dict[frozenset[int], float] = {frozenset(): 0.0}
    for size in range(1, n + 1):
        for chosen in itertools.combinations(found, size):
            made = substitute(chosen)
            if made.shape != a.shape:
                return {}
            closed[frozenset(chosen)] = 1 - log_distance(reference, made.samples()) / whole
    return {
        i: sum(
            math.factorial(len(rest)) * math.factorial(n - len(rest) - 1) / math.factorial(n)
            * (closed[frozenset({*rest, i})] - closed[frozenset(rest)])
            for size in range(n)
            for rest in itertools.combinations([x for x in found if x != i], size)
        )
        for i in found
    }  # fmt: skip


def log_distance(a: Array, b: Array) -> float:
    """Compute the rms difference of levels in dB, over windows and frequencies, of sounds (channels, n)."""
    one, other = _levels(a), _levels(b)
    floor = float(one.max(initial=-300.0)) + SPECTRUM_FLOOR_DB
    change = np.maximum(one, floor) - np.maximum(other, floor)
    return float(np.sqrt(np.square(change).mean())) if change.size else 0.0


def _levels(x: Array) -> Array:
    padded = np.pad(x, ((0, 0), (0, (-x.shape[1]) % SPECTRUM_WINDOW)))
    return np.asarray(10 * np.log10(short_time_power(padded, SPECTRUM_WINDOW, SPECTRUM_WINDOW) + 1e-300))
