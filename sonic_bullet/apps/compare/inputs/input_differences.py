"""Inputs that differ between two runs, by their calls to the simulator and the listener.

    pairs of calls -> leaves that differ -> InputDifference: one quantity of one body, and all places where it is set

A quantity that a scene sets in two ways (a mass when a body is made, and later by changeDynamics) is one input. For a
body that both runs have, each argument that only one sets is an input; a body that only one run has is one input with
all its calls.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sonic_bullet.apps.compare.inputs.call_pairs import CallPair, find_differences, side_by_side
from sonic_bullet.apps.compare.inputs.substitution import HANDLES, Place
from sonic_bullet.apps.compare.inputs.tree_difference import MISSING, Path, leaves
from sonic_bullet.apps.compare.sides import Side
from sonic_bullet.simulators.calls import Call, ObjectId

ONE_QUANTITY = {
    "baseMass": "mass",
    "basePosition": "start position",
    "posObj": "start position",
    "baseOrientation": "start orientation",
    "ornObj": "start orientation",
    "linearVelocity": "start velocity",
    "angularVelocity": "start spin",
    "gravX": "gravity",
    "gravY": "gravity",
    "gravZ": "gravity",
    "timeStep": "time step",
    "fixedTimeStep": "time step",
    "numSubSteps": "sub-steps",
    "numSolverIterations": "solver iterations",
    "contactERP": "contact ERP",
    "defaultContactERP": "contact ERP",
    "lateralFriction": "friction",
    "spinningFriction": "spinning friction",
    "rollingFriction": "rolling friction",
    "linearDamping": "linear damping",
    "angularDamping": "angular damping",
    "localInertiaDiagonal": "inertia",
    "localInertiaDiagonalX": "inertia",
    "localInertiaDiagonalY": "inertia",
    "localInertiaDiagonalZ": "inertia",
    "sensors": "microphones",
    "shapes": "mesh",
    "forceObj": "force",
    "torqueObj": "torque",
    "maxForce": "largest force",
    "parentFramePosition": "joint position",
    "childFramePosition": "joint position in the other",
    "globalScaling": "scale",
    "alpha_per_s": "damping",
    "beta_s": "damping",
}
"""Quantity of an argument; several arguments may mean one."""


@dataclass(slots=True, eq=False)
class InputDifference:
    """An input that differs between two runs.

    Parameters
    ----------
    who
        The body; None: engine or listener.
    places
        Where to substitute it.
    later
        It is set after the first step.
    at_a, at_b
        Step of the call, where only one run makes it in that step.
    """

    who: ObjectId | None
    link: int
    what: str
    a: Any = None
    b: Any = None
    places: list[Place] = field(default_factory=list)
    option: str = ""
    later: bool = False
    at_a: int | None = None
    at_b: int | None = None


def asked_differences(a: Side, b: Side) -> tuple[list[CallPair], list[InputDifference]]:
    """Pair the calls of both runs; return the pairs and the inputs that differ, in the order of calls."""
    # Functions whose arguments can be substituted one by one; others are called whole or not at all
    by_argument = ("changeDynamics", "setPhysicsEngineParameter", "changeConstraint")
    pairs, match = side_by_side(a.calls, b.calls)
    lone = {one for call in a.calls for one in call.made} - set(match)
    lone |= {one for call in b.calls for one in call.made} - set(match.values())
    found: dict[Any, InputDifference] = {}
    for number, pair in enumerate(pairs):
        about = _whose(pair, lone)
        if about in lone:
            one = found.setdefault(about, InputDifference(about, -1, about.kind))
            one.places.append((number, None))
            one.places += [(number, path) for path in find_differences(pair.a, pair.b)]
            value = next((call for call in (pair.a, pair.b) if call is not None and about in call.made), None)
            if value is not None:
                one.a, one.b = (value, None) if pair.a is not None else (None, value)
            continue
        if (pair.a is None or pair.b is None) and name_of(pair) not in by_argument:
            _note_whole(found, pair, number)
            continue
        for path, (old, new) in find_differences(pair.a, pair.b).items():
            if path[0] not in HANDLES:
                _note(found, pair, number, path, old, new)
    return pairs, [*_orders(found), *_options(a, b)]


def _orders(found: Mapping[Any, InputDifference]) -> list[InputDifference]:
    """Merge two equal bodies, one in each run, to one body that is made in another order."""
    listed = list(found.values())
    for old in list(listed):
        new = next((x for x in listed if _is_same_body(old, x)), None)
        if new is not None:
            turns = old.a.made[0].serial + 1, new.b.made[0].serial + 1
            listed[listed.index(old)] = InputDifference(new.who, -1, "turn", *turns, [*old.places, *new.places])
            listed.remove(new)
    return listed


def _is_same_body(old: InputDifference, new: InputDifference) -> bool:
    one, other = old.a, new.b
    lone = isinstance(one, Call) and isinstance(other, Call) and old.b is None and new.a is None
    return lone and one.name == other.name and not find_differences(one, other)


def _whose(pair: CallPair, lone: set[ObjectId]) -> Any:
    """Return the body of a pair's calls, first of all one that only one run has."""
    for call in (pair.b, pair.a):
        if call is not None:
            known = [*call.made, *(value for _, value in leaves(call.arguments) if isinstance(value, ObjectId))]
            for one in known:
                if one in lone:
                    return one
    call = pair.b or pair.a
    assert call is not None
    return call.who or next(iter(call.made), None)


