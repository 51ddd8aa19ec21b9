"""Closed surface -> tetrahedra by Netgen [Schöberl 1997], in a child process with a memory limit and a guard.

Sizes alone decide the mesh, never a clock: a child that runs into the guard is an error.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.machine.leftovers import temporary_folder
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError


class EndlessError(MeshError):
    """A child that did not come to an end."""


class TooLargeError(MeshError):
    """A child that outgrew its memory: smaller elements would too."""


def tetrahedra(
    vertex_m: Array,
    face: Array,
    edge_m: float,
    point_m: Array | None = None,
    size_m: Array | None = None,
    *,
    guard_s: int | None = None,
) -> tuple[Array, Array]:
    """Fill a closed surface vertex_m (v, 3), face (f, 3) with tetrahedra (t, 4) over corners (n, 3).

    Parameters
    ----------
    edge_m : the longest edge
    point_m, size_m : (k, 3), (k,) the longest edge at points

    Raises
    ------
    MeshError
        Netgen fails, fills nothing, needs more than 1 GiB, or hangs.
    """
    point_m, size_m = (np.zeros((0, 3)), np.zeros(0)) if point_m is None or size_m is None else (point_m, size_m)
    given, unit_m, centre = _scale_input(vertex_m, face, edge_m, point_m, size_m)
    volume, area = geometry.volume_m3(vertex_m, face), geometry.face_areas_m2(vertex_m, face).sum()
    tets = float(9 * abs(volume) / edge_m**3 + 2 * area / edge_m**2)
    # Processor time after which a child counts as hung: ten times what meshes take. That is an error, and nothing else
    # is tried: a clock decides no result.
    least_guard_s, guard_s_per_tet = 20, 0.002
    result = in_child("_netgen.py", given, guard_s or int(least_guard_s + guard_s_per_tet * min(tets, 1e4)))
    if len(result["tet"]) == 0:
        raise MeshError("mesh encloses no volume", "give thickness_m to make a sheet solid, or close the surface")
    return result["node"] * unit_m + centre, result["tet"]


def compound_tetrahedra(shapes: Sequence[Shape], edge_m: float) -> tuple[Array, Array]:
    """Fill the union of boxes, balls, cylinders and capsules with tetrahedra (t, 4) over corners (n, 3).

    Errors as of `tetrahedra`.
    """
    guard_s = 60  # ten times what five boxes take
    given = {
        "kind": np.array([one.kind for one in shapes]),
        "size": np.array([one.size_m for one in shapes]),
        "place": np.array([one.position_m for one in shapes]),
        "turn": np.array([one.quaternion_xyzw for one in shapes]),
    }
    unit_m = float(
        np.ptp([[one.position_m - one.size_m, one.position_m + one.size_m] for one in shapes], axis=(0, 1)).max()
    )
    given["size"], given["place"] = given["size"] / unit_m, given["place"] / unit_m
    result = in_child("_compound.py", {**given, "edge": np.array(edge_m / unit_m)}, guard_s)
    return result["node"] * unit_m, result["tet"]


def surface_triangles(
    vertex_m: Array, face: Array, edge_m: float, point_m: Array, size_m: Array
) -> tuple[Array, Array]:
    """Mesh a closed surface anew by triangles (t, 3) over corners (n, 3); arguments and errors as of `tetrahedra`."""
    guard_s = 60  # ten times what 40 000 triangles take
    given, unit_m, centre = _scale_input(vertex_m, face, edge_m, point_m, size_m)
    result = in_child("_netgen.py", {**given, "skin": np.array(1)}, guard_s)
    return result["node"] * unit_m + centre, result["face"]


def _scale_input(
    vertex_m: Array, face: Array, edge_m: float, point_m: Array, size_m: Array
) -> tuple[dict[str, Array], float, Array]:
    """Return what Netgen is given, the unit of its lengths in m and its origin (3,)."""
    across = 100.0  # the diagonal as Netgen sees it: its tolerances then fit metres and micrometres alike
    low, high = vertex_m[face].reshape(-1, 3).min(axis=0), vertex_m[face].reshape(-1, 3).max(axis=0)
    unit_m = float(np.linalg.norm(high - low)) / across
    centre = (low + high) / 2
    given = {
        "vertex": (vertex_m - centre) / unit_m,
        "face": face,
        "edge": np.array(edge_m / unit_m),
        "point": (point_m - centre) / unit_m,
        "size": size_m / unit_m,
    }
    return given, unit_m, centre


def in_child(script: str, given: dict[str, Array], guard_s: int) -> dict[str, Array]:
    """Run a script beside this file on given arrays in its own process, and return its arrays.

    Raises MeshError where it fails.
    """
    busy = 20.0  # Wall time per processor time that a child may take on a busy machine before it counts as hung
    memory_limit_bytes = 1024**3
    cut_off = (9, 24)  # SIGKILL, SIGXCPU: the child's own limit on processor time
    name = script.strip("_").removesuffix(".py").capitalize()
    with temporary_folder() as folder:
        source, target = folder / "in.npz", folder / "out.npz"
        limits = {"memory": np.array(memory_limit_bytes), "seconds": np.array(guard_s)}
        np.savez(source, allow_pickle=False, **given, **limits)
        command = [sys.executable, str(Path(__file__).with_name(script)), str(source), str(target)]
        try:
            ended = subprocess.run(
                command, timeout=busy * guard_s, capture_output=True, text=True, check=False, cwd=folder
            )
        except subprocess.TimeoutExpired:
            ended = None
        if ended is None or -ended.returncode in cut_off:
            raise EndlessError(f"{name} did not come to an end on the mesh", "repair the mesh, or give a simpler one")
        if ended.returncode != 0 or not target.exists():
            said = (ended.stderr.strip().splitlines() or ["no message"])[-1]
            raise (TooLargeError if "MemoryError" in said else MeshError)(
                f"{name} failed on the mesh (exit {ended.returncode}: {said[:200]})",
                "repair the mesh, or give a simpler one",
            )
        with np.load(target, allow_pickle=False) as result:
            return {name: result[name] for name in result.files}
