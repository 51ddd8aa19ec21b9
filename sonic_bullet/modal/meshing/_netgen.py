"""Child process that runs Netgen [Schöberl 1997]: it can hang, grow or abort, and must not take the parent with it.

    python _netgen.py IN.npz OUT.npz     IN: vertex, face, edge, point, size, memory (bytes), seconds
                                         and skin, where triangles of the surface are wanted, no tetrahedra

One thread, so that the same surface has the same tetrahedra, whatever else the machine does. It imports numpy only, so
that starting it is cheap.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

FACET = (
    "facet normal %.17g %.17g %.17g\nouter loop\nvertex %.17g %.17g %.17g\nvertex %.17g %.17g %.17g\n"
    "vertex %.17g %.17g %.17g\nendloop\nendfacet"
)


def limit_process(memory: int, seconds: int) -> None:
    """Limit this process to bytes of memory and seconds of processor time, where the system has such limits."""
    try:
        import resource

        for what, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds)):
            resource.setrlimit(what, (most, most))
    except (ImportError, ValueError):  # then only the parent's time limit applies
        pass


def main() -> None:
    """Mesh the surface of the first argument's file and write nodes and tetrahedra to the second's."""
    grading = 0.3  # how fast sizes may grow, Netgen's own
    source, target = sys.argv[1:]
    with np.load(source, allow_pickle=False) as found:
        given = {name: found[name] for name in found.files}
    limit_process(int(given["memory"]), int(given["seconds"]))
    import netgen.meshing
    import netgen.stl
    import pyngcore

    pyngcore.SetNumThreads(1)
    corner = given["vertex"][given["face"]]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    file = Path("in.stl")  # text, as binary STL holds float32
    rows = np.concatenate([normal[:, None], corner], axis=1).reshape(-1, 12)
    np.savetxt(file, rows, fmt=FACET, header="solid body", footer="endsolid body", comments="")
    wanted = netgen.meshing.MeshingParameters(maxh=float(given["edge"]), grading=grading, closeedgefac=None)
    for (x, y, z), size in zip(given["point"], given["size"], strict=True):
        wanted.RestrictH(x, y, z, size)
    mesh = netgen.stl.STLGeometry(str(file)).GenerateMesh(
        wanted, **({"perfstepsend": netgen.meshing.MeshingStep.MESHSURFACE} if "skin" in given else {})
    )
    if "skin" in given:
        face = mesh.Elements2D().NumPy()["nodes"][:, :3].astype(np.int64) - 1
        np.savez(target, node=np.array(mesh.Coordinates()), face=face)
        return
    tet = mesh.Elements3D().NumPy()["nodes"][:, :4].astype(np.int64) - 1
    np.savez(target, node=np.array(mesh.Coordinates()), tet=tet)


if __name__ == "__main__":
    main()
