"""A body with its modes -> BakedModel.

    Body -> bank.resonator, as in scenes: decays with the air's and the mounting's, pressure at 1 m
         -> modes in order of importance -> shapes at points of the user's surface, by nearest point on the solved one

A mesh's own vertices are where its file has them, in its order; the solver's mesh has others.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.baked_model import BakedMaterial, BakedModel, MassProperties
from sonic_bullet.apps.bake.mode_importance import CONTACT_S, audible_order, important_modes, mode_energy
from sonic_bullet.apps.bake.sample_points import sample_points
from sonic_bullet.effects.presets_of_effects import with_material
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.contact.coupling import ContactSide
from sonic_bullet.engine.runtime.body_table import pressed_pa
from sonic_bullet.files.meshes import read_own_vertices
from sonic_bullet.geometry import SurfaceIndex, inertia, nearest, volume_m3
from sonic_bullet.machine.progress import progress_to
from sonic_bullet.modal import read_mesh
from sonic_bullet.options.bake import BakeMeshOptions, PruningOptions
from sonic_bullet.options.option import takes
from sonic_bullet.records import Air, Array, Body, Material, ModalModel
from sonic_bullet.records.bodies import isotropic_stiffness_pa
from sonic_bullet.records.errors import ModalError
from sonic_bullet.records.units import HEARING_LIMIT_HZ
from sonic_bullet.session.body_models import analyse_body


def for_page(pruning: PruningOptions, count: int) -> PruningOptions:
    """Bound the number of points where none is asked for: shapes are seen between few, and many are megabytes."""
    fewest, most = 1000, 2000
    points = pruning.points or (None if fewest <= count <= most else min(max(count, fewest), most))
    return replace(pruning, points=points)


@takes(BakeMeshOptions, 2)
def bake_mesh(path: Path | str, material: Material, options: BakeMeshOptions) -> BakedModel:
    """Bake a mesh of a material, whose effects count: shapes at the mesh's own vertices, in the file's own order.

    The options are keywords. pruning: what is kept of modes and points; None: all. accuracy: as of `ModalOptions`.
    progress: called with a line now and then. Raises FileError, MeshError, ModalError.
    """
    shape = read_mesh(path, options.scale)
    vertex, face = read_own_vertices(Path(path))
    made = with_material(material)
    to_hz = HEARING_LIMIT_HZ if options.to_hz is None else options.to_hz
    how: dict[str, Any] = {"to_hz": to_hz, "thickness_m": options.thickness_m, "accuracy": options.accuracy}
    with progress_to(options.progress):
        model = analyse_body((shape,), made, tail=False, **how)
    solid = _solid_of(model, made.density_kg_m3)
    body = Body(
        0,
        -1,
        0,
        Path(path).stem,
        model.mass_kg,
        np.zeros((3, 3)) if solid is None else solid.inertia_kg_m2,
        volume_m3=model.volume_m3,
        material=made,
        model=model,
    )
    return bake_body(body, options.pruning or PruningOptions(), (vertex * options.scale, face))


def bake_body(
    body: Body, pruning: PruningOptions | None = None, surface: tuple[Array, Array] | None = None
) -> BakedModel:
    """Bake a body of a contact log, or of a mesh.

    Parameters
    ----------
    body : Body
        With material and model.
    pruning : PruningOptions, optional
        What is kept of modes and points. None: all.
    surface : (v, 3) and (f, 3), optional
        Vertices in m and triangles at which shapes are wanted, in the body frame. None: the surface of its model.

    Returns
    -------
    BakedModel

    Raises
    ------
    ModalError
        Where the body has no mode to bake.
    """
    highest_rate_hz = 384_000  # Modes up to half of it are baked; a player leaves out those above half its own rate

    model, material, pruning = body.model, body.material, pruning or PruningOptions()
    if model is None or material is None or not model.mode_count:
        why = model.note if model is not None and model.note else "nobody gave it a material"
        raise ModalError(f"{body.name} has no modes to bake: {why}", "bake what rings below 20 kHz")
    resonator = build_resonator(body, (), highest_rate_hz, Air())
    if resonator.index is None or not resonator.mode_count:
        raise ModalError(f"{body.name} has no modes that ring", "give a material with less damping")
    freq, pressure = resonator.omega_rad_s / (2 * np.pi), resonator.weight[0]
    energy = mode_energy(model.vertex_m, model.face, resonator.shape, pressure, resonator.decay_per_s)
    keep = important_modes(freq, resonator.decay_per_s, energy, most=pruning.modes, below_db=pruning.below_db)
    point, face = sample_points(*(surface or (model.vertex_m, model.face)), pruning.points)
    kept = np.ascontiguousarray(resonator.shape[:, :, keep])
    notes = [model.note] if model.note else []
    if len(keep) < len(freq):
        notes.append(_kept_words(len(keep), *audible_order(freq, resonator.decay_per_s, energy)))
    shape = _shape_at(point, resonator.index, kept, model)
    if coarse := _coarse(point, face, shape, resonator.index, kept, model, energy[keep]):
        notes.append(coarse)
    fastest = np.sqrt((resonator.shape.astype(float) ** 2).sum(axis=1)).max(axis=0)  # at the surface, of |z| = 1
    bend, growth = resonator.bend, resonator.damping_growth
    return BakedModel(
        name=body.name,
        freq_hz=freq[keep],
        decay_per_s=resonator.decay_per_s[keep],
        shape=shape,
        point_m=point,
        face=face,
        pressure_pa_m=pressure[keep],
        material=bake_material(material),
        mass=_solid_of(model, material.density_kg_m3),
        bend_s2_m2=None if bend is None else (bend / fastest**2)[keep],
        damping_growth_s_m=None if growth is None else (growth / fastest)[keep],
        damping_growth_power=model.damping_growth_power,
        residual=material.residual,
        notes=tuple(notes),
        assumed_wall_m=model.assumed_wall_m,
    )


def _kept_words(count: int, order: Array, error_db: Array) -> str:
    """Describe what is lost with so many modes, with half and with twice as many."""
    whole = len(order)
    others = [other for other in (count // 2, 2 * count) if 0 < other < whole]
    beside = ", ".join(f"{error_db[other]:.1f} dB with {other}" for other in others)
    return (
        f"{count} of {whole} modes are kept, those that are heard: an octave loses {error_db[count]:.1f} dB at most "
        f"over a second, of strikes of {1e3 * CONTACT_S[0]:g} to {1e3 * CONTACT_S[-1]:g} ms"
        + (f"; {beside}" if beside else "")
    )


def _shape_at(point_m: Array, index: SurfaceIndex, shape: Array, model: ModalModel) -> Array:
    """Interpolate shapes (p, 3, m) float32 at points in the solved surface's triangles."""
    face, weight, _ = nearest(index, point_m)
    return np.asarray(np.einsum("pc,pcxm->pxm", weight, shape[model.face[face]]), np.float32)


