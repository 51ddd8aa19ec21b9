"""Modal models on disk, alone, inside a contact log or in the cache: every number bit for bit, no pickle.

format "sonic-bullet-model/2"           one model: model0_<array> as `logs` describes them, in `container`'s npz

    array (…) of n bytes each -> planes (n, …) u1: all first bytes, all second ones … -> deflated
    shape (v, 3, m) f4 = q·2^e -> differences of q u2 in planes, e (m,) i2;   else, as it is, in planes
        [`records.mode_shapes`]

Bytes of one kind side by side deflate to less. A model by reference is one file in the cache, model-<sha256>.npz.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from sonic_bullet.files.storage import cache
from sonic_bullet.files.storage.atomic import cannot
from sonic_bullet.files.storage.cache import LIMIT_VARIABLE, touch
from sonic_bullet.files.storage.container import REMEDY, distinct, read_container, take, write_container
from sonic_bullet.files.storage.json_records import fill_record
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.records.bodies import Solution, TouchedSurface
from sonic_bullet.records.coerce import nearest, quote
from sonic_bullet.records.errors import FileError, LogError, excerpt
from sonic_bullet.records.mode_shapes import differences, from_multiples, sum_differences, whole_multiples

MODEL_FORMAT = "sonic-bullet-model/2"
PACKED = "model"
"""Prefix of the arrays that are deflated."""
MODEL_ARRAYS: dict[str, tuple[type, tuple[int | None, ...]]] = {
    "freq_hz": (float, (None,)),
    "decay_per_s": (float, (None,)),
    "shape": (np.float32, (None, 3, None)),
    "vertex_m": (float, (None, 3)),
    "face": (np.int32, (None, 3)),
    "curvature_per_m": (float, (None,)),
}
BENT_ARRAYS = {"bend_s2_m2": "bend_s2_m2", "choke_s_m": "damping_growth_s_m", "stands_for": "stands_for"}
"""Array in the file -> field, of models whose modes depend on their level, or stand for several; others have none."""
TOUCHED_ARRAYS: dict[str, tuple[type, tuple[int | None, ...]]] = {
    "touched_vertex_m": (float, (None, 3)),
    "touched_face": (np.int32, (None, 3)),
    "touched_curvature_per_m": (float, (None,)),
}
"""Fields of `TouchedSurface`, of models that have one."""


ModelHash = Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]
"""Entry in the header of a model that is in the cache."""


class ModelEntry(msgspec.Struct, omit_defaults=True):
    """A model in the header, without its arrays."""

    volume_m3: float
    mass_kg: float
    dropped: int
    note: str
    damping_growth_power: float = msgspec.field(default=1.0, name="choke_power")
    includes_radiation: bool = False
    assumed_wall_m: float | None = None
    solution: Solution = "full"


LoggedModel = ModelEntry | ModelHash


class _ModelHeader(msgspec.Struct):
    format: str
    model: ModelEntry


def write_model(path: str | os.PathLike[str], model: ModalModel) -> None:
    """Write one modal model, whole or not at all; raises FileError."""
    write_container(path, _ModelHeader(MODEL_FORMAT, _pack_model(model)), _packed_arrays(model, 0), PACKED)


def read_model(path: str | os.PathLike[str]) -> ModalModel:
    """Read the modal model that `write_model` wrote.

    Raises
    ------
    FileError
        There is no such file.
    LogError
        It is cut, foreign, forged or inconsistent.
    """
    header, arrays = read_container(path, _ModelHeader, MODEL_FORMAT, "modal model")
    with reading_file(path, "modal model", LogError, REMEDY):
        return _unpack_model(header.model, arrays, 0, path)


def pack_models(
    models: Sequence[ModalModel | None], where: object
) -> tuple[list[LoggedModel], list[int | None], dict[str, Array]]:
    """Pack the models of a log's bodies, each once.

    Parameters
    ----------
    where
        One of `places`; by reference they are stored in the cache.

    Returns
    -------
    tuple
        Entries of the header, the number of each body's model, and the arrays by their names in the file.

    Raises
    ------
    FileError
        `where` is unknown, or the cache cannot take them.
    """
    places = ("included", "reference")  # place of a log's models: in it, or in the cache
    if not isinstance(where, str) or where not in places:
        raise FileError(f"models is {quote(where)}", nearest(str(where), places))
    different, number = distinct(list(models), model_key)
    if where == "reference":
        return [*_keep_models(different)], number, {}
    arrays: dict[str, Array] = {}
    for i, model in enumerate(different):
        arrays |= _packed_arrays(model, i)
    return [_pack_model(model) for model in different], number, arrays


def recalled_models(
    entries: Sequence[LoggedModel], users: Sequence[tuple[int | None, str]], path: object
) -> dict[int, ModalModel]:
    """Load from the cache the models, by number, that the log ``path`` refers to.

    users: number and name of each body's model.

    Raises
    ------
    LogError
        The cache lacks one.
    """
    found = {i: _kept_model(entry) for i, entry in enumerate(entries) if isinstance(entry, str)}
    models = {i: model for i, model in found.items() if model is not None}
    if len(models) < len(found):
        names = [excerpt(name, 40) for i, name in users if i in found and i not in models]
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        raise LogError(
            f"{path} leaves the modes of {', '.join(names[:3])}{more} to the cache, and they are not in "
            f"{cache.folder('default')}",
            "set SONIC_BULLET_CACHE to the folder they are in, or write the log anew from its scene",
        )
    return models


def unpack_models(
    entries: Sequence[LoggedModel],
    arrays: Mapping[str, Array],
    recalled: Mapping[int, ModalModel],
    path: object,
) -> list[ModalModel]:
    """Build the models of a log's header, those in the cache as recalled; raises LogError."""
    return [
        recalled[i] if isinstance(entry, str) else _unpack_model(entry, arrays, i, path)
        for i, entry in enumerate(entries)
    ]


