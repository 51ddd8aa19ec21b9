"""Keyframes in plain files (docs/reference/animation.md), and tables of materials.

NAME.json                      header with poses in it -> Export
NAME.npz    header: its JSON as bytes; position (t, b, 3), quaternion_xyzw (t, b, 4) -> Export
TABLE.json  [{"name": "cup*", "material": "porcelain", …}, …] -> Rule ...
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from sonic_bullet.apps.soundtrack.score.export import Export, ExportedObject, Rule
from sonic_bullet.files.meshes import read_surfaces
from sonic_bullet.files.storage.container import read_container
from sonic_bullet.files.storage.json_records import read_record, read_text
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.files.storage.typed_json import decode_json
from sonic_bullet.options.film import fraction_of
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import AnimationError

Positive = Annotated[float, msgspec.Meta(gt=0)]
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


class _Said(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    name: str
    material: str | None = None
    restitution: Annotated[float, msgspec.Meta(ge=0, le=1)] | None = None
    friction: Annotated[float, msgspec.Meta(ge=0)] | None = None
    mass_kg: Annotated[float, msgspec.Meta(ge=0)] | None = None
    driven: bool | None = None

    def rule(self) -> Rule:
        return Rule(self.name, self.material, self.restitution, self.friction, self.mass_kg, self.driven)


class _Mesh(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    vertices: list[Three]
    faces: list[tuple[int, int, int]]


class _Object(_Said, frozen=True, forbid_unknown_fields=True, kw_only=True):
    mesh: str | _Mesh | None = None
    sphere_m: Positive | None = None
    box_m: tuple[Positive, Positive, Positive] | None = None
    cylinder_m: tuple[Positive, Positive] | None = None
    inertia_kg_m2: tuple[Positive, Positive, Positive] | None = None
    position: list[Three] | None = None
    quaternion_xyzw: list[Four] | None = None


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    format: str
    fps: Positive | str
    bodies: list[_Object]
    unit_m: Positive = 1.0
    up: Literal["y", "z"] = "z"
    gravity_m_s2: Three | None = None


def read_keyframes(path: str | os.PathLike[str], fps: float | None = None, scale: float = 1.0) -> Export:
    """Read the export that a .json or .npz of keyframes holds.

    fps: in place of its own; scale: of lengths, besides its unit. Raises FileError, AnimationError.
    """
    remedy = "see docs/reference/animation.md, or export it again"
    place = Path(path)
    animation_format = "sonic-bullet-animation/1"
    with reading_file(path, "animation", AnimationError, remedy):
        if place.suffix.lower() == ".npz":
            made, arrays = read_container(place, _File, animation_format, "animation")
            many = len(made.bodies)
            position, turn = (_numbers(arrays, name, many, n) for name, n in (("position", 3), ("quaternion_xyzw", 4)))
            poses = [(position[:, i], turn[:, i]) for i in range(many)]
        else:
            made = read_record(
                path, _File, "animation", AnimationError, remedy, version=animation_format, most_bytes=1 << 30
            )
            poses = [_poses(one) for one in made.bodies]
        frames = max((len(p) for p, _ in poses), default=0)
        unit, up = made.unit_m * scale, made.up
        objects = tuple(
            _object(one, *_whole(one.name, *pose, frames), place.parent, unit, up)
            for one, pose in zip(made.bodies, poses, strict=True)
        )
        gravity = np.array([0.0, 0.0, -9.81])
        if made.gravity_m_s2 is not None:
            gravity = upright(np.array(made.gravity_m_s2), up)
        return Export(fps if fps is not None else _rate(made.fps), objects, gravity)


def _numbers(arrays: Mapping[str, Array], name: str, bodies: int, width: int) -> Array:
    """Check an array (frames, bodies, width) of floats of any precision."""
    found = arrays.get(name, np.zeros(0))
    if found.ndim != 3 or found.shape[1:] != (bodies, width) or found.dtype.kind != "f":
        raise AnimationError(f"{name} is {quote(found)}", f"give floating-point numbers (frames, {bodies}, {width})")
    return np.asarray(found, float)


def _rate(said: float | str) -> float:
    try:
        return float(fraction_of(said) if isinstance(said, str) else said)
    except (ValueError, ZeroDivisionError):
        raise AnimationError(f"fps is {quote(said)}", 'give a number, or "30000/1001"') from None


def _poses(one: _Object) -> tuple[Array, Array]:
    return np.array(one.position or [(0.0, 0.0, 0.0)]), np.array(one.quaternion_xyzw or [(0.0, 0.0, 0.0, 1.0)])


def _whole(name: str, position: Array, turn: Array, frames: int) -> tuple[Array, Array]:
    """Broadcast poses to all frames; one alone holds for all."""
    for what, rows in (("position", position), ("quaternion_xyzw", turn)):
        if len(rows) not in (1, frames):
            raise AnimationError(
                f"{quote(name)}: {what} has {len(rows)} rows, others {frames}", "give one a frame, or one for all"
            )
    return np.broadcast_to(position, (frames, 3)), np.broadcast_to(turn, (frames, 4))


def _object(one: _Object, position: Array, turn: Array, folder: Path, unit: float, up: str) -> ExportedObject:
    given = [x for x in (one.mesh, one.sphere_m, one.box_m, one.cylinder_m) if x is not None]
    if len(given) != 1:
        raise AnimationError(
            f"{quote(one.name)} has {len(given)} shapes", "give one of mesh, sphere_m, box_m, cylinder_m"
        )
    mesh: tuple[Array, Array] | None = None
    shapes: tuple[Shape, ...] = ()
    if one.mesh is not None:
        vertex, face = _mesh(one, folder)
        mesh = vertex * unit, face
    elif one.sphere_m is not None:
        shapes = (Shape("sphere", np.array([one.sphere_m * unit, 0, 0])),)
    elif one.box_m is not None:
        shapes = (Shape("box", np.array(one.box_m) * unit),)
    elif one.cylinder_m is not None:
        shapes = (Shape("cylinder", np.array([*one.cylinder_m, 0]) * unit),)
    moments = None if one.inertia_kg_m2 is None else np.array(one.inertia_kg_m2)
    turn = turn if up == "z" else tip_orientations(turn)
    return ExportedObject(one.name, upright(position * unit, up), turn, mesh, shapes, one.rule(), moments)


def _mesh(one: _Object, folder: Path) -> tuple[Array, Array]:
    if isinstance(one.mesh, str):
        if Path(one.mesh).is_absolute() or ".." in Path(one.mesh).parts:
            raise AnimationError(f"mesh {quote(one.mesh)} lies outside the animation's folder", "copy it beside it")
        surfaces = read_surfaces(folder / one.mesh)
        offset = np.cumsum([0] + [len(vertex) for vertex, _ in surfaces])[:-1]
        return np.concatenate([v for v, _ in surfaces]), np.concatenate(
            [face + at for (_, face), at in zip(surfaces, offset, strict=True)]
        )
    assert one.mesh is not None
    vertex, face = np.array(one.mesh.vertices, float).reshape(-1, 3), np.array(one.mesh.faces, np.int64).reshape(-1, 3)
    if face.size and (face.min() < 0 or face.max() >= len(vertex)):
        raise AnimationError(f"{quote(one.name)}: a face names no vertex", "vertices count from 0")
    return vertex, face


def upright(vector: Array, up: str) -> Array:
    """Turn vectors (…, 3) so that z is up: (x, y, z) of a world with y up is (x, -z, y)."""
    return vector if up == "z" else np.stack([vector[..., 0], -vector[..., 2], vector[..., 1]], axis=-1)


def tip_orientations(turn: Array) -> Array:
    """Turn orientations (…, 4) of a world with y up to one with z up: a quarter turn about x after them."""
    x, y, z, w = np.moveaxis(np.asarray(turn, float), -1, 0)
    h = np.sqrt(0.5)
    return np.stack([h * (x + w), h * (y - z), h * (z + y), h * (w - x)], axis=-1)


def read_rules(path: str | os.PathLike[str]) -> tuple[Rule, ...]:
    """Read a table of materials; the first rule that states something counts. Raises FileError, AnimationError."""
    remedy = 'give a list such as [{"name": "cup*", "material": "porcelain"}]'
    with reading_file(path, "table of materials", AnimationError, remedy):
        content = read_text(path, "table of materials", AnimationError, remedy, 1 << 20)
        found = decode_json(content, list[_Said], f"table of materials {path}", AnimationError, remedy)
    return tuple(one.rule() for one in found)
