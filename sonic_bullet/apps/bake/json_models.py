"""BakedModel <-> .json: the plain form, described field by field in docs/reference/baked.md."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sonic_bullet.apps.bake.baked_form import BAKED_FORMAT, BakedFile, BodyForm, common_form, model_of
from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.files.storage.atomic import replacing
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.files.storage.typed_json import decode_json
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
    with replacing(path) as file:
        file.write(json_bytes(BakedFile(format=BAKED_FORMAT, bodies=bodies)) + b"\n")


def _shortest(values: Array) -> Array:
    """Convert float32 numbers to doubles of fewest digits that are the same float32: a file half as long."""
    return values.astype(np.float32).astype(str).astype(float)


def read_json_models(path: str | os.PathLike[str]) -> tuple[BakedModel, ...]:
    """Read the models that `write_json_models` wrote. Raises FileError, RecordError."""
    largest_bytes = 1 << 30
    place = Path(path)
    if place.stat().st_size > largest_bytes:
        raise FileError(f"{path} is larger than a gigabyte", "bake fewer modes or points")
    form = decode_json(place.read_bytes(), BakedFile, f"baked model {path}", FileError, BAKED_REMEDY)
    if form.format != BAKED_FORMAT:
        raise FileError(f"{path} has format '{form.format}', wanted '{BAKED_FORMAT}'", "bake it again")
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
