"""One encoder for all JSON: strict, numpy's values as what they hold, what is no number as null."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from sonic_bullet.files.storage.json_text import json_bytes


@dataclass
class Record:
    early: Any
    level_db: Any


@pytest.mark.parametrize(
    ("value", "read"),
    [
        (np.bool_(True), True),
        (np.float32(0.5), 0.5),
        (np.float64(1e-7), 1e-7),
        (np.int64(-3), -3),
        (np.uint8(255), 255),
        (np.str_("ä"), "ä"),
        (np.array(2.5), 2.5),
        (np.array([[1, 2], [3, 4]]), [[1, 2], [3, 4]]),
        (np.array([True, False]), [True, False]),
        (np.array([0.0, np.nan, np.inf]), [0.0, None, None]),
        (float("nan"), None),
        (-float("inf"), None),
        (np.float32("nan"), None),
        (Record(np.bool_(False), np.float64("-inf")), {"early": False, "level_db": None}),
        ({"a": (np.int32(1), [np.float64("nan")])}, {"a": [1, [None]]}),
        ({np.str_("k"): 2**70}, {"k": 2**70}),
    ],
    ids=str,
)
def test_what_is_written_is_strict_json(value: Any, read: Any) -> None:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    for indent in (None, 2):
        assert json.loads(json_bytes({"x": value}, indent=indent), parse_constant=refuse) == {"x": read}


def test_floats_come_back_to_the_last_bit() -> None:
    numbers = np.random.default_rng(0).standard_normal(500) * 10.0 ** np.arange(-250, 250)
    assert json.loads(json_bytes(numbers)) == numbers.tolist()


@pytest.mark.parametrize("value", [lambda: 0, 1j, object()], ids=["function", "complex", "object"])
def test_what_has_no_form_in_json_is_named(value: Any) -> None:
    with pytest.raises(TypeError, match=r"^a \w+ has no form in JSON$"):
        json_bytes({"x": value})
