"""Inputs that differ between two contact logs, from all fields of their records.

    header, bodies, first poses -> leaves that differ -> one input a quantity -> where contacts are equal: exchange

An inertia that changed with the mass, a volume with the shape, and modes with the material are not inputs of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from sonic_bullet.apps.compare.inputs.input_differences import ONE_QUANTITY, damping
from sonic_bullet.apps.compare.inputs.matched_logs import body_inputs
from sonic_bullet.apps.compare.inputs.tree_difference import Path, differing_leaves, leaves, same, with_leaves
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Body

Exchange = Callable[[ContactLog, ContactLog], ContactLog]


@dataclass(slots=True, eq=False)
class LogDifference:
    """An input that differs between two logs.

    Parameters
    ----------
    exchange
        (a, b) -> b's log with a's input; None: it cannot be exchanged.
    acts
        On contacts, or on "sound" alone.
    """

    who: str
    what: str
    a: Any
    b: Any
    exchange: Exchange | None = None
    acts: str = "contacts"
    note: str = ""


def logged_differences(a: ContactLog, b: ContactLog, pairs: list[tuple[int | None, int | None]]) -> list[LogDifference]:
    """List the inputs that differ: of the engine, each body, sensors, rendering, versions."""
    # Fields of a log that are not settings of its sound
    of_run = ("bodies", "steps", "events", "changes", "untouched", "versions", "engine")
    found = [*_engine(a, b)]
    for i, j in pairs:
        if i is None or j is None:
            found += _lone(a, b, i, j)
        else:
            found += _body(a, b, i, j)
    found += _changes(a, b, pairs)
    settings = [{one.name: getattr(log, one.name) for one in fields(log) if one.name not in of_run} for log in (a, b)]
    for path, values in differing_leaves(settings[0], settings[1], absent=None).items():
        found.append(LogDifference("", ONE_QUANTITY.get(path[-1], path[-1]), *values, _exchange_setting(path), "sound"))
    step_s = max(float(a.steps[0].dt_s), float(b.steps[0].dt_s))
    if abs(a.duration_s - b.duration_s) > 1.5 * step_s:
        found.append(LogDifference("", "seconds", a.duration_s, b.duration_s))
    for name in {**a.versions, **b.versions}:
        if a.versions.get(name) != b.versions.get(name):
            note = "another version cannot be put back: install it"
            found.append(LogDifference(name, "version", a.versions.get(name), b.versions.get(name), note=note))
    return found


def _engine(a: ContactLog, b: ContactLog) -> list[LogDifference]:
    found = []
    names = [name for name in {**a.engine, **b.engine} if a.engine.get(name) != b.engine.get(name)]
    one, other = a.steps[0], b.steps[0]
    values: dict[str, Any] = {ONE_QUANTITY.get(name, name): (a.engine.get(name), b.engine.get(name)) for name in names}
    if one.dt_s != other.dt_s:
        values["time step"] = (one.dt_s, other.dt_s)
    if not same(one.gravity_m_s2, other.gravity_m_s2):
        values = {name: x for name, x in values.items() if not name.startswith("gravity")}
        values["gravity"] = (tuple(one.gravity_m_s2.tolist()), tuple(other.gravity_m_s2.tolist()))
    for what, (old, new) in values.items():
        found.append(LogDifference("", what, old, new))
    return found


def _lone(a: ContactLog, b: ContactLog, i: int | None, j: int | None) -> list[LogDifference]:
    """Report a body of one log alone; a silent body that touched nothing in the other is there too."""
    body, other = (a.bodies[i], b) if i is not None else (b.bodies[j], a)  # type: ignore[index]
    if body.material is None and body.body_id in other.untouched:
        return []
    return [LogDifference(body.name, "body", body if i is not None else None, body if j is not None else None)]


def _body(a: ContactLog, b: ContactLog, i: int, j: int) -> list[LogDifference]:
    # Fields of a material on which modes depend
    of_modes = ("density_kg_m3", "stiffness_pa", "alpha_per_s", "beta_s", "effects", "includes_radiation", "name")
    one, other = a.bodies[i], b.bodies[j]
    changed = differing_leaves(body_inputs(one), body_inputs(other), absent=None)
    found: dict[str, LogDifference] = {}
    modes_differ = not same_model(one, other)
    for path in changed:
        (what, acts), value = _quantity(path), changed[path]
        if path[0] == "material" and one.material and other.material and one.material.name != other.material.name:
            what, value = "material", (one.material.name, other.material.name)
        if what == "damping":
            value = damping(one.material), damping(other.material)
        if path[0] == "material" and (one.material is None or other.material is None):
            what, value = "sounding", (one.material and one.material.name, other.material and other.material.name)
        if what not in found:
            exchange = _of_modes(i, j) if path[0] in ("material", "options") and modes_differ else _leaf(path, i, j)
            if path[0] == "material" and path[-1] not in of_modes and what not in ("material", "sounding"):
                exchange = _leaf(path, i, j)
            found[what] = LogDifference(one.name, what, *value, exchange, acts)
    if modes_differ and not any(path[0] in ("material", "options") and path[-1] != "source" for path in changed):
        found.setdefault("mesh", _mesh(one, other, i, j))
    _without_what_follows(found, one, other)
    for what in ("since_step", "until_step"):  # in steps: not comparable where their length differs
        old_step, new_step = getattr(one, what), getattr(other, what)
        if old_step != new_step and a.steps[0].dt_s == b.steps[0].dt_s:
            found[what] = LogDifference(one.name, what, old_step, new_step)
    return [*found.values(), *_start(a, b, i, j, bool(found) or bool(_engine(a, b)))]


def _quantity(path: Path) -> tuple[str, str]:
    """Name the quantity of a leaf, and whether it acts on contacts or on sound alone."""
    one_body = {
        ("mass_kg",): "mass",
        ("dynamics", "mass"): "mass",
        ("inertia_kg_m2",): "inertia",
        ("volume_m3",): "shape",
        ("curvature_per_m",): "shape",
    }
    if path in one_body:
        return one_body[path], "contacts"
    acts = "sound" if path[0] in ("material", "options", "mounting") else "contacts"
    return ONE_QUANTITY.get(path[-1], path[-1]), acts


def _without_what_follows(found: dict[str, LogDifference], one: Body, other: Body) -> None:
    """Remove quantities that follow from others."""
    if "mass" in found and "inertia" in found and one.mass_kg and other.mass_kg:
        grown = one.inertia_kg_m2 * (other.mass_kg / one.mass_kg)
        if np.allclose(grown, other.inertia_kg_m2, rtol=1e-6, atol=1e-18):
            found.pop("inertia")
    # relative tolerance of a volume: two meshes of one shape differ by less at this project's element sizes
    shape_share = 2e-3
    if "shape" in found and _is_unsolved(one) != _is_unsolved(
        other
    ):  # one volume is of elements, the other of the surface
        alike = abs(one.volume_m3 - other.volume_m3) <= shape_share * max(one.volume_m3, other.volume_m3)
        if alike and np.array_equal(one.curvature_per_m, other.curvature_per_m, equal_nan=True):
            found.pop("shape")
    if "mesh" in found:
        collides_alike = "inertia" not in found and one.mass_kg > 0  # then the surface that sounds alone is another
        large = abs(one.volume_m3 - other.volume_m3) > shape_share * max(one.volume_m3, other.volume_m3)
        found.pop("mesh" if large and "shape" in found and not collides_alike else "shape", None)
    if "shape" in found:
        found.pop("inertia", None)
    if any(name in found for name in ("thickness_m", "fixed", "material")):
        found.pop("shape", None)


def _mesh(one: Body, other: Body, i: int, j: int) -> LogDifference:
    count = [0 if body.model is None else len(body.model.vertex_m) for body in (one, other)]
    words = [f"{x} vertices" for x in count]
    if count[0] == count[1]:
        words = ["of A", "of B"]
    return LogDifference(one.name, "mesh", words[0], words[1], _of_modes(i, j), "sound")


def same_model(one: Body, other: Body) -> bool:
    """Tell whether two bodies have the same modes on the same surface, as far as both were solved."""
    if _is_unsolved(one) or _is_unsolved(other):
        return True
    return (one.model is None) == (other.model is None) and (one.model is None or same(one.model, other.model))


def _is_unsolved(body: Body) -> bool:
    return body.model is not None and body.model.unsolved


def _start(a: ContactLog, b: ContactLog, i: int, j: int, explained: bool) -> list[LogDifference]:
    """Compare start and initial speed of a body by its first poses and contacts.

    explained: another difference explains a different motion.
    """
    as_poses_tell = "as first poses tell: a force or a joint, which a log does not hold, would look the same"
    one, name = a.bodies[i], a.bodies[i].name
    first = [_pose(log, index, 0) for log, index in ((a, i), (b, j))]
    if first[0] is None or first[1] is None:
        return []
    found = []
    for place, what in ((0, "start position"), (1, "start orientation")):
        if not same(first[0][place], first[1][place]):
            old, new = (tuple(np.round(pose[place], 9).tolist()) for pose in first if pose is not None)
            found.append(LogDifference(name, what, old, new))
    if not found and not explained:
        if one.mass_kg and not same(_speeds(a, i), _speeds(b, j)):
            return [LogDifference(name, "start velocity", _speeds(a, i), _speeds(b, j))]
        second = [_pose(log, index, 1) for log, index in ((a, i), (b, j))]
        free = not any(index in {*log.steps[0].contacts.a, *log.steps[0].contacts.b} for log, index in ((a, i), (b, j)))
        alike = same(a.steps[0].gravity_m_s2, b.steps[0].gravity_m_s2)
        if second[0] is not None and second[1] is not None and free and alike:
            speed = [(s[0] - f[0]) / a.steps[0].dt_s for s, f in zip(second, first, strict=True) if s and f]
            if not np.allclose(speed[0], speed[1], rtol=1e-9, atol=1e-9):
                old, new = (tuple(np.round(x, 6).tolist()) for x in speed)
                found.append(LogDifference(name, "start velocity", old, new, note=as_poses_tell))
            elif not same(second[0][1], second[1][1]):
                found.append(LogDifference(name, "start spin", "of A", "of B", note=as_poses_tell))
    return found


def _speeds(log: ContactLog, index: int) -> tuple[float, ...]:
    """Return the slip of a body's contacts before the first step, m/s: its initial velocity in contact."""
    rows = log.steps[0].contacts.row
    mine = rows[(rows["a"] == index) | (rows["b"] == index)]
    return tuple(np.round(mine["slip_m_s"], 6)[:1].ravel().tolist())


