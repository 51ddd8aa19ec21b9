"""Surface -> tetrahedra by fTetWild [Hu, Schneider, Wang, Zorin, Panozzo 2020], in a child process with a
time and a memory limit.

fTetWild takes soup, holes and overlaps and fills where the winding number says inside; the surface may move by the
envelope.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

TIME_LIMIT_S = 45.0
BUSY = 4.0
"""Wall time per processor time that a child may take on a busy machine before it counts as hung."""
MEMORY_LIMIT_BYTES = 2 * 1024**3
CUT_OFF = (9, 24)  # SIGKILL, SIGXCPU: the child's own limit on processor time


class TooSlow(MeshError):
    """Filling took longer than it may: on another machine it might not."""


def tetrahedra(
    vertex_m: Array,
    face: Array,
    edge_m: float,
    envelope_m: float,
    *,
    passes: int = 80,
    time_limit_s: float = TIME_LIMIT_S,
) -> tuple[Array, Array]:
    """Corners (n, 3) and tetrahedra (t, 4) filling a surface vertex_m (v, 3), face (f, 3).

    edge_m: wanted edge; envelope_m: how far the surface may move; passes: of optimisation, at most. Raises MeshError
    where fTetWild fails, fills nothing, or takes more than time_limit_s of processor time or 2 GiB.
    """
    low, high = vertex_m[face].reshape(-1, 3).min(axis=0), vertex_m[face].reshape(-1, 3).max(axis=0)
    diagonal_m = float(np.linalg.norm(high - low))
    centre = (low + high) / 2
    with tempfile.TemporaryDirectory(prefix="sonic_bullet-") as folder:
        source, target = Path(folder) / "in.npz", Path(folder) / "out.npz"
        # Unit size about the origin: fTetWild's own tolerances then see every body alike, in metres or micrometres.
        numbers = {
            "edge": np.array(edge_m / diagonal_m),
            "envelope": np.array(envelope_m / diagonal_m),
            "passes": np.array(passes),
            "memory": np.array(MEMORY_LIMIT_BYTES),
            "seconds": np.array(int(np.ceil(time_limit_s))),
            "vertex": (vertex_m - centre) / diagonal_m,
            "face": face,
        }
        np.savez(source, allow_pickle=False, **numbers)
        command = [sys.executable, str(Path(__file__).with_name("_tetwild.py")), str(source), str(target)]
        try:
            ended = subprocess.run(
                command, timeout=BUSY * time_limit_s, capture_output=True, text=True, check=False, cwd=folder
            )  # fTetWild leaves a file where it runs
        except subprocess.TimeoutExpired:
            ended = None
        if ended is None or -ended.returncode in CUT_OFF:
            raise TooSlow(
                f"filling the mesh with tetrahedra took more than {time_limit_s:.0f} s of processor time",
                "give a simpler mesh",
            )
        if ended.returncode != 0 or not target.exists():
            said = (ended.stderr.strip().splitlines() or ["no message"])[-1]
            raise MeshError(
                f"fTetWild failed on the mesh (exit {ended.returncode}: {said[:200]})",
                "repair the mesh, or give a simpler one",
            )
        with np.load(target, allow_pickle=False) as result:
            node, tet = result["node"], result["tet"]
    if len(tet) == 0:
        raise MeshError("mesh encloses no volume", "give thickness_m to make a sheet solid, or close the surface")
    return node * diagonal_m + centre, tet.astype(np.int64)
