"""Contact logs on disk: every number bit for bit, no pickle.

The container is `container`'s npz. Scalars, names and references are JSON (`header.npy`), all arrays are entries of
their own:

    format "sonic-bullet-contacts/3"; b bodies, s steps, p = Σ bodies known at each step, k = Σ contacts of each step
      step_dt_s (s,) f8                     length of each step
      step_gravity_m_s2 (s, 3) f8            gravity in the world
      step_body_count, step_contact_count (s,) i8   how many of the p and k rows are each step's, in order
      pose_position_m (p, 3) f8, pose_quaternion_xyzw (p, 4) f8, pose_teleported (p,) bool
      contact_<field> (k, …)
          the fields of `Contacts`: a, b i4; point_a_m, point_b_m, normal, impulse_n_s, slip_m_s,
                                            sweep_m_s, approach_m_s, gap_m f8
      body_inertia_kg_m2 (b, 3, 3) f8, body_curvature_per_m (b,) f8 (NaN: by the model's surface)
      material_stiffness_pa (n, 6, 6) f8    materials and models are stored once each, however many bodies share them
      residual<i>_<field> f8                 of material i, where it has one: the arrays of `Residual`
      model<i>_freq_hz, _decay_per_s (m,) f8, _shape (v, 3, m) f4, _vertex_m (v, 3) f8, _face (f, 3) i4,
          _curvature_per_m (f,) f8
      model<i>_bend_s2_m2, _choke_s_m (m,) f8  only where its modes go with their level
          all arrays of models: deflated, as planes (n, …) u1 of numbers of n bytes: all first bytes, all second ones, …
      model<i>_shape u2, model<i>_shape_exponent (m,) i2
          in place of _shape f4, where shapes are whole multiples of powers of two, as those that are solved here are:
          `differences` of those numbers, and the powers (records/mode_shapes.py)
      models (in the header)
          what is no array of each; or its SHA-256, where it lies in the cache
      events (in the header)
          in order: {"kind": "quench", "step": the step before which it happened, "body": index, or null: all}
    format "sonic-bullet-contacts/2"        models' arrays are not deflated, and of their own types; no SHA-256
    format "sonic-bullet-contacts/1"        nor events

A reader checks sizes before it allocates and records check their invariants, so a cut, foreign or forged file is one
line of LogError.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

from sonic_bullet.files.audio import check_sr
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.container import REMEDY, distinct, read_container, take, write_container
from sonic_bullet.files.models import PACKED, LoggedModel, as_json_text, pack_models, recalled_models, unpack_models
from sonic_bullet.files.reading import reading
from sonic_bullet.records import (
    Air,
    Array,
    Body,
    Material,
    Microphone,
    ModalModel,
    ModalSum,
    Residual,
    Sensor,
    Vibrometer,
)
from sonic_bullet.records.arrays import frozen_array
from sonic_bullet.records.coerce import as_number, as_path
from sonic_bullet.records.contacts import ROW_FIELDS, Contacts, Event, Step
from sonic_bullet.records.errors import LogError

LOG_FORMATS = ("sonic-bullet-contacts/3", "sonic-bullet-contacts/2", "sonic-bullet-contacts/1")
"""What is read; the first is what is written."""
RESIDUAL_ARRAYS: dict[str, tuple[int | None, ...]] = {
    **{f"{part}_{name}": (None,) for part in ("mode", "line") for name in ("freq_hz", "decay_per_s", "amplitude")},
    "freq_hz": (None,),
    "time_s": (None,),
    "power_per_hz": (None, None),
}
Vector = tuple[float, float, float]


class _Residual(msgspec.Struct):
    clip_energy: float
    source: str


class _Material(msgspec.Struct, omit_defaults=True):
    name: str
    density_kg_m3: float
    alpha_per_s: float | None
    beta_s: float | None
    roughness_m: float
    hurst: float
    restitution: float
    source: str
    residual: _Residual | None = None
    includes_radiation: bool = False


class _Body(msgspec.Struct):
    body_id: int
    link: int
    epoch: int
    name: str
    mass_kg: float
    volume_m3: float
    since_step: int
    until_step: int
    material: int | None
    model: int | None


class _Microphone(msgspec.Struct, tag="microphone"):
    position_m: Vector


class _Vibrometer(msgspec.Struct, tag="vibrometer"):
    body_id: int
    link: int
    point_m: Vector
    direction: Vector


class _ModalSum(msgspec.Struct, tag="modal-sum"):
    scale: float


class _LogHeader(msgspec.Struct):
    format: str
    sr: int
    seed: int
    air_density_kg_m3: float
    air_sound_speed_m_s: float
    sensors: list[_Microphone | _Vibrometer | _ModalSum]
    materials: list[_Material]
    models: list[LoggedModel]
    bodies: list[_Body]
    events: list[Event] = []


def write_log(path: str | os.PathLike[str], log: ContactLog, models: object = "included") -> None:
    """Write a contact log, whole or not at all; equal logs give equal bytes.

    models: "included", or "reference": they are left to the cache, and the log names them. Raises FileError.
    """
    materials, material_of = distinct([body.material for body in log.bodies], _material_key)
    entries, model_of, model_arrays = pack_models([body.model for body in log.bodies], models)
    header = _LogHeader(
        format=LOG_FORMATS[0],
        sr=int(log.sr),
        seed=int(log.seed),
        air_density_kg_m3=float(log.air.density_kg_m3),
        air_sound_speed_m_s=float(log.air.sound_speed_m_s),
        sensors=[_pack_sensor(sensor) for sensor in log.sensors],
        materials=[_pack_material(material) for material in materials],
        models=entries,
        bodies=[_pack_body(body, m, n) for body, m, n in zip(log.bodies, material_of, model_of, strict=True)],
        events=list(log.events),
    )
    steps = log.steps
    rows = Contacts.joined([step.contacts for step in steps])
    arrays: dict[str, Array] = {
        "step_dt_s": np.array([step.dt_s for step in steps], float),
        "step_gravity_m_s2": np.reshape([step.gravity_m_s2 for step in steps], (-1, 3)).astype(float),
        "step_body_count": np.array([len(step.position_m) for step in steps], np.int64),
        "step_contact_count": np.array([len(step.contacts) for step in steps], np.int64),
        "pose_position_m": np.concatenate([np.zeros((0, 3)), *(step.position_m for step in steps)]),
        "pose_quaternion_xyzw": np.concatenate([np.zeros((0, 4)), *(step.quaternion_xyzw for step in steps)]),
        "pose_teleported": np.concatenate([np.zeros(0, bool), *(step.teleported for step in steps)]),
        "body_inertia_kg_m2": np.reshape([body.inertia_kg_m2 for body in log.bodies], (-1, 3, 3)).astype(float),
        "body_curvature_per_m": np.array([body.curvature_per_m for body in log.bodies], float),
        "material_stiffness_pa": np.reshape([material.stiffness_pa for material in materials], (-1, 6, 6)).astype(
            float
        ),
    }
    arrays |= {f"contact_{name}": getattr(rows, name) for name in ROW_FIELDS}
    arrays |= model_arrays
    for i, material in enumerate(materials):
        if material.residual is not None:
            arrays |= {f"residual{i}_{name}": getattr(material.residual, name) for name in RESIDUAL_ARRAYS}
    write_container(path, header, arrays, PACKED)


def read_log(path: str | os.PathLike[str]) -> ContactLog:
    """The contact log that `write_log` wrote.

    Raises FileError (no such file) and LogError (cut, foreign, forged, inconsistent, or of models that the cache has
    not).
    """
    path = as_path(path, "path", "name a contact log (.npz)")
    header, arrays = read_container(path, _LogHeader, LOG_FORMATS, "contact log", PACKED)
    kept = recalled_models(header.models, [(body.model, body.name) for body in header.bodies], path)
    with reading(path, "contact log", LogError, REMEDY):
        check_sr(header.sr)
        return _unpack_log(header, arrays, kept, path)


def _material_key(material: Material) -> bytes:
    more = (
        b"".join(getattr(material.residual, name).tobytes() for name in RESIDUAL_ARRAYS)
        if material.residual is not None
        else b""
    )
    return msgspec.json.encode(_pack_material(material)) + material.stiffness_pa.tobytes() + more


def _pack_material(x: Material) -> _Material:
    return _Material(
        name=as_json_text(x.name),
        density_kg_m3=float(x.density_kg_m3),
        alpha_per_s=None if x.alpha_per_s is None else float(x.alpha_per_s),
        beta_s=None if x.beta_s is None else float(x.beta_s),
        roughness_m=float(x.roughness_m),
        hurst=float(x.hurst),
        restitution=float(x.restitution),
        source=as_json_text(x.source),
        residual=None
        if x.residual is None
        else _Residual(float(x.residual.clip_energy), as_json_text(x.residual.source)),
        includes_radiation=bool(x.includes_radiation),
    )


def _pack_body(x: Body, material: int | None, model: int | None) -> _Body:
    numbers = (int(x.body_id), int(x.link), int(x.epoch))
    return _Body(
        *numbers,
        as_json_text(x.name),
        float(x.mass_kg),
        float(x.volume_m3),
        int(x.since_step),
        int(x.until_step),
        material,
        model,
    )


def _pack_sensor(sensor: Sensor) -> _Microphone | _Vibrometer | _ModalSum:
    if isinstance(sensor, Microphone):
        return _Microphone(_vector(sensor.position_m))
    if isinstance(sensor, Vibrometer):
        return _Vibrometer(int(sensor.body_id), int(sensor.link), _vector(sensor.point_m), _vector(sensor.direction))
    return _ModalSum(float(sensor.scale))


def _vector(array: Array) -> Vector:
    x, y, z = (float(value) for value in array)
    return x, y, z


def _unpack_residual(
    header: _Residual | None, arrays: Mapping[str, Array], index: int, path: object
) -> Residual | None:
    if header is None:
        return None
    parts = {
        name: take(arrays, f"residual{index}_{name}", float, shape, path) for name, shape in RESIDUAL_ARRAYS.items()
    }
    return Residual(**parts, clip_energy=header.clip_energy, source=header.source)


def _unpack_sensor(sensor: _Microphone | _Vibrometer | _ModalSum) -> Sensor:
    if isinstance(sensor, _Microphone):
        return Microphone(np.array(sensor.position_m))
    if isinstance(sensor, _Vibrometer):
        made = Vibrometer(sensor.body_id, np.array(sensor.point_m), np.array(sensor.direction), sensor.link)
        # already of unit length: dividing again would move its last bit
        object.__setattr__(made, "direction", np.array(sensor.direction))
        made.direction.setflags(write=False)
        return made
    return ModalSum(sensor.scale)


def _unpack_log(
    header: _LogHeader, arrays: Mapping[str, Array], kept: Mapping[int, ModalModel], path: object
) -> ContactLog:
    b, n = len(header.bodies), len(header.materials)
    inertia = take(arrays, "body_inertia_kg_m2", float, (b, 3, 3), path)
    curvature = take(arrays, "body_curvature_per_m", float, (b,), path)
    stiffness = take(arrays, "material_stiffness_pa", float, (n, 6, 6), path)
    materials = [
        Material(
            stiffness_pa=stiffness[i],
            **{**msgspec.structs.asdict(x), "residual": _unpack_residual(x.residual, arrays, i, path)},
        )
        for i, x in enumerate(header.materials)
    ]
    models = unpack_models(header.models, arrays, kept, path)
    bodies = [
        Body(
            **{
                **msgspec.structs.asdict(x),
                "material": _pick(materials, x.material, path),
                "model": _pick(models, x.model, path),
            },
            inertia_kg_m2=inertia[i],
            curvature_per_m=float(curvature[i]),
        )
        for i, x in enumerate(header.bodies)
    ]
    return ContactLog(
        bodies=tuple(bodies),
        steps=_unpack_steps(arrays, path),
        sensors=tuple(_unpack_sensor(sensor) for sensor in header.sensors),
        sr=header.sr,
        seed=header.seed,
        air=Air(header.air_density_kg_m3, header.air_sound_speed_m_s),
        events=tuple(header.events),
    )


def _pick(things: list[Any], index: int | None, path: object) -> Any:
    if index is not None and not 0 <= index < len(things):
        raise LogError(f"{path}: a body refers to a part that is not there", REMEDY)
    return None if index is None else things[index]


def _unpack_steps(arrays: Mapping[str, Array], path: object) -> tuple[Step, ...]:
    dt = take(arrays, "step_dt_s", float, (None,), path)
    ends = []
    for name in ("step_body_count", "step_contact_count"):
        count = take(arrays, name, np.int64, (len(dt),), path)
        if (count < 0).any() or (count > 2**40).any():
            raise LogError(f"{path}: {name} is negative or absurd", REMEDY)
        ends.append(np.concatenate([[0], np.cumsum(count)]))
    poses, contacts = ends
    p, k = int(poses[-1]), int(contacts[-1])
    position = take(arrays, "pose_position_m", float, (p, 3), path)
    quaternion = take(arrays, "pose_quaternion_xyzw", float, (p, 4), path)
    gravity = take(arrays, "step_gravity_m_s2", float, (len(dt), 3), path)
    teleported = take(arrays, "pose_teleported", bool, (p,), path)
    rows = Contacts(
        **{name: take(arrays, f"contact_{name}", dtype, (k, *tail), path) for name, (dtype, tail) in ROW_FIELDS.items()}
    )
    if k and min(rows.a.min(), rows.b.min()) < 0:
        raise LogError(f"{path}: a contact names a body below zero", REMEDY)
    if (np.maximum(rows.a, rows.b) >= np.repeat(np.diff(poses), np.diff(contacts))).any():
        raise LogError(f"{path}: a contact names a body that the step does not know", REMEDY)
    # checked whole, not step by step: hours of steps are read in a moment
    position = frozen_array(position, float, (p, 3), "step: position_m")
    quaternion = frozen_array(quaternion, float, (p, 4), "step: quaternion_xyzw")
    teleported = frozen_array(teleported, bool, (p,), "teleported")
    gravity = frozen_array(gravity, float, (len(dt), 3), "step: gravity_m_s2")
    remedy = "set a time step between 0 and 1 s with setTimeStep"
    for wrong in dt[~((dt > 0) & (dt <= 1))][:1]:
        as_number(float(wrong), "dt_s of a physics step", remedy, above=0, most=1, error=LogError)
    return tuple(
        Step.trusted(length, position[p0:p1], quaternion[p0:p1], teleported[p0:p1], rows.rows(k0, k1), gravity[i])
        for i, (length, p0, p1, k0, k1) in enumerate(
            zip(dt.tolist(), poses[:-1], poses[1:], contacts[:-1], contacts[1:], strict=True)
        )
    )
