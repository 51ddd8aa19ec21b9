"""What a ladder came to."""

from __future__ import annotations

from dataclasses import dataclass

AGREES, PARTLY, DIFFERS, LACKING = "agrees", "in part", "differs", "not rendered"


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