def _coarse(
    point: Array, face: Array, shape: Array, index: SurfaceIndex, solved: Array, model: ModalModel, energy: Array
) -> str:
    """Describe the error of shapes between the points, where it is large.

    At the triangles' middles, against the solved shapes, mean of the modes by energy.
    """
    # Relative rms error of shapes interpolated between points above which a note is given. A tenth is 1 dB.
    coarse = 0.1
    if not len(face):
        return ""
    between = shape[face].mean(axis=1)
    true = _shape_at(point[face].mean(axis=1), index, solved, model)
    wrong = ((between - true) ** 2).sum(axis=(0, 1)) / np.maximum((true**2).sum(axis=(0, 1)), 1e-30)
    rms = float(np.sqrt(np.average(np.minimum(wrong, 1.0), weights=energy + 1e-300)))
    if rms < coarse:
        return ""
    return (
        f"between its {len(point)} points shapes are off by {100 * rms:.0f} %: strikes at points are right, others are "
        f"not; more points mend it (--points {4 * len(point)})"
    )


def bake_material(material: Material) -> BakedMaterial:
    """Return what a baked file holds of a material."""
    return BakedMaterial(
        name=material.name,
        density_kg_m3=material.density_kg_m3,
        youngs_pa=material.youngs_pa,
        poisson=material.poisson,
        alpha_per_s=material.alpha_per_s,
        beta_s=material.beta_s,
        contact_modulus_pa=pressed_pa(material, ContactSide.of(material)),
        restitution=material.restitution,
        roughness_m=material.roughness_m,
        hurst=material.hurst,
        octave_rms_m=None if material.octave_rms_m is None else tuple(material.octave_rms_m.tolist()),
        waviness_m=None if material.form is None else material.form.waviness_m,
        waviness_length_m=None if material.form is None else material.form.waviness_length_m,
        stiffness_pa=_grain(material),
    )


def _grain(material: Material) -> Any:
    """Rows of a stiffness that is not the same in every direction, else None."""
    even = isotropic_stiffness_pa(material.youngs_pa, material.poisson)
    if np.allclose(material.stiffness_pa, even, rtol=1e-9, atol=1e-9 * float(even.max())):
        return None
    return tuple(tuple(row) for row in material.stiffness_pa.tolist())


def _solid_of(model: ModalModel, density_kg_m3: float) -> MassProperties | None:
    """Compute the mass properties of the meshed solid, which normalises the shapes; None where its surface is open."""
    if model.mass_kg <= 0 or volume_m3(model.vertex_m, model.face) <= 0:
        return None
    mass, centre, moment = inertia(model.vertex_m, model.face, density_kg_m3)
    return MassProperties(model.mass_kg, centre, moment * (model.mass_kg / mass))