def name_of(pair: CallPair) -> str:
    """Return the function's name."""
    call = pair.b or pair.a
    return "" if call is None else call.name


def _note(found: dict[Any, InputDifference], pair: CallPair, number: int, path: Path, old: Any, new: Any) -> None:
    """Record a leaf that differs."""
    call = pair.b or pair.a
    assert call is not None
    what = quantity(call, path)
    if path[0] == "material" and pair.a is not None and pair.b is not None:
        names = pair.a.arguments["material"].name, pair.b.arguments["material"].name
        if names[0] != names[1]:  # another material is one input, whatever of it differs
            what, old, new = "material", *names
    if call.name == "setGravity" and pair.a is not None and pair.b is not None:
        old, new = (tuple(one.arguments.get(f"grav{x}", 0.0) for x in "XYZ") for one in (pair.a, pair.b))
    if what == "damping" and pair.a is not None and pair.b is not None:
        old, new = (damping(one.arguments["material"]) for one in (pair.a, pair.b))
    one = _entry(found, call, what)
    one.a, one.b = _value(old), _value(new)  # the last call holds
    one.places.append((number, path))


def _note_whole(found: dict[Any, InputDifference], pair: CallPair, number: int) -> None:
    """Record a call that only one run makes, and that is made whole or not at all."""
    call = pair.b or pair.a
    assert call is not None
    inner = {path: value for path, value in leaves(call.arguments) if path[0] not in HANDLES}
    what = "sounding" if call.name == "add" else quantity(call, next(iter(inner))) if inner else call.name
    one = _entry(found, call, what)
    value = tuple(inner.values()) if len(inner) > 1 else next(iter(inner.values()), True)
    value = call.arguments["material"].name if call.name == "add" else value
    if pair.b is None:
        one.a, one.at_a = value, call.step
    else:
        one.b, one.at_b = value, call.step
    one.places.append((number, None))


def _entry(found: dict[Any, InputDifference], call: Call, what: str) -> InputDifference:
    # Functions that act anew each step: all their calls are one input; others set a lasting value
    drives = ("apply", "setJointMotor")
    who, link, later = call.who or next(iter(call.made), None), _link(call), call.step > 0
    return found.setdefault(
        (who, link, what, later and not call.name.startswith(drives)), InputDifference(who, link, what, later=later)
    )


def quantity(call: Call, path: Path) -> str:
    """Name the quantity of a call's leaf."""
    name = path[-1]
    if path[0] == "baseCollisionShapeIndex" or path[0] == "linkCollisionShapeIndices":
        return "mesh" if name in ("fileName", "vertices", "indices") else f"shape {name}"
    if call.name == "resetBasePositionAndOrientation" or name in ONE_QUANTITY:
        return ONE_QUANTITY.get(name, name)
    return " ".join(path) if call.name in ("add", "attach") else name


def damping(material: Any) -> tuple[float, float] | None:
    """Return Rayleigh's α and β, which are one input."""
    return None if material is None else (material.alpha_per_s, material.beta_s)


def _link(call: Call) -> int:
    link = call.arguments.get("linkIndex", call.arguments.get("jointIndex", -1))
    links = call.arguments.get("links", ())
    return int(links[0]) if len(links) == 1 else int(link)


def _value(value: Any) -> Any:
    return None if value is MISSING else value


def _options(a: Side, b: Side) -> list[InputDifference]:
    """List differing options of rendering."""
    found = []
    if a.scene is None or b.scene is None or a.log is None or b.log is None:
        return []
    options: Mapping[str, tuple[Any, Any]] = {
        "sr": (a.sr, b.sr),
        "residual": (a.log.residual, b.log.residual),
        "seconds": (a.log.duration_s, b.log.duration_s),
    }
    step_s = max(float(log.steps[0].dt_s) if len(log.steps) else 0.0 for log in (a.log, b.log))
    for name, (old, new) in options.items():
        if abs(float(old) - float(new)) > (1.5 * step_s if name == "seconds" else 0):
            found.append(InputDifference(None, -1, name, old, new, option=name))
    return found
