"""Calls of a scene into its simulator by name and by value, to compare two scenes and to substitute arguments.

    createMultiBody(0.004, shape) -> Call("createMultiBody", {"baseMass": 0.004, "shape": {"radius": 0.005, …}}, who)
    Call -> leaves {("shape", "radius"): 0.005, …} -> with_leaves(…) -> Call

Values hold no handles: a body is the n-th that its run made (`Who`), a shape is the arguments that made it, a file is
its content.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, Protocol

import numpy as np

Path = tuple[str, ...]
"""Path of a leaf: names of arguments, of fields of records, of keys."""


class _Absent:
    def __repr__(self) -> str:
        """Return the word that reports print."""
        return "nothing"


FIRST_ABSENT = 1_000_000
"""First id of the bodies that a scene asked for and a plan left out."""
ABSENT = _Absent()
"""Stands for a leaf that is not there."""


@dataclass(frozen=True, slots=True)
class Who:
    """The body, or constraint, that a run made as its ``serial``-th; side: which run."""

    side: str
    serial: int
    kind: str = "body"


@dataclass(frozen=True, slots=True)
class InputFile:
    """A file that a scene names. Two files of the same content are equal, whatever their paths."""

    path: str
    digest: str

    def __eq__(self, other: object) -> bool:
        """Compare the contents."""
        return isinstance(other, InputFile) and self.digest == other.digest

    def __hash__(self) -> int:
        """Hash the content."""
        return hash(self.digest)


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """One call into the simulator.

    Parameters
    ----------
    step
        Physics steps made before it.
    arguments
        By name and by value.
    who
        The body it is about; None: the engine.
    made
        The bodies it made.
    own
        Its origin, where the arguments do not say all (a `WantedBody`).
    """

    name: str
    step: int
    arguments: Mapping[str, Any]
    who: Who | None = None
    made: tuple[Who, ...] = ()
    own: Any = None


class Plan(Protocol):
    """Calls that substitute those of a scene."""

    def instead(self, call: Call) -> tuple[list[Call], Mapping[str, Any] | None]:
        """Return the other scene's calls to be made first, and arguments for this one; None: do not make it."""
        ...

    def behind(self, step: int, name: str | None = None) -> list[Call]:
        """Return the other scene's calls that remain of a step; with a name, those of that name that come next."""
        ...


def leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield (path, value) of all that is neither a mapping nor a record; nested names follow each other in the path."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from leaves(inner, (*path, str(name)))
    elif is_dataclass(value) and not isinstance(value, (type, Who, InputFile)) and len(path) < 3:
        for one in fields(value):
            yield from leaves(getattr(value, one.name), (*path, one.name))
    else:
        yield path, value


def with_leaves(value: Any, given: Mapping[Path, Any]) -> Any:
    """Return the value with those leaves replaced; ABSENT removes a key.

    Raises what a record raises that rejects the value.
    """
    if () in given:
        return given[()]
    heads: dict[str, dict[Path, Any]] = {}
    for path, leaf in given.items():
        heads.setdefault(path[0], {})[path[1:]] = leaf
    if isinstance(value, Mapping):
        made = dict(value)
        for name, inner in heads.items():
            one = with_leaves(made.get(name, {}), inner)
            if one is ABSENT:
                made.pop(name, None)
            else:
                made[name] = one
        return made
    return replace(value, **{name: with_leaves(getattr(value, name), inner) for name, inner in heads.items()})


def same(one: Any, other: Any) -> bool:
    """Compare two values of any kind, to the bit."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        a, b = np.asarray(one), np.asarray(other)
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(same(one[name], other[name]) for name in one)
    if isinstance(one, Sequence) and isinstance(other, Sequence) and not isinstance(one, (str, bytes)):
        return len(one) == len(other) and all(map(same, one, other))
    if is_dataclass(one) and type(one) is type(other) and not isinstance(one, (Who, InputFile)):
        return all(same(getattr(one, x.name), getattr(other, x.name)) for x in fields(one))
    if isinstance(one, (int, float)) and isinstance(other, (int, float)):
        return one == other or (math.isnan(one) and math.isnan(other))
    return one is other or (type(one) is type(other) and bool(one == other))


def mapped(value: Any, change: Callable[[Any], Any]) -> Any:
    """Return the value with every leaf changed, in mappings and sequences too."""
    if isinstance(value, Mapping):
        return {name: mapped(inner, change) for name, inner in value.items()}
    if isinstance(value, tuple):
        return tuple(mapped(inner, change) for inner in value)
    return change(value)
