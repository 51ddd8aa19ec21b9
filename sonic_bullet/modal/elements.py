"""Any body as a method (methods.py): filled with quadratic tetrahedra, clamped or free, of any material."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.modal import cache as store
from sonic_bullet.modal import eigen, fem
from sonic_bullet.modal.meshing.solid import Solid
from sonic_bullet.modal.sectors import SHIFT, Sector, Shown, Wanted
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import ModalError

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.shape_meshes import Filled

SOLID = {
    "node": store.Kept("f8", ("n", 3)),
    "tet": store.Kept("i", (None, None), "n"),
    "affine": store.Kept("b1", (1,)),
    "skin": store.Kept("i", ("v",), "n"),
    "face": store.Kept("i", ("f", 3), "v"),
    "curvature": store.Kept("f8", ("f",)),
}


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """body: filled, in m. held (n,): its clamped nodes."""

    body: Filled
    length_m: float
    held: Array

    @property
    def solid(self) -> Solid:
        """The body over L."""
        return Solid(self.body.solid.node_m / self.length_m, self.body.solid.tet, self.body.solid.affine)

    @property
    def volume(self) -> float:
        """In units of L³."""
        return fem.volume_m3(self.solid)

    @property
    def meshed(self) -> bool:
        """Elements are too stiff."""
        return True

    @property
    def free(self) -> Array:
        """Unknowns that no clamp holds."""
        return np.flatnonzero(np.repeat(~self.held, 3))

    def sectors(self, tensors: Sequence[Array], wanted: Wanted, say: Callable[[str], None]) -> list[Sector]:
        """The modes wanted of each tensor (6, 6), one sector. Raises ModalError, MeshError."""
        solid, free = self.solid, self.free
        corner = solid.node_m[self.body.skin.node][self.body.skin.face]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2
        shift = -SHIFT * (2 * self.volume / float(area)) ** 2
        say(f"assembling {3 * len(self.held)} unknowns")
        rigid, clamped = 6, bool(self.held.any())
        if clamped:
            rigid -= int(np.linalg.matrix_rank(fem.rigid_modes(solid.node_m)[np.repeat(self.held, 3)], tol=1e-9))
        most = min(wanted.most, max(1, len(free) // 3 - rigid))
        bound = wanted.beyond * wanted.limit
        solved, stiff, mass = [], [], None
        for tensor in tensors:
            k_matrix, mass = fem.assemble(solid, tensor, 1.0)
            if clamped:
                k_matrix, mass = k_matrix[free][:, free], mass[free][:, free]
            modes = eigen.solve(
                k_matrix, mass, shift, rigid=rigid, enough=lambda value: bool(value[-1] > bound), most=most, say=say
            )
            keep = modes.lambda_per_s2 <= bound
            solved.append((modes.lambda_per_s2[keep], modes.vector[:, keep]))
            stiff.append(k_matrix)
        return [Sector(tuple(solved), tuple(stiff), mass, 1, None)]

    def shown(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> Shown:
        """Vectors (n, b) on the surface."""
        skin = self.body.skin
        (vector,) = vectors
        whole = np.zeros((3 * len(self.held), vector.shape[1]), np.float32)
        whole[self.free] = vector
        shape = np.ascontiguousarray(whole.reshape(len(self.held), 3, -1)[skin.node])
        return Shown(self.body.solid.node_m[skin.node], skin.face, self.body.curvature_per_m, shape)

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Not known."""
        return float("nan")

    def finer(self) -> None:
        """None: its size is its budget's."""
        return

    def note(self, sectors: Sequence[Sector]) -> str:
        """How it was done."""
        clamped = f"; {int(self.held.sum())} nodes clamped" if self.held.any() else ""
        return f"{self.body.solid.note}; {len(self.free)} unknowns{clamped}"


def filled(
    shapes: tuple[Shape, ...],
    length_m: float,
    clamp: Array,
    sizes: tuple[float | None, float | None],
    kept: tuple[store.Place, str],
    say: Callable[[str], None],
) -> Elements:
    """The method of any body, clamped where clamp (k, 4) reaches. sizes: edge_m, thickness_m.

    Raises MeshError, ModalError.
    """
    body = _filled(shapes, sizes, kept, say)
    held = fem.clamped(body.solid, clamp)
    if held.all():
        raise ModalError("the clamps hold the whole body", "give a smaller radius")
    return Elements(body, length_m, held)


def _filled(
    shapes: tuple[Shape, ...],
    sizes: tuple[float | None, float | None],
    kept: tuple[store.Place, str],
    say: Callable[[str], None],
) -> Filled:
    """The body's inside and skin, from the cache where it is there. sizes: edge_m, thickness_m."""
    from sonic_bullet.modal.meshing.shape_meshes import Filled, fill
    from sonic_bullet.modal.meshing.solid import SolidSurface

    found = store.load(*kept, SOLID)
    if found is not None:
        a, note = found
        return Filled(
            Solid(a["node"], a["tet"], bool(a["affine"][0]), note), SolidSurface(a["skin"], a["face"]), a["curvature"]
        )
    body = fill(shapes, *sizes, say)
    solid, skin = body.solid, body.skin
    arrays = {
        "node": solid.node_m,
        "tet": solid.tet,
        "affine": np.array([solid.affine]),
        "skin": skin.node,
        "face": skin.face,
        "curvature": body.curvature_per_m,
    }
    store.save(*kept, arrays, solid.note)
    return body
