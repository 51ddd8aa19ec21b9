"""Calls of two runs, side by side; causes and shares of made-up sounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from sonic_bullet.apps.compare.inputs.call_pairs import align_sequences, side_by_side
from sonic_bullet.apps.compare.inputs.causes import find_causes, log_distance, same_sound, shapley_shares
from sonic_bullet.apps.compare.inputs.tree_difference import MISSING, leaves, same, with_leaves
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.simulators.calls import Call, ObjectId


def made(side: str, *places: float) -> list[Call]:
    return [
        Call("createMultiBody", 0, {"baseMass": 1.0, "basePosition": (x, 0.0, 0.0)}, None, (ObjectId(side, i),))
        for i, x in enumerate(places)
    ]


def test_the_body_that_is_missing_is_found_among_equal_ones() -> None:
    _, match = side_by_side(made("a", 0.0, 1.0, 2.0, 3.0), made("b", 0.0, 2.0, 3.0))
    assert match == {
        ObjectId("a", 0): ObjectId("b", 0),
        ObjectId("a", 2): ObjectId("b", 1),
        ObjectId("a", 3): ObjectId("b", 2),
    }


def test_both_orders_are_kept() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        a, b = (rng.integers(0, 4, rng.integers(0, 8)).tolist() for _ in range(2))
        found = align_sequences(a, b, lambda x, y: float(x != y) * 3, lambda x: 1.0)
        assert [x for x, _ in found if x is not None] == a
        assert [y for _, y in found if y is not None] == b


def test_leaves_come_back() -> None:
    value = {"shape": {"radius": 1.0, "kind": 2}, "mass": 3.0}
    assert dict(leaves(value)) == {("shape", "radius"): 1.0, ("shape", "kind"): 2, ("mass",): 3.0}
    assert with_leaves(value, {("shape", "radius"): 5.0, ("mass",): MISSING}) == {"shape": {"radius": 5.0, "kind": 2}}
    assert same(float("nan"), float("nan"))
    assert not same(np.zeros(2), np.zeros(3))
    assert not same(np.zeros(1), np.array([-0.0]))  # to the bit


@pytest.mark.parametrize("needed", [(2,), (0, 3), (1, 2, 4)])
def test_the_smallest_set_is_found(needed: tuple[int, ...]) -> None:
    asked: list[tuple[int, ...]] = []

    def is_a(chosen: Sequence[int]) -> bool:
        asked.append(tuple(chosen))
        return set(needed) <= set(chosen)

    found = find_causes(5, is_a)
    assert found.found == needed
    assert found.exact
    assert len(asked) <= 11


def test_what_cannot_be_put_back_leaves_the_cause_open() -> None:
    found = find_causes(3, lambda chosen: False)
    assert found.found == ()
    assert not found.exact


def test_shares_are_shapley_values() -> None:
    rng = np.random.default_rng(2)
    a, parts = rng.normal(size=(1, 4096)), rng.normal(size=(3, 1, 4096)) * np.array([0.5, 0.2, 0.0])[:, None, None]

    def sound(chosen: Sequence[int]) -> KeptSound:
        return KeptSound.of(a + sum((parts[i] for i in range(3) if i not in chosen), np.zeros((1, 4096))))

    shares = shapley_shares((0, 1, 2), KeptSound.of(a), sound(()), sound)
    assert sum(shares.values()) == pytest.approx(1, abs=1e-12)  # efficiency: all put back closes all
    assert shares[2] == pytest.approx(0, abs=1e-12)  # a player that adds nothing
    assert shares[0] > shares[1] > 0


def test_the_same_is_to_the_bit() -> None:
    x = np.random.default_rng(3).normal(size=(2, 1000))
    assert same_sound(KeptSound.of(x), KeptSound.of(x.copy()))
    other = x.copy()
    other[1, 500] = np.nextafter(other[1, 500], 2)
    assert not same_sound(KeptSound.of(x), KeptSound.of(other))
    assert log_distance(x, x) == 0
