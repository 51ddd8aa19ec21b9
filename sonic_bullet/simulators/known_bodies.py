"""The bodies that a log of a world names: the link of each code, since when and until when.

code of a link -> index into the bodies, ascending and never reused; a code may be reused
roster -> START.index, START.pose, and the indices (b,) of those whose poses a step holds
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from sonic_bullet.geometry.flat_faces import flat_faces
from sonic_bullet.records import Array, Body, Material, ModalModel, Shape
from sonic_bullet.records.contacts import first_bodies
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting, usual_mounting
from sonic_bullet.simulators.frames import Roster, rows_of
from sonic_bullet.simulators.start import start_table


class KnownBodies:
    """Records of the bodies of one world.

    Attributes
    ----------
    records
        By index, in its order: of all bodies or, where ended records are dropped, of the living.
    count
        Number of all there ever were.
    body : Array, shape (b,)
        Indices of those in the roster last asked for, ascending; the same array while they are the same.
    """

    def __init__(self) -> None:
        self.records: dict[int, Body] = {}
        self.count = 0
        self.live: dict[int, int] = {}
        self.body: Array = first_bodies(0)
        self._roster: Roster | None = None
        self._start: Array = np.zeros(0)

    def append(self, code: int, record: Body) -> None:
        """Begin a record of the link of that code."""
        self.live[code] = self.count
        self.records[self.count] = record
        self.count += 1
        self._roster = None

    def close(self, codes: Iterable[int], step: int, *, keep: bool) -> None:
        """End the records of these links before that step; keep: retain them, ended."""
        for code in codes:
            if code in self.live:
                index = self.live.pop(code)
                if keep:
                    self.records[index] = replace(self.records[index], until_step=step)
                else:
                    del self.records[index]
        self._roster = None

    def gone(self, roster: Roster) -> list[int]:
        """List the codes of living links that a roster does not hold."""
        codes = np.array(list(self.live), np.int64)
        return [int(code) for code in codes[rows_of(roster, codes) < 0]]

    def enter(self, start: Array) -> None:
        """Fill index and pose of START rows (n,), -1 for links without a record; set `body` to those indices."""
        start["index"] = index = np.array([self.live.get(code, -1) for code in start["code"].tolist()], np.int64)
        body = np.sort(index[index >= 0])
        if not np.array_equal(body, self.body):
            first = first_bodies(len(body))
            self.body = first if np.array_equal(body, first) else body
            self.body.flags.writeable = False
        start["pose"] = np.searchsorted(self.body, index)

    def start(self, roster: Roster) -> Array:
        """Return START rows (n,) of a roster with code, static, index and pose filled.

        The table is the same while roster and records are.
        """
        if self._roster is not roster:
            self._roster, self._start = roster, start_table(roster)
            self.enter(self._start)
        return self._start


def alike(first: Body, second: Body) -> bool:
    """Tell whether two records can be of one body: same mass, inertia and curvature."""
    same = first.mass_kg == second.mass_kg and np.array_equal(first.inertia_kg_m2, second.inertia_kg_m2)
    return same and np.array_equal(first.curvature_per_m, second.curvature_per_m, equal_nan=True)


def sounding_body(
    record: Body,
    *,
    material: Material | None,
    model: ModalModel | None,
    volume_m3: float | None = None,
    shapes: Sequence[Shape] = (),
    options: ModalOptions | None = None,
    mounting: Mounting | None = None,
) -> Body:
    """Return the record of a link with what it is made of.

    Parameters
    ----------
    record
        Of the silent link.
    volume_m3
        None: the model's, or 0.
    shapes
        In place of its own; a single sphere determines the curvature.
    mounting
        How it is held; None: the usual mounting of its mass.
    """
    volume = volume_m3 if volume_m3 is not None else (model.volume_m3 if model else 0.0)
    held = usual_mounting(record.mass_kg) if mounting is None else mounting
    record = replace(record, material=material, model=model, volume_m3=volume, options=options, mounting=held)
    if not shapes:
        return record
    faces = flat_faces(shapes) if record.mass_kg == 0 else record.flat_faces_m
    return replace(record, curvature_per_m=only_curvature(shapes), flat_faces_m=faces)


def only_curvature(shapes: Sequence[Shape]) -> float:
    """Return the curvature of a body that is one sphere, else NaN."""
    ball = len(shapes) == 1 and shapes[0].kind == "sphere" and shapes[0].size_m[0] > 0
    return 1 / float(shapes[0].size_m[0]) if ball else math.nan
