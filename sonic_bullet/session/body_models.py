"""Compute a body's modes from a material and shapes, with all effects of the material.

Material -> with_material (effects on stiffness)
    -> analyse_body: modes of the elasticity -> effects on modes -> effects on their decay -> those above the last one
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Any

from sonic_bullet.effects.presets_of_effects import needs_exact_shapes, with_modes
from sonic_bullet.records import Material, ModalModel, Shape
from sonic_bullet.records.mode_shapes import quantize_shapes
from sonic_bullet.records.units import HEARING_LIMIT_HZ
from sonic_bullet.session.tail.statistical_tail import with_tail


def analyse_body(shapes: Sequence[Shape], material: Material, *, tail: bool = False, **options: Any) -> ModalModel:
    """Compute the modes of shapes, and their decay.

    Parameters
    ----------
    material
        As `with_material` returns it.
    tail
        Whether plates and shells go on above their last mode; drafts and thick walls in place of thinner ones do.
    options
        Of `modal.analyse`.

    Raises
    ------
    MeshError, ModalError
        As `modal.analyse` does.
    """
    from sonic_bullet import modal
    from sonic_bullet.modal.meshing.filling import stands_for_thinner
    from sonic_bullet.modal.sectors import MOST_MODES

    solved = modal.analyse(tuple(shapes), material, exact_shapes=needs_exact_shapes(material), **options)
    made = with_modes(solved, material)
    made = made if made is solved else replace(made, shape=quantize_shapes(made.shape))  # effects rotate shapes
    draft = options.get("draft", False)
    if not (tail or draft or stands_for_thinner(solved.note)):
        return made
    resonators_per_third = 8.0 if draft else 20.0  # twice a tone's own: the ear tells them from more, and no level does
    to_hz, whole = options.get("to_hz", HEARING_LIMIT_HZ), tail or not draft
    most = inf if whole else MOST_MODES  # a draft stands for the full sound, which has no more
    return with_tail(made, material, to_hz, resonators_per_third, lumps=draft, most_modes=most)
