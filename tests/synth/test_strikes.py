"""Loads told apart: what lasts is silent, what is shorter is a blow, and a blow needs a cause."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.records.contacts import Contacts
from sonic_bullet.synth.strikes import (
    LOOKAHEAD,
    SPAN,
    LoadHistory,
    accepted_impulse,
    causing_approach_m_s,
    key_bodies,
    pair_key,
    push,
    split,
    unheld_steps,
)

DT = 1 / 240


def contacts(load_n: dict[tuple[int, int], float], *, points: int = 1) -> Contacts:
    """One step's rows: normal loads of pairs (a, b), each spread over ``points`` rows."""
    pairs = [pair for pair, load in load_n.items() if load > 0 for _ in range(points)]
    k = len(pairs)
    force = np.repeat([load for load in load_n.values() if load > 0], points) / points
    normal = np.tile([0.0, 0.0, 1.0], (k, 1))
    zero = np.zeros((k, 3))
    a, b = np.array(pairs, np.int32).reshape(k, 2).T
    return Contacts(
        a, b, zero, zero, normal, normal * force.reshape(k, 1) * DT, zero, np.zeros((k, 2)), np.zeros(k), np.zeros(k)
    )


def told_apart(
    loads: dict[tuple[int, int], list[float]], **how: int
) -> tuple[list[tuple[int, int, float]], dict[int, list[float]]]:
    """Strikes (step, key, impulse) in the order that the synthesizer asks for them, and each pair's support at the end
    of each step.
    """
    long = max(map(len, loads.values()))
    steps = [
        contacts({pair: column[i] if i < len(column) else 0.0 for pair, column in loads.items()}, **how)
        for i in range(long)
    ]
    steps += [Contacts.none()] * LOOKAHEAD
    history = LoadHistory.empty()
    found: list[tuple[int, int, float]] = []
    support: dict[int, list[float]] = {int(pair_key(contacts({pair: 1.0}))[0]): [] for pair in loads}

    def keep(parts: object, first: int) -> None:
        for row, share in zip(parts.strike, parts.share, strict=True):  # type: ignore[attr-defined]
            key = int(parts.key[row])  # type: ignore[attr-defined]
            column = [loads_of(loads, key, first + j) for j in range(len(share))]
            found.append((first, key, float(np.dot(share, column)) * DT))

    for newest, step in enumerate(steps):
        history = push(history, step, DT)
        now = newest - LOOKAHEAD
        if now < 0:
            continue
        parts, history = split(history, ahead=0)
        keep(parts, now)
        parts, history = split(history)
        keep(parts, now + 1)
        for key, column in support.items():
            at = np.flatnonzero(parts.key == key)
            column.append(float(parts.support_n[at[0], 0]) if len(at) else 0.0)
    return found, support


def loads_of(loads: dict[tuple[int, int], list[float]], key: int, step: int) -> float:
    low, high = key_bodies(np.array([key]))
    column = loads.get((int(low[0]), int(high[0])), loads.get((int(high[0]), int(low[0])), []))
    return column[step] if step < len(column) else 0.0


def test_steady_load_is_silent() -> None:
    found, support = told_apart({(0, 1): [0.0] * 3 + [2.0] * 40})
    assert found == []
    assert support[int(pair_key(contacts({(0, 1): 1.0}))[0])][3:40] == [2.0] * 37


@pytest.mark.parametrize("slope", [0.3, -0.3])
def test_a_ramp_is_silent(slope: float) -> None:
    ramp = list(6.0 + slope * np.arange(-18, 18))
    found, _ = told_apart({(0, 1): ramp[:1] * 8 + ramp + ramp[-1:] * 8})
    assert found == []


def test_a_slow_swing_is_silent() -> None:
    """A load that swings over many steps keeps below its opening's resolution: what is left is the tips, under 1 % of
    it.
    """
    swing = list(10 + 5 * np.sin(2 * np.pi * np.arange(400) / 100))
    found, _ = told_apart({(0, 1): swing})
    assert sum(j for _, _, j in found) < 1e-3 * sum(swing) * DT


