"""Contact logs on disk: every number bit for bit, no pickle.

The container is `container`'s npz. Scalars, names and references are JSON (`header.npy`), all arrays are entries of
their own:

    format "sonic-bullet-contacts/3"; b bodies, s steps, p = Σ bodies in each step, k = Σ contacts of each step
      step_dt_s (s,) f8                     length of each step
      step_gravity_m_s2 (s, 3) f8            gravity in the world
      step_body_count, step_contact_count (s,) i8   number of each step's rows among the p and k rows, in order
      pose_position_m (p, 3) f8, pose_quaternion_xyzw (p, 4) f8, pose_teleported (p,) bool
      pose_body (p,) i4                     indices of the bodies, ascending in a step; removed bodies are absent
      contact_<field> (k, …)
          the fields of `Contacts`: a, b i4; point_a_m, point_b_m, normal, impulse_n_s, slip_m_s,
                                            sweep_m_s, approach_m_s, gap_m f8
      body_flat_face_count (b,) i8, body_flat_face_m (r, 3, 3) f8   only where some body has such faces
      step_motion_count (s,) i8, motion_<field> (r, …)   only where a sensor is on a jointed body
          how its links move, the fields of `records.touching.link_motions.LINK_MOTION`
      body_inertia_kg_m2 (b, 3, 3) f8, body_curvature_per_m (b,) f8 (NaN: by the model's surface)
      material_stiffness_pa (n, 6, 6) f8    materials and models are stored once each, however many bodies share them
      residual<i>_<field> f8                 of material i, where it has one: the arrays of `Residual`
      track<i> (n,) f8                       of material i, where it has one: heights of its `SurfaceForm`
      model<i>_freq_hz, _decay_per_s (m,) f8, _shape (v, 3, m) f4, _vertex_m (v, 3) f8, _face (f, 3) i4,
          _curvature_per_m (f,) f8
      model<i>_bend_s2_m2, _choke_s_m (m,) f8  only where its modes depend on their level
      model<i>_stands_for (m,) f8             only where modes above the last solved one are statistical
      model<i>_touched_vertex_m, _touched_face, _touched_curvature_per_m: where elements lean from the given surface
          all arrays of models: deflated, as planes (n, …) u1 of numbers of n bytes: all first bytes, all second ones, …
      model<i>_shape u2, model<i>_shape_exponent (m,) i2
          in place of _shape f4, where shapes are whole multiples of powers of two, as those solved here are:
          `differences` of those numbers, and the powers (records/mode_shapes.py)
      head<i>_direction (d, 3) f8, head<i>_response (d, 2, n) f8
          of sensor i, where it is a head
      response<i>_freq_hz, response<i>_magnitude (k,) f8
          of sensor i, where it touches and has a response
      models (in the header)
          each model without its arrays; or its SHA-256, where it is in the cache
      events (in the header)
          in order: {"kind": "quench", "reset" or "moved", "step": the step before which it happened,
                     "body": index of the moved body, or null: all}
      changes (in the header)
          in order: {"step": the step before which it happened, "body": index, or null: the engine, "values": {…}}
      of each body: dynamics, options, mounting, silent; of all: engine, versions, residual, supports, image (see
          `Body`, `ContactLog`)

Steps are written and read by blocks (`step_entries`): a log may be larger than the memory.

A reader checks sizes before it allocates and records check their invariants, so a cut or foreign file is one line of
LogError.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

import msgspec
import numpy as np

from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.levels import check_sr
from sonic_bullet.files.log_header import (
    RESIDUAL_ARRAYS,
    LogHeader,
    material_key,
    pack_body,
    pack_change,
    pack_material,
    pack_sensor,
    pack_values,
    pick,
    sensor_arrays,
    unpack_body,
    unpack_change,
    unpack_residual,
    unpack_sensor,
)  # fmt: skip
from sonic_bullet.files.models import PACKED, pack_models, recalled_models, unpack_models
from sonic_bullet.files.rows.flat_face_entries import face_arrays, taken_faces
from sonic_bullet.files.rows.step_entries import LAZY, read_steps, step_entries
from sonic_bullet.files.rows.surface_forms import track_arrays, unpack_form
from sonic_bullet.files.storage.container import REMEDY, Column, distinct, read_container, take, write_container
from sonic_bullet.files.storage.json_text import as_json_text
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records import Air, Array, Material, ModalModel
from sonic_bullet.records.coerce import as_path
from sonic_bullet.records.errors import LogError

LOG_FORMAT = "sonic-bullet-contacts/3"


def write_log(path: str | os.PathLike[str], log: ContactLog, models: object = "included") -> None:
    """Write a contact log, whole or not at all; equal logs give equal bytes.

    Parameters
    ----------
    models
        "included", or "reference": they go to the cache, and the log names them.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    materials, material_of = distinct([body.material for body in log.bodies], material_key)
    entries, model_of, model_arrays = pack_models([body.model for body in log.bodies], models)
    header = LogHeader(
        format=LOG_FORMAT,
        sr=int(log.sr),
        seed=int(log.seed),
        air_density_kg_m3=float(log.air.density_kg_m3),
        air_sound_speed_m_s=float(log.air.sound_speed_m_s),
        sensors=[pack_sensor(sensor) for sensor in log.sensors],
        materials=[pack_material(material) for material in materials],
        models=entries,
        bodies=[pack_body(body, m, n) for body, m, n in zip(log.bodies, material_of, model_of, strict=True)],
        events=list(log.events),
        engine=pack_values(log.engine),
        versions={as_json_text(name): as_json_text(text) for name, text in log.versions.items()},
        changes=[pack_change(change) for change in log.changes],
        residual=bool(log.residual),
        supports=bool(log.supports),
        image=bool(log.image),
    )
    arrays: dict[str, Array | Column] = {
        **step_entries(log._steps),
        "body_inertia_kg_m2": np.reshape([body.inertia_kg_m2 for body in log.bodies], (-1, 3, 3)).astype(float),
        "body_curvature_per_m": np.array([body.curvature_per_m for body in log.bodies], float),
        "material_stiffness_pa": np.reshape([material.stiffness_pa for material in materials], (-1, 6, 6)).astype(
            float
        ),
    }
    arrays |= model_arrays | sensor_arrays(log.sensors) | face_arrays(log.bodies)
    for i, material in enumerate(materials):
        if material.residual is not None:
            arrays |= {f"residual{i}_{name}": getattr(material.residual, name) for name in RESIDUAL_ARRAYS}
        arrays |= track_arrays(i, material)
    write_container(path, header, arrays, PACKED)


