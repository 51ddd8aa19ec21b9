"""The recipe of the meshes in this folder: run `python assets/make_meshes.py` to make them again, byte for byte.

Solids of revolution about z, in metres, centre of the bounding box at the origin, walls of a thickness that tableware
has.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

HERE = Path(__file__).parent
SECTIONS = 32

# (radius, height) of the closed profile, outside first, in metres.
PLATE = [
    (0, 0),
    (0.055, 0),
    (0.075, 0.004),
    (0.115, 0.016),
    (0.115, 0.0205),
    (0.0735, 0.009),
    (0.054, 0.005),
    (0, 0.005),
]
BOWL = [
    (0, 0),
    (0.03, 0),
    (0.055, 0.012),
    (0.07, 0.03),
    (0.075, 0.055),
    (0.0727, 0.055),
    (0.0678, 0.0315),
    (0.0535, 0.0145),
    (0.0293, 0.0023),
    (0, 0.0023),
]
TUMBLER = [(0, 0), (0.03, 0), (0.036, 0.1), (0.0335, 0.1), (0.0278, 0.007), (0, 0.007)]


def revolve(profile: list[tuple[float, float]]) -> trimesh.Trimesh:
    """Closed solid of revolution of a profile that starts and ends on the axis."""
    mesh = trimesh.creation.revolve(np.array(profile, float), sections=SECTIONS)
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces())
    mesh.remove_unreferenced_vertices()
    if mesh.volume < 0:
        mesh.invert()
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    if not mesh.is_volume:
        raise SystemExit("the profile does not close")
    return mesh


def write_obj(path: Path, mesh: trimesh.Trimesh) -> None:
    """OBJ with seven decimals: a tenth of a micrometre, the same bytes everywhere."""
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in mesh.vertices + 0.0]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path.write_text("# made by assets/make_meshes.py\n" + "\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    for name, profile in (("plate", PLATE), ("bowl", BOWL), ("tumbler", TUMBLER)):
        mesh = revolve(profile)
        write_obj(HERE / f"{name}.obj", mesh)
        print(f"{name}: {len(mesh.faces)} triangles, {mesh.volume * 1e6:.1f} cm³")
