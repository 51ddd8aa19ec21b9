"""Vibration modes of a body, from its shapes and its material.

`modal_analysis.analyse` is the way in; `methods` chooses how the modes are computed:

    a free box           -> polynomials.py
    a body of revolution -> revolution/: a Fourier series around the axis  -> lanczos.py: λ, U of K u = λ M u
    everything else      -> meshing/: Solid -> fem.py, elements.py: K, M   -> lanczos.py
      -> refined to the accuracy asked for -> ModalModel, kept under the names of keys.py
"""

from sonic_bullet.modal.meshing.mesh_files import read_mesh
from sonic_bullet.modal.meshing.shape_meshes import check_fillable
from sonic_bullet.modal.modal_analysis import analyse, missing_name
from sonic_bullet.records.modal_options import ModalOptions

__all__ = ["ModalOptions", "analyse", "check_fillable", "missing_name", "read_mesh"]
