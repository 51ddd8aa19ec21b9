"""Median and worst of any number of latencies, in a fixed room."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonic_bullet.session.live.latencies import Latencies

BIN_S = 1e-4


def test_median_and_worst_are_those_of_all() -> None:
    rng, kept = np.random.default_rng(1), Latencies()
    given = rng.gamma(4.0, 0.01, 5001)
    for one in given:
        kept.add(float(one))
    assert len(kept) == 5001
    assert kept.median_s == pytest.approx(np.median(given), abs=BIN_S)
    assert kept.worst_s == given.max()


def test_none_is_no_number() -> None:
    assert math.isnan(Latencies().median_s)
    assert Latencies().worst_s == 0


def test_what_is_beyond_the_room_is_kept_as_worst() -> None:
    kept = Latencies()
    for one in (0.03, 7.5, -0.001):
        kept.add(one)
    assert (len(kept), kept.worst_s) == (3, 7.5)
    assert kept.median_s == pytest.approx(0.03, abs=BIN_S)
