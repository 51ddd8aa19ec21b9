"""Tables that travel together, as NamedTuples that are made inside the outermost kernel.

    holders with attributes -> `gather`: the values of a group, in order of its fields     Python, once a change
        -> one flat tuple -> the kernel -> `grouping`: a NamedTuple of groups, by name     compiled, costs nothing

A NamedTuple that Python passes costs a microsecond a field, a flat tuple a tenth of it. Order is that of the fields
alone, in both places: no list of names is kept beside another.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from functools import cache
from typing import Any, get_type_hints

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from sonic_bullet.machine.borrowed import without_count


@cache
def kinds_of(groups: type) -> dict[str, Any]:
    """Return the class of each group, by its name."""
    return get_type_hints(groups)


def gather(group: type, *holders: Any) -> Any:
    """Fill a group by name: each field from the first of ``holders`` that has it. Raises AttributeError for none."""
    key = group, *map(type, holders)
    if key not in _holders:
        fields = group._fields  # type: ignore[attr-defined]
        _holders[key] = [
            (next((i for i, one in enumerate(holders) if hasattr(one, name)), -1), name) for name in fields
        ]
    return group(*[getattr(holders[i], name) for i, name in _holders[key]])


_holders: dict[tuple[type, ...], list[tuple[int, str]]] = {}
"""Which of the holders, by their types, has each field of a group."""


def group_types(groups: type, kinds: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return numba's type of each group where the flat values have the types ``kinds``."""
    found, at = [], 0
    for group in kinds_of(groups).values():
        found.append(types.BaseTuple.from_types(kinds[at : at + len(group._fields)], group))
        at += len(group._fields)
    if at != len(kinds):
        raise TypeError(f"{len(kinds)} values for {at} fields of {groups.__name__}")
    return tuple(found)


def grouping(groups: type) -> Any:
    """Make the kernel function that turns a flat tuple into ``groups``, a NamedTuple of NamedTuples, all borrowed."""

    @intrinsic
    def grouped(typingctx, values):
        kinds = group_types(groups, values.types)

        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            parts = iter(cgutils.unpack_tuple(builder, args[0], len(signature.args[0])))
            made = []
            for kind in kinds:
                bare = [without_count(context, builder, one, next(parts)) for one in kind.types]
                made.append(context.make_tuple(builder, kind, bare))
            return context.make_tuple(builder, signature.return_type, made)

        return types.BaseTuple.from_types(kinds, groups)(values), codegen

    return grouped
