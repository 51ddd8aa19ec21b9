"""Loads split on the tables: what lasts is silent, what is shorter is a strike, and a strike needs a cause."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sonic_bullet._engine import STRIKE, accept_strikes, set_gravity_steps, split_loads
from sonic_bullet.engine.contact.load_splitting import LOOKAHEAD, NOW, SPAN
from sonic_bullet.engine.contact.pulse_shape import spectrum_table
from sonic_bullet.engine.runtime.channels.body_images import BodyImages
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Contacts
from tests.made.models import ball_body, box_body, row, step, wall_body
from tests.made.stages import Stages, body_table

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
        a,
        b,
        point_a_m=zero,
        point_b_m=zero,
        normal=normal,
        impulse_n_s=normal * force.reshape(k, 1) * DT,
        slip_m_s=zero,
        sweep_m_s=np.zeros((k, 2)),
        approach_m_s=np.zeros(k),
        gap_m=np.zeros(k),
    )


def split_of(
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
    balls = tuple(ball_body(0.02, body_id=i) for i in range(8))
    stages = Stages(balls, pairs=8, rows=16)
    found: list[tuple[int, int, float]] = []
    support: dict[int, list[float]] = {pair_key(*pair): [] for pair in loads}
    for newest, one in enumerate(steps):
        stages.enter(step(np.zeros((8, 3)).tolist(), one))
        now = newest - LOOKAHEAD
        if now < 0:
            continue
        pairs, active = stages.pairs.pair, stages.pairs.active[: stages.pairs.count[0]]
        for ahead in (0, 1):
            force = {int(p["key"]): p["force_n"].copy() for p in pairs[active]}
            window = stages.window, BodyImages()
            count = split_loads(ahead, stages.rendered + ahead, window, stages.pairs, stages.strikes)
            for strike in stages.strikes[:count]:
                key = pair_key(*strike["body"])
                column = force[key][NOW + ahead :][: SPAN - 1]
                found.append((now + ahead, key, float(np.dot(strike["fraction"], column)) * DT))
        for key, column in support.items():
            at = np.flatnonzero(pairs["key"][active] == key)
            column.append(float(pairs["support_n"][active[at[0]], 0]) if len(at) else 0.0)
    return found, support


def pair_key(a: int, b: int) -> int:
    return (int(min(a, b)) << 32) | int(max(a, b))


def test_steady_load_is_silent() -> None:
    found, support = split_of({(0, 1): [0.0] * 3 + [2.0] * 40})
    assert found == []
    assert support[pair_key(0, 1)][3:40] == [2.0] * 37


@pytest.mark.parametrize("slope", [0.3, -0.3])
def test_a_ramp_is_silent(slope: float) -> None:
    ramp = list(6.0 + slope * np.arange(-18, 18))
    found, _ = split_of({(0, 1): ramp[:1] * 8 + ramp + ramp[-1:] * 8})
    assert found == []


def test_a_slow_swing_is_silent() -> None:
    """A load that swings over many steps keeps below its opening's resolution: what is left is the tips, under 1 % of
    it.
    """
    swing = list(10 + 5 * np.sin(2 * np.pi * np.arange(400) / 100))
    found, _ = split_of({(0, 1): swing})
    assert sum(j for _, _, j in found) < 1e-3 * sum(swing) * DT


@pytest.mark.parametrize("shape", [[5.0], [5.0, 3.0], [3.0, 5.0], [4.0, 4.0], [7.0, 0.01]])
@pytest.mark.parametrize("start", [0, 1, 2, 3, 4, 9])
def test_impacts_of_one_and_two_steps_are_found_whole(shape: list[float], start: int) -> None:
    found, _ = split_of({(0, 1): [0.0] * start + shape + [0.0] * 8})
    assert [step for step, *_ in found] == [start]
    assert found[0][2] == pytest.approx(sum(shape) * DT, rel=1e-12)


@pytest.mark.parametrize(
    "shape", [[9.0, 5.0, 0.5], [1.0, 9.0, 0.2], [3.0, 3.0, 3.0], [1.2, 1.0, 1.0], [1.0, 2.0, 4.0], [5.0, 0.1, 2.0]]
)
@pytest.mark.parametrize("start", [0, 3])
def test_impacts_of_three_steps_are_found_whole(shape: list[float], start: int) -> None:
    found, _ = split_of({(0, 1): [0.0] * start + shape + [0.0] * 8})
    assert sum(j for *_, j in found) == pytest.approx(sum(shape) * DT, rel=1e-12)
    assert all(start <= step <= start + 1 for step, *_ in found)


def test_an_impact_of_span_steps_is_support() -> None:
    found, _ = split_of({(0, 1): [0.0] * 5 + [3.0] * SPAN + [0.0] * 8})
    assert found == []


@pytest.mark.parametrize("shape", [[9.0], [9.0, 4.0], [4.0, 9.0]])
def test_landing_strikes_with_what_exceeds_the_support(shape: list[float]) -> None:
    found, support = split_of({(0, 1): [0.0] * 6 + shape + [2.0] * 20})
    assert [step for step, *_ in found] == [6]
    assert found[0][2] == pytest.approx(sum(x - 2 for x in shape) * DT, rel=1e-12)
    assert next(iter(support.values()))[8:20] == [2.0] * 12


def test_a_strike_on_top_of_support_is_the_excess_alone() -> None:
    found, _ = split_of({(0, 1): [2.0] * 12 + [10.0, 5.0] + [2.0] * 12})
    assert [(step, pytest.approx(11.0 * DT)) for step, *_ in found] == [(12, found[0][2])]


def test_bounces_five_steps_apart_are_two() -> None:
    found, _ = split_of({(0, 1): [0.0] * 4 + [6.0, 2.0] + [0.0] * 3 + [4.0] + [0.0] * 8})
    assert [(step, pytest.approx(j)) for step, _, j in found] == [(4, 8.0 * DT), (9, 4.0 * DT)]


def test_a_manifolds_points_are_one_load() -> None:
    one, _ = split_of({(0, 1): [0.0] * 4 + [6.0, 2.0] + [1.0] * 9})
    four, _ = split_of({(0, 1): [0.0] * 4 + [6.0, 2.0] + [1.0] * 9}, points=4)
    assert [x[:2] for x in one] == [x[:2] for x in four]
    assert [x[2] for x in four] == pytest.approx([x[2] for x in one], rel=1e-12)


def test_swapping_a_and_b_changes_nothing() -> None:
    column = [0.0] * 4 + [6.0, 2.0] + [1.0] * 9 + [5.0] + [1.0] * 9
    rng = np.random.default_rng(1)
    other = list(rng.uniform(0, 4, 24))
    one = split_of({(0, 1): column, (2, 7): other})
    swapped = split_of({(7, 2): other, (1, 0): column})
    assert one[0] == swapped[0]
    assert one[1] == swapped[1]
    assert len(one[0]) >= 2


@pytest.mark.parametrize("seed", range(5))
def test_strikes_and_support_never_exceed_the_load(seed: int) -> None:
    """Whatever the loads, the parts are at most the whole: no momentum is made, and none is given out twice."""
    rng = np.random.default_rng(seed)
    column = list(rng.uniform(0, 5, 300) * (rng.random(300) < 0.6))
    found, support = split_of({(0, 1): column})
    kept = next(iter(support.values()))
    struck = sum(j for *_, j in found) / DT
    assert struck + sum(kept[: len(column)]) <= sum(column) * (1 + 1e-12)
    assert all(s <= x + 1e-12 for s, x in zip(kept, column, strict=False))
    assert len(found) > 10


# --- causes


def accepted(raw: Any, budget: Any, a: Any, b: Any, mobile: list[bool]) -> Array:
    """Accepted impulses of strikes between bodies a and b (q,)."""
    strikes = np.zeros(len(raw), STRIKE)
    strikes["raw_n_s"], strikes["budget_n_s"], strikes["body"] = raw, budget, np.stack([a, b], axis=1)
    bodies = body_table([ball_body(0.02, mass_kg=float(moves)) for moves in mobile]).bodies
    accept_strikes(strikes, bodies)
    return np.asarray(strikes["accepted_n_s"])


def test_a_strike_is_bounded_by_its_cause() -> None:
    for budget, expected in ((0.3, 0.3), (2.0, 1.0), (0.0, 0.0)):
        assert accepted([1.0], [budget], [0], [1], [True, True]) == pytest.approx([expected])


def test_neighbours_hand_a_strike_on_but_floors_do_not() -> None:
    """A cradle: the first pair is hit, the others touch and nothing approaches; each hands on what it got."""
    a, b = np.arange(5), np.arange(1, 6)
    raw, budget = np.full(5, 1.0), np.array([1.0, 0, 0, 0, 0])
    assert accepted(raw, budget, a, b, [True] * 6) == pytest.approx(np.ones(5))
    assert accepted(raw, budget, a, b, [True, True, True, False, True, True]) == pytest.approx([1, 1, 1, 0, 0])


def test_the_largest_neighbour_counts_and_not_the_sum() -> None:
    found = accepted([0.1, 0.2, 0.1, 9.0], [0.1, 0.2, 0.1, 0.0], np.zeros(4, int), [1, 2, 3, 4], [True] * 5)
    assert found[3] == pytest.approx(0.2)


def test_supported_are_mobile_bodies_that_carried_load() -> None:
    stages = Stages((wall_body(), ball_body(0.02, body_id=1), ball_body(0.02, body_id=2)))
    for pair in ([(0, 1)] * SPAN) + [(1, 2)] * LOOKAHEAD:
        stages.enter(step(np.zeros((3, 3)).tolist(), contacts({pair: 2.0})))
    steps = np.zeros(3)
    for number, expected in ((100, [0, 1, 0]), (3, [0, SPAN, SPAN])):
        set_gravity_steps(1, number, stages.pairs, stages.table.bodies, steps)
        assert steps.tolist() == expected


def fallen(
    approach: float, *, fall: float = 9.81, normal: Any = (0, 0, 1), since: int = -10, rests: bool = False
) -> float:
    """Approach speed that a strike of a ball on a wall was granted, by what of a great impulse comes out."""
    ball = replace(ball_body(0.02), since_step=since)
    stages = Stages((ball, wall_body()))
    heavy = row(0, 1, 9.0 * np.array(normal), normal=normal, approach=approach)
    light = row(0, 1, 1e-3 * np.array(normal), normal=normal, approach=0.0)
    pulses = []
    for number in range(8):
        rows = heavy if number == 4 else light if rests and number < 4 else None
        pulses += list(stages.take(step([(0, 0, 0), (0, 0, 0)], rows, gravity=(0, 0, -fall)))[0])
    if not pulses:
        return 0.0
    (pulse,) = pulses
    assert pulse["ahead"] == 1
    return float(np.linalg.norm(pulse["impulse_n_s"]) / (2 * ball.mass_kg))


def test_what_gravity_gives_in_one_step_is_no_cause_for_what_rests() -> None:
    speed = 9.81 * DT
    assert fallen(speed, rests=True) == 0
    assert fallen(speed) == pytest.approx(speed)
    assert fallen(3.9 * speed, since=4) == 0  # it was just put there
    assert 0.8 < fallen(1.0, since=4) < 1.0
    assert fallen(speed, rests=True, normal=(1, 0, 0)) == pytest.approx(speed, rel=0.011)  # a wall
    assert fallen(1e-4, rests=True, fall=0.0) == pytest.approx(1e-4)


# --- pulses


def test_a_pulse_is_its_rows_sum() -> None:
    """Four points and two steps are one pulse: impulse, moment and share; dated by gap/approach."""
    box, wall = box_body((0.2, 0.2, 0.05), np.linspace(400, 9000, 12)), wall_body(body_id=1)
    stages = Stages((box, wall))
    places = [(x, y, -0.025) for x in (-0.05, 0.05) for y in (-0.05, 0.05)]
    loads = ((4e-3, 1e-3, 2e-3, 3e-3), (1e-3, 1e-3, 1e-3, 1e-3))
    steps = [
        Contacts.join(
            [row(0, 1, (1e-4, 0, j), point_a=p, approach=0.5, gap=5e-4) for j, p in zip(k, places, strict=True)]
        )
        for k in loads
    ]
    pulses, pushes = [], []
    for number in range(8):
        rows = steps[number - 4] if number in (4, 5) else None
        found, modal_impulse = stages.take(step([(0, 0, 0), (0, 0, 0)], rows))
        pulses += list(found)
        pushes += list(modal_impulse)
    (pulse,), (modal_impulse,) = pulses, pushes
    table, impulses = stages.table, [(j, p) for k in loads for j, p in zip(k, places, strict=True)]
    raw = sum(j for j, _ in impulses)
    arm = sum(j / raw * np.array(p) for j, p in impulses)
    moment = np.cross(arm, (0, 0, 1.0))
    mass = 1 / (1 / box.mass_kg + moment @ np.linalg.solve(box.inertia_kg_m2, moment))
    scale = min(1.0, 2 * mass * 0.5 / raw)
    assert tuple(pulse["body"]) == (0, 1)
    assert pulse["impulse_n_s"] == pytest.approx([scale * 8e-4, 0, scale * raw], rel=1e-12)
    assert pulse["start_s"] == pytest.approx(1e-3)
    assert box.model is not None
    expected = np.zeros(12)
    for r in stages.window.row[stages.window.row["key"] == 1]:
        weight, face = r["barycentric"][0], table.faces[table.bodies["face_at"][0] + r["face"][0]]
        shape = box.model.shape[face["vertex"]].astype(float)
        expected += scale * np.einsum("c,cxm,x->m", weight, shape, r["local_impulse_n_s"][0])
    assert modal_impulse[0] == pytest.approx(expected, rel=1e-9)
    freq = table.frequency_hz[table.bodies["frequency_at"][0] :][:12]
    spectrum = np.interp(freq * pulse["length_s"], np.arange(321) / 40, spectrum_table()[pulse["flat"]])
    given = np.sum((modal_impulse[0] * spectrum) ** 2)
    assert pulse["transmitted_fraction"] == pytest.approx(1 / (1 + mass * given / (scale * raw) ** 2), rel=1e-12)


def test_an_impulse_too_small_to_square_shares_nothing() -> None:
    """As only a forged log has it."""
    stages = Stages((box_body((0.1, 0.1, 0.1), (900.0,), mass_kg=1e-180), wall_body(body_id=1)))
    pulses = []
    for number in range(8):
        rows = row(0, 1, (0, 0, 1e-170), point_a=(0, 0, -0.05), approach=1.0) if number == 4 else None
        pulses += list(stages.take(step([(0, 0, 0), (0, 0, 0)], rows))[0])
    (pulse,) = pulses
    assert pulse["impulse_n_s"][2] == pytest.approx(2e-180, rel=1e-9)
    assert pulse["transmitted_fraction"] == 1.0


def test_what_nobody_hears_is_passed_over() -> None:
    """Two walls, a silent partner, a manifold of friction alone: no pulse."""
    ball, wall = ball_body(0.02), wall_body(body_id=1)
    silent = replace(ball, material=None, model=None)
    cases = (
        ((ball, wall), (0, 0, 0.1)),
        ((wall, wall), (0, 0, 0.1)),
        ((silent, wall), (0, 0, 0.1)),
        ((ball, wall), (1, 0, 0.09)),
    )
    counts = []
    for bodies, impulse in cases:
        stages, count = Stages(bodies), 0
        for number in range(8):
            rows = row(0, 1, impulse) if number == 4 else None
            count += len(stages.take(step([(0, 0, 0), (0, 0, 0)], rows))[0])
        counts.append(count)
    assert counts == [1, 0, 0, 0]


def test_asked_one_step_late_a_strike_comes_a_step_later() -> None:
    """As it is before a quench, where what strikes waits for its own step."""
    bodies, places = (ball_body(0.02), wall_body(body_id=1)), [(0, 0, 0), (0, 0, 0)]
    stages = Stages(bodies)
    for number in range(5):
        stages.enter(step(places, row(0, 1, (0, 0, 0.1), gap=-1e-3) if number == 4 else None))
    assert stages.pulses_of(0) == 0  # of step 1; not asked for step 2
    for _ in range(3):
        stages.enter(step(places))
    assert stages.pulses_of(0) == 1
    assert stages.pulses["start_s"][0] == pytest.approx(DT - 1e-3, rel=1e-12) and stages.pulses["ahead"][0] == 0
    assert stages.pulses_of(1, 1) == 1  # and it is used up


def test_bits_hang_on_no_place_in_a_table() -> None:
    """Random piles, in tables of one size and of another: the same pulses to the bit."""
    rng = np.random.default_rng(5)
    bodies = [box_body((0.1, 0.08, 0.05), np.linspace(300, 9000, 9), body_id=i) for i in range(5)] + [wall_body()]
    small, large = Stages(bodies, pairs=16, rows=24), Stages(bodies, pairs=99, rows=200)
    large.pairs.free[:] = rng.permutation(99)
    count = 0
    for _ in range(80):
        rows = [
            row(
                a, b, load * rng.uniform(0.5, 1, 3), normal=(0, 0, 1), point_a=rng.uniform(-0.05, 0.05, 3), approach=0.3
            )
            for a in range(5)
            for b in (a + 1, 5)
            for load in (rng.uniform(0, 0.1, 2) if rng.random() < 0.3 else ())
        ]
        one = step(np.zeros((6, 3)).tolist(), Contacts.join(rows), gravity=(0, 0, -9.81))
        found, other = small.take(one), large.take(one)
        count += len(found[0])
        for name in found[0].dtype.names or ():
            assert found[0][name].tobytes() == other[0][name].tobytes()
        assert found[1].tobytes() == other[1].tobytes()
    assert count > 30
