"""A material and shapes become a body's modes, with all that the material's effects say: the one way there is.

Material -> with_material (effects on stiffness)
    -> analyse_body: modes of the elasticity -> effects on modes -> effects as they ring
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from sonic_bullet.effects.presets_of_effects import with_modes
from sonic_bullet.records import Material, ModalModel, Shape
from sonic_bullet.records.mode_shapes import rounded


def analyse_body(shapes: Sequence[Shape], material: Material, **options: Any) -> ModalModel:
    """Compute the modes of shapes, and how they ring.

    material: as `with_material` gives it. options: of `modal.analyse`. Raises MeshError and ModalError as that does.
    """
    from sonic_bullet import modal

    solved = modal.analyse(tuple(shapes), material, **options)
    made = with_modes(solved, material)
    return made if made is solved else replace(made, shape=rounded(made.shape))  # effects turn shapes
