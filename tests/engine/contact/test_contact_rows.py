"""Rows as both bodies see them, and histories of load: against numpy, in any order, from either side."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from sonic_bullet._engine import CONTACT_PATCH, HISTORY, SPAN, enter_loads, orient
from sonic_bullet.engine.runtime.synthesis_state import TouchingPairs
from sonic_bullet.engine.runtime.tables import PAIR, ROW
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Contacts
from tests.made.stages import packed

DT = 1 / 240


def some(rng: np.random.Generator, count: int, bodies: int = 7) -> Contacts:
    a = rng.integers(0, bodies, count)
    b = (a + rng.integers(1, bodies, count)) % bodies
    point, other, normal, impulse, slip = rng.normal(size=(5, count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Contacts(
        a,
        b,
        point_a_m=point,
        point_b_m=other,
        normal=normal,
        impulse_n_s=impulse,
        slip_m_s=slip,
        sweep_m_s=rng.random((count, 2)),
        approach_m_s=rng.normal(size=count),
        gap_m=rng.normal(size=count),
    )


def swapped(c: Contacts) -> Contacts:
    """The same contacts, told from b's side."""
    return Contacts(
        c.b,
        c.a,
        point_a_m=c.point_b_m,
        point_b_m=c.point_a_m,
        normal=-c.normal,
        impulse_n_s=-c.impulse_n_s,
        slip_m_s=-c.slip_m_s,
        sweep_m_s=c.sweep_m_s[:, ::-1],
        approach_m_s=c.approach_m_s,
        gap_m=c.gap_m,
    )


def oriented(contacts: Contacts, quaternion: Array) -> Array:
    rows = np.zeros(len(contacts), ROW)
    orient(packed(contacts), quaternion, rows)
    return rows


def group(pairs: Array, active: Array, counts: Array, free: Array) -> TouchingPairs:
    return TouchingPairs(pairs, active, counts, free, np.zeros((0, 2, 0)), np.zeros(0, CONTACT_PATCH))


def test_rows_are_sorted_by_pair_and_within_it_as_they_came() -> None:
    rng = np.random.default_rng(0)
    turned = rng.normal(size=(7, 4))
    for count in (0, 1, 2, 3, 17, 64, 301):
        contacts = some(rng, count)
        low, high = np.minimum(contacts.a, contacts.b), np.maximum(contacts.a, contacts.b)
        key = (low.astype(np.int64) << 32) | high
        order = np.argsort(key, kind="stable")
        rows = oriented(contacts, turned)
        assert (rows["key"] == key[order]).all()
        assert (rows["gap_m"] == contacts.gap_m[order]).all()
        assert (rows["body"] == np.stack([low, high], axis=1)[order]).all()


def test_rows_are_the_same_from_either_side() -> None:
    rng = np.random.default_rng(1)
    contacts, turned = some(rng, 80), rng.normal(size=(7, 4))
    one, other = oriented(contacts, turned), oriented(swapped(contacts), turned)
    for name in ROW.names or ():
        assert (one[name] == other[name]).all(), name


def test_either_body_sees_its_own_side() -> None:
    """Impulses and normals turned back, levers forth: Rᵀj, Rᵀn, R p."""
    rng = np.random.default_rng(2)
    contacts, turned = some(rng, 60), rng.normal(size=(7, 4))
    rows = oriented(contacts, turned)
    turn = Rotation.from_quat(turned).as_matrix()[rows["body"]]
    sign = np.array([1.0, -1.0])[:, None]
    back = np.einsum("ksji,ksj->ksi", turn, sign * rows["impulse_n_s"][:, None])
    assert np.abs(rows["local_impulse_n_s"] - back).max() < 1e-14
    back = np.einsum("ksji,ksj->ksi", turn, -sign * rows["normal"][:, None])
    assert np.abs(rows["outward"] - back).max() < 1e-14
    assert np.abs(rows["arm_m"] - np.einsum("ksij,ksj->ksi", turn, rows["point_m"])).max() < 1e-14
    assert np.abs(rows["load_n_s"] - np.maximum((rows["impulse_n_s"] * rows["normal"]).sum(axis=1), 0)).max() < 1e-14


def test_histories_are_the_loads_of_the_last_steps() -> None:
    """Pairs come, stay, go and come again; places are given back, and nothing hangs on which they are."""
    rng = np.random.default_rng(3)
    turned, room = rng.normal(size=(12, 4)), 80
    tables = [(np.zeros(room, PAIR), np.zeros(room, np.int64), np.array([0, room]), np.arange(room))]
    tables.append(
        (
            np.full(room, -1, np.int8).repeat(PAIR.itemsize).view(PAIR),
            *(x.copy() for x in tables[0][1:3]),
            np.arange(room)[::-1].copy(),
        )
    )
    loads: list[dict[int, float]] = []
    for step in range(60):
        rows = oriented(some(rng, int(rng.integers(0, 9)) if step % 20 < 10 else 0, 12), turned)
        loads.append({})
        for key, load in zip(rows["key"], rows["load_n_s"], strict=True):
            loads[-1][int(key)] = loads[-1].get(int(key), 0.0) + float(load)
        known = sorted({key for last in loads[-HISTORY:] for key, load in last.items() if load > 0})
        for pairs, active, counts, free in tables:
            enter_loads(rows, 0, len(rows), DT, group(pairs, active, counts, free))
            here = pairs[active[: counts[0]]]
            assert here["key"].tolist() == known
            expected = [[last.get(key, 0.0) / DT for last in ([{}] * HISTORY + loads)[-HISTORY:]] for key in known]
            assert (here["force_n"] == np.array(expected).reshape(-1, HISTORY)).all()
            assert not here["struck_n"].any() and not here["rubs"].any()
            assert (here["body"] == np.stack([here["key"] >> 32, here["key"] & 0xFFFFFFFF], axis=1)).all()
            places = np.concatenate([active[: counts[0]], free[: counts[1]]])
            assert np.array_equal(np.sort(places), np.arange(room))
            assert (here["support_n"] <= here["force_n"][:, SPAN - 1 : SPAN + 1]).all()


def test_a_pair_with_a_voice_stays() -> None:
    pairs, active, counts, free = np.zeros(4, PAIR), np.zeros(4, np.int64), np.array([0, 4]), np.arange(4)
    rows = np.zeros(1, ROW)
    rows["key"], rows["load_n_s"] = 5, 1.0
    enter_loads(rows, 0, 1, DT, group(pairs, active, counts, free))
    pairs["rubs"][active[0]] = 1
    for _ in range(2 * HISTORY):
        enter_loads(rows, 0, 0, DT, group(pairs, active, counts, free))
    assert counts.tolist() == [1, 3] and not pairs["force_n"].any()
    pairs["rubs"] = 0
    enter_loads(rows, 0, 0, DT, group(pairs, active, counts, free))
    assert counts.tolist() == [0, 4]
