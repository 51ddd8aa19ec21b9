"""Finite elements as a method (methods.py): tetrahedra for any body, clamped or free, of any material.

Polynomials are of degree 3 (lagrange.py); of degree 2 where the user gives elements smaller than a bar is thick. The
first size comes from the shortest wave asked for.

Elements are too stiff: a frequency is too high by something between nothing and the least of two estimates,

    by recovered stress                               (element_errors.py)
    (f(p − 1) − f(p)) / ((p/(p − 1))^s − 1), s = 2    same elements, one degree less (p): spaces contain each other,

errors fall as p^-4μ beside a crease [Babuška & Suri 1994, sec. 3], and no crease has a μ below 1/2 [Williams 1952].
Half of it is subtracted, 1 % at most. The distance to the farther end is reported. Where the size changes the body,
too, its change from another size is reported if it is more. What the elements' faces lose of a bent surface comes on
top (surface_gaps.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal import cost, fem, lagrange, lanczos
from sonic_bullet.modal.cost import CUBIC_UNKNOWNS, FINER_EDGE, MOST_UNKNOWNS, UNKNOWNS_A_TET
from sonic_bullet.modal.element_errors import extend_values, log_changes, recovered_errors, with_neighbours
from sonic_bullet.modal.meshing.filling import LATTICE_NOTE, LATTICE_WALL_EDGES, TETS_A_CUBE, Filler
from sonic_bullet.modal.meshing.sizes import chunkiness
from sonic_bullet.modal.meshing.solid import Solid
from sonic_bullet.modal.meshing.tetrahedra import EndlessError
from sonic_bullet.modal.sectors import MOST_MODES, SHIFT_RATIO, Sector, SurfaceShapes, WantedModes
from sonic_bullet.modal.sparse.ordering import dissection
from sonic_bullet.modal.surface_gaps import gaps_error
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError, ModalError

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.shape_meshes import FilledBody


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """A body filled with tetrahedra.

    Attributes
    ----------
    body : filled body, in m
    clamp : (k, 4) spheres that hold it
    degree : of the polynomials of its field
    thin : whether elements are wider than the wall: one layer of them
    edge_m : edge of the elements
    at_size : fills the body anew by an edge and a filler; None where the user gave the edge
    modes : about how many modes are wanted
    spare : work (cost.py) left for them
    simple : whether surface detail is left out
    draft : whether solved roughly
    skin : corners (v, 3), in m, and triangles (f, 3) of the surface that is filled; None of a named shape
    coarser : the size before
    known : λ (m,) found, by tensor
    """

    ALIKE_EDGES = 1.2  # ratio of a coarser body's edge to a finer one's below which the two are too similar to compare
    OVER = 1.4  # × most_unknowns: a surface with more detail than its volume and area predict takes larger elements

    body: FilledBody
    length_m: float
    clamp: Array
    degree: int
    thin: bool
    edge_m: float
    at_size: Callable[[float, Filler], FilledBody] | None
    modes: int = MOST_MODES
    spare: float = cost.MOST_WORK
    simple: bool = False
    draft: bool = False
    skin: tuple[Array, Array] | None = None
    coarser: Elements | None = None
    known: dict[bytes, Array] = field(default_factory=dict)

    @property
    def solid(self) -> Solid:
        """The body, lengths over L."""
        return Solid(self.body.solid.node_m / self.length_m, self.body.solid.tet, self.body.solid.affine)

    @property
    def volume(self) -> float:
        """Volume in units of L³."""
        return fem.volume_m3(self.solid)

    @property
    def thickened(self) -> float:
        """How many times as thick its walls are as the body's."""
        return self.body.solid.thickened

    @property
    def is_lump(self) -> bool:
        """Whether a body whose walls stand for thinner ones is no plate or shell, so that its modes are no bending."""
        return chunkiness(LATTICE_WALL_EDGES * self.edge_m / self.thickened, self.length_m) > 0

    def waves(self) -> int:
        """Count the bending modes of a wall of `LATTICE_WALL_EDGES` edges whose waves are as long as four of them.

        Shorter ones shear, as those of the thinner wall that it stands for do not. N = A k²/4π, k = 2π/4e
        [Courant & Hilbert 1924, ch. VI.4], and A = V/1.5 e, of tetrahedra of e³/12. Eight at least: the density of
        bending waves goes on from half of them.
        """
        return max(8, int(len(self.body.solid.tet) * np.pi / (16 * TETS_A_CUBE * LATTICE_WALL_EDGES)))

    @property
    def meshed(self) -> bool:
        """Whether λ carries a discretisation error: always, elements are too stiff."""
        return True

    @property
    def nodes(self) -> lagrange.Field:
        """Nodes of the unknowns, over L, in elimination order."""
        made = lagrange.field(self.solid, self.degree)
        if self.degree == 2:  # the solid's nodes are in elimination order
            return made
        order = dissection(made.node_m, made.tet)
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        return lagrange.Field(self.degree, made.node_m[order], place[made.tet])

    def held(self, nodes: lagrange.Field) -> Array:
        """Return which nodes (n,) are clamped.

        Raises
        ------
        ModalError
            All nodes are clamped.
        MeshError
            A clamp does not touch the body.
        """
        clamp = self.clamp / self.length_m
        held = fem.mark_clamped(nodes, clamp)
        if held.all():
            raise ModalError("the clamps hold the whole body", "give a smaller radius")
        return held

    def sectors(self, tensors: Sequence[Array], wanted: WantedModes) -> list[Sector]:
        """Solve for the modes wanted of each tensor (6, 6), in one sector.

        From all λ the discretisation error of the first tensor is subtracted. Raises ModalError, MeshError.
        """
        raw = self._solve(tensors, wanted)
        nodes, free, _ = raw.unknowns
        most = self._most(tensors[0], raw)
        most_off = 0.01  # where elements err by more, their stress tells it badly
        off = np.minimum(np.nan_to_num(most) / 2, most_off if self._same_body else 0.0)
        off = with_neighbours(off, raw.found[0][0])  # pairs stay pairs
        left = np.maximum(most - off, off)
        found = tuple((value * np.exp(-2 * extend_values(off, len(value))), vector) for value, vector in raw.found)
        return [raw._replace(found=found, unknowns=(nodes, free, left))]

    def _most(self, tensor: Array, raw: Sector) -> Array:
        """Estimate the most by which ln f of a tensor's modes (m,) may be too high; NaN where the user gave a size.

        Of a body that another size changes, the most by which that changes them if it is more.
        """
        fine = raw.found[0][0]
        if self.at_size is None or not len(fine):
            return np.full(len(fine), np.nan)
        power = 2.0  # 4μ of a cut, μ = 1/2: no crease is sharper. Of the size, where nothing is singular: the least
        held = fem.mark_clamped(self.solid, self.clamp / self.length_m)
        most = recovered_errors(self.solid, raw.unknowns[0], tensor, held, (fine, _whole(raw, raw.found[0][1])))
        # on bent elements a linear field has no rotations, so no free body of it has modes to compare
        nested = self.degree > 2 or self.body.solid.affine or bool(held.any())
        lower = self._error_against(self._with_degree(self.degree - 1), tensor, fine) if nested else np.full(1, np.nan)
        most = np.fmin(most, np.maximum(lower, 0) / ((self.degree / (self.degree - 1)) ** power - 1))
        coarser, ratio = (None, np.nan) if self._same_body else self._coarser()
        if coarser is not None:
            thicker = np.log(coarser.thickened / self.thickened)  # λ of thickened walls is that of the body times this²
            lower = (self._error_against(coarser, tensor, fine) - thicker) / (ratio**power - 1)
        return most if self._same_body else np.asarray(np.fmax(most, np.abs(lower)))

    def _error_against(self, other: Elements, tensor: Array, fine: Array) -> Array:
        """Compute ln f of other elements minus that of modes with λ ``fine`` (m,), NaN where they have none."""
        name = np.asarray(tensor).tobytes()
        try:
            if len(other.known.get(name, ())) < len(fine):
                other._solve([tensor], WantedModes(np.inf, len(fine)))
        except ModalError:  # walls too thin for its rigid motions to be told from its modes
            return np.full(len(fine), np.nan)
        return log_changes(other.known[name], fine)

    def _solve(self, tensors: Sequence[Array], wanted: WantedModes) -> Sector:
        """Solve for the modes wanted of each tensor (6, 6) by these elements alone. Raises ModalError, MeshError."""
        solid, nodes = self.solid, self.nodes
        held = self.held(nodes)
        free = np.flatnonzero(np.repeat(~held, 3))
        corner = solid.node_m[self.body.skin.node][self.body.skin.face]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2
        shift = -SHIFT_RATIO * (2 * self.volume / float(area)) ** 2
        report_progress(f"assembling {len(free)} unknowns")
        rigid = 6
        if held.any():
            rigid -= int(np.linalg.matrix_rank(fem.rigid_modes(nodes.node_m)[np.repeat(held, 3)], tol=1e-9))
        most = min(wanted.most, max(1, len(free) // 3 - rigid))
        bound = wanted.beyond * wanted.limit
        solved, stiff, mass = [], [], None
        for tensor in tensors:
            k_matrix, mass = fem.assemble(solid, tensor, 1.0, nodes)
            if held.any():
                k_matrix, mass = k_matrix[free][:, free], mass[free][:, free]
            modes = lanczos.solve(
                k_matrix,
                mass,
                shift,
                rigid=rigid,
                enough=lambda value: bool(value[-1] > bound),
                most=most,
                report=True,
                draft=self.draft or self._lattice,  # which errs by percents
            )
            keep = modes.lambda_per_s2 <= bound
            self.known[np.asarray(tensor).tobytes()] = modes.lambda_per_s2
            solved.append((modes.lambda_per_s2[keep], modes.vector[:, keep]))
            stiff.append(k_matrix)
        return Sector(tuple(solved), tuple(stiff), mass, 1, (nodes, free, None))

    def evaluate_on_surface(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> SurfaceShapes:
        """Evaluate vectors (n, b) on the surface."""
        skin = self.body.skin
        nodes, whole = sectors[0].unknowns[0], _whole(sectors[0], vectors[0])
        on_skin = lagrange.at_nodes(nodes, self.body.solid, skin.node) @ whole.reshape(len(nodes.node_m), -1)
        shape = np.ascontiguousarray(on_skin.reshape(len(skin.node), 3, -1), np.float32)
        return SurfaceShapes(
            self.body.solid.node_m[skin.node], skin.face, self.body.curvature_per_m, shape, self.body.touched
        )

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Return the largest relative error estimated of the modes up to top[1], NaN where the user gave the size."""
        return float(sectors[0].unknowns[2][: top[1] + 1].max())

    def surface_error(self, sectors: Sequence[Sector], tensor: Array) -> float:
        """Estimate by how much frequencies change where the body's own surface takes the place of its elements'.

        0 where that is not asked: of a draft, of walls that stand for thinner ones, and of a lattice, whose error is
        that of two sizes.
        """
        if self.skin is None or self.draft or self._lattice or self.thickened != 1:
            return 0.0
        value, vector = sectors[0].found[0]
        skin = self.skin[0] / self.length_m, self.skin[1]
        return gaps_error(self.solid, sectors[0].unknowns[0], tensor, (value, _whole(sectors[0], vector)), skin)

    def within(self, most: float) -> Elements:
        """Return the body with larger elements where unknowns are far over what is allowed, or over ``most``."""
        coarser_tries = 2
        made, aim = self, min(MOST_UNKNOWNS[self.thin], most)
        for _ in range(coarser_tries):
            if made._unknowns < min(self.OVER * MOST_UNKNOWNS[self.thin], most):
                break
            larger = made._refill(made.edge_m * (made._unknowns / aim) ** (1 / made._growth))
            if larger is None:
                break
            made = larger
        return made

    def bounded(self) -> Elements:
        """Return the body with no more unknowns than its work allows.

        It takes larger elements, less detail, a lattice, or degree 2. Raises MeshError where none of these is enough.
        """

        def most(degree: int) -> float:
            return cost.most_unknowns(self.spare, self.modes, degree, self.thin, coarse(self.thin))

        made = self.within(most(3))
        with_less: tuple[Filler, ...] = ("simple", "lattice")  # fillers tried where a surface has too much detail
        for filler in with_less:  # its surface has so much detail
            if made._lattice or self.at_size is None or (filler == "simple" and self.simple):
                continue
            if made._unknowns <= most(3) or (filler == "lattice" and made._with_degree(2)._unknowns <= most(2)):
                break
            other = self._refill(self.edge_m, filler)
            if other is not None:
                other = replace(other, simple=filler == "simple").within(most(3))
                made = min(made, other, key=lambda one: one._unknowns)
        if made._unknowns > min(CUBIC_UNKNOWNS, most(3)):
            made = made._with_degree(2)
        if made._unknowns > most(2):
            raise MeshError(
                f"its surface has so much detail that it needs {made._unknowns:.2g} unknowns, more than {most(2):.2g}",
                "give a simpler mesh, or edge_m, which may cost more",
            )
        return made

    def finer(self) -> Elements | None:
        """Return the body with smaller elements, None where they would be too similar or a clamp holds other nodes.

        Edges are 0.7 times as long, or what the most unknowns and the work left allow.
        """
        spare, most, least = self._room()
        if self.at_size is None or len(self.clamp) or spare <= 0:
            return None
        if least * self.ALIKE_EDGES <= 1:
            made = self._of_size(self.edge_m * max(FINER_EDGE, least), self._filler("any")).within(most)
            if (
                made._unknowns <= min(self.OVER * MOST_UNKNOWNS[self.thin], most)
                and made._smaller_than(self) >= self.ALIKE_EDGES
            ):
                return replace(made, coarser=self, spare=spare)
        return None

    def most_fall(self) -> float:
        """Return by how many times its error falls at most: with all unknowns allowed, at the rate of smooth modes.

        That of a frequency is h^2p  [Strang & Fix 1973, ch. 6.3]. A lattice rounds the body, as h²: twice as good is
        four times as dear at least, and its error is not told that well, so it stays as it is.
        """
        if not self._same_body:
            return 1.0
        return float(max(1.0, 1 / max(self._room()[2], 1e-9)) ** (2 * self.degree))

    def _room(self) -> tuple[float, float, float]:
        """Return the work left for another size, the unknowns that it allows, and their edges over these."""
        modes = max([len(value) for value in self.known.values()], default=self.modes)
        spare = self.spare - cost.work(self._unknowns, modes, self.degree, self.thin)
        if self.known and self.coarser is None:
            spare -= cost.work(coarse(self.thin) * self._unknowns, modes, self.degree, self.thin)
        most = cost.most_unknowns(spare, modes, self.degree, self.thin)
        allowed = max(min(MOST_UNKNOWNS[self.thin], most), 1.0)
        return spare, most, (self._unknowns / allowed) ** (1 / self._growth)

    def _smaller_than(self, other: Elements) -> float:
        """Return how many times smaller its elements are than the other's."""
        return float((len(self.body.solid.node_m) / len(other.body.solid.node_m)) ** (1 / self._growth))

    def _coarser(self) -> tuple[Elements | None, float]:
        """Return the body with larger elements, and how much larger they are.

        None where no coarser body can be made.
        """
        times = 1 / FINER_EDGE
        most_tries = 3  # how often a coarser body is tried: creases keep elements small
        for _ in range(most_tries):
            made = self.coarser or self._refill(self.edge_m * times)
            if made is None or made._lattice != self._lattice:  # cached by a fill with filler "any"
                break
            larger = self._smaller_than(made)
            if larger > self.ALIKE_EDGES:
                return made, larger
            times /= FINER_EDGE
        return None, np.nan

    @property
    def _same_body(self) -> bool:
        """Whether elements of all sizes fill the same body, held at the same places.

        A lattice rounds the body differently at each size, and a clamp reaches other nodes.
        """
        return not self._lattice and not len(self.clamp)

    @property
    def _growth(self) -> int:
        """Power of 1/edge with which the unknowns grow: 2 for a wall of one layer, 3 for a full lump."""
        return 2 if self.thin else 3

    @property
    def _lattice(self) -> bool:
        return self.body.solid.note.startswith(LATTICE_NOTE)

    @property
    def _unknowns(self) -> float:
        return UNKNOWNS_A_TET[self.degree] * len(self.body.solid.tet)

    def _with_degree(self, degree: int) -> Elements:
        return replace(self, degree=degree, known={})

    def _filler(self, otherwise: Filler) -> Filler:
        if self.thickened != 1:
            return "draft"
        return "lattice" if self._lattice else "simple" if self.simple else otherwise

    def _of_size(self, edge_m: float, filler: Filler) -> Elements:
        assert self.at_size is not None
        return replace(self, body=self.at_size(edge_m, filler), edge_m=edge_m, coarser=None, known={})

    def _refill(self, edge_m: float, filler: Filler | None = None) -> Elements | None:
        """Fill anew by its own filler or ``filler``, None where that fails. Raises EndlessError."""
        try:
            return self._of_size(edge_m, filler or self._filler("netgen"))
        except EndlessError:
            raise
        except MeshError:
            return None

    def note(self, sectors: Sequence[Sector]) -> str:
        """Describe how the modes were found."""
        nodes, free, _ = sectors[0].unknowns
        held = len(nodes.node_m) - len(free) // 3
        clamped = f"; {held} nodes clamped" if held else ""
        return f"{self.body.solid.note}; degree {self.degree}, {len(free)} unknowns{clamped}"


def coarse(thin: bool) -> float:
    """Return about what fraction of its unknowns a coarser body has."""
    return float(FINER_EDGE ** (2 if thin else 3))


def _whole(sector: Sector, vector: Array) -> Array:
    """Extend vectors (n, b) of a sector by the clamped unknowns."""
    nodes, free, _ = sector.unknowns
    whole = np.zeros((3 * len(nodes.node_m), vector.shape[1]))
    whole[free] = vector
    return whole
