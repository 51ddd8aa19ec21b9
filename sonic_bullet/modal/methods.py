"""One choice of method for scenes, `modes`, estimator and diagnosis, by what the body and its material are.

a free box, its material's axes its own  -> polynomials (polynomials.py)
a free isotropic body of revolution      -> a Fourier series around its axis (revolution/)
everything else                          -> tetrahedra (first_elements.py, elements.py)

and one way from there to modes as accurate as asked (`converged`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sonic_bullet.files import cache as store
from sonic_bullet.modal.sectors import ModalMethod, Sector, Wanted
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
    from sonic_bullet.modal.first_elements import filled
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


class Converged(NamedTuple):
    """sectors of the method that came last; value (m,): λ of the first tensor's lowest modes wanted, ascending, mode
    order[k] of all in turn; error: relative, of the highest's frequency, NaN where it is not known.
    """

    method: ModalMethod
    sectors: list[Sector]
    value: Array
    order: Array
    error: float


def converged(
    method: ModalMethod, tensors: Sequence[Array], wanted: Wanted, accuracy: float, say: Callable[[str], None]
) -> Converged:
    """The modes wanted of each tensor (6, 6), refined until the first's highest is as accurate as asked, or until that
    may cost no more. Raises ModalError, MeshError.
    """
    while True:
        sectors = method.sectors(tensors, wanted, say)
        value, owner, index = _listed(sectors)
        order = np.argsort(value, kind="stable")[: min(wanted.most, int((value <= wanted.limit).sum()))]
        top = (int(owner[order[-1]]), int(index[order[-1]])) if len(order) else None
        error = method.error(sectors, tensors[0], top) if top else np.nan
        finer = method.finer() if error > accuracy else None
        if finer is None:
            return Converged(method, sectors, value[order], order, error)
        method = finer


def _listed(sectors: Sequence[Sector]) -> tuple[Array, Array, Array]:
    """λ (b,) of the sectors' modes in turn, each as often as it counts, its sector and its place there."""
    value = [np.tile(sector.found[0][0], sector.multiplicity) for sector in sectors]
    index = [np.tile(np.arange(len(sector.found[0][0])), sector.multiplicity) for sector in sectors]
    owner = np.repeat(np.arange(len(sectors)), [len(v) for v in value])
    return np.concatenate([np.zeros(0), *value]), owner, np.concatenate([np.zeros(0, int), *index])