@pytest.mark.parametrize("shape", [[5.0], [5.0, 3.0], [3.0, 5.0], [4.0, 4.0], [7.0, 0.01]])
@pytest.mark.parametrize("start", [0, 1, 2, 3, 4, 9])
def test_impacts_of_one_and_two_steps_are_found_whole(shape: list[float], start: int) -> None:
    found, _ = told_apart({(0, 1): [0.0] * start + shape + [0.0] * 8})
    assert [step for step, *_ in found] == [start]
    assert found[0][2] == pytest.approx(sum(shape) * DT, rel=1e-12)


@pytest.mark.parametrize(
    "shape", [[9.0, 5.0, 0.5], [1.0, 9.0, 0.2], [3.0, 3.0, 3.0], [1.2, 1.0, 1.0], [1.0, 2.0, 4.0], [5.0, 0.1, 2.0]]
)
@pytest.mark.parametrize("start", [0, 3])
def test_impacts_of_three_steps_are_found_whole(shape: list[float], start: int) -> None:
    found, _ = told_apart({(0, 1): [0.0] * start + shape + [0.0] * 8})
    assert sum(j for *_, j in found) == pytest.approx(sum(shape) * DT, rel=1e-12)
    assert all(start <= step <= start + 1 for step, *_ in found)


def test_an_impact_of_span_steps_is_support() -> None:
    found, _ = told_apart({(0, 1): [0.0] * 5 + [3.0] * SPAN + [0.0] * 8})
    assert found == []


@pytest.mark.parametrize("shape", [[9.0], [9.0, 4.0], [4.0, 9.0]])
def test_landing_strikes_with_what_exceeds_the_support(shape: list[float]) -> None:
    found, support = told_apart({(0, 1): [0.0] * 6 + shape + [2.0] * 20})
    assert [step for step, *_ in found] == [6]
    assert found[0][2] == pytest.approx(sum(x - 2 for x in shape) * DT, rel=1e-12)
    assert next(iter(support.values()))[8:20] == [2.0] * 12


def test_a_blow_on_top_of_support_is_the_excess_alone() -> None:
    found, _ = told_apart({(0, 1): [2.0] * 12 + [10.0, 5.0] + [2.0] * 12})
    assert [(step, pytest.approx(11.0 * DT)) for step, *_ in found] == [(12, found[0][2])]


def test_bounces_five_steps_apart_are_two() -> None:
    found, _ = told_apart({(0, 1): [0.0] * 4 + [6.0, 2.0] + [0.0] * 3 + [4.0] + [0.0] * 8})
    assert [(step, pytest.approx(j)) for step, _, j in found] == [(4, 8.0 * DT), (9, 4.0 * DT)]


def test_a_manifolds_points_are_one_load() -> None:
    one, _ = told_apart({(0, 1): [0.0] * 4 + [6.0, 2.0] + [1.0] * 9})
    four, _ = told_apart({(0, 1): [0.0] * 4 + [6.0, 2.0] + [1.0] * 9}, points=4)
    assert [x[:2] for x in one] == [x[:2] for x in four]
    assert [x[2] for x in four] == pytest.approx([x[2] for x in one], rel=1e-12)


def test_swapping_a_and_b_changes_nothing() -> None:
    column = [0.0] * 4 + [6.0, 2.0] + [1.0] * 9 + [5.0] + [1.0] * 9
    rng = np.random.default_rng(1)
    other = list(rng.uniform(0, 4, 24))
    one = told_apart({(0, 1): column, (2, 7): other})
    swapped = told_apart({(7, 2): other, (1, 0): column})
    assert one[0] == swapped[0]
    assert one[1] == swapped[1]
    assert len(one[0]) >= 2


