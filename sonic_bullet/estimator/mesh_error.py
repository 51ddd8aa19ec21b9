"""How far the mesh itself bends γ: what halving its elements would do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet.errors import SonicBulletError
from sonic_bullet.estimator.fitted import ObjectFit
from sonic_bullet.records import Material

MESH_MOVES = 0.01
HALVING = 8.0  # halving takes this part of what doubling did: order 3 at least, 4 where the surface is smooth [Strang & Fix 1973, ch. 6.3]


def mesh_warning(o: ObjectFit, youngs_pa: float, density: float, poisson: float, progress: Callable[[str], None] | None) -> list[str]:
    """A warning where halving the elements would move γ by over 1 %, judged by doubling them."""
    from sonic_bullet.geometry import face_areas_m2
    from sonic_bullet.modal import analyse, read_mesh

    e = o.evidence
    if e.family is None or e.thing.mesh is None:
        return []
    area = float(np.median(face_areas_m2(e.family.vertex_m, e.family.face))) * 4
    edge = float(np.sqrt(area * 4 / np.sqrt(3)))
    value = np.sqrt(e.family.modes(youngs_pa / density, poisson)[0]) / (2 * np.pi)
    count = int(min(12, len(value)))
    try:
        material = Material.isotropic("fit", youngs_pa=youngs_pa, poisson=poisson, density_kg_m3=density)
        coarse = analyse((read_mesh(e.thing.mesh, e.thing.scale),), material, count=count, fixed=e.thing.fixed, edge_m=2 * edge, cache=None, progress=progress)
    except SonicBulletError as error:
        return [f"mesh error not known: a mesh of twice the size fails ({error.what})"]
    moved = float(np.median(2 * np.log(coarse.freq_hz[:count] / value[: len(coarse.freq_hz[:count])]))) / HALVING
    return [f"halving the mesh size would move gamma by about {moved:.1%}"] if abs(moved) > MESH_MOVES else []
