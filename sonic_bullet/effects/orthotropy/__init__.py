"""`orthotropy`: stiffness that depends on direction: crystals, wood, rolled and laid-up sheets. Axes are the mesh's.

    σ = C ε with C cubic (3 constants), hexagonal about x, y or z (5) or orthorhombic (9)
        [Nye 1957, ch. VIII; Migliori et al. 1993]

Identified by all lines, whatever isotropic modes they were paired with (tensor_search.py); None where isotropy does as
well. Density is the guess's: modes depend on C/ρ alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.orthotropy.tensor_lines import LINE_CAP, body_lines_of, ringing, weigh_lines
from sonic_bullet.effects.orthotropy.tensor_search import Tensor, fitted, isotropic_p, search
from sonic_bullet.effects.orthotropy.tensors import NAMES, SYMMETRIES, TENSOR_SEARCH, isotropic_shear, p_of
from sonic_bullet.effects.protocol import Cost, Effect, Evidence, ObjectEvidence, Owner, Stage, Traits
from sonic_bullet.records import ORTHOTROPIC, Array, Material


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

    @classmethod
    def of(cls, tensor: Tensor, density_kg_m3: float) -> Self:
        """Build the effect from a fitted tensor and a density."""
        stiff = tensor.stiffness_m2_s2 * density_kg_m3
        return cls(tuple(float(stiff[i, j]) for i, j in ORTHOTROPIC), tensor.symmetry, tensor.held)

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        """Search for the tensor that explains all lines best; None where isotropy does as well."""
        # or in BIC, with a line more within the cap: half of those in a room are no modes, and beyond it whatever the
        # tensor
        in_a_room = 30.0
        least = 0.03  # of ln E_i/E_j or ln of Zener's ratio: less is the mesh's
        nearer = 0.7  # of isotropy's rms of ln f, lines beyond the cap counted at the cap
        better = 10.0  # in BIC, than isotropy
        bodies = body_lines_of(evidence)
        if isinstance(evidence.known, cls) and bodies:
            density = bodies[0].elastic.material.density_kg_m3
            start = p_of(evidence.known.stiffness_pa / density)
            return cls.of(
                fitted(
                    bodies, evidence.known.symmetry, start, isotropic_p(bodies[0].elastic), TENSOR_SEARCH.widths[4:]
                ),
                density,
            )
        lines = sum(len(t.log_hz) for t in bodies)
        if lines < 6 or all(_fits(h) for h in evidence.observed):
            return None
        found = search(evidence)
        if found is None:
            return None
        plain, best = found
        gain, dry = plain.bic - best.bic, any(h.dry for h in evidence.observed)
        anisotropic = gain > better and best.off < nearer * plain.off
        anisotropic |= dry and gain > in_a_room and round(lines * (best.matched - plain.matched)) >= 1
        if not anisotropic or departure(best) < least:
            return None
        return cls.of(best, bodies[0].elastic.material.density_kg_m3)


def departure(tensor: Tensor) -> float:
    """Compute the distance from isotropy: the largest of |ln E_i/E_j| and |ln G_ij/(√(E_i E_j)/2(1+n_ij))|."""
    p = tensor.p
    return float(max(np.ptp(p[:3]), np.abs(p[6:] - isotropic_shear(p)).max()))


def _fits(h: ObjectEvidence) -> bool:
    """Decide whether the isotropic body's modes are where the lines are."""
    # rms of ln f from the nearest isotropic mode that leaves nothing to look for: split pairs, corrected meshes
    suffices = 5e-3
    if not len(h.freq_hz):
        return False
    off, own = np.log(h.freq_hz / h.model_hz), ringing(h)
    shift = float(np.median(off))
    left = np.minimum(np.abs(off - shift), LINE_CAP)
    if own.any():
        model = h.plain or h.model
        modes = model.freq_hz if model is not None else h.all_hz
        strange = np.abs(np.log(h.foreign_hz[own][:, None] / modes[None, :]) - shift).min(axis=1)
        left = np.concatenate([left, np.minimum(strange, LINE_CAP)])
    worth = weigh_lines(np.concatenate([h.amplitude, h.foreign_amplitude[:, own]], axis=1))
    return bool(np.sqrt((worth * left**2).sum() / worth.sum()) < suffices)


__all__ = ["NAMES", "Orthotropy", "departure"]
