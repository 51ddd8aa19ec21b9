"""Contacts as labels: a pair of bodies, from the step in which they meet to the one in which they separate.

ContactLog -> rows -> (pair, consecutive steps) -> one label a contact, in the order of their starts
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.models import model_key
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.records import Array
from sonic_bullet.simulators.animated import matrices


def contact_labels(log: ContactLog) -> list[dict[str, Any]]:
    """List the contacts of a log.

    Each has ``start_s``, ``end_s``, ``bodies`` and their ``materials`` (None: a body that does not sound),
    ``impulse_n_s`` (magnitude of the vector sum), ``approach_m_s`` at its start, and ``place_m`` there, in the world.
    """
    row, step, start_s = log.rows.row, log.step, log.start_s
    if not len(row):
        return []
    pair = np.sort(np.column_stack([row["a"], row["b"]]), axis=1)
    order = np.lexsort((step, pair[:, 1], pair[:, 0]))
    row, step, pair = row[order], step[order], pair[order]
    begins = np.any(np.diff(pair, axis=0, prepend=-1) != 0, axis=1) | (np.diff(step, prepend=-2) > 1)
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(row)) - 1
    sign = np.where(row["a"] == pair[:, 0], 1.0, -1.0)[:, None]
    impulse = np.linalg.norm(np.add.reduceat(sign * row["impulse_n_s"], first), axis=1)
    ends_s = np.append(start_s[1:], log.duration_s)
    labels = [
        {
            "start_s": start_s[step[i]],
            "end_s": ends_s[step[j]],
            "bodies": [log.bodies[k].name for k in pair[i]],
            "materials": [None if (m := log.bodies[k].material) is None else m.name for k in pair[i]],
            "impulse_n_s": whole,
            "approach_m_s": row["approach_m_s"][i],
            "place_m": _place_m(log, int(step[i]), row[i]),
        }
        for i, j, whole in zip(first, last, impulse, strict=True)
    ]
    return [labels[i] for i in np.argsort(step[first], kind="stable")]


def _place_m(log: ContactLog, number: int, row: Array) -> Array:
    """Return a row's point in the world (3,); points belong to the pose at the start of the step."""
    step = log.steps[number]
    at = int(np.searchsorted(step.body, row["a"]))
    return np.asarray(step.position_m[at] + matrices(step.quaternion_xyzw[at]) @ row["point_a_m"])


def log_digest(log: ContactLog) -> str:
    """Return the SHA-256 of what a log's sound is made of: steps, poses, contacts, bodies, rate, seed."""
    digest = hashlib.sha256(json_bytes([log.sr, log.seed, len(log.steps)]))
    for body in log.bodies:
        of = None if body.material is None else body.material.name
        digest.update(json_bytes([body.name, of, None if body.model is None else model_key(body.model)]))
    for block in log.blocks():
        for table in block:
            for name in table.dtype.names or ():  # fields alone: a table's padding is any bytes
                digest.update(np.ascontiguousarray(table[name]).tobytes())
    return digest.hexdigest()
