"""Materials of the household: elastic numbers of the package's presets, and loss of the material alone.

Loss is that of the material, from tables: what a body loses besides, by sound, fingers and what it lies on, the run
time adds. Loss of measured bodies, which `made-NAME` presets have, holds their supports and what they radiated: added
once more it made glass ring as short as plastic.

Wood has a stand-in: as stiff in all directions, anywhere between across and along the grain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.files.presets import load_material
from sonic_bullet.records import Material, isotropic_stiffness_pa
from sonic_bullet.session.drawn_recording import vary_material

CLASS_OF = {
    "steel": "metal", "aluminium": "metal", "brass": "metal", "copper": "metal", "glass": "glass",
    "porcelain": "ceramic", "plastic": "plastic", "wood": "wood",
}  # fmt: skip
LOSS_FACTORS: Mapping[str, tuple[float, float]] = {
    "steel": (1e-4, 6e-4),  # Norton & Karczub 2003, table 6.1
    "aluminium": (1e-4, 1e-3),  # Vigran 2008, table 3.1; Hopkins 2007, table A2 (at most)
    "brass": (2e-4, 1e-3),  # Cremer & Heckl 1988, table of material constants; Bies, Hansen & Howard 2017, table C.1
    "copper": (1e-3, 2e-3),  # Bies, Hansen & Howard 2017, table C.1: rolled, annealed
    "glass": (6e-4, 2e-3),  # Vigran 2008, table 3.1
    "porcelain": (5e-4, 4e-3),  # Ren, Yeh & Lin 2013, table I: 2πfβ from 1 to 8 kHz
    "plastic": (3e-3, 0.036),  # Bies, Hansen & Howard 2017, table C.1; Ashby 2011, ch. 4: 0.04 GPa/E, E from 1.1 GPa on
    # times `wood_loss`: from a marimba's rosewood, 0.0036 at E/ρ = 22 [Hill, Exponential time decay constants of
    # marimba bars, University of Illinois: 0.0045 ± 0.0009], to birch plywood, 0.016 at about 10 [Hopkins 2007, A2]
    "wood": (0.5, 1.4),
}
"""η of materials at audible frequencies, uniform in the logarithm."""
SOFT_WOOD_SHARE = 0.12
"""Of the modulus along the grain, across it: radial and tangential of red oak have 0.154 and 0.082 [Wood Handbook
2010, table 5-1]."""


def wood_loss(youngs_pa: float, density_kg_m3: float) -> float:
    """Compute η of wood by its stiffness, along the grain or across: the stiffer for its weight, the less.

    tan δ = 10^(-1.23) (E/ρ in GPa per g/cm³)^(-0.68)  [Ono & Norimoto 1983, Jpn. J. Appl. Phys. 22(4)]: 0.008 along,
    0.03 across. Species depart from it by extractives, those of xylophones the most [Brémaud 2012, JASA 131(1)].
    """
    return float(10**-1.23 * (youngs_pa / density_kg_m3 / 1e6) ** -0.68)


def specimen(name: str, elastic: np.random.Generator, loss: np.random.Generator) -> Material:
    """Draw a material: stiffness and density by one generator, all else by another."""
    base = load_material(f"made-{name}")
    stiff, _ = vary_material(base, elastic)
    stiffness, share = stiff.stiffness_pa, 1.0
    if name == "wood":
        share = float(np.exp(elastic.uniform(np.log(SOFT_WOOD_SHARE), 0.0)))
        stiffness = isotropic_stiffness_pa(share * stiff.youngs_pa, stiff.poisson)
    varied, _ = vary_material(base, loss)
    eta = float(np.exp(loss.uniform(*np.log(LOSS_FACTORS[name]))))
    if name == "wood":
        eta *= wood_loss(share * stiff.youngs_pa, stiff.density_kg_m3)
    return replace(
        varied, stiffness_pa=stiffness, density_kg_m3=stiff.density_kg_m3, includes_radiation=False,
        effects=(DampingLaw("constant-loss", eta),),
    )  # fmt: skip
