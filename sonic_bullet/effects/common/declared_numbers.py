"""Parameters of an effect, each declared once: meaning, range, whether it is free, and how reports show it.

    tau_s: Annotated[float, Number("duration at the impulse `impulse_n_s`", least=0.0, free=1)]

A unit stands in the name. Presets are written by hand, too, so every effect checks its numbers when it is built.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, get_args, get_type_hints

import numpy as np

from sonic_bullet.records.errors import RecordError

Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Number:
    """Declaration of a parameter, or of a list of them.

    Attributes
    ----------
    meaning : str
        The symbol of the effect's equation, in words, with the shape of a list.
    least, most : float
        Range of each: finite, `least` or more and below `most`.
    known : tuple
        The values that there are, where it is no number of a range.
    free : int
        Free numbers that it stands for in a fit, an entry.
    key : str
        Name in reports and messages, the field's own where empty.
    table : str
        Name of the table of equally long lists that it is a column of.
    of : str
        Field without which, at its default, this one has no meaning: then it is neither reported nor counted.
    shown : bool
        Whether reports show it.
    """

    meaning: str
    least: float = -math.inf
    most: float = math.inf
    known: tuple[Any, ...] = ()
    free: int = 0
    key: str = ""
    table: str = ""
    of: str = ""
    shown: bool = True


def check_numbers(effect: Any) -> None:
    """Raise RecordError where a number of an effect is out of its range, or a table's lists differ in length."""
    lengths: dict[str, dict[str, int]] = {}
    for name, number, value, default in _values(effect):
        label = number.key or name
        if number.table:
            lengths.setdefault(number.table, {})[name] = len(value)
        if number.known and value not in number.known:
            known = ", ".join(map(str, number.known))
            raise RecordError(f"{label} is {value!r}, which is none there is", f"use one of {known}")
        undefined = value is None or (isinstance(default, float) and math.isnan(default))  # none, as a state
        if number.known or undefined:
            continue
        for one in np.ravel(value).tolist():
            if not (math.isfinite(one) and number.least <= one < number.most):
                within = (f" >= {number.least:g}" if math.isfinite(number.least) else "") + (
                    f", below {number.most:g}" if math.isfinite(number.most) else ""
                )
                raise RecordError(f"{label} is {one}", "use a finite number" + within)
    for columns in lengths.values():
        if len(set(columns.values())) > 1:
            held = ", ".join(f"{name} holds {count}" for name, count in columns.items())
            raise RecordError(held, "give as many of each")


def reported_numbers(effect: Any) -> dict[str, Any]:
    """Return an effect's numbers by name in SI units, for reports and JSON; a table is a list of its rows."""
    found: dict[str, Any] = {}
    tables: dict[str, dict[str, Any]] = {}
    for name, number, value in _list_stated(effect):
        if number.shown:
            (tables.setdefault(number.table, {}) if number.table else found)[number.key or name] = value
    rows = {key: [dict(zip(t, row, strict=True)) for row in zip(*t.values(), strict=True)] for key, t in tables.items()}
    return {name: _to_lists(value) for name, value in found.items()} | {key: row for key, row in rows.items() if row}


def free_numbers(effect: Any) -> int:
    """Count an effect's free numbers."""
    return sum(n.free * (len(value) if isinstance(value, tuple) else 1) for _, n, value in _list_stated(effect))


def signed_fields(kind: type) -> frozenset[str]:
    """Return the declared fields of a kind of effect that may be negative."""
    return frozenset(name for name, number, _ in _list_declared(kind) if number.least < 0)


@cache
def _list_declared(kind: type) -> tuple[tuple[str, Number, Any], ...]:
    """Return the declared fields of a kind of effect: name, declaration, default."""
    hints = get_type_hints(kind, include_extras=True)
    marks = {name: [m for m in get_args(hint) if isinstance(m, Number)] for name, hint in hints.items()}
    return tuple((f.name, marks[f.name][0], f.default) for f in fields(kind) if marks[f.name])


def _values(effect: Any) -> list[tuple[str, Number, Any, Any]]:
    """Return the declared fields of an effect: name, declaration, value, default; a decoder leaves defaults out."""
    return [
        (name, n, vars(effect).get(name, default), default) for name, n, default in _list_declared(effect.__class__)
    ]


def _list_stated(effect: Any) -> list[tuple[str, Number, Any]]:
    """Return the declared fields that have a meaning in an effect: name, declaration, value."""
    every = _values(effect)
    idle = {name for name, _, value, default in every if value == default}
    return [(name, n, value) for name, n, value, _ in every if n.of not in idle]


def _to_lists(value: Any) -> Any:
    """Return tuples as lists."""
    return [_to_lists(one) for one in value] if isinstance(value, tuple) else value