def _keep_models(models: Sequence[ModalModel]) -> list[str]:
    """Store models in the cache for logs that refer to them; return the SHA-256 of each.

    Raises FileError where there is no cache, or it cannot take them all.
    """
    keys, place = [model_key(model) for model in models], cache.folder("default")
    instead = "set SONIC_BULLET_CACHE to a folder that you may write to, or leave the models in the log"
    if place is None:
        raise FileError("there is no cache that models could be left to", instead)
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise cannot("make the cache's folder", place, error) from error
    for key, model in zip(keys, models, strict=True):
        if _kept_model(key) is None:
            write_model(_kept_at(place, key), model)
    cache.bound(place)
    if not all(_kept_at(place, key).is_file() for key in keys):
        raise FileError(
            "the cache is too small for the models of this log", f"raise {LIMIT_VARIABLE}, or leave them in the log"
        )
    return keys


def _kept_model(key: str) -> ModalModel | None:
    """Load the model of that SHA-256 from the cache; None where it is missing or another."""
    place = cache.folder("default")
    if place is None:
        return None
    try:
        model = read_model(_kept_at(place, key))
    except (FileError, LogError):
        return None
    if model_key(model) != key:
        return None
    touch(_kept_at(place, key))
    return model


def _kept_at(place: Path, key: str) -> Path:
    return place / f"model-{key}.npz"


def model_key(model: ModalModel) -> str:
    """Return the SHA-256 of a model's content in hexadecimal; equal models are stored once."""
    digest = hashlib.sha256(json_bytes(_pack_model(model)))
    for name, array in _arrays(model).items():
        digest.update(f"model0_{name} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _pack_model(x: ModalModel) -> ModelEntry:
    """Convert a model to the header's struct."""
    return fill_record(ModelEntry, x, assumed_wall_m=x.assumed_wall_m or None)


def _arrays(model: ModalModel) -> dict[str, Array]:
    """Return the arrays of a model, by their names in a file."""
    bent = {name: field for name, field in BENT_ARRAYS.items() if getattr(model, field) is not None}
    own = {name: getattr(model, field) for name, field in ({name: name for name in MODEL_ARRAYS} | bent).items()}
    if model.touched is None:
        return own
    return own | {name: getattr(model.touched, name.removeprefix("touched_")) for name in TOUCHED_ARRAYS}


def _packed_arrays(model: ModalModel, index: int) -> dict[str, Array]:
    """Return the arrays of a model as a file holds them, by their names there."""
    arrays = _arrays(model)
    exact = whole_multiples(model.shape)
    if exact is not None:
        arrays |= {"shape": differences(exact[0], model.face), "shape_exponent": exact[1]}
    return {f"model{index}_{name}": _planes(array) for name, array in arrays.items()}


def _planes(array: Array) -> Array:
    """Convert an array (…) of n bytes each to planes (n, …) u1: all first bytes, all second ones, and so on."""
    parts = np.ascontiguousarray(array)[..., None].view(np.uint8)
    return np.ascontiguousarray(np.moveaxis(parts, -1, 0))


def _take_array(
    arrays: Mapping[str, Array], name: str, dtype: Any, shape: tuple[int | None, ...], path: object
) -> Array:
    """Read an array back from the planes ``name``; raises LogError."""
    planes = take(arrays, name, np.uint8, (np.dtype(dtype).itemsize, *shape), path)
    found = np.ascontiguousarray(np.moveaxis(planes, 0, -1)).view(dtype)
    return np.asarray(found.reshape(planes.shape[1:]))


def _unpack_model(header: ModelEntry, arrays: Mapping[str, Array], index: int, path: object) -> ModalModel:
    """Build a model from its header and arrays; raises LogError, RecordError."""
    exact = f"model{index}_shape_exponent" in arrays
    kinds = MODEL_ARRAYS | ({"shape": (np.uint16, MODEL_ARRAYS["shape"][1])} if exact else {})
    parts = {
        name: _take_array(arrays, f"model{index}_{name}", dtype, shape, path) for name, (dtype, shape) in kinds.items()
    }
    if exact:
        step, face = parts["shape"], parts["face"]
        exponent = _take_array(arrays, f"model{index}_shape_exponent", np.int16, (step.shape[2],), path)
        if face.min(initial=0) < 0 or face.max(initial=-1) >= len(step):
            raise LogError(f"{path}: faces point at missing vertices", REMEDY)
        parts["shape"] = from_multiples(sum_differences(step, face), exponent)
    parts |= {
        field: _take_array(arrays, f"model{index}_{name}", float, (None,), path)
        for name, field in BENT_ARRAYS.items()
        if f"model{index}_{name}" in arrays
    }
    wall_m = 0.0 if header.assumed_wall_m is None else header.assumed_wall_m
    own = {"assumed_wall_m": wall_m, "touched": _take_touched(arrays, index, path)}
    return ModalModel(**msgspec.structs.asdict(header) | parts | own)


def _take_touched(arrays: Mapping[str, Array], index: int, path: object) -> TouchedSurface | None:
    """Read the surface that a model is touched on, None where it has none of its own; raises LogError, RecordError."""
    if f"model{index}_touched_vertex_m" not in arrays:
        return None
    return TouchedSurface(
        *(_take_array(arrays, f"model{index}_{name}", *kind, path) for name, kind in TOUCHED_ARRAYS.items())
    )
