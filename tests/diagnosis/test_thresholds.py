"""The numbers that decide: each has a unit, a reason and a provenance; the page's table is the record's."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.diagnosis.selection.thresholds import RULES, Count, Threshold, Thresholds, rows, table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "explanation" / "how-a-diagnosis-judges.md"


def test_every_number_says_what_it_is() -> None:
    every = rows(RULES)
    assert len(every) > 20
    for name, rule in every:
        assert isinstance(rule, Threshold | Count), name
        assert rule.unit and rule.reason and rule.provenance, name


def test_a_number_reckons_as_any_other() -> None:
    assert RULES.least_drop_db == 0.4 and RULES.rounds == 4
    assert np.asarray(RULES.least_drop_db).dtype == np.float64
    assert type(2.0 * RULES.least_drop_db) is float and list(range(RULES.loudest_strikes)) == [0, 1]
    made = copy.deepcopy(RULES)
    assert made == RULES and made.lost_share.reason == RULES.lost_share.reason


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"least_drop_db": RULES.least_drop_db.at(0.0)}, "above 0"),
        ({"most_share": RULES.most_share.at(1.5)}, "1 at most"),
        ({"most_share": RULES.most_share.at(0.8)}, "a room must close"),
        ({"faint_drop_db": RULES.faint_drop_db.at(0.5)}, "no larger drop"),
        ({"rounds": Count(4, "rounds", "", "convention")}, "without a unit"),
    ],
)
def test_a_record_is_checked_when_built(wrong: dict[str, Threshold], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(RULES, **wrong)  # type: ignore[arg-type]


def test_the_record_is_frozen() -> None:
    with pytest.raises(AttributeError):
        RULES.rounds = RULES.rounds.at(5)  # type: ignore[misc]
    assert Thresholds() == RULES


def test_the_pages_table_is_the_records() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert table(RULES) in page, "make docs"
    assert page.count("| unknown; since ") == sum(rule.provenance.startswith("unknown") for _, rule in rows(RULES))
