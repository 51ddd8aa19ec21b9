"""Vibration modes of a body, from its shapes and its material.

`modal_analysis.analyse` is the way in; `methods` chooses how the modes are computed:

    a free box           -> polynomials.py
    a body of revolution -> revolution/: a Fourier series around the axis  -> lanczos.py: λ, U of K u = λ M u
    everything else      -> meshing/: Solid -> fem.py, elements.py: K, M   -> lanczos.py
      -> refined to the accuracy asked for -> ModalModel, kept under the names of keys.py
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.mesh_files import read_mesh
    from sonic_bullet.modal.meshing.shape_meshes import check_fillable, outline
    from sonic_bullet.modal.modal_analysis import analyse, missing_name
    from sonic_bullet.records.modal_options import ModalOptions

_MODULE_OF_FUNCTION = {
    "ModalOptions": "sonic_bullet.records.modal_options",
    "analyse": "sonic_bullet.modal.modal_analysis",
    "check_fillable": "sonic_bullet.modal.meshing.shape_meshes",
    "missing_name": "sonic_bullet.modal.modal_analysis",
    "outline": "sonic_bullet.modal.meshing.shape_meshes",
    "read_mesh": "sonic_bullet.modal.meshing.mesh_files",
}

__all__ = ["ModalOptions", "analyse", "check_fillable", "missing_name", "outline", "read_mesh"]


def __getattr__(name: str) -> Any:
    """Import a function when it is first used: a run whose models are kept meshes nothing."""
    if name in _MODULE_OF_FUNCTION:
        return vars(importlib.import_module(_MODULE_OF_FUNCTION[name]))[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