@pytest.mark.parametrize("seed", range(5))
def test_strikes_and_support_never_exceed_the_load(seed: int) -> None:
    """Whatever the loads, the parts are at most the whole: no momentum is made, and none is given out twice."""
    rng = np.random.default_rng(seed)
    column = list(rng.uniform(0, 5, 300) * (rng.random(300) < 0.6))
    found, support = told_apart({(0, 1): column})
    kept = next(iter(support.values()))
    struck = sum(j for *_, j in found) / DT
    assert struck + sum(kept[: len(column)]) <= sum(column) * (1 + 1e-12)
    assert all(s <= x + 1e-12 for s, x in zip(kept, column, strict=False))
    assert len(found) > 10


# --- causes


def test_a_blow_is_bounded_by_its_cause() -> None:
    raw, mobile = np.array([1.0]), np.array([True, True])
    assert accepted_impulse(raw, np.array([0.3]), np.array([0]), np.array([1]), mobile) == pytest.approx([0.3])
    assert accepted_impulse(raw, np.array([2.0]), np.array([0]), np.array([1]), mobile) == pytest.approx([1.0])
    assert accepted_impulse(raw, np.array([0.0]), np.array([0]), np.array([1]), mobile) == pytest.approx([0.0])


def test_neighbours_hand_a_blow_on_but_floors_do_not() -> None:
    """A cradle: the first pair is hit, the others touch and nothing approaches; each hands on what it got."""
    a, b = np.arange(5), np.arange(1, 6)
    raw, budget = np.full(5, 1.0), np.array([1.0, 0, 0, 0, 0])
    assert accepted_impulse(raw, budget, a, b, np.ones(6, bool)) == pytest.approx(np.ones(5))
    floor_between = np.array([True, True, True, False, True, True])
    assert accepted_impulse(raw, budget, a, b, floor_between) == pytest.approx([1, 1, 1, 0, 0])


def test_the_largest_neighbour_counts_and_not_the_sum() -> None:
    a, b = np.array([0, 0, 0, 0]), np.array([1, 2, 3, 4])
    accepted = accepted_impulse(np.array([0.1, 0.2, 0.1, 9.0]), np.array([0.1, 0.2, 0.1, 0.0]), a, b, np.ones(5, bool))
    assert accepted[3] == pytest.approx(0.2)


def test_what_gravity_gives_in_one_step_is_no_cause_for_what_rests() -> None:
    up, fall = np.array([[0.0, 0.0, 1.0]]), np.array([0, 0, -9.81]) * DT
    resting, free, placed = np.array([1.0, 0]), np.array([0.0, 0]), np.array([4.0, 0])
    low, high = np.array([0]), np.array([1])
    speed = 9.81 * DT
    assert causing_approach_m_s(np.array([speed]), low, high, up, resting, fall)[0] == 0
    assert causing_approach_m_s(np.array([speed]), low, high, up, free, fall)[0] == pytest.approx(speed)
    assert causing_approach_m_s(np.array([3.9 * speed]), low, high, up, placed, fall)[0] == 0
    assert causing_approach_m_s(np.array([1.0]), low, high, up, placed, fall)[0] > 0.8
    sideways = np.array([[1.0, 0.0, 0.0]])  # a wall: gravity approaches nothing there
    assert causing_approach_m_s(np.array([speed]), low, high, sideways, resting, fall)[0] == pytest.approx(
        speed, rel=0.011
    )
    assert causing_approach_m_s(np.array([1e-4]), low, high, up, resting, np.zeros(3))[0] == pytest.approx(1e-4)


def test_supported_are_mobile_bodies_that_carried_load() -> None:
    history = LoadHistory.empty()
    for _ in range(SPAN):
        history = push(history, contacts({(0, 1): 2.0}), DT)
    for _ in range(LOOKAHEAD):
        history = push(history, contacts({(1, 2): 2.0}), DT)
    parts, _ = split(history)
    mobile = np.array([False, True, True])
    assert unheld_steps(parts, mobile, np.zeros(3, bool)).tolist() == [0, 1, 0]
    assert unheld_steps(parts, mobile, np.ones(3, bool)).tolist() == [0, SPAN, SPAN]
