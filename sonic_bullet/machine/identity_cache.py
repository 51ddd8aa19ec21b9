"""Identity cache: results kept as long as the record they were computed from lives.

`functools.lru_cache` would hold the last so many of them, and all that belongs to them, for ever.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Of = TypeVar("Of")
More = ParamSpec("More")
Result = TypeVar("Result")


class WhileAlive(Generic[Of, More, Result]):
    """Decorator of a function call(of, *more): computed once for each ``of`` and each hashable ``more``.

    What it returns must not hold ``of``.
    """

    def __init__(self, call: Callable[Concatenate[Of, More], Result]) -> None:
        self.__wrapped__ = call
        self._kept: WeakKeyDictionary[Of, dict[Any, Result]] = WeakKeyDictionary()
        update_wrapper(self, call)

    def __call__(self, of: Of, *more: More.args, **named: More.kwargs) -> Result:
        """Return the cached result, computed on the first call."""
        mine = self._kept.setdefault(of, {})
        key = (more, tuple(sorted(named.items())))
        if key not in mine:
            mine[key] = self.__wrapped__(of, *more, **named)
        return mine[key]

    def put(self, of: Of, result: Result, *more: More.args, **named: More.kwargs) -> None:
        """Store a result that was computed elsewhere."""
        self._kept.setdefault(of, {})[(more, tuple(sorted(named.items())))] = result

    def cache_clear(self) -> None:
        """Forget all results."""
        self._kept.clear()

    def __len__(self) -> int:
        """Count the records with results."""
        return len(self._kept)
