"""Header of a contact log: conversion of records to JSON and back, except their arrays.

Body, Material, Sensor, Change -> structs (msgspec) -> JSON -> structs -> the same records; arrays are other entries
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from sonic_bullet.files.models import LoggedModel
from sonic_bullet.files.rows.surface_forms import LoggedForm, pack_form, track_arrays
from sonic_bullet.files.storage.container import REMEDY, take
from sonic_bullet.files.storage.json_records import fill_record
from sonic_bullet.files.storage.json_text import as_json_text, json_bytes
from sonic_bullet.records import (
    Ambisonics,
    Array,
    Binaural,
    Body,
    ContactMicrophone,
    Head,
    Material,
    Microphone,
    MicrophonePath,
    ModalSum,
    Residual,
    Sensor,
    SensorResponse,
    Vibrometer,
)
from sonic_bullet.records.contacts import Event
from sonic_bullet.records.errors import LogError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.simulated import Change

RESIDUAL_ARRAYS: dict[str, tuple[int | None, ...]] = {
    **{f"{part}_{name}": (None,) for part in ("mode", "line") for name in ("freq_hz", "decay_per_s", "amplitude")},
    "freq_hz": (None,),
    "time_s": (None,),
    "power_per_hz": (None, None),
}
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


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
    octave_rms_m: tuple[float, ...] | None = None
    form: LoggedForm | None = None


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
    dynamics: dict[str, float] = {}
    options: ModalOptions | None = None
    mounting: str | float = "free"
    silent: bool = False
    gain_db: float = 0.0


class _Change(msgspec.Struct):
    step: int
    body: int | None
    values: dict[str, float | None]


class _Path(msgspec.Struct, omit_defaults=True):
    time_s: list[float]
    position_m: list[Vector]
    quaternion_xyzw: list[Quaternion] | None = None


class _Microphone(msgspec.Struct, tag="microphone", omit_defaults=True):
    position_m: Vector
    quaternion_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)
    body_id: int | None = None
    link: int = -1
    path: _Path | None = None
    ambisonics: int | None = None
    head: str | None = None
    head_sr: int = 0
    directivity: bool = False


class _Vibrometer(msgspec.Struct, tag="vibrometer"):
    body_id: int
    link: int
    point_m: Vector
    direction: Vector


class _ContactMicrophone(_Vibrometer, tag="contact-microphone", omit_defaults=True):
    noise_m_s2_rthz: float = 0.0
    has_response: bool = False


class _ModalSum(msgspec.Struct, tag="modal-sum"):
    scale: float


_Sensor = _Microphone | _Vibrometer | _ContactMicrophone | _ModalSum


class LogHeader(msgspec.Struct):
    """The header. A field that a log may omit has its default: not known, or none."""

    format: str
    sr: int
    seed: int
    air_density_kg_m3: float
    air_sound_speed_m_s: float
    sensors: list[_Sensor]
    materials: list[_Material]
    models: list[LoggedModel]
    bodies: list[_Body]
    events: list[Event] = []
    engine: dict[str, float] = {}
    versions: dict[str, str] = {}
    changes: list[_Change] = []
    residual: bool = True
    supports: bool = False
    image: bool = False


def material_key(material: Material) -> bytes:
    """Return the content of a material, by which equal ones are stored once."""
    more = (
        b"".join(getattr(material.residual, name).tobytes() for name in RESIDUAL_ARRAYS)
        if material.residual is not None
        else b""
    )
    more += b"".join(track.tobytes() for track in track_arrays(0, material).values())
    return json_bytes(pack_material(material)) + material.stiffness_pa.tobytes() + more


def pack_material(x: Material) -> _Material:
    """Convert a material to the header's struct."""
    return fill_record(
        _Material,
        x,
        residual=None if x.residual is None else fill_record(_Residual, x.residual),
        octave_rms_m=None if x.octave_rms_m is None else tuple(x.octave_rms_m.tolist()),
        form=pack_form(x.form),
    )


def pack_body(x: Body, material: int | None, model: int | None) -> _Body:
    """Convert a body to the header's struct; material, model: their indices in the log."""
    return fill_record(_Body, x, material=material, model=model, dynamics=pack_values(x.dynamics))


def unpack_body(x: _Body, **parts: Any) -> Body:
    """Build the body of that entry; parts: its fields outside the header; raises RecordError."""
    return Body(**{**msgspec.structs.asdict(x), **parts})


def pack_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Make the names of values valid in JSON."""
    return {as_json_text(name): x for name, x in values.items()}


def pack_change(x: Change) -> _Change:
    """Convert a change to the header's struct."""
    return fill_record(_Change, x, values=pack_values(x.values))


def unpack_change(x: _Change) -> Change:
    """Build the change of that entry; raises LogError, RecordError."""
    return Change(**msgspec.structs.asdict(x))