def read_log(path: str | os.PathLike[str]) -> ContactLog:
    """Read the contact log that `write_log` wrote.

    Raises
    ------
    FileError
        There is no such file.
    LogError
        It is cut, foreign, forged or inconsistent, or its models are not in the cache.
    """
    path = as_path(path, "path", "name a contact log (.npz)")
    header, arrays = read_container(path, LogHeader, LOG_FORMAT, "contact log", LAZY)
    kept = recalled_models(header.models, [(body.model, body.name) for body in header.bodies], path)
    with reading_file(path, "contact log", LogError, REMEDY):
        check_sr(header.sr)
        return _unpack_log(header, arrays, kept, path)


def _unpack_log(
    header: LogHeader, arrays: Mapping[str, Array], kept: Mapping[int, ModalModel], path: object
) -> ContactLog:
    b, n = len(header.bodies), len(header.materials)
    faces = taken_faces(arrays, b, path)
    inertia = take(arrays, "body_inertia_kg_m2", float, (b, 3, 3), path)
    curvature = take(arrays, "body_curvature_per_m", float, (b,), path)
    stiffness = take(arrays, "material_stiffness_pa", float, (n, 6, 6), path)
    materials = [
        Material(
            stiffness_pa=stiffness[i],
            **{
                **msgspec.structs.asdict(x),
                "residual": unpack_residual(x.residual, arrays, i, path),
                "form": unpack_form(x.form, arrays, i, path),
            },
        )
        for i, x in enumerate(header.materials)
    ]
    models = unpack_models(header.models, arrays, kept, path)
    bodies = [
        unpack_body(
            x,
            material=pick(materials, x.material, path),
            model=pick(models, x.model, path),
            inertia_kg_m2=inertia[i],
            curvature_per_m=float(curvature[i]),
            flat_faces_m=faces[i],
        )
        for i, x in enumerate(header.bodies)
    ]
    return ContactLog(
        bodies=tuple(bodies),
        steps=read_steps(arrays, [x.name for x in header.bodies], path),
        sensors=tuple(unpack_sensor(sensor, arrays, i, path) for i, sensor in enumerate(header.sensors)),
        sr=header.sr,
        seed=header.seed,
        air=Air(header.air_density_kg_m3, header.air_sound_speed_m_s),
        events=tuple(header.events),
        engine=header.engine,
        versions=header.versions,
        changes=tuple(unpack_change(change) for change in header.changes),
        residual=header.residual,
        supports=header.supports,
        image=header.image,
    )
