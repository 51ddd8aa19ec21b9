"""Calls of a scene into its simulator by name and by value, to compare two scenes and to substitute arguments.

    createMultiBody(0.004, shape) -> Call("createMultiBody", {"baseMass": 0.004, "shape": {"radius": 0.005, …}}, who)

Values hold no handles: a body is the n-th that its run made (`ObjectId`), a shape is the arguments that made it, a file
is its content.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

FIRST_ABSENT = 1_000_000
"""First id of the bodies that a scene asked for and a plan left out."""


@dataclass(frozen=True, slots=True)
class ObjectId:
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
        Its origin, where the arguments do not say all (a `BodyRequest`).
    """

    name: str
    step: int
    arguments: Mapping[str, Any]
    who: ObjectId | None = None
    made: tuple[ObjectId, ...] = ()
    own: Any = None


class Plan(Protocol):
    """Calls that substitute those of a scene."""

    def ahead_of(self, call: Call) -> tuple[list[Call], Mapping[str, Any] | None]:
        """Return the other scene's calls to be made first, and arguments for this one; None: do not make it."""
        ...

    def remaining_calls(self, step: int, name: str | None = None) -> list[Call]:
        """Return the other scene's calls that remain of a step; with a name, those of that name that come next."""
        ...


def map_leaves(value: Any, change: Callable[[Any], Any]) -> Any:
    """Return the value with every leaf changed, in mappings and sequences too."""
    if isinstance(value, Mapping):
        return {name: map_leaves(inner, change) for name, inner in value.items()}
    if isinstance(value, tuple):
        return tuple(map_leaves(inner, change) for inner in value)
    return change(value)