def pack_sensor(sensor: Sensor) -> _Sensor:
    """Convert a sensor to the header's struct."""
    if isinstance(sensor, Microphone):
        return _pack_microphone(sensor)
    if isinstance(sensor, Vibrometer):
        place: dict[str, Any] = {"point_m": _vector(sensor.point_m), "direction": _vector(sensor.direction)}
        if isinstance(sensor, ContactMicrophone):
            return fill_record(_ContactMicrophone, sensor, has_response=sensor.response is not None, **place)
        return fill_record(_Vibrometer, sensor, **place)
    return fill_record(_ModalSum, sensor)


def _pack_microphone(one: Microphone) -> _Microphone:
    path, head = one.path, one.head if isinstance(one, Binaural) else None
    turned = (
        None if path is None or path.quaternion_xyzw is None else [_to_quaternion(row) for row in path.quaternion_xyzw]
    )
    return fill_record(
        _Microphone,
        one,
        position_m=_vector(one.position_m),
        quaternion_xyzw=_to_quaternion(one.quaternion_xyzw),
        path=None if path is None else _Path(path.time_s.tolist(), [_vector(row) for row in path.position_m], turned),
        ambisonics=one.order if isinstance(one, Ambisonics) else None,
        head=None if head is None else as_json_text(head.name),
        head_sr=0 if head is None else int(head.sr),
    )


def sensor_arrays(sensors: Sequence[Sensor]) -> dict[str, Array]:
    """List the arrays that lie beside the header: responses of heads and sensors, by the number of the sensor."""
    touching = {
        f"response{i}_{name}": getattr(sensor.response, name)
        for i, sensor in enumerate(sensors)
        if isinstance(sensor, ContactMicrophone) and sensor.response is not None
        for name in ("freq_hz", "magnitude")
    }
    return touching | {
        f"head{i}_{name}": getattr(sensor.head, name)
        for i, sensor in enumerate(sensors)
        if isinstance(sensor, Binaural)
        for name in ("direction", "response")
    }


def _to_quaternion(array: Array) -> Quaternion:
    x, y, z, w = (float(value) for value in array)
    return x, y, z, w


def _vector(array: Array) -> Vector:
    x, y, z = (float(value) for value in array)
    return x, y, z


def unpack_residual(header: _Residual | None, arrays: Mapping[str, Array], index: int, path: object) -> Residual | None:
    """Build the residual of material ``index``, where it has one; raises LogError, RecordError."""
    if header is None:
        return None
    parts = {
        name: take(arrays, f"residual{index}_{name}", float, shape, path) for name, shape in RESIDUAL_ARRAYS.items()
    }
    return Residual(**parts, clip_energy=header.clip_energy, source=header.source)


def unpack_sensor(sensor: _Sensor, arrays: Mapping[str, Array], index: int, path: object) -> Sensor:
    """Build the sensor of entry ``index``; raises LogError, RecordError."""
    if isinstance(sensor, _Microphone):
        return _unpack_microphone(sensor, arrays, index, path)
    if isinstance(sensor, _Vibrometer):
        place = (sensor.body_id, np.array(sensor.point_m), np.array(sensor.direction), sensor.link)
        made = Vibrometer(*place)
        if isinstance(sensor, _ContactMicrophone):
            parts = [take(arrays, f"response{index}_{name}", float, (None,), path) for name in ("freq_hz", "magnitude")
                     if sensor.has_response]  # fmt: skip
            response = SensorResponse(*parts) if parts else None
            made = ContactMicrophone(*place, response=response, noise_m_s2_rthz=sensor.noise_m_s2_rthz)
        # already of unit length: dividing again would move its last bit
        object.__setattr__(made, "direction", np.array(sensor.direction))
        made.direction.setflags(write=False)
        return made
    return ModalSum(sensor.scale)


def _unpack_microphone(x: _Microphone, arrays: Mapping[str, Array], index: int, path: object) -> Microphone:
    along = None
    if x.path is not None:
        along = MicrophonePath(
            np.array(x.path.time_s),
            np.array(x.path.position_m),
            None if x.path.quaternion_xyzw is None else np.array(x.path.quaternion_xyzw),
        )
    how: dict[str, Any] = {
        "position_m": None if along is not None else np.array(x.position_m),
        "quaternion_xyzw": np.array(x.quaternion_xyzw),
        "body_id": x.body_id,
        "link": x.link,
        "path": along,
        "directivity": x.directivity,
    }
    if x.head is not None:
        direction = take(arrays, f"head{index}_direction", float, (None, 3), path)
        response = take(arrays, f"head{index}_response", float, (len(direction), 2, None), path)
        return Binaural(**how, head=Head(direction, response, x.head_sr, x.head))
    return Microphone(**how) if x.ambisonics is None else Ambisonics(**how, order=x.ambisonics)


def pick(things: list[Any], index: int | None, path: object) -> Any:
    """Return the object of that index, None without an index; LogError where it is out of range."""
    if index is not None and not 0 <= index < len(things):
        raise LogError(f"{path}: a body refers to a part that is not there", REMEDY)
    return None if index is None else things[index]
