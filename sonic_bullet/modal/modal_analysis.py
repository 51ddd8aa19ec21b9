"""Shapes + material -> ModalModel: fill, assemble, solve, damp, keep the surface.

    K u = λ M u,  UᵀMU = 1,   d = (α + βλ)/2,   f = √(λ − d²)/2π            [Ren, Yeh, Lin 2013, eq. 5-7]

Solved without units: lengths by the body's diagonal L, stiffness by its largest entry C, density by itself; then
λ = λ' C/(ρL²) and u = u'/√(ρL³). Damping comes last: another α and β costs nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from sonic_bullet.files.storage import cache as store
from sonic_bullet.geometry import oversize
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.machine.progress import show_progress
from sonic_bullet.modal.cost import DRAFT_ACCURACY, DRAFT_MOST_MODES
from sonic_bullet.modal.elements import Elements
from sonic_bullet.modal.kept_solids import pack_touched, unpack_touched
from sonic_bullet.modal.keys import key
from sonic_bullet.modal.meshing.surfaces import given_wall_m
from sonic_bullet.modal.methods import choose_method, refine_until_accurate
from sonic_bullet.modal.sectors import MOST_MODES, WantedModes
from sonic_bullet.records import Array, Material, ModalModel, Shape, TouchedSurface
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import MeshError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mode_shapes import quantize_shapes

LEAST_ERROR = 1e-4  # relative, of a frequency: smaller errors are not distinguished


@dataclass(frozen=True, slots=True, eq=False)
class _ScaleFreeModes:
    """Modes of a body whose lengths and eigenvalues are divided by its own; its surface in metres.

    value (m,), vector (v, 3, m) float32 on its skin and volume have no units; its surfaces have.
    """

    value: Array
    vector: Array
    volume: float
    vertex_m: Array
    face: Array
    curvature_per_m: Array
    note: str
    touched: TouchedSurface | None


@show_progress()
@one_thread(with_scipy=False)
def analyse(
    shapes: tuple[Shape, ...],
    material: Material,
    *,
    to_hz: float = 20_000.0,
    count: int | None = None,
    fixed: Sequence[Sequence[float]] = (),
    thickness_m: float | None = None,
    accuracy: float | None = 0.01,
    edge_m: float | None = None,
    exact_shapes: bool = False,
    draft: bool = False,
    cache: Path | Literal["default"] | None = "default",
) -> ModalModel:
    """Compute the vibration modes of a body up to to_hz, or its lowest ``count``.

    At most `MOST_MODES` are kept; the note says when that cut them. A body all of whose modes lie above to_hz has none,
    and a plane has none. Of unconnected pieces the largest is kept, and noted.

    Parameters
    ----------
    shapes
        Together one solid, in the body frame.
    fixed
        Spheres (x, y, z, radius) in m, body frame, that clamp it; one between nodes takes the nearest.
    thickness_m
        Wall of open surfaces (see surfaces.py); it makes closed ones hollow.
    accuracy
        Relative, of the highest frequency; the note says what is reached. None: as it comes, its error untold.
    edge_m
        Element size, by default from a budget of unknowns.
    exact_shapes
        Shapes as solved, for whoever derives strains from them and rounds them then; else rounded.
    draft
        Few modes, of coarse elements, within a second.
    cache
        Folder, "default" or None.

    Raises
    ------
    MeshError
        The mesh is broken, empty, flat, absurd or too slow.
    ModalError
        There are no usable modes.
    """
    asked = ModalOptions(to_hz, count, fixed, thickness_m, accuracy, draft=draft)
    to_hz, count = asked.to_hz, asked.count
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
    body_key = _scale_free_key(shapes, material, asked, edge_m)
    scale_free = _recall(store.load(cache, body_key.name))
    if scale_free is None:
        scale_free = _solve(body_key, shapes, asked, edge_m, cache)
        store.save(cache, body_key.name, _arrays(scale_free), scale_free.note)
    lam = scale_free.value * body_key.per_s2
    freq, decay, alive = damp_modes(lam, material)
    note = scale_free.note
    most = DRAFT_MOST_MODES if draft else MOST_MODES
    if count is None and len(lam) == most and lam[-1] * 1.01 < (2 * np.pi * to_hz) ** 2:
        note += f"; cut at {most} modes, {np.sqrt(lam[-1]) / (2 * np.pi):.0f} Hz"
    dropped = len(lam) - len(alive)
    if dropped:
        note += f"; {format_count(dropped, 'overdamped mode')} dropped"
    volume = scale_free.volume * body_key.length_m**3
    mass = volume * material.density_kg_m3
    large = oversize(scale_free.vertex_m, mass)
    if large:
        note += f"; it {large}"
    vector = scale_free.vector[:, :, alive] if dropped else scale_free.vector
    shape = vector / np.float32(np.sqrt(material.density_kg_m3 * body_key.length_m**3))
    return ModalModel(
        freq_hz=freq,
        decay_per_s=decay,
        shape=shape if exact_shapes else quantize_shapes(shape),
        vertex_m=scale_free.vertex_m,
        face=scale_free.face,
        curvature_per_m=scale_free.curvature_per_m,
        volume_m3=volume,
        mass_kg=mass,
        dropped=dropped,
        note=note,
        includes_radiation=material.includes_radiation,
        assumed_wall_m=given_wall_m(scale_free.note) if thickness_m is None else 0.0,
        solution="draft" if draft else "full",
        touched=scale_free.touched,
    )


def missing_name(
    shapes: tuple[Shape, ...], material: Material, options: ModalOptions, cache: store.Place = "default"
) -> str | None:
    """Return the name under which `analyse` would keep these modes, None where it would not keep any.

    None where they are kept already, where no cache is given, or where there are no modes, as of a plane. Raises
    MeshError.
    """
    if not shapes or any(shape.kind == "plane" for shape in shapes) or not store.folders(cache):
        return None
    name = _scale_free_key(shapes, material, options, None).name
    return None if store.holds(cache, name) else name


class _ScaleFreeKey(NamedTuple):
    """What modes without units are kept by, and what gives them their units.

    Attributes
    ----------
    name, solid : of its modes and of its filling, in the cache
    length_m, per_s2 : what lengths and eigenvalues are divided by
    limit : of the eigenvalues asked for
    stiffness, clamp : (6, 6), (k, 4)
    """

    name: str
    solid: str
    length_m: float
    per_s2: float
    limit: float
    stiffness: Array
    clamp: Array


def _scale_free_key(
    shapes: tuple[Shape, ...], material: Material, asked: ModalOptions, edge_m: float | None
) -> _ScaleFreeKey:
    solid = solid_key(shapes, asked.thickness_m, edge_m)
    length_m = diagonal_m(shapes)
    pascal = float(np.abs(material.stiffness_pa).max())
    per_s2 = pascal / (material.density_kg_m3 * length_m**2)
    limit = (2 * np.pi * asked.to_hz) ** 2 / per_s2
    clamp = np.array(asked.fixed, float).reshape(-1, 4)
    stiffness = material.stiffness_pa / pascal
    name = key("modes", solid, stiffness, clamp, asked.count, limit, asked.accuracy, asked.draft)
    return _ScaleFreeKey(name, solid, length_m, per_s2, limit, stiffness, clamp)


def solid_key(shapes: tuple[Shape, ...], thickness_m: float | None, edge_m: float | None) -> str:
    """Name the body that shapes make when filled with elements."""
    fields = [one for s in shapes for one in (s.kind, s.size_m, s.position_m, s.quaternion_xyzw, s.vertex_m, s.face)]
    return key("solid", *fields, thickness_m, edge_m)


def diagonal_m(shapes: tuple[Shape, ...]) -> float:
    """Compute the length of the shapes that all lengths are divided by. Raises MeshError where it is none."""
    sizes = [
        np.linalg.norm(np.ptp(s.vertex_m[np.unique(s.face)], axis=0)) if s.kind == "mesh" else np.linalg.norm(s.size_m)
        for s in shapes
    ]
    length = float(max(sizes))
    if not (np.isfinite(length) and length > 0):
        raise MeshError("body has no extent", "give shapes with sizes above zero")
    return length


def damp_modes(lambda_per_s2: Array, material: Material) -> tuple[Array, Array, Array]:
    """Compute frequencies, ascending, and decays of the modes that oscillate, and their indices.

    Decays are NaN without alpha. [Ren et al. 2013, eq. 7]
    """
    if material.alpha_per_s is None or material.beta_s is None:
        return np.sqrt(lambda_per_s2) / (2 * np.pi), np.full(len(lambda_per_s2), np.nan), np.arange(len(lambda_per_s2))
    decay = (material.alpha_per_s + material.beta_s * lambda_per_s2) / 2
    alive = np.flatnonzero(decay**2 < lambda_per_s2)
    freq = np.sqrt(lambda_per_s2[alive] - decay[alive] ** 2) / (2 * np.pi)
    order = np.argsort(freq, kind="stable")  # strong stiffness damping bends f(λ) back down
    return freq[order], decay[alive[order]], alive[order]


@one_thread()
def _solve(
    body_key: _ScaleFreeKey,
    shapes: tuple[Shape, ...],
    asked: ModalOptions,
    edge_m: float | None,
    cache: store.Place,
) -> _ScaleFreeModes:
    """Solve for the body's modes without units, by its method, as accurate as asked or as that can be."""
    most = DRAFT_MOST_MODES if asked.draft else MOST_MODES
    wanted = WantedModes(body_key.limit, most) if asked.count is None else WantedModes(np.inf, min(asked.count, most))
    method = choose_method(
        shapes,
        body_key.length_m,
        body_key.stiffness,
        wanted,
        clamp=body_key.clamp,
        edge_m=edge_m,
        thickness_m=asked.thickness_m,
        kept=(cache, body_key.solid),
        draft=asked.draft,
    )
    ratio = method.thickened if isinstance(method, Elements) else 1.0
    if isinstance(method, Elements) and ratio != 1:
        # a wall h/t times as thick with λ divided by (h/t)² and 1/ρ by h/t has the same D and mass per area
        wanted = wanted._replace(limit=wanted.limit * ratio**2)
        if asked.count is None and not (asked.draft and method.is_lump):
            wanted = wanted._replace(most=min(wanted.most, method.waves()))
    accuracy = None if asked.accuracy is None else max(asked.accuracy, DRAFT_ACCURACY * asked.draft)
    found = refine_until_accurate(method, [body_key.stiffness], wanted, accuracy)
    surface = found.method.evaluate_on_surface(found.sectors, [sector.found[0][1] for sector in found.sectors])
    note = found.method.note(found.sectors)
    if ratio != 1 and wanted.most < most and len(found.value) == wanted.most and asked.count is None:
        note += f"; {wanted.most} modes, whose waves are as long as four elements"
    left_open = 0.0 if accuracy is None else found.method.surface_error(found.sectors, body_key.stiffness)
    of_elements = isinstance(found.method, Elements)
    open_too = left_open if left_open >= LEAST_ERROR else 0.0
    if asked.accuracy is not None and np.isfinite(found.error):
        whole = found.error + open_too
        top_hz = np.sqrt(found.value[-1] * body_key.per_s2) / (2 * np.pi * ratio)
        note += f"; error up to {top_hz:.0f} Hz {_percent(whole)}"
        if whole > asked.accuracy:
            remedy = (
                "finer elements need more unknowns than allowed"
                if found.error > asked.accuracy
                else "elements of a smaller edge_m follow its bends better"
                if of_elements
                else "give a mesh of finer facets"
            )
            note += f", more than the {100 * asked.accuracy:g} % asked for: {remedy}"
    elif found.method.meshed and len(found.value):
        given = "none was asked for" if accuracy is None else "the size of its elements was given"
        note += "; error not known: " + ("a draft" if asked.draft else given)
    if open_too:
        what = (
            "its own surface in place of its elements' changes" if of_elements else "arcs in place of its facets change"
        )
        note += f"; {what} frequencies by up to {_percent(open_too).removeprefix('about ')}"
    return _ScaleFreeModes(
        found.value / ratio**2,
        np.ascontiguousarray(surface.shape[:, :, found.order] * np.float32(np.sqrt(ratio))),
        found.method.volume / ratio,
        surface.vertex_m,
        surface.face,
        surface.curvature_per_m,
        note,
        surface.touched,
    )


def _percent(error: float) -> str:
    return (
        f"about {100 * error:.{2 if error < 1 else 3}g} %" if error >= LEAST_ERROR else f"under {100 * LEAST_ERROR:g} %"
    )


def _arrays(scale_free: _ScaleFreeModes) -> dict[str, Array]:
    return {
        "value": scale_free.value,
        "vector": scale_free.vector,
        "volume": np.array([scale_free.volume]),
        "vertex": scale_free.vertex_m,
        "face": scale_free.face,
        "curvature": scale_free.curvature_per_m,
        **pack_touched(scale_free.touched),
    }


def _recall(found: tuple[dict[str, Array], str] | None) -> _ScaleFreeModes | None:
    if found is None:
        return None
    a, note = found
    return _ScaleFreeModes(
        a["value"],
        a["vector"],
        float(a["volume"][0]),
        a["vertex"],
        a["face"],
        a["curvature"],
        note,
        unpack_touched(a),
    )
