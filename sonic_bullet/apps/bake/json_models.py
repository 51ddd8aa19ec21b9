"""BakedModel <-> .json: the plain form, described field by field in docs/reference/baked.md."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from sonic_bullet.apps.bake.baked_form import BAKED_FORMAT, BakedFile, BodyForm, common_form, model_of
from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.files.storage.json_records import read_record, write_record
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError

BAKED_REMEDY = "bake it again, or mend that field; docs/reference/baked.md describes the file"


def write_json_models(path: str | os.PathLike[str], models: Sequence[BakedModel]) -> None:
    """Write models as one JSON file, whole or not at all. Raises FileError."""
    bodies = [
        BodyForm(
            name=model.name,
            point_m=[tuple(row) for row in model.point_m.tolist()],
            face=[tuple(row) for row in model.face.tolist()],
            shape_per_sqrt_kg=_shortest(model.shape.transpose(2, 0, 1)).tolist(),
            **common_form(model),
        )
        for model in models
    ]
    write_record(path, BakedFile(format=BAKED_FORMAT, bodies=bodies))


def _shortest(values: Array) -> Array:
    """Convert float32 numbers to doubles of fewest digits that are the same float32: a file half as long."""
    return values.astype(np.float32).astype(str).astype(float)


def read_json_models(path: str | os.PathLike[str]) -> tuple[BakedModel, ...]:
    """Read the models that `write_json_models` wrote. Raises FileError, RecordError."""
    form = read_record(
        path, BakedFile, "baked model", FileError, BAKED_REMEDY, version=BAKED_FORMAT, most_bytes=1 << 30
    )
    return tuple(_model(body) for body in form.bodies)


def _model(body: BodyForm) -> BakedModel:
    points, modes = len(body.point_m), len(body.modes.freq_hz)
    for number, rows in enumerate(body.shape_per_sqrt_kg, 1):
        if len(rows) != points:
            raise FileError(f"{body.name}: shape of mode {number} is at {len(rows)} of {points} points", BAKED_REMEDY)
    if len(body.shape_per_sqrt_kg) != modes:
        raise FileError(
            f"{body.name} has shapes of {len(body.shape_per_sqrt_kg)} modes, but {modes} modes", BAKED_REMEDY
        )
    shape = np.array(body.shape_per_sqrt_kg, float).reshape(modes, points, 3)
    return model_of(
        body,
        name=body.name,
        point_m=np.array(body.point_m, float).reshape(-1, 3),
        face=np.array(body.face, np.int64).reshape(-1, 3),
        shape=shape.transpose(1, 2, 0),
    )
