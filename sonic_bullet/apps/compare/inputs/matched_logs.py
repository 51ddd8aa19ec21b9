"""Match the bodies of two contact logs, and find the first step whose contacts differ.

names -> match; bodies without a name -> by their properties, in order       rows with A's indices -> first difference
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from sonic_bullet.apps.compare.inputs.call_pairs import GAP, align_sequences
from sonic_bullet.apps.compare.inputs.tree_difference import unlike_fraction
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Body
from sonic_bullet.records.errors import CompareError

NO_NAME = re.compile(r"^(body \d+|link\d+|baseLink)( #?\d+)?$")
"""Names that a simulator gives to bodies without one."""


@dataclass(frozen=True, slots=True)
class FirstDifference:
    """First step whose contacts differ, None: none does; bodies: names of those whose contacts differ there."""

    step: int | None
    at_s: float | None
    bodies: frozenset[str] = frozenset()


def body_inputs(body: Body) -> dict[str, Any]:
    """Return all inputs of a body, by field."""
    # fields of a body that identify it and its lifetime; its modes follow from the rest
    no_input = ("body_id", "link", "epoch", "name", "since_step", "until_step", "model")
    return {one.name: getattr(body, one.name) for one in fields(body) if one.name not in no_input}


def match_bodies(a: ContactLog, b: ContactLog) -> list[tuple[int | None, int | None]]:
    """Match the bodies of both logs by index.

    Raises
    ------
    CompareError
        Two living bodies have one name, or no body is in both.
    """
    one, other = _latest(a), _latest(b)
    pairs: list[tuple[int | None, int | None]] = [
        (one[name], other[name]) for name in one if name in other and not NO_NAME.match(name)
    ]
    rest = [
        [(index, body_inputs(log.bodies[index])) for name, index in known.items() if NO_NAME.match(name)]
        for log, known in ((a, one), (b, other))
    ]
    found = align_sequences(rest[0], rest[1], lambda x, y: unlike_fraction(x[1], y[1], absent=None), lambda x: GAP)
    pairs += [(None if x is None else x[0], None if y is None else y[0]) for x, y in found]
    pairs += [(index, None) for name, index in one.items() if name not in other and not NO_NAME.match(name)]
    pairs += [(None, index) for name, index in other.items() if name not in one and not NO_NAME.match(name)]
    if (one or other) and not any(x is not None and y is not None for x, y in pairs):
        raise CompareError(
            "no body of the one is in the other: they are not two versions of one scene", "give two that are"
        )
    return pairs


def _latest(log: ContactLog) -> dict[str, int]:
    """Return the last record of each name."""
    found: dict[str, int] = {}
    for index, body in enumerate(log.bodies):
        if body.name in found:
            before = log.bodies[found[body.name]]
            if (before.body_id, before.link) != (body.body_id, body.link) and before.until_step < 0:
                raise CompareError(
                    f"two bodies are called '{body.name[:60]}'", "give each its own name: listener.add(…, name=…)"
                )
        found[body.name] = index
    return found


def first_difference(a: ContactLog, b: ContactLog, pairs: list[tuple[int | None, int | None]]) -> FirstDifference:
    """Find the first step whose contacts or step length differ, to the bit, bodies counted as in ``a``."""
    index = np.full(len(b.bodies) + 1, -1)
    for x, y in pairs:
        if x is not None and y is not None:
            for number, body in enumerate(b.bodies):  # earlier records of the same link too
                if (body.name, body.link) == (b.bodies[y].name, b.bodies[y].link):
                    index[number] = x
    same_of = {i: next((j for j, y in enumerate(a.bodies) if y.name == x.name), i) for i, x in enumerate(a.bodies)}
    as_a = np.array([same_of[i] for i in range(len(a.bodies))] + [-1])
    time_s = 0.0
    for number, (one, other) in enumerate(zip(a.steps, b.steps, strict=False)):
        rows = [_rows(one.contacts.row, as_a), _rows(other.contacts.row, as_a[index])]
        if one.dt_s != other.dt_s or rows[0].tobytes() != rows[1].tobytes():
            who = _who_differs(rows[0], rows[1])
            names = frozenset(a.bodies[i].name for i in who if 0 <= i < len(a.bodies))
            return FirstDifference(number, time_s, names)
        time_s += one.dt_s
    if len(a.steps) != len(b.steps):
        return FirstDifference(min(len(a.steps), len(b.steps)), time_s)
    return FirstDifference(None, None)


def _rows(row: Array, index: Array) -> Array:
    made = row.copy()
    made["a"], made["b"] = index[row["a"]], index[row["b"]]
    return made


def _who_differs(one: Array, other: Array) -> set[int]:
    kept = [{row.tobytes() for row in rows} for rows in (one, other)]
    return set(_bodies(one, kept[1])) | set(_bodies(other, kept[0]))


def _bodies(rows: Array, known: set[bytes]) -> Iterator[int]:
    for row in rows:
        if row.tobytes() not in known:
            yield int(row["a"])
            yield int(row["b"])


def require_kin(a: ContactLog, b: ContactLog, pairs: list[tuple[int | None, int | None]]) -> None:
    """Raise CompareError where under half of the bodies have a partner of like name, material, size, mass or place."""
    known = [(a.bodies[i], b.bodies[j]) for i, j in pairs if i is not None and j is not None]
    like = sum(_kin(x, y) for x, y in known)
    most = max(len(_latest(a)), len(_latest(b)))
    if most and like < most / 2:
        raise CompareError(
            f"these are two scenes altogether: {like} of {most} bodies are in both", "give two versions of one scene"
        )


def _kin(a: Body, b: Body) -> bool:
    if a.name == b.name and not NO_NAME.match(a.name):
        return True
    both = [(x.material and x.material.name, x.volume_m3, x.mass_kg, float(np.trace(x.inertia_kg_m2))) for x in (a, b)]
    return any(bool(x) and x == y for x, y in zip(*both, strict=True)) or (not a.mass_kg and not b.mass_kg)
