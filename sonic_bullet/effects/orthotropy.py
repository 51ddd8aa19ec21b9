"""`orthotropy`: stiffness that depends on direction: crystals, wood, rolled and laid-up sheets. Axes are the mesh's.

σ = C ε with C cubic (3 constants), hexagonal about x, y or z (5) or orthorhombic (9)
    [Nye 1957, ch. VIII; Migliori et al. 1993]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Cost, Effect, Owner, Stage, Traits
from sonic_bullet.records import ORTHOTROPIC, Array, Material

SYMMETRIES = {"isotropic": 2, "cubic": 3, "hexagonal-x": 5, "hexagonal-y": 5, "hexagonal-z": 5, "orthorhombic": 9}
"""How many constants are free under each."""


@dataclass(frozen=True)
class Orthotropy(Effect):
    """Elastic constants with axes along the mesh's.

    Attributes
    ----------
    constants_pa : (9,)
        C11 C22 C33 C23 C13 C12 C44 C55 C66.
    symmetry : str
        "cubic", "hexagonal-x", "hexagonal-y", "hexagonal-z" or "orthorhombic".
    held : tuple of str
        Names of the constants that no mode identifies.
    """

    id: ClassVar[str] = "orthotropy"
    stage: ClassVar[Stage] = Stage.MATERIAL
    owner: ClassVar[Owner] = Owner.MATERIAL
    reference: ClassVar[str] = "Nye 1957, ch. VIII; Migliori et al. 1993; Bodig & Jayne 1982, ch. 3"
    traits: ClassVar[Traits] = Traits(moves_modes=True, cost=Cost.COSTLY)

    constants_pa: tuple[float, ...]
    symmetry: str = "orthorhombic"
    held: tuple[str, ...] = ()

    @property
    def stiffness_pa(self) -> Array:
        """Return the stiffness (6, 6) in Voigt's notation."""
        found = np.zeros((6, 6))
        for (i, j), c in zip(ORTHOTROPIC, self.constants_pa, strict=True):
            found[i, j] = found[j, i] = c
        return found

    def apply(self, x: Material) -> Material:
        """Set the material's stiffness."""
        return replace(x, stiffness_pa=self.stiffness_pa)

    def parameters(self) -> dict[str, Any]:
        """Return its parameters by name, in SI units, for reports and JSON."""
        compliance = np.linalg.inv(self.stiffness_pa)
        youngs = 1 / np.diag(compliance)
        c = dict(zip(("c11", "c22", "c33", "c23", "c13", "c12", "c44", "c55", "c66"), self.constants_pa, strict=True))
        names = {"cubic": ("c11", "c12", "c44")}.get(self.symmetry, tuple(c))
        values: dict[str, Any] = {"symmetry": self.symmetry} | {f"{name}_pa": float(c[name]) for name in names}
        values |= {
            "youngs_ratio": [1.0, float(youngs[1] / youngs[0]), float(youngs[2] / youngs[0])],
            "youngs_x_pa": float(youngs[0]),
        }
        if self.symmetry == "cubic":
            values["zener_ratio"] = float(2 * c["c44"] / (c["c11"] - c["c12"]))
        return values | ({"held_near_isotropy": list(self.held)} if self.held else {})

    def freedom(self) -> int:
        """Count the numbers that were free when it was proposed."""
        return SYMMETRIES[self.symmetry]
