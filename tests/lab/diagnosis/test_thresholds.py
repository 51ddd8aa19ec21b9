"""The numbers that decide: each has a unit, a reason and a provenance; the page's table is the record's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sonic_bullet.lab.diagnosis.thresholds import RULES, Thresholds, rows, table

PAGE = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "how-a-diagnosis-judges.md"


def test_every_number_says_what_it_is() -> None:
    every = rows(RULES)
    assert len(every) <= 12 and all(len(row) == 5 and all(row[2:]) for row in every)
    assert RULES.least_drop_db == 0.2 and RULES.strong_evidence == 6


def test_what_is_derived_follows_from_the_others() -> None:
    assert RULES.little_share == (1 - RULES.most_share) ** 2
    assert RULES.suffices_db == RULES.most_share * RULES.band_apart_db


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"least_drop_db": 0.0}, "above 0"),
        ({"most_share": 1.5}, "1 at most"),
        ({"most_share": 0.2}, "no more than most"),
        ({"same_share": 0.3}, "no more than a little"),
    ],
)
def test_a_record_is_checked_when_built(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(RULES, **wrong)  # type: ignore[arg-type]


def test_the_record_is_frozen() -> None:
    with pytest.raises(AttributeError):
        RULES.least_drop_db = 0.5  # type: ignore[misc]
    assert Thresholds() == RULES


def test_the_pages_table_is_the_records() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert table(RULES) in page, "make docs"
    assert not any(row[4].startswith("unknown") for row in rows(RULES))
