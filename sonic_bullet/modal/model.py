"""Shapes + material -> ModalModel: fill, assemble, solve, damp, keep the surface.

    K u = λ M u,  UᵀMU = 1,   d = (α + βλ)/2,   f = √(λ − d²)/2π            [Ren, Yeh, Lin 2013, eq. 5-7]

Solved without units: lengths by the body's diagonal L, stiffness by its largest entry C, density by itself; then
λ = λ' C/(ρL²) and u = u'/√(ρL³). Damping comes last: another α and β costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from sonic_bullet.files import cache as store
from sonic_bullet.geometry import oversize
from sonic_bullet.modal.keys import key
from sonic_bullet.records import Array, Material, ModalModel, Shape
from sonic_bullet.records.errors import MeshError, ModalError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mode_shapes import rounded

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.shape_meshes import Filled

MOST_MODES = 200
MODES = {
    "value": store.Kept("f8", ("m",)),
    "vector": store.Kept("f4", ("v", 3, "m")),
    "volume": store.Kept("f8", (1,)),
    "vertex": store.Kept("f8", ("v", 3)),
    "face": store.Kept("i", ("f", 3), "v"),
    "curvature": store.Kept("f8", ("f",)),
}
SOLID = {
    "node": store.Kept("f8", ("n", 3)),
    "tet": store.Kept("i", (None, None), "n"),
    "affine": store.Kept("b1", (1,)),
    "skin": store.Kept("i", ("v",), "n"),
    "face": store.Kept("i", ("f", 3), "v"),
    "curvature": store.Kept("f8", ("f",)),
}
SHIFT = 20.0  # × (2V/A)²/L²: a third of the first elastic λ' of plates and bars, less of chunky bodies


@dataclass(frozen=True, slots=True, eq=False)
class _Unit:
    """A solved body without units: value (m,), vector (v, 3, m) float32 on its skin, volume; vertex_m, face,
    curvature with units.
    """

    value: Array
    vector: Array
    volume: float
    vertex_m: Array
    face: Array
    curvature_per_m: Array
    note: str


def analyse(
    shapes: tuple[Shape, ...],
    material: Material,
    *,
    to_hz: float = 20_000.0,
    count: int | None = None,
    fixed: Sequence[Sequence[float]] = (),
    thickness_m: float | None = None,
    edge_m: float | None = None,
    cache: Path | Literal["default"] | None = "default",
    progress: Callable[[str], None] | None = None,
) -> ModalModel:
    """Vibration modes of a body up to to_hz (at most `MOST_MODES`; the note says when that cut them), or its lowest
    ``count``.

    shapes: together one solid, in the body frame. fixed: clamped where (x, y, z, radius) in m, body frame, reach; a
    clamp between nodes takes the nearest. thickness_m: wall of open surfaces (see surfaces.py); it makes closed ones
    hollow. edge_m: element size, by default from a budget of unknowns. cache: folder, "default" or None. progress:
    called with a line now and then. A body all of whose modes lie above to_hz has none; so has a plane. Pieces that do
    not hang together: the largest is kept and noted. Raises MeshError (broken, empty, flat, absurd or too slow mesh),
    ModalError (no usable modes).
    """
    say = progress or (lambda _: None)
    asked = ModalOptions(to_hz, count, fixed, thickness_m)
    to_hz, count, thickness_m = asked.to_hz, asked.count, asked.thickness_m
    if not shapes:
        raise MeshError("body has no shape", "give it a collision or visual shape, or pass mesh=")
    if any(shape.kind == "plane" for shape in shapes):
        none = np.zeros(0)
        return ModalModel(
            none,
            none,
            np.zeros((0, 3, 0)),
            np.zeros((0, 3)),
            np.zeros((0, 3)),
            none,
            0.0,
            0.0,
            note="plane: unbounded, no modes",
        )
    of = _unit_of(shapes, material, asked, edge_m)
    unit = _recall(store.load(cache, of.name, MODES))
    if unit is None:
        unit = _solve(
            shapes, (edge_m, thickness_m), (cache, of.solid), of.length_m, of.stiffness, of.clamp, count, of.limit, say
        )
        store.save(cache, of.name, _arrays(unit), unit.note)
    lam = unit.value * of.per_s2
    freq, decay, alive = damped(lam, material)
    note = unit.note
    if count is None and len(lam) == MOST_MODES and lam[-1] * 1.01 < (2 * np.pi * to_hz) ** 2:
        note += f"; cut at {MOST_MODES} modes, {np.sqrt(lam[-1]) / (2 * np.pi):.0f} Hz"
    dropped = len(lam) - len(alive)
    if dropped:
        note += f"; {dropped} overdamped modes dropped"
    volume = unit.volume * of.length_m**3
    mass = volume * material.density_kg_m3
    large = oversize(unit.vertex_m, mass)
    if large:
        note += f"; it {large}"
    return ModalModel(
        freq_hz=freq,
        decay_per_s=decay,
        shape=rounded(unit.vector[:, :, alive] / np.float32(np.sqrt(material.density_kg_m3 * of.length_m**3))),
        vertex_m=unit.vertex_m,
        face=unit.face,
        curvature_per_m=unit.curvature_per_m,
        volume_m3=volume,
        mass_kg=mass,
        dropped=dropped,
        note=note,
        includes_radiation=material.includes_radiation,
    )


def missing_name(
    shapes: tuple[Shape, ...], material: Material, options: ModalOptions, cache: store.Place = "default"
) -> str | None:
    """Under which name `analyse` would keep the modes of these shapes, None where they are kept already, have no place
    to be kept in, or are none, as a plane's. Raises MeshError.
    """
    if not shapes or any(shape.kind == "plane" for shape in shapes) or store.folder(cache) is None:
        return None
    name = _unit_of(shapes, material, options, None).name
    return None if store.holds(cache, name) else name


class _UnitOf(NamedTuple):
    """What a body without units is found by. name: of its modes in the cache; solid: of its filling. length_m, per_s2:
    what lengths and eigenvalues are divided by. limit: of the eigenvalues asked for; stiffness (6, 6), clamp (k, 4).
    """

    name: str
    solid: str
    length_m: float
    per_s2: float
    limit: float
    stiffness: Array
    clamp: Array


def _unit_of(shapes: tuple[Shape, ...], material: Material, asked: ModalOptions, edge_m: float | None) -> _UnitOf:
    solid = _solid_key(shapes, asked.thickness_m, edge_m)
    length_m = _diagonal_m(shapes)
    pascal = float(np.abs(material.stiffness_pa).max())
    per_s2 = pascal / (material.density_kg_m3 * length_m**2)
    limit = (2 * np.pi * asked.to_hz) ** 2 / per_s2
    clamp = np.array(asked.fixed, float).reshape(-1, 4)
    stiffness = material.stiffness_pa / pascal
    name = key("modes", solid, stiffness, clamp, asked.count if asked.count is not None else limit)
    return _UnitOf(name, solid, length_m, per_s2, limit, stiffness, clamp)


def surface_of(
    shapes: tuple[Shape, ...], *, cache: store.Place = "default", progress: Callable[[str], None] | None = None
) -> tuple[Array, Array]:
    """vertex_m (v, 3) and face (f, 3) of the surface on which `analyse` gives the modes of these shapes, without
    solving for them. Raises MeshError.
    """
    _diagonal_m(shapes)
    body = _filled(shapes, (None, None), (cache, _solid_key(shapes, None, None)), progress or (lambda _: None))
    return body.solid.node_m[body.skin.node], body.skin.face


def _solid_key(shapes: tuple[Shape, ...], thickness_m: float | None, edge_m: float | None) -> str:
    parts = [part for s in shapes for part in (s.kind, s.size_m, s.position_m, s.quaternion_xyzw, s.vertex_m, s.face)]
    return key("solid", *parts, thickness_m, edge_m)


def _diagonal_m(shapes: tuple[Shape, ...]) -> float:
    """A length that belongs to the shapes alone: what all is divided by. Raises MeshError where there is none."""
    sizes = [
        np.linalg.norm(np.ptp(s.vertex_m[np.unique(s.face)], axis=0)) if s.kind == "mesh" else np.linalg.norm(s.size_m)
        for s in shapes
    ]
    length = float(max(sizes))
    if not (np.isfinite(length) and length > 0):
        raise MeshError("body has no extent", "give shapes with sizes above zero")
    return length


def damped(lambda_per_s2: Array, material: Material) -> tuple[Array, Array, Array]:
    """Frequencies, ascending, and decays of the modes that oscillate, and their indices; decays NaN without alpha [Ren
    et al. 2013, eq. 7].
    """
    if material.alpha_per_s is None or material.beta_s is None:
        return np.sqrt(lambda_per_s2) / (2 * np.pi), np.full(len(lambda_per_s2), np.nan), np.arange(len(lambda_per_s2))
    decay = (material.alpha_per_s + material.beta_s * lambda_per_s2) / 2
    alive = np.flatnonzero(decay**2 < lambda_per_s2)
    freq = np.sqrt(lambda_per_s2[alive] - decay[alive] ** 2) / (2 * np.pi)
    order = np.argsort(freq, kind="stable")  # strong stiffness damping bends f(λ) back down
    return freq[order], decay[alive[order]], alive[order]


def _filled(
    shapes: tuple[Shape, ...],
    sizes: tuple[float | None, float | None],
    kept: tuple[store.Place, str],
    say: Callable[[str], None],
) -> Filled:
    """The body's inside and skin, from the cache where it is there. sizes: edge_m, thickness_m."""
    from sonic_bullet.modal.meshing.shape_meshes import Filled, fill
    from sonic_bullet.modal.meshing.solid import Solid, SolidSurface

    found = store.load(*kept, SOLID)
    if found is not None:
        a, note = found
        return Filled(
            Solid(a["node"], a["tet"], bool(a["affine"][0]), note), SolidSurface(a["skin"], a["face"]), a["curvature"]
        )
    body = fill(shapes, *sizes, say)
    solid, skin = body.solid, body.skin
    arrays = {
        "node": solid.node_m,
        "tet": solid.tet,
        "affine": np.array([solid.affine]),
        "skin": skin.node,
        "face": skin.face,
        "curvature": body.curvature_per_m,
    }
    store.save(*kept, arrays, solid.note)
    return body


