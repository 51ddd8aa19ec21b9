"""Numbers that decide which effect is accepted, and the verdict, each with unit, reason and provenance.

    RULES.least_drop_db       a float; its unit, reason and provenance are the field's metadata

provenance is a source, a derivation, a convention or a measurement: how many verdicts move where it moves by a fifth.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field, fields
from typing import Any


def _rule(value: float, unit: str, reason: str, provenance: str) -> Any:
    """Build a field of a number with its words."""
    return field(default=value, metadata={"unit": unit, "reason": reason, "provenance": provenance})


@dataclass(frozen=True, slots=True)
class Thresholds:
    """All of them. Raises ValueError where one is out of its range, or has no unit, reason or provenance."""

    strong_evidence: float = _rule(
        6.0,
        "2 Δ ln L",
        "of strikes, decays and phases together: speaks for an effect, or for one of two",
        "Kass & Raftery 1995, section 3.2: 6 to 10 is strong",
    )
    standard_errors: float = _rule(
        2.0, "standard errors", "a mean over strikes differs from zero", "convention: 95 % of a normal mean"
    )
    most_share: float = _rule(
        0.5,
        "1",
        "most of a gap, of a gain or of what is needed: more than half",
        "convention: of two parts the larger",
    )
    same_share: float = _rule(
        0.1,
        "of the whole gap",
        "what closes less says the same as what was there",
        "measurement: in 198 cases of five draws a fifth more loses 1 right name, a fifth less gains 2 wrong ones",
    )
    little_share: float = _rule(
        0.25,
        "of a gap, of a gain",
        "so little left is nearly nothing",
        "derivation: (1 − most_share)², what two leave that close half of it each",
    )
    least_drop_db: float = _rule(
        0.2,
        "dB",
        "mean gain on strikes left out, at least",
        "measurement: a fifth moves no verdict of 141 cases (draws 8263, 2764)",
    )
    suffices_db: float = _rule(
        1.5,
        "dB",
        "a smaller gap is the mesh's and the shapes' own",
        "derivation: most_share of band_apart_db: nearer to as loud than to twice as loud; two takes differ by 2.5",
    )
    kept_lines_share: float = _rule(
        0.8,
        "of the lines",
        "kept in every fold, the others left out",
        "convention: five folds, Hastie, Tibshirani & Friedman 2009, section 7.10",
    )
    early_s: float = _rule(
        0.05,
        "s",
        "the attack is looked at by itself, for a long decay would outweigh it",
        "convention: early energy by ISO 3382-1:2009, annex A (C50)",
    )
    band_apart_db: float = _rule(
        3.0, "dB", "a band is half or twice as loud as it should be", "derivation: 10 lg 2 of power"
    )

    def __post_init__(self) -> None:
        """Check the numbers."""
        if wrong := [name for name, rule, *words in rows(self) if not (rule > 0 and all(words))]:
            raise ValueError(f"thresholds must be above 0, with a unit, a reason and a provenance: {', '.join(wrong)}")
        if wrong := [name for name, rule, *_ in rows(self) if name.endswith("_share") and rule > 1]:
            raise ValueError(f"shares must be 1 at most: {', '.join(wrong)}")
        if not self.same_share <= self.little_share <= self.most_share:
            raise ValueError("what says the same is no more than a little, and that no more than most")


def rows(rules: Thresholds) -> list[tuple[str, float, str, str, str]]:
    """Return every name with its number, unit, reason and provenance, in their order."""
    every = zip(fields(rules), astuple(rules), strict=True)
    words = ("unit", "reason", "provenance")
    return [(f.name, value, *(f.metadata[k] for k in words)) for f, value in every]


def table(rules: Thresholds) -> str:
    """Format a table in Markdown: name, value, unit, reason, provenance."""
    head = ["| threshold | value | unit | why | where from |", "|---|---|---|---|---|"]
    return "\n".join([*head, *(f"| `{name}` | {rule:g} | {' | '.join(words)} |" for name, rule, *words in rows(rules))])


RULES = Thresholds()
"""What the package judges by."""