def _pose(log: ContactLog, index: int, step: int) -> tuple[Array, Array] | None:
    if len(log.steps) <= step:
        return None
    one = log.steps[step]
    row = np.flatnonzero(one.body == index)
    return (one.position_m[row[0]], one.quaternion_xyzw[row[0]]) if len(row) else None


def _changes(a: ContactLog, b: ContactLog, pairs: list[tuple[int | None, int | None]]) -> list[LogDifference]:
    """List changes made after the first step that differ."""
    names = {j: a.bodies[i].name for i, j in pairs if i is not None and j is not None}
    listed: list[dict[tuple[str, str], list[Any]]] = []
    for log in (a, b):
        mine: dict[tuple[str, str], list[Any]] = {}
        for change in log.changes:
            for what, value in change.values.items():
                who = "" if change.body is None else log.bodies[change.body].name
                if log is b and change.body is not None:
                    who = names.get(change.body, who)
                mine.setdefault((who, ONE_QUANTITY.get(what, what)), []).append((change.step, value))
        listed.append(mine)
    return [
        LogDifference(who, f"{what} under way", str(listed[0].get((who, what))), str(listed[1].get((who, what))))
        for who, what in {**listed[0], **listed[1]}
        if listed[0].get((who, what)) != listed[1].get((who, what)) and a.steps[0].dt_s == b.steps[0].dt_s
    ]


