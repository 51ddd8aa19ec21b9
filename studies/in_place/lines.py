"""A line of the table: what must hold, the figure, whether it does."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Line:
    """holds None: reported only."""

    what: str
    bound: str
    figure: str
    holds: bool | None

    def __post_init__(self) -> None:
        if self.holds is not None:  # numpy's False is not Python's, and would be counted as none
            object.__setattr__(self, "holds", bool(self.holds))

    def row(self) -> str:
        verdict = {True: "met", False: "**missed**", None: "reported"}[self.holds]
        return f"| {self.what} | {self.bound} | {self.figure} | {verdict} |"


HEAD = "| what | must hold | measured | |\n|---|---|---|---|"
