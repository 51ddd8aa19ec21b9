"""Child process that unites boxes, balls, cylinders and capsules exactly, and fills their union (see _netgen.py).

    python _compound.py IN.npz OUT.npz     IN: kind, size, place, turn of each solid, edge, memory (bytes), seconds

Surfaces of the union are faces of a boundary representation, not triangles: no sliver is left for Netgen to refuse.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from _netgen import limit_process  # type: ignore[import-not-found]  # the folder of a script is on its path


def solid(kind: str, size: Any, place: Any, turn: Any) -> Any:
    """Return one solid of Open CASCADE. kind, size, turn (quaternion): as of `records.Shape`."""
    from netgen.occ import Axis, Box, Cylinder, Dir, Pnt, Sphere, Vec, Z

    x, y, z = size
    if kind == "box":
        made = Box(Pnt(-x / 2, -y / 2, -z / 2), Pnt(x / 2, y / 2, z / 2))
    elif kind == "sphere":
        made = Sphere(Pnt(0, 0, 0), x)
    else:
        made = Cylinder(Pnt(0, 0, -y / 2), Z, r=x, h=y)
        if kind == "capsule":
            made = made + Sphere(Pnt(0, 0, -y / 2), x) + Sphere(Pnt(0, 0, y / 2), x)
    sine = float(np.linalg.norm(turn[:3]))
    if sine > 0:
        made = made.Rotate(Axis(Pnt(0, 0, 0), Dir(*turn[:3])), np.degrees(2 * np.arctan2(sine, turn[3])))
    return made.Move(Vec(*place))


def main() -> None:
    """Fill the union of the first argument's solids and write nodes and tetrahedra to the second's."""
    source, target = sys.argv[1:]
    with np.load(source, allow_pickle=False) as found:
        given = {name: found[name] for name in found.files}
    limit_process(int(given["memory"]), int(given["seconds"]))
    import netgen.occ
    import pyngcore

    pyngcore.SetNumThreads(1)
    each = zip(given["kind"].tolist(), given["size"].tolist(), given["place"].tolist(), given["turn"], strict=True)
    first, *rest = [solid(*one) for one in each]
    for one in rest:
        first = first + one
    mesh = netgen.occ.OCCGeometry(first).GenerateMesh(maxh=float(given["edge"]))
    tet = mesh.Elements3D().NumPy()["nodes"][:, :4].astype(np.int64) - 1
    np.savez(target, node=np.array(mesh.Coordinates()), tet=tet)


if __name__ == "__main__":
    main()
