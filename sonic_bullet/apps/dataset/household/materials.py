"""Materials of the household: presets of things as they are made, each specimen within the preset's spread.

Loss is that of measured bodies (docs/measured/decays.csv), which `made-NAME` presets are fitted to, with the spread of
those bodies about it. It was measured with what the bodies radiated; the run time adds radiation all the same, because
bars and bells, of which most of them are, radiate little, and a lid or a tray much.

Wood has a stand-in: as stiff in all directions, anywhere between across and along the grain.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from sonic_bullet.files.presets import load_material
from sonic_bullet.records import Material, isotropic_stiffness_pa
from sonic_bullet.session.drawn_recording import vary_material

CLASS_OF = {
    "steel": "metal", "aluminium": "metal", "brass": "metal", "copper": "metal", "glass": "glass",
    "porcelain": "ceramic", "plastic": "plastic", "wood": "wood",
}  # fmt: skip
MATERIALS = tuple(CLASS_OF)
SOFT_WOOD_SHARE = 0.12
"""Of the modulus along the grain, across it: radial and tangential of red oak have 0.154 and 0.082 [Wood Handbook
2010, table 5-1]."""


@lru_cache(maxsize=64)
def preset(name: str, folder: str) -> Material:
    """Load a material as things are made of it, from a folder where it has it."""
    own = Path(folder, f"{name}.json")
    return load_material(own if folder and own.is_file() else f"made-{name}")


def specimen(name: str, folder: str, elastic: np.random.Generator, loss: np.random.Generator) -> Material:
    """Draw a material: stiffness and density by one generator, all else by another."""
    base = preset(name, folder)
    stiff, _ = vary_material(base, elastic)
    stiffness = stiff.stiffness_pa
    if name == "wood":
        share = float(np.exp(elastic.uniform(np.log(SOFT_WOOD_SHARE), 0.0)))
        stiffness = isotropic_stiffness_pa(share * stiff.youngs_pa, stiff.poisson)
    varied, _ = vary_material(base, loss)
    return replace(varied, stiffness_pa=stiffness, density_kg_m3=stiff.density_kg_m3, includes_radiation=False)
