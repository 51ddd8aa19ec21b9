"""One choice of method for scenes, `modes`, estimator and diagnosis, by what the body and its material are.

a free box, its material's axes its own  -> polynomials (polynomials.py)
a free isotropic body of revolution      -> a Fourier series around its axis (revolution/)
everything else                          -> tetrahedra (elements.py)
"""

from __future__ import annotations

from collections.abc import Callable

from sonic_bullet.files import cache as store
from sonic_bullet.modal.sectors import ModalMethod, Wanted
from sonic_bullet.records import Array, Shape


def chosen(
    shapes: tuple[Shape, ...],
    length_m: float,
    tensor: Array,
    wanted: Wanted,
    *,
    clamp: Array,
    edge_m: float | None,
    thickness_m: float | None,
    kept: tuple[store.Place, str],
    say: Callable[[str], None],
) -> ModalMethod:
    """The method for shapes and a material of stiffness (6, 6), its modes to be true up to what is wanted.

    kept: cache and name of the body filled with elements. Raises MeshError.
    """
    from sonic_bullet.modal import polynomials
    from sonic_bullet.modal.elements import filled
    from sonic_bullet.modal.meshing.shape_meshes import check_fillable
    from sonic_bullet.modal.revolution import fourier

    if len(shapes) == 1 and edge_m is None and thickness_m is None and not len(clamp):
        check_fillable(shapes, None)
        found = polynomials.method_for(shapes[0], length_m, tensor, wanted) or fourier.method_for(
            shapes[0], length_m, tensor, wanted
        )
        if found is not None:
            return found
    return filled(shapes, length_m, tensor, wanted, clamp, (edge_m, thickness_m), kept, say)
