"""Elements of records: read-only arrays of a stated shape, and conditions whose errors name the fault."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import RecordError

Array = NDArray[Any]
LARGEST_SI = 1e30
"""Largest length, force, stiffness or frequency in SI units; fourth powers of such numbers are still finite."""


def frozen_array(value: object, dtype: Any, shape: tuple[int | None, ...], name: str, *, finite: bool = True) -> Array:
    """Return a read-only C-contiguous copy of ``value``, or the same array where it is one already.

    Parameters
    ----------
    dtype, shape
        Of the result; None in shape: any length.
    finite
        Whether to refuse NaN, infinite numbers and numbers beyond `LARGEST_SI`.

    Raises
    ------
    RecordError
        It holds no numbers, or none that ``dtype`` can hold (1.5 as an index), or the shape differs.
    """
    # a record's own array: read-only and not a view
    kept = isinstance(value, np.ndarray) and not value.flags.writeable and value.base is None
    try:
        given = value if isinstance(value, np.ndarray) else np.asarray(value)
        if given.dtype == dtype:
            array = np.asarray(given, order="C") if kept else np.array(given, order="C")
        elif given.dtype.kind in "biufO":  # no texts, complex numbers, dates
            array = _convert_dtype(given, dtype)
        else:
            raise TypeError
    except (TypeError, ValueError, OverflowError):
        raise RecordError(
            f"{name} is {quote(value)}", f"pass {np.dtype(dtype).name} numbers of shape {shape}"
        ) from None
    if array.ndim != len(shape) or any(
        want is not None and have != want for have, want in zip(array.shape, shape, strict=True)
    ):
        raise RecordError(f"{name} has shape {array.shape}, wanted {shape}", "pass an array of that shape")
    # False for NaN too
    if (
        finite
        and array.dtype.kind == "f"
        and not (array.max(initial=0) <= LARGEST_SI and array.min(initial=0) >= -LARGEST_SI)
    ):
        what = (
            f"a number of {float(np.abs(array).max()):.3g}" if np.isfinite(array).all() else "NaN or infinite numbers"
        )
        raise RecordError(f"{name} holds {what}", "look for the step or file that produced them")
    array.setflags(write=False)
    return array


def join_arrays(parts: Sequence[Array], dtype: Any, tail: tuple[int, ...] = ()) -> Array:
    """Join C-contiguous arrays of one dtype to a read-only array (n, *tail).

    np.concatenate promotes structured dtypes field by field, pair by pair: 40 µs a part of CONTACT rows, where joining
    bytes takes 0.1 µs.
    """
    count = math.prod(tail)
    array = np.frombuffer(b"".join(parts), dtype)  # type: ignore[arg-type]
    return array if not tail else array.reshape(len(array) // count if count else len(parts), *tail)


def _convert_dtype(given: Array, dtype: Any) -> Array:
    """Return a C-contiguous copy with ``dtype``; ValueError where conversion to integers would change a number."""
    with np.errstate(invalid="ignore", over="ignore"):
        array: Array = np.array(given, dtype=dtype, order="C")
    if array.dtype.kind == "i" and not (array == given).all():
        raise ValueError
    return array


def store(record: object, **values: object) -> None:
    """Set fields of a frozen record that is being built."""
    for name, value in values.items():
        object.__setattr__(record, name, value)


def require(condition: bool, what: str, remedy: str) -> None:
    """Raise RecordError unless the condition holds."""
    if not condition:
        raise RecordError(what, remedy)