def _exchange_setting(path: Path) -> Exchange:
    """Return the exchange of a setting, or of a part of it."""

    def exchange(a: ContactLog, b: ContactLog) -> ContactLog:
        made: ContactLog = with_leaves(b, {path: dict(leaves(getattr(a, path[0]), path[:1])).get(path)})
        return made

    return exchange


def _leaf(path: Path, i: int, j: int) -> Exchange:
    def exchange(a: ContactLog, b: ContactLog) -> ContactLog:
        value = dict(leaves(body_inputs(a.bodies[i]))).get(path)
        return _with_body(b, j, with_leaves(b.bodies[j], {path: value}))

    return exchange


def _of_modes(i: int, j: int) -> Exchange:
    """Return the exchange of a body's material with its modes."""

    def exchange(a: ContactLog, b: ContactLog) -> ContactLog:
        one = a.bodies[i]
        given: dict[str, Any] = {
            "material": one.material,
            "model": one.model,
            "options": one.options,
            "volume_m3": one.volume_m3,
        }
        return _with_body(b, j, replace(b.bodies[j], **given))

    return exchange


def _with_body(log: ContactLog, index: int, body: Body) -> ContactLog:
    bodies = list(log.bodies)
    bodies[index] = body
    return replace(log, bodies=tuple(bodies))
