"""Vibration modes of a body, from its shapes and its material.

Shape -> solid.Solid (structured.py, tetrahedra.py) -> K, M (fem.py) -> λ, U (eigen.py) -> ModalModel (model.py), kept
    under the names of keys.py
"""

from sonic_bullet.modal.meshing.mesh_files import read_mesh
from sonic_bullet.modal.meshing.shape_meshes import check_fillable
from sonic_bullet.modal.model import analyse, missing_name
from sonic_bullet.records.modal_options import ModalOptions

__all__ = ["ModalOptions", "analyse", "check_fillable", "missing_name", "read_mesh"]
