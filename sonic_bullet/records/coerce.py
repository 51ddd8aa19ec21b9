"""Checks of public arguments: a value becomes the one type that inner code takes, or an error of one line names it.

    as_number(3, "to_hz", …) -> 3.0
        as_number("x", "to_hz", …) -> "to_hz is 'x'; give a frequency in Hz, above zero"

Each function takes the argument's name, the remedy, and the class of the error. bool is not a number here: True is not
a body.
"""

from __future__ import annotations

import difflib
import math
import numbers
import os
import reprlib
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np

from sonic_bullet.records.errors import FileError, RecordError, SonicBulletError

Kind = TypeVar("Kind")
Call = TypeVar("Call", bound=Callable[..., Any])
Error = type[SonicBulletError]

_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = 60
_short.maxlevel = 3
LISTED = 8
"""Most names that a message lists."""


def quote(value: object) -> str:
    """Quote a value for a message, in at most 80 characters."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape}"
    try:
        text = _short.repr(value)
    except Exception:  # a foreign object's own repr may raise anything, and an int of 5000 digits has none
        text = f"a {type(value).__name__}"
    return text if len(text) <= 80 else f"{text[:77]}..."


def brief(text: object) -> str:
    """Return a name for a message: its first 117 characters where it has over 120."""
    name = str(text)
    return name if len(name) <= 120 else f"{name[:117]}..."


def as_number(
    value: object,
    name: str,
    remedy: str,
    *,
    above: float = -math.inf,
    below: float = math.inf,
    least: float = -math.inf,
    most: float = math.inf,
    error: Error = RecordError,
) -> float:
    """Return a finite number with above < number < below and least <= number <= most, or raise ``error``."""
    value = _scalar(value)
    if isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_)):
        try:
            number = float(value)
        except (OverflowError, ValueError):
            number = math.nan
        if math.isfinite(number) and above < number < below and least <= number <= most:
            return number
    raise error(f"{name} is {quote(value)}", remedy)


def as_whole(
    value: object, name: str, remedy: str, *, least: int = -(2**63), most: int = 2**63 - 1, error: Error = RecordError
) -> int:
    """Return a whole number of at most 64 bits between ``least`` and ``most``, of any type, or raise ``error``."""
    value = _scalar(value)
    if isinstance(value, numbers.Integral) and not isinstance(value, (bool, np.bool_)):
        whole = int(value)
    else:
        number = as_number(value, name, remedy, error=error)
        whole = int(number)
        if whole != number:
            raise error(f"{name} is {quote(value)}", remedy)
    if not least <= whole <= most:
        raise error(f"{name} is {quote(value)}", remedy)
    return whole


def _scalar(value: object) -> object:
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value


def as_flag(value: object, name: str) -> bool:
    """Return True or False; RecordError for any other value, also one that is merely true."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise RecordError(f"{name} is {quote(value)}", "give True or False")


def as_text(value: object, name: str, remedy: str, *, error: Error = RecordError) -> str:
    """Return a text, or raise ``error``."""
    if isinstance(value, str):
        return value
    raise error(f"{name} is {quote(value)}", remedy)


def as_path(value: object, name: str, remedy: str, *, error: Error = FileError) -> str:
    """Return the name of a file, given as a text or os.PathLike, or raise ``error``, also for invalid names."""
    text = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(text, str):
        raise error(f"{name} is {quote(value)}", remedy)
    reason = "no name that a file can have"
    longest_name = 255  # most bytes of a file's name in file systems
    with suppress(UnicodeEncodeError):
        if "\0" not in text:
            if all(len(os.fsencode(part)) <= longest_name for part in text.split(os.sep)):
                return text
            reason = f"too long: a file's name has at most {longest_name} bytes"
    raise error(f"cannot read or write {quote(text)}: {name} is {reason}", remedy)


def as_call(value: Call | None, name: str) -> Call | None:
    """Return a function, or None; raise RecordError for anything else."""
    if value is None or callable(value):
        return value
    raise RecordError(f"{name} is {quote(value)}", "give a function, or leave it out")


def as_kind(value: object, kind: type[Kind], name: str, remedy: str, *, error: Error = RecordError) -> Kind:
    """Return the value if it is of that type, or raise ``error``."""
    if isinstance(value, kind):
        return value
    raise error(f"{name} is {quote(value)}", remedy)


def as_kinds(value: object, kind: Any, name: str, remedy: str, *, error: Error = RecordError) -> tuple[Any, ...]:
    """Return several values, all of that type (a class, or a union of some), or raise ``error``."""
    items = as_items(value, name, remedy, error=error)
    for number, item in enumerate(items):
        if not isinstance(item, kind):
            raise error(f"{name}[{number}] is {quote(item)}", remedy)
    return items


def as_items(value: Any, name: str, remedy: str, *, error: Error = RecordError) -> tuple[Any, ...]:
    """Return the items of a list, tuple, array or iterator, not of a text or mapping, or raise ``error``."""
    if (
        isinstance(value, Iterable)
        and not isinstance(value, (str, bytes, dict))
        and not (isinstance(value, np.ndarray) and value.ndim == 0)
    ):
        return tuple(value)
    raise error(f"{name} is {quote(value)}", remedy)


def as_rows(
    value: Any, name: str, columns: int, remedy: str, *, error: Error = RecordError
) -> tuple[tuple[float, ...], ...]:
    """Return rows of ``columns`` finite numbers each, or raise ``error`` naming the row."""
    rows = as_items(value, name, remedy, error=error)
    made = []
    for number, row in enumerate(rows):
        numbers_ = as_items(row, f"{name}[{number}]", remedy, error=error)
        if len(numbers_) != columns:
            raise error(f"{name}[{number}] is {quote(row)}", remedy)
        made.append(tuple(as_number(x, f"{name}[{number}]", remedy, error=error) for x in numbers_))
    return tuple(made)


def nearest(word: str, known: Collection[str], otherwise: str = "") -> str:
    """Make a remedy for an unknown word: the nearest of ``known``, or all where none is near, then ``otherwise``."""
    lower = {one.lower(): one for one in reversed(list(known))}
    near = difflib.get_close_matches(word.lower()[:100], lower, n=3, cutoff=0.5)
    if near:
        return f"did you mean {' or '.join(lower[one] for one in near)}?"
    listed = ", ".join(list(known)[:LISTED]) + (f" and {len(known) - LISTED} more" if len(known) > LISTED else "")
    return f"one of {listed}{otherwise}" if known else f"there are none{otherwise}"


def check_options(given: Iterable[str], known: Collection[str], name: str, *, error: Error = RecordError) -> None:
    """Raise ``error`` where a keyword is not in ``known``, with the nearest that is."""
    for word in given:
        if word not in known:
            raise error(f"{name} has no option {quote(word)}", nearest(word, known))
