"""An object solved once, kept on disk, and resized.

shape, stiffness, density -> analyse -> modes and radiation at size 1 -> the cache, one file an object
-> size, loss: f ∝ 1/s, u ∝ s^(-3/2), decays by the specimen's law at the new λ; pressure ∝ s^(-1/2), Δd ∝ 1/s
[modal.model_of_size, session.known_shapes: their equations]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.apps.dataset.household.objects import KINDS, DrawnObject, shape_of
from sonic_bullet.effects.damping_law import own_decay_per_s
from sonic_bullet.files.storage import cache as store
from sonic_bullet.modal.keys import code_digest, key
from sonic_bullet.radiation.radiated import PACKAGES, SOURCES, radiation_and_note
from sonic_bullet.records import Air, Array, Material, ModalModel
from sonic_bullet.session.body_models import analyse_body

TO_HZ = 10_000.0
"""Highest mode. Solving to 16 kHz costs three times as much; above 10 kHz little lasts in recordings."""
ACCURACY = 0.1
"""Of the highest mode's frequency, as of a draft: lower ones are as much better as they are lower, and specimens differ
by more in stiffness and size."""


@dataclass(frozen=True, slots=True, eq=False)
class SolvedObject:
    """Modes at size 1, without loss, and how they radiate: pressure weight (m,) at 1 m, added decay (m,)."""

    model: ModalModel
    weight: Array
    damping_per_s: Array

    def specimen(self, size: float, material: Material, even_radiation: bool = False) -> ModalModel:
        """Return the modes at a size with a material's loss; their radiation is known with them.

        even_radiation: all radiate alike and lose nothing by it.
        """
        large, m = self.model, self.model.mode_count
        square = (2 * np.pi * large.freq_hz / size) ** 2
        decay = np.minimum(own_decay_per_s(material, square), 0.99 * np.sqrt(square))
        made = ModalModel(
            freq_hz=np.sqrt(square - decay**2) / (2 * np.pi),
            decay_per_s=decay,
            shape=large.shape * np.float32(size**-1.5),
            vertex_m=large.vertex_m * size,
            face=large.face,
            curvature_per_m=large.curvature_per_m / size,
            volume_m3=large.volume_m3 * size**3,
            mass_kg=large.mass_kg * size**3,
            note=large.note,
        )
        weight, damping = self.weight / np.sqrt(size), self.damping_per_s / size
        if even_radiation and m:
            weight, damping = np.full(m, np.sqrt((np.abs(weight) ** 2).mean()), complex), np.zeros(m)
        radiation_and_note.put(made, (weight, damping, ""), Air(), "default")
        return made


def solved_object(of: DrawnObject, material: Material) -> SolvedObject:
    """Solve an object, or take it from the cache."""
    shape = shape_of(of.kind, of.wall_m, of.seed)
    edge_m = KINDS[of.kind].edge_m
    elastic: Array = np.append(material.stiffness_pa.ravel(), material.density_kg_m3)
    radiates = code_digest(SOURCES, PACKAGES).hex()
    name = key(
        "household", shape.kind, shape.size_m, shape.vertex_m, shape.face, elastic, TO_HZ, ACCURACY, edge_m, radiates
    )
    found = store.load("default", name)
    if found is None:
        model = analyse_body((shape,), material, to_hz=TO_HZ, accuracy=ACCURACY, edge_m=edge_m)
        weight, damping, _ = radiation_and_note(model, Air())
        numbers = np.array([model.volume_m3, model.mass_kg])
        arrays = {"freq": np.sqrt(model.omega0_squared_per_s2) / (2 * np.pi), "shape": model.shape,
                  "vertex": model.vertex_m, "face": model.face, "curvature": model.curvature_per_m,
                  "numbers": numbers, "real": weight.real, "imag": weight.imag, "damping": damping}  # fmt: skip
        found = arrays, model.note
        store.save("default", name, arrays, model.note)
    a, note = found
    model = ModalModel(
        freq_hz=a["freq"], decay_per_s=np.zeros(len(a["freq"])), shape=a["shape"], vertex_m=a["vertex"], face=a["face"],
        curvature_per_m=a["curvature"], volume_m3=float(a["numbers"][0]), mass_kg=float(a["numbers"][1]), note=note,
    )  # fmt: skip
    return SolvedObject(model, a["real"] + 1j * a["imag"], np.array(a["damping"]))
