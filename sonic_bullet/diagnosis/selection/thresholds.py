"""Numbers that decide which effect is accepted, and the verdict, each with unit, reason and provenance.

    RULES.least_drop_db       a float like any other, with .unit, .reason, .provenance

provenance is a source, a derivation or a convention; "unknown" means that nobody wrote down which cases set it, and
names the change that brought it. What is unknown is removed first.
"""

# ruff: noqa: RUF009  the defaults are frozen values

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from typing import Self


class Threshold(float):
    """A number with its unit ("1" where it has none), reason and provenance."""

    unit: str
    reason: str
    provenance: str

    def __new__(cls, value: float, unit: str, reason: str, provenance: str) -> Self:
        """Build the number with its words."""
        made = super().__new__(cls, value)
        made.unit, made.reason, made.provenance = unit, reason, provenance
        return made

    def __getnewargs__(self) -> tuple[float, str, str, str]:  # type: ignore[override]
        """Return what a copy is built of."""
        return float(self), self.unit, self.reason, self.provenance

    def at(self, value: float) -> Self:
        """Return the same rule with another number, to measure its influence."""
        return type(self)(value, self.unit, self.reason, self.provenance)


class Count(int):
    """A whole number with what it counts, reason and provenance."""

    unit: str
    reason: str
    provenance: str

    def __new__(cls, value: int, unit: str, reason: str, provenance: str) -> Self:
        """Build the number with its words."""
        made = super().__new__(cls, value)
        made.unit, made.reason, made.provenance = unit, reason, provenance
        return made

    def __getnewargs__(self) -> tuple[int, str, str, str]:  # type: ignore[override]
        """Return what a copy is built of."""
        return int(self), self.unit, self.reason, self.provenance

    def at(self, value: int) -> Self:
        """Return the same rule with another number, to measure its influence."""
        return type(self)(value, self.unit, self.reason, self.provenance)


def _since(commit: str) -> str:
    """Format the provenance of a number of which only the change that brought it is known."""
    return f"unknown; since {commit}"


T, C = Threshold, Count
FIRST_DIAGNOSIS = _since("f650a3c")  # the commit with which diagnosis began


