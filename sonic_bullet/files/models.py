"""Modal models on disk, alone or inside a contact log: every number bit for bit, no pickle.

format "sonic-bullet-model/1"           one model: model0_<array> as `logs` describes them, in `container`'s npz
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping

import msgspec
import numpy as np

from sonic_bullet.files.container import REMEDY, read_container, take, write_container
from sonic_bullet.files.reading import reading
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.records.errors import LogError

MODEL_FORMAT = "sonic-bullet-model/1"
MODEL_ARRAYS: dict[str, tuple[type, tuple[int | None, ...]]] = {
    "freq_hz": (float, (None,)),
    "decay_per_s": (float, (None,)),
    "shape": (np.float32, (None, 3, None)),
    "vertex_m": (float, (None, 3)),
    "face": (np.int32, (None, 3)),
    "curvature_per_m": (float, (None,)),
}
BENT_ARRAYS = {"bend_s2_m2": "bend_s2_m2", "choke_s_m": "damping_growth_s_m"}
"""Array in the file -> field, of models whose modes go with their level; others have none."""


class ModelEntry(msgspec.Struct, omit_defaults=True):
    """What the header says of a model: all that is no array."""

    volume_m3: float
    mass_kg: float
    dropped: int
    note: str
    damping_growth_power: float = msgspec.field(default=1.0, name="choke_power")
    includes_radiation: bool = False


class _ModelHeader(msgspec.Struct):
    format: str
    model: ModelEntry


def write_model(path: str | os.PathLike[str], model: ModalModel) -> None:
    """Write one modal model, whole or not at all. Raises FileError."""
    write_container(path, _ModelHeader(MODEL_FORMAT, pack_model(model)), model_arrays(model, 0))


def read_model(path: str | os.PathLike[str]) -> ModalModel:
    """The modal model that `write_model` wrote.

    Raises FileError (no such file) and LogError (cut, foreign, forged, inconsistent).
    """
    header, arrays = read_container(path, _ModelHeader, MODEL_FORMAT, "modal model")
    with reading(path, "modal model", LogError, REMEDY):
        return unpack_model(header.model, arrays, 0, path)


def model_key(model: ModalModel) -> bytes:
    """Digest of a model's content: equal models are stored once."""
    digest = hashlib.sha256(msgspec.json.encode(pack_model(model)))
    for name, array in model_arrays(model, 0).items():
        digest.update(f"{name} {array.shape}".encode() + array.tobytes())
    return digest.digest()


def pack_model(x: ModalModel) -> ModelEntry:
    """The header's part of a model."""
    return ModelEntry(
        float(x.volume_m3),
        float(x.mass_kg),
        int(x.dropped),
        as_json_text(x.note),
        float(x.damping_growth_power),
        bool(x.includes_radiation),
    )


def model_arrays(model: ModalModel, index: int) -> dict[str, Array]:
    """The arrays of a model, by their names in the file."""
    bent = {name: field for name, field in BENT_ARRAYS.items() if getattr(model, field) is not None}
    return {
        f"model{index}_{name}": getattr(model, field)
        for name, field in ({name: name for name in MODEL_ARRAYS} | bent).items()
    }


def unpack_model(header: ModelEntry, arrays: Mapping[str, Array], index: int, path: object) -> ModalModel:
    """The model that these were made of. Raises LogError, RecordError."""
    parts = {
        name: take(arrays, f"model{index}_{name}", dtype, shape, path) for name, (dtype, shape) in MODEL_ARRAYS.items()
    }
    parts |= {
        field: take(arrays, f"model{index}_{name}", float, (None,), path)
        for name, field in BENT_ARRAYS.items()
        if f"model{index}_{name}" in arrays
    }
    return ModalModel(
        **parts,
        volume_m3=header.volume_m3,
        mass_kg=header.mass_kg,
        dropped=header.dropped,
        note=header.note,
        damping_growth_power=header.damping_growth_power,
        includes_radiation=header.includes_radiation,
    )


def as_json_text(text: str) -> str:
    """``text`` as JSON can hold it: lone surrogates, as undecodable names carry them, become question marks."""
    return text.encode("utf-8", "replace").decode()
