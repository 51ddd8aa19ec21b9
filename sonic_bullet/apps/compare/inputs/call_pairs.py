"""Pair the calls of two runs: which call of one corresponds to which of the other, and which only one makes.

    A: create a, create b, friction a        a with a: two of the same arguments about the same body
    B: create a, friction a                  b, and all about it: of A alone

Bodies are matched first, by the calls that make them, in their order: the alignment of least cost [Needleman and
Wunsch, J. Mol. Biol. 48 (1970) 443], which finds the body that is missing among equal ones. Then calls are matched, a
step at a time: the same function about the same body, in order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from sonic_bullet.apps.compare.inputs.tree_difference import differing_leaves, unlike_fraction
from sonic_bullet.simulators.calls import Call, ObjectId, map_leaves

One = TypeVar("One")
GAP = 0.6
"""Cost of a body without a partner; two that share nothing cost 1, less than two without partners."""


@dataclass(frozen=True, slots=True, eq=False)
class CallPair:
    """A call of A, of B, or of both that correspond; arguments of A name B's bodies where those are matched."""

    a: Call | None
    b: Call | None

    @property
    def step(self) -> int:
        """Step of the calls."""
        one = self.b or self.a
        return one.step if one is not None else 0


def side_by_side(a: Sequence[Call], b: Sequence[Call]) -> tuple[list[CallPair], dict[ObjectId, ObjectId]]:
    """Return all calls of both, paired in an order that keeps that of each, and the match of A's bodies to B's."""
    match = matched_bodies(a, b)
    renamed = [_rename_bodies(call, match) for call in a]
    pairs: list[CallPair] = []
    of_a, of_b = _by_step(renamed), _by_step(b)
    for step in sorted({*of_a, *of_b}):
        pairs += [
            CallPair(one, other)
            for one, other in align_sequences(of_a.get(step, []), of_b.get(step, []), _unlike, _gap)
        ]
    return pairs, match


def matched_bodies(a: Sequence[Call], b: Sequence[Call]) -> dict[ObjectId, ObjectId]:
    """Match the bodies and constraints of A to those of B."""
    makers = [[call for call in calls if call.made] for calls in (a, b)]
    return {
        one: other
        for x, y in align_sequences(makers[0], makers[1], _unlike_bodies, lambda call: GAP)
        if x is not None and y is not None
        for one, other in zip(x.made, y.made, strict=False)
    }


def align_sequences(
    a: Sequence[One], b: Sequence[One], unlike: Callable[[One, One], float], gap: Callable[[One], float]
) -> list[tuple[One | None, One | None]]:
    """Align two sequences at the least sum of ``unlike`` (inf: never paired) and gaps."""
    start = 0
    while start < min(len(a), len(b)) and unlike(a[start], b[start]) == 0:
        start += 1
    end = 0
    while end < min(len(a), len(b)) - start and unlike(a[-1 - end], b[-1 - end]) == 0:
        end += 1
    head = [(x, y) for x, y in zip(a[:start], b[:start], strict=True)]
    tail = [(x, y) for x, y in zip(a[len(a) - end :], b[len(b) - end :], strict=True)]
    return [*head, *_middle(a[start : len(a) - end], b[start : len(b) - end], unlike, gap), *tail]


def _middle(
    a: Sequence[One], b: Sequence[One], unlike: Callable[[One, One], float], gap: Callable[[One], float]
) -> list[tuple[One | None, One | None]]:
    # most pairs of calls that are aligned; beyond, calls that differ are paired by position alone
    most_cells = 4_000_000
    n, m = len(a), len(b)
    if n * m > most_cells:
        half = min(n, m)
        return [*zip(a[:half], b[:half], strict=True), *((x, None) for x in a[half:]), *((None, y) for y in b[half:])]
    cost = np.zeros((n + 1, m + 1))
    cost[1:, 0] = np.cumsum([gap(x) for x in a])
    cost[0, 1:] = np.cumsum([gap(y) for y in b])
    between = np.array([[unlike(x, y) for y in b] for x in a]).reshape(n, m)
    for i in range(1, n + 1):
        for j in range(1, m + 1):
            cost[i, j] = min(
                cost[i - 1, j - 1] + between[i - 1, j - 1],
                cost[i - 1, j] + gap(a[i - 1]),
                cost[i, j - 1] + gap(b[j - 1]),
            )
    found: list[tuple[One | None, One | None]] = []
    i, j = n, m
    while i or j:
        if i and j and cost[i, j] == cost[i - 1, j - 1] + between[i - 1, j - 1]:
            i, j = i - 1, j - 1
            found.append((a[i], b[j]))
        elif i and cost[i, j] == cost[i - 1, j] + gap(a[i - 1]):
            i -= 1
            found.append((a[i], None))
        else:
            j -= 1
            found.append((None, b[j]))
    return found[::-1]


def find_differences(a: Call | None, b: Call | None) -> dict[tuple[str, ...], tuple[Any, Any]]:
    """Return the leaves of two calls that differ: (A's, B's), MISSING where one has none."""
    return differing_leaves(a.arguments if a else {}, b.arguments if b else {})


def about(call: Call) -> tuple[Any, ...]:
    """Return what corresponding calls share: function, body, link or joint."""
    places = (call.arguments.get(name) for name in ("linkIndex", "jointIndex", "jointIndices", "links"))
    return (call.name, call.who, *places)


def _unlike(a: Call, b: Call) -> float:
    return unlike_fraction(a.arguments, b.arguments) if about(a) == about(b) else float("inf")


def _gap(call: Call) -> float:
    return GAP


def _unlike_bodies(a: Call, b: Call) -> float:
    alike = a.name == b.name and len(a.made) == len(b.made)
    return unlike_fraction(a.arguments, b.arguments) if alike else float("inf")


def _by_step(calls: Iterable[Call]) -> dict[int, list[Call]]:
    found: dict[int, list[Call]] = {}
    for call in calls:
        found.setdefault(call.step, []).append(call)
    return found


def _rename_bodies(call: Call, match: Mapping[ObjectId, ObjectId]) -> Call:
    """Replace A's bodies in a call by B's where they are matched."""

    def other(value: Any) -> Any:
        return match.get(value, value) if isinstance(value, ObjectId) else value

    who = other(call.who)
    made = tuple(other(one) for one in call.made)
    return Call(call.name, call.step, map_leaves(call.arguments, other), who, made, call.own)
