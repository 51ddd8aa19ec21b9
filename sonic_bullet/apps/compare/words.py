"""Text of findings: one line each, in physics and with units."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from sonic_bullet.apps.compare.inputs.input_differences import InputDifference
from sonic_bullet.apps.compare.inputs.log_differences import LogDifference
from sonic_bullet.apps.compare.inputs.matched_logs import NO_NAME
from sonic_bullet.apps.compare.inputs.tree_difference import same
from sonic_bullet.apps.compare.sides import Side
from sonic_bullet.apps.compare.tolerance import sameness_words
from sonic_bullet.simulators.calls import Call, InputFile, ObjectId

if TYPE_CHECKING:
    from sonic_bullet.apps.compare.comparison_record import Comparison


def difference_words(a: Side, b: Side, one: InputDifference) -> tuple[str, str]:
    """Return the body, and a line: "steel ball: friction 0.5 → 0.45 (−10 %)"."""
    who = name_of(a, b, one.who, one.link) if one.who is not None else ""
    if isinstance(one.a, Call) or isinstance(one.b, Call):
        return who, f"{who}: is {'missing in' if one.b is None else 'only in'} B"
    head = f"{who}: " if who else ""
    if one.what == "turn":
        return who, f"{head}order of making {one.a} → {one.b}"
    if not one.later:
        return who, head + change_words(one.what, one.a, one.b)
    what = one.what.removeprefix("start ")
    if one.at_a is not None and one.at_b is not None and same(one.a, one.b):
        return who, f"{head}{what} in step {one.at_a} → {one.at_b}"
    return who, f"{head}{what}{change_words(one.what, one.a, one.b).removeprefix(one.what)}, set while the scene runs"


def logged_words(one: LogDifference) -> str:
    """Return the line of an input of two logs."""
    if one.what == "body":
        return f"{one.who}: is {'missing in' if one.b is None else 'only in'} B"
    return f"{f'{one.who}: ' if one.who else ''}{change_words(one.what, one.a, one.b)}"


def change_words(what: str, a: Any, b: Any) -> str:
    """Describe a change: "density 7850 → 7929 kg/m³ (+1.0 %)"."""
    quantity_units = {
        "mass": "kg",
        "start position": "m",
        "start velocity": "m/s",
        "start spin": "rad/s",
        "gravity": "m/s²",
        "force": "N",
        "torque": "N m",
        "largest force": "N",
        "joint position": "m",
        "time step": "s",
        "inertia": "kg m²",
        "density_kg_m3": "kg/m³",
        "stiffness_pa": "Pa",
        "roughness_m": "m",
        "sr": "Hz",
        "seconds": "s",
        "shape radius": "m",
        "shape halfExtents": "m",
        "shape height": "m",
        "to_hz": "Hz",
        "thickness_m": "m",
        "sound_speed_m_s": "m/s",
    }
    last = what.rsplit(maxsplit=1)[-1]
    plain_words = {
        "density_kg_m3": "density",
        "stiffness_pa": "stiffness",
        "roughness_m": "roughness",
        "sr": "sample rate",
        "seconds": "length",
        "sound_speed_m_s": "speed of sound",
        "to_hz": "modes up to",
        "count": "number of modes",
        "thickness_m": "wall",
        "fixed": "clamps",
        "seed": "seed of the surfaces",
        "since_step": "added in step",
        "until_step": "gone in step",
    }
    key = last if last in plain_words else what
    name, unit = plain_words.get(key, what), quantity_units.get(key, "")
    unit = f" {unit}" if unit else ""
    if a is None or b is None:
        return f"{name} {format_entry(a)} → {format_entry(b)}{unit}"
    one, other = _array(a), _array(b)
    if key == "microphones" or one is None or other is None or one.shape != other.shape:
        return f"{name} {format_entry(a)} → {format_entry(b)}{unit}" if key != "microphones" else _places(name, a, b)
    if key in ("stiffness_pa", "damping") or one.size > 4:
        ratio = other[one != 0] / one[one != 0]
        if len(ratio) and np.allclose(ratio, ratio[0], rtol=1e-9):
            return f"{name} × {ratio[0]:.4g} ({_percent(ratio[0])})"
        if key == "damping":
            return f"damping (α in 1/s, β in s) {format_entry(a)} → {format_entry(b)}"
        return f"{name} changed in {int((one != other).sum())} of {one.size} numbers"
    count_fields = ("seed", "since_step", "until_step")  # numbers without a relative change
    share = (
        f" ({_percent(float(other) / float(one))})" if one.ndim == 0 and float(one) and key not in count_fields else ""
    )
    if key in ("start position",):
        share = f" (moved by {_distance(other - one)})"
    return f"{name} {format_entry(a)} → {format_entry(b)}{unit}{share}"


def _places(name: str, a: Any, b: Any) -> str:
    """Describe how sensors moved."""
    if len(a) != len(b):
        return f"{name}: {len(a)} → {len(b)}"
    moved = []
    for number, (x, y) in enumerate(zip(a, b, strict=True), 1):
        p, q = getattr(x, "position_m", None), getattr(y, "position_m", None)
        if p is None or q is None:
            moved.append(f"{number}: {type(x).__name__} → {type(y).__name__}")
        elif not np.array_equal(p, q):
            moved.append(f"{number} moved by {_distance(q - p)}, from {_point(p)} to {_point(q)} m")
    return f"{name.rstrip('s')} {', '.join(moved)}"


def _distance(vector_m: Any) -> str:
    """Format the length of a vector (3,) in m, in mm below 1 cm and in cm below 1 m."""
    length_m = float(np.linalg.norm(vector_m))
    factor, unit = (1000, "mm") if length_m < 0.01 else (100, "cm") if length_m < 1 else (1, "m")
    return f"{length_m * factor:.3g} {unit}"


def _point(place_m: Any) -> str:
    return f"({', '.join(f'{x:.6g}' for x in place_m)})"


def name_of(a: Side, b: Side, who: ObjectId, link: int) -> str:
    """Name a body: its name, or its material and shape; a joint by the body it holds."""
    if who.kind == "constraint":
        made = next((call for side in (b, a) for call in side.calls if who in call.made), None)
        held = made.arguments.get("parentBodyUniqueId") if made is not None else None
        return f"joint of {name_of(a, b, held, -1)}" if isinstance(held, ObjectId) else f"joint {who.serial}"
    for side in (b, a):
        names = {one: name for (x, one), name in side.names.items() if x == who}
        if names:
            name = names.get(link, next(iter(names.values())))
            return f"{_made_of(side, who)} ({name})" if NO_NAME.match(name) and _made_of(side, who) else name
    made = next((call for side in (b, a) for call in side.calls if who in call.made), None)
    file = made.arguments.get("fileName") if made is not None else None
    if isinstance(file, InputFile):
        return file.path.rsplit("/", 1)[-1].split(".")[0]
    return next((x for x in (_made_of(side, who) for side in (b, a)) if x), f"{who.kind} {who.serial}")


def _made_of(side: Side, who: ObjectId) -> str:
    shapes = {2: "ball", 3: "box", 4: "cylinder", 5: "mesh", 6: "plane", 7: "capsule", 9: "heightfield"}
    shape = material = ""
    for call in side.calls:
        if who in call.made:
            value = call.arguments.get("baseCollisionShapeIndex")
            shape = shapes.get(int(value.get("shapeType", 0)), "body") if isinstance(value, dict) else "body"
        if call.name == "add" and call.who == who:
            material = call.arguments["material"].name
    return f"{material} {shape}".strip()


def format_entry(value: Any) -> str:
    """Format a value for a line."""
    if value is None:
        return "not set"
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, float):
        return "0" if value == 0 else f"{value:.6g}"
    if isinstance(value, (list, tuple)) and len(value) <= 4:
        return f"({', '.join(format_entry(one) for one in value)})"
    if isinstance(value, InputFile):
        return f"{value.path.rsplit('/', 1)[-1]} ({value.digest[:7]})"
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


def _percent(ratio: float) -> str:
    return f"{(ratio - 1) * 100:+.3g} %" if math.isfinite(ratio) else "from nothing"


def _array(value: Any) -> Any:
    try:
        made = np.asarray(value, float)
    except (TypeError, ValueError):
        return None
    return None if isinstance(value, bool) else made


def verdict(found: Comparison) -> str:
    """Summarise the comparison in one line."""
    rest = [one for one in found.differences if not one.cause]
    if found.same:
        tail = (
            "" if not rest else f"; {len(rest)} input{'s differ' if len(rest) > 1 else ' differs'} and change no sample"
        )
        return f"same: all samples are equal{tail}"
    head = f"{sameness_words(found.closeness)}: samples differ" if found.passed else "differs"
    if found.causes and found.exact:
        names = "; ".join(one.words for one in found.causes)
        return f"{f'{head}; ' if found.passed else ''}{names}: put back, the scene is A to the bit"
    if found.differences:
        names = "; ".join(one.words for one in found.differences[:3])
        return f"{head}; inputs that differ: {names}"
    return f"{head}; no input is known to differ"
