"""Substitute inputs of the first scene in the second.

pairs + chosen places -> Plan: each call of B with A's arguments, calls of A where B has none, none where A has none
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sonic_bullet.apps.compare.inputs.call_pairs import CallPair, about, find_differences
from sonic_bullet.apps.compare.inputs.tree_difference import MISSING, Path, leaves, with_leaves
from sonic_bullet.simulators.calls import Call

HANDLES = ("bodyUniqueId", "objectUniqueId", "multiBodyUniqueId", "body", "links", "linkIndex", "jointIndex")
"""Arguments that identify the body of a call; they are not inputs."""
Place = tuple[int, Path | None]
"""Number of a pair, and one of its leaves; None: the whole call."""


@dataclass(slots=True, eq=False)
class Substitution:
    """A `Plan` that gives places of pairs A's arguments."""

    pairs: Sequence[CallPair]
    chosen: frozenset[Place]
    _next: int = field(default=0)

    def ahead_of(self, call: Call) -> tuple[list[Call], Mapping[str, Any] | None]:
        """Return calls of A before a call of B, and its substituted arguments, see `Plan`."""
        if call.who is not None and call.who.side == "a":  # B's own loop finds a body of A: its calls are made anyway
            return [], None
        number = self._number(call)
        if number is None:
            return [], call.arguments
        first = self._of_a(self._next, number)
        self._next = number + 1
        pair = self.pairs[number]
        if (number, None) in self.chosen and pair.a is None:
            return first, None
        changed = {
            path: a for path, (a, _) in find_differences(pair.a, pair.b).items() if (number, path) in self.chosen
        }
        if not changed:
            return first, call.arguments
        made = with_leaves(call.arguments, changed)
        return first, made if pair.a is not None or _asks(made) else None

    def remaining_calls(self, step: int, name: str | None = None) -> list[Call]:
        """Return the remaining calls of A in a step, see `Plan`."""
        end = self._next
        while end < len(self.pairs) and self.pairs[end].step <= step:
            pair = self.pairs[end]
            gone = pair.a is None and (end, None) in self.chosen  # B does not make this call
            if name is not None and not gone and (pair.b is not None or pair.a is None or pair.a.name != name):
                break
            end += 1
        found, self._next = self._of_a(self._next, end), end
        return found

    def _number(self, call: Call) -> int | None:
        """Find the next pair whose call of B is this one."""
        for number in range(self._next, len(self.pairs)):
            pair = self.pairs[number]
            if pair.step > call.step:
                return None
            if pair.b is not None and pair.step == call.step and about(pair.b) == about(call):
                return number
        return None

    def _of_a(self, start: int, stop: int) -> list[Call]:
        """List the chosen calls that A alone makes: whole, or with the chosen arguments."""
        found = []
        for number, pair in enumerate(self.pairs[start:stop], start):
            if pair.a is None or pair.b is not None:
                continue
            paths = {path for path, _ in leaves(pair.a.arguments)}
            absent = {path: MISSING for path in paths if (number, path) not in self.chosen and path[0] not in HANDLES}
            if (number, None) in self.chosen:
                found.append(pair.a)
            elif len(absent) < len([path for path in paths if path[0] not in HANDLES]):
                found.append(replace(pair.a, arguments=with_leaves(pair.a.arguments, absent)))
        return found


def _asks(arguments: Mapping[str, Any]) -> bool:
    """Tell whether the arguments hold more than the body."""
    return any(name not in HANDLES for name in arguments)
