"""Convert what a user may give for a sensor, a material or a shape to its record."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.effects.presets_of_effects import check_effects
from sonic_bullet.records import Material, Microphone, Sensor, Shape
from sonic_bullet.records.coerce import as_items, as_kinds, as_path, as_rows, as_text, quote
from sonic_bullet.records.errors import MaterialError, MeshError, SceneError
from sonic_bullet.records.sensors import MicrophoneLike


def as_sensors(microphone: MicrophoneLike, name: str = "microphone") -> tuple[Sensor, ...]:
    """Return the sensors given as a point, several points, a sensor or several.

    Raises
    ------
    RecordError
        A point is not three finite numbers.
    """
    if isinstance(microphone, Sensor):
        return (microphone,)
    remedy = "give x, y, z in m, several such points, or sensors"
    items = as_items(microphone, name, remedy)
    if all(isinstance(item, Sensor) for item in items):
        return items
    points = items if any(isinstance(item, Iterable) for item in items) else (items,)
    return tuple(Microphone(np.array(point)) for point in as_rows(points, name, 3, remedy))


def as_name(name: object) -> str:
    """Return a body's name, a text of one line; raise SceneError for anything else."""
    remedy = "give a text of one line"
    if not as_text(name, "name", remedy, error=SceneError).isprintable() or not str(name).strip():
        raise SceneError(f"name is {quote(name)}", remedy)
    return str(name)


def as_material(material: str | Path | Material) -> Material:
    """Return the material itself, or the preset of that name or path.

    Raises
    ------
    MaterialError
        It has no damping, so that it would never decay, or an effect that no scene plays.
    """
    from sonic_bullet.files.presets import load_material

    remedy = "give a name ('sonic-bullet materials' lists them), a preset file or a Material"
    made = (
        material
        if isinstance(material, Material)
        else load_material(as_path(material, "material", remedy, error=MaterialError))
    )
    if made.alpha_per_s is None:
        raise MaterialError(f"material '{made.name}' states no damping", "give alpha_per_s and beta_s")
    check_effects(made)
    return made


def as_shapes(mesh: str | Path | Shape | Sequence[Shape]) -> tuple[Shape, ...]:
    """Return a mesh file, a shape or several as shapes in the body frame; raises MeshError and FileError."""
    from sonic_bullet.modal import read_mesh

    if isinstance(mesh, Shape):
        return (mesh,)
    if isinstance(mesh, (str, Path)):
        return (read_mesh(as_path(mesh, "mesh", "give a mesh file in metres")),)
    return as_kinds(mesh, Shape, "mesh", "give a mesh file in metres, a Shape or several", error=MeshError)


@lru_cache(maxsize=64)
def keywords(call: Callable[..., Any]) -> tuple[str, ...]:
    """List a function's keyword-only arguments; once, since a log asks with each step."""
    return tuple(one.name for one in inspect.signature(call).parameters.values() if one.kind is one.KEYWORD_ONLY)
