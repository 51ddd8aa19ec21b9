"""How near do thin walls radiate whose sides were moved apart, and what had the law of compact bodies in their place?

    python studies/thickened_walls.py

A steel plate of 1.5 mm has a near field of its own, at two sizes of its mesh: the same with its sides moved apart by
`near_mesh.THICKENED` of an edge is held against it. A household's steel bowl of 0.8 mm has none: meshes and distances
are held against the finest mesh. Errors are of the damping by sound, 10 lg of its ratio, of the modes that are within
60 dB of the most damped one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sonic_bullet.apps.dataset.household.objects import shape_of
from sonic_bullet.files.presets import load_material
from sonic_bullet.radiation.entrained_mass import PotentialMap, moved_air
from sonic_bullet.radiation.far_field import radiation_and_note
from sonic_bullet.radiation.near_mesh import THICKENED, near_mesh
from sonic_bullet.records import Air, Array, ModalModel, Shape
from sonic_bullet.session.body_models import analyse_body

OCTAVES_HZ = (250, 500, 1000, 2000, 4000)
NearField = Callable[[Array, Array, Array, int], tuple[PotentialMap, Array] | None]


def near_field(most: int, thickened: float) -> NearField:
    """Return a near field by a mesh of so many triangles, its surface moved outwards; most 0: none."""

    def found(corner: Array, area: Array, normal: Array, _least: int) -> tuple[PotentialMap, Array] | None:
        if not most:
            return None
        coarse, nearest = near_mesh(corner, area, normal, most, thickened)
        moved = moved_air(coarse)
        return None if moved is None else (moved, nearest)

    return found


def compare(name: str, model: ModalModel, meshes: list[tuple[int, float]]) -> None:
    """Print errors against the first mesh, and the median T60 by sound alone, by octave."""
    damping = [radiation_and_note(model, Air(), near_field(*mesh))[1] for mesh in meshes]
    reference = damping[0]
    counted = reference > 1e-6 * reference.max()
    print(f"{name}, {model.mode_count} modes to {model.freq_hz.max():.0f} Hz; T60 by sound in s, median by octave")
    print(" " * 32 + "median  90 %  worst dB" + "".join(f"{octave:>10}" for octave in OCTAVES_HZ))
    for (most, thickened), found in zip(meshes, damping, strict=True):
        off = np.abs(10 * np.log10(found / reference))[counted]
        inside = [np.abs(np.log2(model.freq_hz / octave)) <= 0.5 for octave in OCTAVES_HZ]
        t60 = [np.median(np.log(1000) / found[some]) if some.any() else np.nan for some in inside]
        what = f"{most} triangles, moved by {thickened:g}" if most else "law of compact bodies"
        numbers = f"{np.median(off):6.1f}{np.quantile(off, 0.9):6.1f}{off.max():8.1f}  "
        print(f"  {what:30s}{numbers}" + "".join(f"{one:10.3g}" for one in t60), flush=True)


def main() -> None:
    """Print both tables."""
    steel = replace(load_material("steel"), alpha_per_s=0.0, beta_s=0.0, effects=())
    plate = analyse_body((Shape("box", size_m=np.array([0.25, 0.2, 0.0015])),), steel, to_hz=4000)
    compare("steel plate of 1.5 mm", plate, [(950, 0.0), (950, THICKENED), (700, 0.0), (700, THICKENED)])
    bowl = analyse_body((shape_of("bowl", 0.0008, 7),), steel, to_hz=6000, accuracy=0.1)
    finest = (1400, THICKENED)
    others = [(950, THICKENED), (700, THICKENED), (1400, THICKENED / 2), (1400, 2 * THICKENED), (0, 0.0)]
    compare("steel bowl of 0.8 mm", bowl, [finest, *others])


if __name__ == "__main__":
    main()