def _solve(
    shapes: tuple[Shape, ...],
    sizes: tuple[float | None, float | None],
    kept: tuple[store.Place, str],
    length_m: float,
    stiffness: Array,
    clamp: Array,
    count: int | None,
    limit: float,
    say: Callable[[str], None],
) -> _Unit:
    """Fill (or fetch the filled body), assemble, clamp and solve, all without units."""
    from sonic_bullet.modal import eigen, fem, polynomials
    from sonic_bullet.modal.meshing.solid import Solid

    body = _filled(shapes, sizes, kept, say)
    unit = Solid(body.solid.node_m / length_m, body.solid.tet, body.solid.affine)
    skin_m = unit.node_m[body.skin.node]
    corner = skin_m[body.skin.face]
    area = float(np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2)
    volume = fem.volume_m3(unit)
    box = polynomials.recognised(shapes[0]) if len(shapes) == 1 and sizes == (None, None) and not len(clamp) else None
    exact = (
        polynomials.free(box, length_m, stiffness, body.solid.node_m[body.skin.node], limit, count, MOST_MODES)
        if box is not None
        else None
    )
    if exact is not None:
        value, moved = exact
        below = slice(None) if count is not None else value <= limit
        said = f"{body.solid.note}, its modes by polynomials"
        where = body.solid.node_m[body.skin.node]
        return _Unit(
            value[below],
            np.ascontiguousarray(moved[:, :, below], np.float32),
            volume,
            where,
            body.skin.face,
            body.curvature_per_m,
            said,
        )
    say(f"assembling {3 * len(unit.node_m)} unknowns")
    k_matrix, m_matrix = fem.assemble(unit, stiffness, 1.0)
    fixed = fem.clamped(body.solid, clamp)
    if fixed.all():
        raise ModalError("the clamps hold the whole body", "give a smaller radius")
    free = np.flatnonzero(np.repeat(~fixed, 3))
    rigid = 6 - (
        int(np.linalg.matrix_rank(fem.rigid_modes(unit.node_m)[~np.isin(np.arange(3 * len(fixed)), free)], tol=1e-9))
        if fixed.any()
        else 0
    )
    if fixed.any():
        k_matrix, m_matrix = k_matrix[free][:, free], m_matrix[free][:, free]
    most = min(count or MOST_MODES, max(1, len(free) // 3 - rigid))
    shift = -SHIFT * (2 * volume / area) ** 2
    enough = (lambda value: len(value) >= count) if count is not None else (lambda value: bool(value[-1] > limit))
    modes = eigen.solve(k_matrix, m_matrix, shift, rigid=rigid, enough=enough, most=most, say=say)
    keep = np.arange(len(modes.lambda_per_s2)) < most if count is not None else (modes.lambda_per_s2 <= limit)
    vector = np.zeros((3 * len(fixed), int(keep.sum())), np.float32)
    vector[free] = modes.vector[:, keep]
    note = body.solid.note + f"; {len(free)} unknowns" + (f"; {int(fixed.sum())} nodes clamped" if fixed.any() else "")
    shape = np.ascontiguousarray(vector.reshape(len(fixed), 3, -1)[body.skin.node])
    return _Unit(
        modes.lambda_per_s2[keep],
        shape,
        volume,
        body.solid.node_m[body.skin.node],
        body.skin.face,
        body.curvature_per_m,
        note,
    )


def _arrays(unit: _Unit) -> dict[str, Array]:
    return {
        "value": unit.value,
        "vector": unit.vector,
        "volume": np.array([unit.volume]),
        "vertex": unit.vertex_m,
        "face": unit.face,
        "curvature": unit.curvature_per_m,
    }


def _recall(found: tuple[dict[str, Array], str] | None) -> _Unit | None:
    if found is None:
        return None
    a, note = found
    return _Unit(a["value"], a["vector"], float(a["volume"][0]), a["vertex"], a["face"], a["curvature"], note)
