"""What a ladder came to."""

from __future__ import annotations

from dataclasses import dataclass

AGREES, ERRS, PARTLY, DIFFERS, LACKING = "agrees", "the draft errs", "in part", "differs", "not rendered"
"""ERRS: what is rendered follows a source that contradicts the prediction; `right` cites it."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """predicted: by the draft; rendered: here; right: who is, by which source, where both differ."""

    predicted: str
    rendered: str
    verdict: str
    right: str = ""


def within(value: float, wanted: float, share: float) -> bool:
    """Tell whether a number is as near to another as a share of it."""
    return abs(value - wanted) <= share * abs(wanted)