@dataclass(frozen=True, slots=True)
class Thresholds:
    """All of them. Raises ValueError where one is out of its range, or has no unit, reason or provenance."""

    most_share: Threshold = T(
        0.5,
        "1",
        "most of a gap, of a gain or of what is needed: more than half",
        "convention: of two parts the larger",
    )
    # acceptance
    least_drop_db: Threshold = T(0.4, "dB", "mean gain on strikes left out, at least", FIRST_DIAGNOSIS)
    least_drop_share: Threshold = T(0.08, "of the gap", "the same, where the gap is wide", _since("5e45792"))
    faint_drop_db: Threshold = T(
        0.2,
        "dB",
        "in place of the least drop while nothing is found, if the gain is most of the gap",
        _since("0d18b91"),
    )
    certain_drop_db: Threshold = T(
        0.1,
        "dB",
        "in place of the faint drop, where lines agreed on the effect before it was proposed",
        _since("58d84bf"),
    )
    certain_share: Threshold = T(0.25, "of the gap", "in place of the faint share, likewise", _since("ca2b773"))
    standard_errors: Threshold = T(
        2.0, "standard errors", "a mean over strikes differs from zero", "convention: 95 % of a normal mean"
    )
    loudest_strikes: Count = C(2, "strikes", "left out first; what gains on none of them is dropped", _since("ca2b773"))
    lost_share: Threshold = T(
        0.15,
        "of the gain",
        "what one strike may lose of the mean, all others together of the loudest's, and not speak against an effect",
        _since("2b1b956"),
    )
    many_strikes: Count = C(
        4,
        "strikes",
        "of as many, none losing speaks as well as standard errors; of more, one may be odd",
        _since("b840359"),
    )
    odd_strike_factor: Threshold = T(
        3.0, "times the drop needed", "what the rest must gain before one strike counts as odd", _since("3e49a55")
    )
    # simplest
    strong_evidence: Threshold = T(
        6.0,
        "2 Δ ln L",
        "of lines' decays or phases, where strikes prefer neither",
        "Kass & Raftery 1995, section 3.2: 6 to 10 is strong",
    )
    same_share: Threshold = T(
        0.1, "of what a room's response leaves open", "two that differ by less say the same", _since("bb1e1b4")
    )
    # stepwise
    rounds: Count = C(4, "rounds", "effects added one by one, at most", FIRST_DIAGNOSIS)
    suffices_db: Threshold = T(1.5, "dB", "a smaller gap is the mesh's and the shapes' own", FIRST_DIAGNOSIS)
    explained_by_room_share: Threshold = T(
        0.7,
        "of the gap",
        "the same with a room, whose response has a tap for every sample and takes up much",
        _since("8b6cb3e"),
    )
    costly_open_share: Threshold = T(
        0.3, "of the first gap", "with less left, no costly candidate is tried", _since("af918d8")
    )
    # pairwise
    pair_leaves_share: Threshold = T(
        0.25,
        "of the gap",
        "two at once are twice as many choices, so they must close more than one after another",
        _since("08f1067"),
    )
    # phase test
    phases_decide_share: Threshold = T(
        0.2, "of the gain", "between two that differ by less, phases or decays may decide", _since("5245b93")
    )
    clear_phases: Threshold = T(25.0, "2 Δ ln L", "phases decide against what strikes prefer", _since("5245b93"))
    # exchange
    alike_share: Threshold = T(0.03, "of the gain", "two that differ by less are alike", _since("f039c9b"))
    # cross-validation
    kept_lines_share: Threshold = T(0.75, "of the lines", "kept in every fold, the others left out", FIRST_DIAGNOSIS)
    control_draws: Count = C(2, "draws", "of the control effect, for every strike left out", FIRST_DIAGNOSIS)
    control_numbers: Count = C(8, "numbers", "of a control effect, at most", FIRST_DIAGNOSIS)
    enough_effects: Count = C(
        2, "effects", "with as many found and little open, no long search is begun", _since("879e402")
    )
    # levels by band
    early_s: Threshold = T(
        0.05, "s", "the attack is looked at by itself, for a long decay would outweigh it", _since("3a31221")
    )
    band_apart_db: Threshold = T(
        3.0, "dB", "a band is half or twice as loud as it should be", "derivation: 10 lg 2 of power"
    )
    band_cells: Count = C(4, "cells", "of a spectrum in every band, at least", _since("3a31221"))
    lobe_cells: Count = C(
        2, "cells", "to each side in a Hann window's main lobe", "derivation: the window's first zeros"
    )
    own_scatter_strikes: Count = C(
        3, "strikes", "of fewer, the scatter of all bands says how far a mean may be off", _since("3a31221")
    )

    def __post_init__(self) -> None:
        """Check the numbers."""
        if wrong := [name for name, rule in rows(self) if not (rule.unit and rule.reason and rule.provenance)]:
            raise ValueError(f"thresholds without a unit, reason or provenance: {', '.join(wrong)}")
        if wrong := [name for name, rule in rows(self) if not rule > 0]:
            raise ValueError(f"thresholds must be above 0: {', '.join(wrong)}")
        if wrong := [name for name, rule in rows(self) if name.endswith("_share") and rule > 1]:
            raise ValueError(f"shares must be 1 at most: {', '.join(wrong)}")
        if not self.certain_drop_db <= self.faint_drop_db <= self.least_drop_db:
            raise ValueError(
                "what lines agree on needs no larger drop than what is faint, and that none larger than any other"
            )
        if not self.most_share <= self.explained_by_room_share:
            raise ValueError("a room must close no less of the gap than another effect")


def rows(rules: Thresholds) -> list[tuple[str, Threshold | Count]]:
    """Return every name with its number, in their order."""
    return list(zip((field.name for field in fields(rules)), astuple(rules), strict=True))


def table(rules: Thresholds) -> str:
    """Format a table in Markdown: name, value, unit, reason, provenance."""
    head = ["| threshold | value | unit | why | where from |", "|---|---|---|---|---|"]
    return "\n".join(
        [
            *head,
            *(
                f"| `{name}` | {rule:g} | {rule.unit} | {rule.reason} | {rule.provenance} |"
                for name, rule in rows(rules)
            ),
        ]
    )


RULES = Thresholds()
"""What the package judges by."""
