"""Checks of effects' records when they are built: presets are written by hand, too."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

from sonic_bullet.records.errors import RecordError


def one_of(name: str, value: Any, known: Collection[Any]) -> None:
    """Raise RecordError where a field's value is none of those known."""
    if value not in known:
        raise RecordError(f"{name} is {value!r}, which is none there is", f"use one of {', '.join(map(str, known))}")


def finite(name: str, *values: float, least: float = -math.inf, most: float = math.inf) -> None:
    """Raise RecordError where a field's values are not all finite, `least` or more and below `most`."""
    for value in values:
        if not (math.isfinite(value) and least <= value < most):
            within = (f" >= {least:g}" if math.isfinite(least) else "") + (
                f", below {most:g}" if math.isfinite(most) else ""
            )
            raise RecordError(f"{name} is {value}", "use a finite number" + within)


def same_length(**fields: Sequence[Any]) -> None:
    """Raise RecordError where lists that belong together are not as long as each other."""
    if len({len(values) for values in fields.values()}) > 1:
        raise RecordError(
            ", ".join(f"{name} holds {len(values)}" for name, values in fields.items()), "give as many of each"
        )
