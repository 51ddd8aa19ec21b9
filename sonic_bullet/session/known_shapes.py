"""Models of known shapes: a size or a material costs no solution, neither of the modes nor of how they radiate.

known_shape: Shape -> Family, cached, its modes up to to_hz at the largest size and the lowest E/ρ asked for
    -> KnownShape.model(size, material): modes scaled (modal/model_of_size.py), the material's effects and loss anew
    -> radiation: of the largest size, solved or from the cache, times the law of sizes
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sonic_bullet.effects.presets_of_effects import needs_exact_shapes, with_material, with_modes
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.modal import read_mesh
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.modal.model_of_size import check_isotropic, model_of_size, radiation_of_size
from sonic_bullet.modal.reduced import family
from sonic_bullet.radiation.radiated import radiation_and_note
from sonic_bullet.records import Air, Array, Material, ModalModel, Shape
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.errors import ModalError
from sonic_bullet.records.mode_shapes import quantize_shapes
from sonic_bullet.records.units import HEARING_LIMIT_HZ
from sonic_bullet.session.arguments import as_material


@dataclass(frozen=True, slots=True, eq=False)
class KnownShape:
    """A shape whose modes are known at every size up to ``largest``. Made by `known_shape`.

    Attributes
    ----------
    gamma_m2_s2 : the lowest E/ρ at which they are known
    """

    family: Family
    largest: float
    gamma_m2_s2: float
    to_hz: float

    @one_thread()
    def model(self, size: float, material: str | Path | Material, air: Air | None = None) -> ModalModel:
        """Make the model of the shape times ``size`` of a material, for ``model=`` of `Listener.add`.

        Its radiation into air is known with it, in this process.

        Raises
        ------
        ModalError
            The size is above the largest, or the material not isotropic, or slower than those the shape is known for.
        """
        size = as_number(size, "size", f"give one up to {self.largest:g}", above=0, most=self.largest, error=ModalError)
        made = with_material(as_material(material))
        check_isotropic(made)
        if made.youngs_pa / made.density_kg_m3 < self.gamma_m2_s2 * (size / self.largest) ** 2 * (1 - 1e-9):
            raise ModalError(
                f"{made.name} has a lower E/density than the shape is known for", "add it to its materials"
            )
        plain, mine = model_of_size(self.family, made, size, self.to_hz, exact_shapes=needs_exact_shapes(made))
        model = with_modes(plain, made)
        if model is not plain:
            model = replace(model, shape=quantize_shapes(model.shape))
        if model.mode_count == plain.mode_count and np.array_equal(model.shape, quantize_shapes(plain.shape)):
            self._put_radiation(model, mine, made, size, air or Air())
        return model

    def _put_radiation(self, model: ModalModel, mine: Array, material: Material, size: float, air: Air) -> None:
        """Scale the radiation of the largest size, unless damping moves the modes' ka between the sizes."""
        # of a damped mode's ka from one size to another, for which radiation is not evaluated anew: 0.5 dB of a dipole
        most_shift = 0.03
        large, of = model_of_size(self.family, material, self.largest, self.to_hz)
        ratio = size / self.largest
        at = np.full(max(self.family.count, 1), -1)
        at[of] = np.arange(len(of))
        at = at[mine]
        if (at < 0).any() or (np.abs(model.freq_hz * ratio / large.freq_hz[at] - 1) > most_shift).any():
            return
        weight, damping, note = radiation_and_note(large, air, keep_surface=True)
        radiation_and_note.put(model, (*radiation_of_size(weight[at], damping[at], ratio), note), air, "default")


def known_shape(
    mesh: str | Path | Shape,
    materials: Iterable[str | Path | Material],
    *,
    largest: float = 1.0,
    to_hz: float = HEARING_LIMIT_HZ,
) -> KnownShape:
    """Solve a shape once, for every isotropic material among ``materials`` and near them, and every size.

    Parameters
    ----------
    mesh
        A mesh file, in metres, or a shape, at size 1.
    materials
        Of which the one of the lowest E/density decides how many modes are solved.
    largest
        Size up to which they are known.
    to_hz
        Frequency up to which they are known, at every size.

    Raises
    ------
    MeshError, ModalError, MaterialError
        As of `Listener.add`.
    """
    poisson = 0.3  # About which families are solved: 0.2 to 0.4 holds every solid but rubber
    largest = as_number(largest, "largest", "give a size above 0", above=0, error=ModalError)
    made = [with_material(as_material(one)) for one in materials]
    for one in made:
        check_isotropic(one)
    if not made:
        raise ModalError("materials are none", "name those that the shape will be made of")
    gamma = min(one.youngs_pa / one.density_kg_m3 for one in made)
    shape = mesh if isinstance(mesh, Shape) else read_mesh(mesh)
    # of to_hz: a mode above it at one of the family's Poisson's ratios may lie below it at another
    frequency_margin = 1.02
    found = family(
        shape,
        gamma_m2_s2=gamma,
        poisson=poisson,
        to_hz=to_hz * largest * frequency_margin,
    )
    return KnownShape(found, largest, gamma, to_hz)
