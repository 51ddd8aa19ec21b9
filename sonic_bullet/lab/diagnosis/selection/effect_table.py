"""The candidates of a selection as one table: what each gains on strikes left out, and the rule that kept it out.

nearer, dB: mean over the strikes of D without the effect − D with it, each strike fitted without
±: standard error of that mean;  chance: the same of control effects of as many numbers
"""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.lab.diagnosis.selection.decay_test import parameter_count
from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared, SelectionEnd

NAMED = "named"
HEAD = ("effect", "numbers", "nearer, dB", "±", "chance, dB", "strikes", "named, or why not")


@dataclass(frozen=True, slots=True)
class Row:
    """One candidate in the last round in which it was tried.

    Attributes
    ----------
    id : str
        Of the effect.
    numbers : int
        That it adds to the model; a law in Rayleigh's place has two less.
    nearer_db, standard_error_db, chance_db : float
        Mean gain on strikes left out, its standard error, and a control effect's.
    strikes : int
        That were left out.
    word : str
        "named", or why it is not.
    """

    id: str
    numbers: int
    nearer_db: float
    standard_error_db: float
    chance_db: float
    strikes: int
    word: str

    def cells(self) -> tuple[str, ...]:
        """Format the row's cells, as `HEAD` names them."""
        return (
            self.id,
            str(self.numbers),
            f"{self.nearer_db:+.2f}",
            f"{self.standard_error_db:.2f}",
            f"{self.chance_db:+.2f}",
            str(self.strikes),
            self.word,
        )


def effect_table(end: SelectionEnd | NothingCompared) -> tuple[Row, ...]:
    """Return a row for every candidate that was tried, those that are named first, then by what they gain."""
    named = {c.id for c in end.added}
    withheld, why = end.withheld if isinstance(end, SelectionEnd) else ((), "")
    made = []
    for c in (*end.added, *(c for c in end.tried if c.id not in named)):
        word = (
            NAMED
            if c.id in named
            else f"withheld: {why}"
            if c.id in withheld
            else c.why_not or "accepted alone, not beside the others"
        )
        made.append(Row(c.id, parameter_count(c.effect), c.mean_db, c.sd_db, c.control_db, len(c.drop_db), word))
    return tuple(sorted(made, key=lambda row: (row.word != NAMED, -row.nearer_db)))


def explain_chance() -> str:
    """Return what the column of chance holds, for those who read the table."""
    return (
        "Chance: what a control effect of as many numbers, which mean nothing, gains on the same strikes; "
        "below 0 it leads away from them."
    )
