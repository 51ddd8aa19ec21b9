"""Entries of a contact log that hold large flat faces of bodies: how many each has, and all of them in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sonic_bullet.files.storage.container import REMEDY, take
from sonic_bullet.records import Array, Body
from sonic_bullet.records.errors import LogError


def face_arrays(bodies: Sequence[Body]) -> dict[str, Array]:
    """List the arrays; none where no body has such a face."""
    count = np.array([len(body.flat_faces_m) for body in bodies], np.int64)
    return (
        {"body_flat_face_count": count, "body_flat_face_m": np.concatenate([body.flat_faces_m for body in bodies])}
        if count.any()
        else {}
    )


def taken_faces(arrays: Mapping[str, Array], bodies: int, path: object) -> list[Array]:
    """Return the faces (k, 3, 3) of each body; raises LogError."""
    if "body_flat_face_count" not in arrays:
        return [np.zeros((0, 3, 3))] * bodies
    count = take(arrays, "body_flat_face_count", np.int64, (bodies,), path)
    faces = take(arrays, "body_flat_face_m", float, (None, 3, 3), path)
    if (count < 0).any() or int(count.sum()) != len(faces):
        raise LogError(f"{path}: flat faces of bodies and their number differ", REMEDY)
    return np.split(faces, np.cumsum(count)[:-1])
