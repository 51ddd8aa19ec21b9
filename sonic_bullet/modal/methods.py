"""Choice of the method for a body and its material, the same for scenes, `modes`, estimator and diagnosis.

a free box, its material's axes its own  -> polynomials (polynomials.py)
a free isotropic body of revolution      -> a Fourier series around its axis (revolution/)
a free sheet, very thin or many-sided     -> wedges, one layer of them (sheets/)
everything else                          -> tetrahedra (first_elements.py, elements.py)

`refine_until_accurate` refines any of them to the accuracy asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sonic_bullet.files.storage import cache as store
from sonic_bullet.modal import polynomials
from sonic_bullet.modal.first_elements import fill_with_elements
from sonic_bullet.modal.meshing.shape_meshes import check_fillable
from sonic_bullet.modal.revolution import fourier
from sonic_bullet.modal.sectors import ModalMethod, Sector, WantedModes
from sonic_bullet.modal.sheets import sheet_elements
from sonic_bullet.records import Array, Shape


def choose_method(
    shapes: tuple[Shape, ...],
    length_m: float,
    tensor: Array,
    wanted: WantedModes,
    *,
    clamp: Array,
    edge_m: float | None,
    thickness_m: float | None,
    kept: tuple[store.Place, str],
    draft: bool = False,
) -> ModalMethod:
    """Choose the method for shapes and a material of stiffness (6, 6), its modes to be true up to what is wanted.

    kept: cache and name of the body filled with elements. draft: few elements, where any. Raises MeshError.
    """
    if len(shapes) == 1 and edge_m is None and thickness_m is None and not len(clamp):
        check_fillable(shapes, None)
        found = (
            polynomials.method_for(shapes[0], length_m, tensor, wanted, draft=draft)
            or fourier.method_for(shapes[0], length_m, tensor, wanted)
            or (None if draft else sheet_elements.method_for(shapes[0], length_m, tensor, wanted))
        )
        if found is not None:
            return found
    return fill_with_elements(shapes, length_m, tensor, wanted, clamp, (edge_m, thickness_m), kept, draft=draft)


class ConvergedModes(NamedTuple):
    """Modes of a refined method.

    Attributes
    ----------
    method, sectors : the last method and its sectors
    value : (m,) λ of the first tensor's lowest modes wanted, ascending
    order : (m,) index of each among the modes of all sectors in turn
    error : relative, of the highest frequency, NaN where it is not known
    """

    method: ModalMethod
    sectors: list[Sector]
    value: Array
    order: Array
    error: float


def refine_until_accurate(
    method: ModalMethod, tensors: Sequence[Array], wanted: WantedModes, accuracy: float | None
) -> ConvergedModes:
    """Solve for the modes wanted of each tensor (6, 6), refined until the first's highest is as accurate as asked.

    None: as they come, their error not looked for. It ends earlier where refining costs more than allowed. Raises
    ModalError, MeshError.
    """
    while True:
        sectors = method.sectors(tensors, wanted)
        value, owner, index = _list_modes(sectors)
        order = np.argsort(value, kind="stable")[: min(wanted.most, int((value <= wanted.limit).sum()))]
        top = (int(owner[order[-1]]), int(index[order[-1]])) if len(order) else None
        error = method.error(sectors, tensors[0], top) if top and accuracy is not None else np.nan
        finer = None
        if accuracy is not None and accuracy < error <= accuracy * method.most_fall():  # beyond: all work, no answer
            finer = method.finer()
        if finer is None:
            return ConvergedModes(method, sectors, value[order], order, error)
        method = finer


def _list_modes(sectors: Sequence[Sector]) -> tuple[Array, Array, Array]:
    """List λ (b,) of the sectors' modes in turn, each by its multiplicity, with its sector and its index there."""
    value = [np.tile(sector.found[0][0], sector.multiplicity) for sector in sectors]
    index = [np.tile(np.arange(len(sector.found[0][0])), sector.multiplicity) for sector in sectors]
    owner = np.repeat(np.arange(len(sectors)), [len(v) for v in value])
    return np.concatenate([np.zeros(0), *value]), owner, np.concatenate([np.zeros(0, int), *index])
