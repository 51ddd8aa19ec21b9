"""An object's modes and radiation at any size of a drawn specimen: solved at size 1, kept by their caches, and resized.

shape, stiffness, density -> analyse, radiation: both from their caches -> modal/model_of_size.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.apps.dataset.household.objects import KINDS, DrawnObject, shape_of
from sonic_bullet.effects.damping_law import own_decay_per_s
from sonic_bullet.modal.model_of_size import radiation_of_size, resize_model
from sonic_bullet.radiation.radiated import radiation_and_note
from sonic_bullet.records import Air, Material, ModalModel
from sonic_bullet.session.body_models import analyse_body

TO_HZ = 10_000.0
"""Highest mode. Solving to 16 kHz costs three times as much; above 10 kHz little lasts in recordings."""


def object_of_size(of: DrawnObject, size: float, material: Material, even_radiation: bool = False) -> ModalModel:
    """Return the modes of an object at a size, with a specimen's loss; their radiation is known with them.

    even_radiation: all radiate alike and lose nothing by it.
    """
    shape = shape_of(of.kind, of.wall_m, of.seed)
    lossless = replace(material, alpha_per_s=0.0, beta_s=0.0, effects=())  # one solution for all its specimens
    kind = KINDS[of.kind]  # errors are not looked for: specimens differ by more in stiffness and size
    wall_m = of.wall_m if kind.sheet else None
    large = analyse_body((shape,), lossless, to_hz=TO_HZ, accuracy=None, edge_m=kind.edge_m, thickness_m=wall_m)
    weight, damping = radiation_of_size(*radiation_and_note(large, Air(), "default")[:2], size)
    if even_radiation and large.mode_count:
        weight = np.full(len(weight), np.sqrt((np.abs(weight) ** 2).mean()), complex)
        damping = np.zeros(len(damping))
    made = resize_model(large, size, lambda value: own_decay_per_s(material, value))
    radiation_and_note.put(made, (weight, damping, ""), Air(), "default")
    return made
