"""Difference of two trees: mappings and records, such as the arguments of two calls or the bodies of two logs.

tree -> leaves {("shape", "radius"): 0.005, …}
two trees -> differing_leaves {("shape", "radius"): (0.005, 0.006)} -> with_leaves(other, …) -> the first tree
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.simulators.calls import InputFile, ObjectId

Path = tuple[str, ...]
"""Path of a leaf: names of arguments, of fields of records, of keys."""


class _Missing:
    def __repr__(self) -> str:
        """Return the word that reports print."""
        return "nothing"


MISSING = _Missing()
"""Stands for a leaf that is not there."""


def leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield (path, value) of all that is neither a mapping nor a record; nested names follow each other in the path."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from leaves(inner, (*path, str(name)))
    elif is_dataclass(value) and not isinstance(value, (type, ObjectId, InputFile)) and len(path) < 3:
        for one in fields(value):
            yield from leaves(getattr(value, one.name), (*path, one.name))
    else:
        yield path, value


def with_leaves(value: Any, given: Mapping[Path, Any]) -> Any:
    """Return the value with those leaves replaced; MISSING removes a key.

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
            if one is MISSING:
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
    if is_dataclass(one) and type(one) is type(other) and not isinstance(one, (ObjectId, InputFile)):
        return all(same(getattr(one, x.name), getattr(other, x.name)) for x in fields(one))
    if isinstance(one, (int, float)) and isinstance(other, (int, float)):
        return one == other or (math.isnan(one) and math.isnan(other))
    return one is other or (type(one) is type(other) and bool(one == other))


def differing_leaves(one: Any, other: Any, absent: Any = MISSING) -> dict[Path, tuple[Any, Any]]:
    """Return the leaves of two trees that differ, by path: (one's, other's), ``absent`` where one has none."""
    old, new = dict(leaves(one)), dict(leaves(other))
    pairs = {path: (old.get(path, absent), new.get(path, absent)) for path in {**old, **new}}
    return {path: pair for path, pair in pairs.items() if not same(*pair)}


def unlike_fraction(one: Any, other: Any, absent: Any = MISSING) -> float:
    """Compute the fraction of all leaves of both trees that differ."""
    most = len({path for tree in (one, other) for path, _ in leaves(tree)})
    return len(differing_leaves(one, other, absent)) / max(most, 1)
