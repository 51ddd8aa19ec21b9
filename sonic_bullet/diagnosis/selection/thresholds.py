"""Numbers that decide which effect is accepted, and the verdict, each with unit, reason and provenance.

    RULES.least_drop_db       a float; its unit, reason and provenance are the field's metadata

provenance is a source, a derivation or a convention; "unknown" means that nobody wrote down which cases set it, and
names the change that brought it. What is unknown is removed first.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field, fields
from typing import Any


def _rule(value: float, unit: str, reason: str, provenance: str) -> Any:
    """Build a field of a number with its words."""
    return field(default=value, metadata={"unit": unit, "reason": reason, "provenance": provenance})


def _since(commit: str) -> str:
    """Format the provenance of a number of which only the change that brought it is known."""
    return f"unknown; since {commit}"


WORDS = ("unit", "reason", "provenance")
FIRST_DIAGNOSIS = _since("f650a3c")  # the commit with which diagnosis began


@dataclass(frozen=True, slots=True)
class Thresholds:
    """All of them. Raises ValueError where one is out of its range, or has no unit, reason or provenance."""

    most_share: float = _rule(
        0.5,
        "1",
        "most of a gap, of a gain or of what is needed: more than half",
        "convention: of two parts the larger",
    )
    # acceptance
    least_drop_db: float = _rule(0.4, "dB", "mean gain on strikes left out, at least", FIRST_DIAGNOSIS)
    least_drop_share: float = _rule(0.08, "of the gap", "the same, where the gap is wide", _since("5e45792"))
    faint_drop_db: float = _rule(
        0.2,
        "dB",
        "in place of the least drop while nothing is found, if the gain is most of the gap",
        _since("0d18b91"),
    )
    certain_drop_db: float = _rule(
        0.1,
        "dB",
        "in place of the faint drop, where lines agreed on the effect before it was proposed",
        _since("58d84bf"),
    )
    certain_share: float = _rule(0.25, "of the gap", "in place of the faint share, likewise", _since("ca2b773"))
    standard_errors: float = _rule(
        2.0, "standard errors", "a mean over strikes differs from zero", "convention: 95 % of a normal mean"
    )
    loudest_strikes: int = _rule(
        2, "strikes", "left out first; what gains on none of them is dropped", _since("ca2b773")
    )
    lost_share: float = _rule(
        0.15,
        "of the gain",
        "what one strike may lose of the mean, all others together of the loudest's, and not speak against an effect",
        _since("2b1b956"),
    )
    many_strikes: int = _rule(
        4,
        "strikes",
        "of as many, none losing speaks as well as standard errors; of more, one may be odd",
        _since("b840359"),
    )
    odd_strike_factor: float = _rule(
        3.0, "times the drop needed", "what the rest must gain before one strike counts as odd", _since("3e49a55")
    )
    # simplest
    strong_evidence: float = _rule(
        6.0,
        "2 Δ ln L",
        "of lines' decays or phases, where strikes prefer neither",
        "Kass & Raftery 1995, section 3.2: 6 to 10 is strong",
    )
    same_share: float = _rule(
        0.1, "of what a room's response leaves open", "two that differ by less say the same", _since("bb1e1b4")
    )
    # stepwise
    rounds: int = _rule(4, "rounds", "effects added one by one, at most", FIRST_DIAGNOSIS)
    suffices_db: float = _rule(1.5, "dB", "a smaller gap is the mesh's and the shapes' own", FIRST_DIAGNOSIS)
    explained_by_room_share: float = _rule(
        0.7,
        "of the gap",
        "the same with a room, whose response has a tap for every sample and takes up much",
        _since("8b6cb3e"),
    )
    costly_open_share: float = _rule(
        0.3, "of the first gap", "with less left, no costly candidate is tried", _since("af918d8")
    )
    # pairwise
    pair_leaves_share: float = _rule(
        0.25,
        "of the gap",
        "two at once are twice as many choices, so they must close more than one after another",
        _since("08f1067"),
    )
    # phase test
    phases_decide_share: float = _rule(
        0.2, "of the gain", "between two that differ by less, phases or decays may decide", _since("5245b93")
    )
    clear_phases: float = _rule(25.0, "2 Δ ln L", "phases decide against what strikes prefer", _since("5245b93"))
    # exchange
    alike_share: float = _rule(0.03, "of the gain", "two that differ by less are alike", _since("f039c9b"))
    # cross-validation
    kept_lines_share: float = _rule(0.75, "of the lines", "kept in every fold, the others left out", FIRST_DIAGNOSIS)
    control_draws: int = _rule(2, "draws", "of the control effect, for every strike left out", FIRST_DIAGNOSIS)
    control_numbers: int = _rule(8, "numbers", "of a control effect, at most", FIRST_DIAGNOSIS)
    enough_effects: int = _rule(
        2, "effects", "with as many found and little open, no long search is begun", _since("879e402")
    )
    # levels by band
    early_s: float = _rule(
        0.05, "s", "the attack is looked at by itself, for a long decay would outweigh it", _since("3a31221")
    )
    band_apart_db: float = _rule(
        3.0, "dB", "a band is half or twice as loud as it should be", "derivation: 10 lg 2 of power"
    )
    band_cells: int = _rule(4, "cells", "of a spectrum in every band, at least", _since("3a31221"))
    lobe_cells: int = _rule(
        2, "cells", "to each side in a Hann window's main lobe", "derivation: the window's first zeros"
    )
    own_scatter_strikes: int = _rule(
        3, "strikes", "of fewer, the scatter of all bands says how far a mean may be off", _since("3a31221")
    )

    def __post_init__(self) -> None:
        """Check the numbers."""
        if wrong := [name for name, rule, *words in rows(self) if not (rule > 0 and all(words))]:
            raise ValueError(f"thresholds must be above 0, with a unit, a reason and a provenance: {', '.join(wrong)}")
        if wrong := [name for name, rule, *_ in rows(self) if name.endswith("_share") and rule > 1]:
            raise ValueError(f"shares must be 1 at most: {', '.join(wrong)}")
        if not self.certain_drop_db <= self.faint_drop_db <= self.least_drop_db:
            raise ValueError(
                "what lines agree on needs no larger drop than what is faint, and that none larger than any other"
            )
        if not self.most_share <= self.explained_by_room_share:
            raise ValueError("a room must close no less of the gap than another effect")


def rows(rules: Thresholds) -> list[tuple[str, float, str, str, str]]:
    """Return every name with its number, unit, reason and provenance, in their order."""
    every = zip(fields(rules), astuple(rules), strict=True)
    return [(f.name, value, *(f.metadata[k] for k in WORDS)) for f, value in every]


def table(rules: Thresholds) -> str:
    """Format a table in Markdown: name, value, unit, reason, provenance."""
    head = ["| threshold | value | unit | why | where from |", "|---|---|---|---|---|"]
    return "\n".join([*head, *(f"| `{name}` | {rule:g} | {' | '.join(words)} |" for name, rule, *words in rows(rules))])


RULES = Thresholds()
"""What the package judges by."""
