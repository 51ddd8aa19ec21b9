"""Objects of an export, and the bodies that they become.

    object frame: meshes, mass where stated, poses of each frame          (gltf.py, keyframes.py)
        -> rules by name, density × volume -> centre of mass, principal axes -> Animation, poses of the body frames

x_b(k) = x_o(k) + R_o(k) c,  R_b = R_o A          c centre of mass, A principal axes, both in the object frame
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import Animation, check_orientations
from sonic_bullet.geometry import inertia, is_closed, volume_m3, weld_vertices
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import AnimationError
from sonic_bullet.simulators.animated import AnimatedBody, matrices


@dataclass(frozen=True, slots=True, eq=False)
class Rule:
    """What holds for objects whose name matches a pattern (* and ?); None: not stated."""

    name: str
    material: str | None = None
    restitution: float | None = None
    friction: float | None = None
    mass_kg: float | None = None
    driven: bool | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ExportedObject:
    """An object of an export.

    Attributes
    ----------
    position_m, quaternion_xyzw : (t, 3), (t, 4) of its origin
    mesh : vertices (v, 3) in m and faces (f, 3), object frame; or shapes
    stated : what the export itself states
    inertia_kg_m2 : (3,) principal moments along the object's axes, with that mass
    """

    name: str
    position_m: Array
    quaternion_xyzw: Array
    mesh: tuple[Array, Array] | None = None
    shapes: tuple[Shape, ...] = ()
    stated: Rule = field(default_factory=lambda: Rule("*"))
    inertia_kg_m2: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Export:
    """All of an export: z is up, in metres."""

    fps: float
    objects: tuple[ExportedObject, ...]
    gravity_m_s2: Array
    notes: tuple[str, ...] = ()


def assemble_animation(
    export: Export, rules: Sequence[Rule] = (), default: str | None = None
) -> tuple[Animation, tuple[str, ...]]:
    """Assemble the animation, and notes for the user.

    What the export states comes before rules, the first of them before others; default: material of bodies that move
    and have none. Raises AnimationError, and MaterialError for an unknown material.
    """
    from sonic_bullet.files.presets import load_material

    if not export.objects:
        raise AnimationError("no object of the animation has a mesh", "export the meshes with it")
    place = np.stack([one.position_m for one in export.objects], axis=1)
    turn = np.stack([one.quaternion_xyzw for one in export.objects], axis=1)
    names = [one.name for one in export.objects]
    check_orientations(names, turn)
    blank = [AnimatedBody(name, (Shape("sphere"),), 0.0, np.zeros(3)) for name in names]
    moving = Animation(export.fps, tuple(blank), place, turn).moving  # checks them, too
    notes, bodies, materials, plain = list(export.notes), [], {}, []
    for i, one in enumerate(export.objects):
        said = _stated_of(one, rules)
        material = said.material or (default if moving[i] else None)
        if said.material is None and material is not None:
            plain.append(one.name)
        if material is not None:
            materials[one.name] = material
        density = load_material(material).density_kg_m3 if material is not None else 1000.0
        body, centre, axes = _body(one, said, density, bool(moving[i]))
        bodies.append(body)
        place[:, i] += np.einsum("tij,j->ti", matrices(turn[:, i]), centre)
        turn[:, i] = _times(turn[:, i], axes)
    if plain:
        notes.append(f"{default} is what {_format_names(plain)} sound as: no rule and no property names a material")
    silent = [one.name for i, one in enumerate(export.objects) if not moving[i] and one.name not in materials]
    if silent:
        notes.append(
            f"silent partners, as they never move: {_format_names(silent)}; a rule with a material lets them sound"
        )
    _check_apart(names, place, turn, moving)
    return Animation(export.fps, tuple(bodies), place, turn, export.gravity_m_s2, materials), tuple(notes)


def _format_names(names: Sequence[str]) -> str:
    few = ", ".join(quote(name) for name in names[:5])
    return few + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def _stated_of(one: ExportedObject, rules: Sequence[Rule]) -> Rule:
    """Combine what export and rules state of an object."""
    found = one.stated
    for rule in rules:
        if fnmatchcase(one.name, rule.name):
            given = {
                key: getattr(rule, key)
                for key in ("material", "restitution", "friction", "mass_kg", "driven")
                if getattr(found, key) is None
            }
            found = replace(found, **given)
    return found


def _body(one: ExportedObject, said: Rule, density: float, moves: bool) -> tuple[AnimatedBody, Array, Array]:
    """Build the body, its centre of mass in the object frame, and the quaternion of its principal axes there."""
    restitution, friction = 0.7, 0.7  # of a body where none is stated: the pair's are products, 0.5 and 0.5
    centre, axes, moments, mass = np.zeros(3), np.array([0.0, 0, 0, 1]), np.zeros(3), 0.0
    shapes = one.shapes
    if one.mesh is not None:
        vertex, face = weld_vertices(*one.mesh)
        size = float(np.ptp(vertex, axis=0).max(initial=0.0))
        if not len(face) or size <= 0:
            raise AnimationError(f"object {quote(one.name)} has no triangle", "delete it, or give it a mesh")
        if moves:
            volume = volume_m3(vertex, face)
            if not is_closed(face) or abs(volume) < 1e-6 * size**3:
                raise AnimationError(
                    f"the mesh of {quote(one.name)} encloses no volume",
                    "close its holes and give it thickness before the export (Blender: modifier Solidify)",
                )
            face = face if volume > 0 else face[:, ::-1]
            centre, axes, moments, mass = _solid(vertex, face, density)
        turn = matrices(axes)
        shapes = (Shape("mesh", vertex_m=(vertex - centre) @ turn, face=face),)
    elif moves:
        moments, mass = _primitive(shapes[0], density)
    if moves and said.mass_kg is not None and said.mass_kg > 0:
        moments, mass = moments * said.mass_kg / mass, said.mass_kg
    if moves and one.inertia_kg_m2 is not None and said.mass_kg is not None:
        moments = matrices(axes).T @ np.diag(one.inertia_kg_m2) @ matrices(axes)
        moments = np.diag(moments)
    kinematic = bool(said.driven) or (moves and said.mass_kg == 0)
    made = AnimatedBody(
        one.name, shapes, mass if moves else 0.0, moments,
        restitution if said.restitution is None else said.restitution,
        friction if said.friction is None else said.friction, kinematic and moves,
    )  # fmt: skip
    return made, centre, axes


def _solid(vertex: Array, face: Array, density: float) -> tuple[Array, Array, Array, float]:
    """Compute centre of mass, quaternion of the principal axes, principal moments and mass of a closed mesh."""
    from scipy.spatial.transform import Rotation

    mass, centre, moment = inertia(vertex, face, density)
    moments, frame = np.linalg.eigh((moment + moment.T) / 2)
    frame = frame * np.where(np.linalg.det(frame) < 0, -1, 1)
    return centre, Rotation.from_matrix(frame).as_quat(), np.maximum(moments, 1e-12), mass


def _primitive(shape: Shape, density: float) -> tuple[Array, float]:
    """Compute principal moments and mass of a sphere, box or cylinder [Goldstein, Classical Mechanics, ch. 5]."""
    x, y, z = shape.size_m
    if shape.kind == "sphere":
        mass = density * 4 / 3 * np.pi * x**3
        return np.full(3, 0.4 * mass * x * x), mass
    if shape.kind == "box":
        mass = density * x * y * z
        return mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y]), mass
    mass = density * np.pi * x * x * y
    side = mass * (3 * x * x + y * y) / 12
    return np.array([side, side, mass * x * x / 2]), mass


def _times(first: Array, second: Array) -> Array:
    """Multiply quaternions (t, 4): rotation `first` after rotation `second` (4,)."""
    from scipy.spatial.transform import Rotation

    return np.asarray((Rotation.from_quat(first) * Rotation.from_quat(second)).as_quat())


def _check_apart(names: Sequence[str], place: Array, turn: Array, moving: Array) -> None:
    """Raise AnimationError where two bodies coincide all the time: an object exported twice."""
    one_spot_m = 1e-4
    for i in range(len(names)):
        for j in range(i + 1, len(names)):
            if (moving[i] or moving[j]) and np.abs(place[:, i] - place[:, j]).max() < one_spot_m:
                raise AnimationError(
                    f"{quote(names[i])} and {quote(names[j])} are on one spot in every frame",
                    "export each object once; leave out copies and collision hulls",
                )
