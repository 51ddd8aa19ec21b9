"""Contacts are one table of rows that nobody can write to and whose numbers are numbers, however they came there."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.records.contacts import CONTACT, ROW_FIELDS, Contacts, Step
from sonic_bullet.records.errors import LogError, RecordError


def table(k: int, seed: int = 0) -> np.ndarray:
    """Rows (k,) of CONTACT, every number another."""
    rng = np.random.default_rng(seed)
    row = np.empty(k, CONTACT)
    for name, (dtype, tail) in ROW_FIELDS.items():
        row[name] = rng.integers(0, 5, k) if dtype is np.int32 else rng.normal(size=(k, *tail))
    return row


def test_the_fields_are_the_table_and_no_byte_lies_between_them() -> None:
    assert tuple(ROW_FIELDS) == CONTACT.names
    assert sum(CONTACT[name].itemsize for name in CONTACT.names or ()) == CONTACT.itemsize == 160
    row = table(6)
    rows = Contacts.of(row)
    for name, (dtype, tail) in ROW_FIELDS.items():
        column = getattr(rows, name)
        assert column.dtype == dtype and column.shape == (6, *tail)
        np.testing.assert_array_equal(column, row[name])
        assert np.shares_memory(column, rows.row)
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 0


def test_a_table_and_its_fields_make_the_same_rows() -> None:
    row = table(4)
    by_name = Contacts(**{name: row[name] for name in ROW_FIELDS})
    assert by_name.row.tobytes() == Contacts.of(row).row.tobytes()
    joined = Contacts.join([by_name.rows(0, 1), Contacts.none(), by_name.rows(1, 4)])
    assert joined.row.tobytes() == row.tobytes()
    assert len(Contacts.join([])) == len(Contacts.none()) == 0


def test_a_table_that_is_written_to_afterwards_is_another() -> None:
    row = table(2)
    rows = Contacts.of(row)
    row["gap_m"] = 7.0
    assert (rows.gap_m != 7.0).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e31])
@pytest.mark.parametrize("name", [name for name, (dtype, _) in ROW_FIELDS.items() if dtype is float])
def test_a_number_that_is_none_is_named(name: str, value: float) -> None:
    row = table(3)
    row[name][1] = value
    with pytest.raises(RecordError, match=f"contact {name} holds"):
        Contacts.of(row)


@pytest.mark.parametrize("wrong", [np.zeros((2, 20)), [1, 2], np.zeros((1, 1), CONTACT)])
def test_what_is_no_table_is_refused(wrong: object) -> None:
    with pytest.raises(RecordError, match="contacts: row is"):
        Contacts.of(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("index", [-1, 2])
def test_a_contact_of_nobody_is_refused(index: int) -> None:
    row = table(1)
    row["a"], row["b"] = 0, index
    with pytest.raises(LogError, match="a contact names a body"):
        Step(0.01, np.zeros((2, 3)), np.zeros((2, 4)), np.zeros(2, bool), Contacts.of(row))
