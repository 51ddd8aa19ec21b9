"""Any body as a method (methods.py): filled with tetrahedra, clamped or free, of any material.

Polynomials are of degree 3 (lagrange.py); of degree 2 where the user gives elements smaller than a bar is thick. The
first size comes from the shortest wave asked for. Elements are too stiff: from one size to the next f falls, and what
two sizes tell is taken off [Richardson 1911]:

    f(h) = f + C h^p,   (f(rh) − f(h)) / (r^p − 1) is taken off f(h) with a middle p;  what the least and the highest p
    would have taken off lies on both sides of it: half of what they disagree is the error told
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.files import cache as store
from sonic_bullet.modal import eigen, fem, lagrange, polynomials
from sonic_bullet.modal.kept_solids import kept_or_filled
from sonic_bullet.modal.keys import key
from sonic_bullet.modal.meshing.filling import LATTICE
from sonic_bullet.modal.meshing.named_shapes import soup
from sonic_bullet.modal.meshing.sizes import edge_within_m
from sonic_bullet.modal.meshing.solid import Solid
from sonic_bullet.modal.meshing.surfaces import prepared
from sonic_bullet.modal.ordering import dissection
from sonic_bullet.modal.sectors import MOST_MODES, SHIFT, Sector, Shown, Wanted
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError, ModalError

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.shape_meshes import Filled

PER_WAVE = 0.2
"""First edge over the shortest wave."""
ORDERS = {2: (2.0, 3.0, 4.0), 3: (2.0, 2.5, 3.5)}
"""Of frequencies in h, by degree: least, middle and most. Smooth lumps have 4 [Strang & Fix 1973, ch. 6.3]; less is
measured where walls are an element thick, and along creases, where stress is singular."""
FINER = 0.7  # from one edge to the next: half the elements of a wall
ALIKE, LARGER = 1.2, 3
"""Edges of a coarser body over a finer one's, below which both are too much alike to tell anything; how often a coarser
one is tried: creases keep elements small."""
MOST_UNKNOWNS = {True: 70_000, False: 30_000}
"""Of thin bodies and of lumps, whose factor is full: 15 s of processor and 1.2 GB at most. An edge_m allows more."""
LIMIT = 100_000  # unknowns that degree 3 may take: of more elements those of degree 2 are a third
TRIES = 2
OVER = 1.4  # over those: a surface has more detail than its volume and area tell, and takes larger elements
UNKNOWNS_PER_TET = {2: 6.0, 3: 18.0}  # by degree, of thin walls; less of lumps
WIDE = 2.2  # given elements over 2V/A, which is half as thick as a bar: wider ones take degree 3
LARGEST = 0.2  # edge over the diagonal: fewer elements than that are no body
TOGETHER = 3  # highest modes whose errors are averaged: one alone may change places with its neighbour


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """body: filled, in m, by elements of edge_m. clamp (k, 4): spheres that hold it. degree: of its field.
    thin: elements are wider than the wall: one layer of them.

    at_size: the body filled anew by an edge, by the lattice or not, by Netgen or not at all; None where the user gave
    the edge. coarser: the
    size before. known: λ (m,) found, by tensor.
    """

    body: Filled
    length_m: float
    clamp: Array
    degree: int
    thin: bool
    edge_m: float
    at_size: Callable[[float, bool, bool], Filled] | None
    coarser: Elements | None = None
    known: dict[bytes, Array] = field(default_factory=dict)

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
    def nodes(self) -> lagrange.Field:
        """Of the unknowns, over L, in elimination order."""
        made = lagrange.field(self.solid, self.degree)
        if self.degree == 2:  # the solid is in that order
            return made
        order = dissection(made.node_m, made.tet)
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        return lagrange.Field(self.degree, made.node_m[order], place[made.tet])

    def held(self, nodes: lagrange.Field) -> Array:
        """Which nodes (n,) are clamped. Raises ModalError where all are, MeshError where a clamp is elsewhere."""
        clamp = self.clamp / self.length_m
        held = fem.clamped(nodes, clamp)
        if held.all():
            raise ModalError("the clamps hold the whole body", "give a smaller radius")
        return held

    def sectors(self, tensors: Sequence[Array], wanted: Wanted, say: Callable[[str], None]) -> list[Sector]:
        """The modes wanted of each tensor (6, 6), one sector; of all λ that is taken off which the first tensor's tell.

        Raises ModalError, MeshError.
        """
        raw = self._solved(tensors, wanted, say)
        nodes, free, _ = raw.place
        less = self._less(tensors[0], raw.found[0][0], say)
        off = np.nan_to_num(less[1]) if self._same_body else np.zeros(less.shape[1])
        found = tuple((value * np.exp(-2 * _as_long(off, len(value))), vector) for value, vector in raw.found)
        return [raw._replace(found=found, place=(nodes, free, (less[0] - less[2]) / 2 if self._same_body else less[1]))]

    def _less(self, tensor: Array, fine: Array, say: Callable[[str], None]) -> Array:
        """ln f of modes with λ ``fine`` (m,) less that of infinitely small elements, (3, m) by its `ORDERS`; NaN where
        nothing coarser tells.
        """
        coarser, ratio = self._coarser()
        if coarser is None or not len(fine):
            return np.full((3, len(fine)), np.nan)
        name = np.asarray(tensor).tobytes()
        if len(coarser.known.get(name, ())) < len(fine):
            coarser._solved([tensor], Wanted(np.inf, len(fine)), say)
        coarse = coarser.known[name][: len(fine)]
        lost = np.log(_as_long(coarse / fine[: len(coarse)], len(fine))) / 2
        # modes nearer to one another than that may have changed places: they share it
        apart = np.flatnonzero(np.diff(np.log(fine)) / 2 > np.abs(lost[:-1])) + 1
        lost = np.concatenate([np.full(len(few), few.mean()) for few in np.split(lost, apart) if len(few)])
        return np.array([lost / (ratio**order - 1) for order in ORDERS[self.degree]])

    def _solved(self, tensors: Sequence[Array], wanted: Wanted, say: Callable[[str], None]) -> Sector:
        """The modes wanted of each tensor (6, 6) by these elements alone. Raises ModalError, MeshError."""
        solid, nodes = self.solid, self.nodes
        held = self.held(nodes)
        free = np.flatnonzero(np.repeat(~held, 3))
        corner = solid.node_m[self.body.skin.node][self.body.skin.face]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2
        shift = -SHIFT * (2 * self.volume / float(area)) ** 2
        say(f"assembling {len(free)} unknowns")
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
            modes = eigen.solve(
                k_matrix, mass, shift, rigid=rigid, enough=lambda value: bool(value[-1] > bound), most=most, say=say
            )
            keep = modes.lambda_per_s2 <= bound
            self.known[np.asarray(tensor).tobytes()] = modes.lambda_per_s2
            solved.append((modes.lambda_per_s2[keep], modes.vector[:, keep]))
            stiff.append(k_matrix)
        return Sector(tuple(solved), tuple(stiff), mass, 1, (nodes, free, None))

    def shown(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> Shown:
        """Vectors (n, b) on the surface."""
        skin = self.body.skin
        ((vector,), (nodes, free, _)) = vectors, sectors[0].place
        whole = np.zeros((3 * len(nodes.node_m), vector.shape[1]))
        whole[free] = vector
        on_skin = lagrange.at_nodes(nodes, self.body.solid, skin.node) @ whole.reshape(len(nodes.node_m), -1)
        shape = np.ascontiguousarray(on_skin.reshape(len(skin.node), 3, -1), np.float32)
        return Shown(self.body.solid.node_m[skin.node], skin.face, self.body.curvature_per_m, shape)

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Of the frequency of mode top[1], relative, the mean over it and two below; NaN where the user gave the size,
        or no coarser body can be made.
        """
        left = sectors[0].place[2]
        return float(np.abs(left[max(0, top[1] + 1 - TOGETHER) : top[1] + 1]).mean())

    def within(self, unknowns: float) -> Elements:
        """The same with larger elements where there are by far more unknowns."""
        made = self
        for _ in range(TRIES):
            if made._unknowns < OVER * unknowns:
                break
            made = made._of_size(made.edge_m * (made._unknowns / unknowns) ** (1 / made._growth))
        return made

    def finer(self) -> Elements | None:
        """The same with edges `FINER` as long, or as `MOST_UNKNOWNS` allows; None where that is too much alike, or
        where a clamp would hold other nodes.
        """
        most = MOST_UNKNOWNS[self.thin]
        least = (self._unknowns / most) ** (1 / self._growth)
        if self.at_size is None or len(self.clamp):
            return None
        if least * ALIKE <= 1:
            made = self._of_size(self.edge_m * max(FINER, least)).within(most)
            if made._unknowns <= OVER * most and made._smaller_than(self) >= ALIKE:
                return replace(made, coarser=self)
        return replace(self, degree=2, coarser=None, known={}).finer() if self.degree == 3 else None

    def _smaller_than(self, other: Elements) -> float:
        """How many times smaller its elements are."""
        return float((len(self.body.solid.node_m) / len(other.body.solid.node_m)) ** (1 / self._growth))

    def _coarser(self) -> tuple[Elements | None, float]:
        """The same with larger elements, and how much larger they are; None where the user gave their size, or none can
        be made.
        """
        times = 1 / FINER
        for _ in range(LARGER):
            if self.coarser is None and self.at_size is None:
                break
            try:  # what only tells the error of Netgen's elements is not filled by what stands for Netgen
                made = self.coarser or self._of_size(self.edge_m * times, netgen=not self._lattice)
            except MeshError:
                break
            if made._lattice != self._lattice:
                break
            larger = self._smaller_than(made)
            if larger > ALIKE:
                return made, larger
            times /= FINER
        return None, np.nan

    @property
    def _same_body(self) -> bool:
        """Whether elements of all sizes fill the same body, held at the same places: what a lattice rounds and which
        nodes a clamp reaches is another matter.
        """
        return not self._lattice and not len(self.clamp)

    @property
    def _growth(self) -> int:
        """Power of 1/edge that the unknowns grow with: a wall takes one layer, a lump is full."""
        return 2 if self.thin else 3

    @property
    def _lattice(self) -> bool:
        return self.body.solid.note.startswith(LATTICE)

    @property
    def _unknowns(self) -> float:
        return UNKNOWNS_PER_TET[self.degree] * len(self.body.solid.tet)

    def _of_size(self, edge_m: float, *, netgen: bool = False) -> Elements:
        assert self.at_size is not None
        return replace(self, body=self.at_size(edge_m, self._lattice, netgen), edge_m=edge_m, coarser=None, known={})

    def note(self, sectors: Sequence[Sector]) -> str:
        """How it was done."""
        nodes, free, _ = sectors[0].place
        held = len(nodes.node_m) - len(free) // 3
        clamped = f"; {held} nodes clamped" if held else ""
        return f"{self.body.solid.note}; degree {self.degree}, {len(free)} unknowns{clamped}"


def _as_long(values: Array, count: int) -> Array:
    """values (m,), cut or the last repeated."""
    return np.asarray(values[np.minimum(np.arange(count), len(values) - 1)]) if len(values) else np.zeros(count)


def filled(
    shapes: tuple[Shape, ...],
    length_m: float,
    tensor: Array,
    wanted: Wanted,
    clamp: Array,
    sizes: tuple[float | None, float | None],
    kept: tuple[store.Place, str],
    say: Callable[[str], None],
) -> Elements:
    """The method of any body, clamped where clamp (k, 4) reaches, its first size from what is wanted of a material of
    stiffness (6, 6). sizes: edge_m, None for that, and thickness_m. Raises MeshError, ModalError.
    """
    given, thickness_m = sizes

    def at_size(edge_m: float, lattice: bool, netgen: bool) -> Filled:
        cache, name = kept
        name = key("solid", name, edge_m, lattice)
        return kept_or_filled(shapes, (edge_m, thickness_m), (cache, name), say, lattice=lattice, netgen=netgen)

    # which nodes a clamp reaches goes with their size, and moves modes by up to 1 %: one size then, whatever is wanted
    first = Wanted(np.inf, MOST_MODES) if len(clamp) else wanted
    wall_m, edge_m = _first(shapes, thickness_m, length_m, tensor, first, say)
    edge = given or edge_m
    thin = edge > wall_m
    degree = 2 if given and given < WIDE * wall_m else 3
    made = Elements(at_size(edge, False, False), length_m, clamp, degree, thin, edge, None if given else at_size)
    if given is None:
        made = made.within(MOST_UNKNOWNS[thin])
    if made.degree == 3 and made._unknowns > LIMIT:  # the surface's detail, or a lattice's, wants so many elements
        made = replace(made, degree=2)
    made.held(lagrange.field(made.solid, 2))
    return made


def _first(
    shapes: tuple[Shape, ...],
    thickness_m: float | None,
    length_m: float,
    tensor: Array,
    wanted: Wanted,
    say: Callable[[str], None],
) -> tuple[float, float]:
    """The wall and the edge to begin with, in m: for the shortest wave of a plate as thick as the body is, at the
    highest λ wanted or the wave of as many modes as are wanted, and no more unknowns than may be.
    """
    skin = prepared(*soup(shapes), thickness_m)
    area = float(geometry.face_areas_m2(skin.vertex_m, skin.face).sum()) / length_m**2
    wall = skin.thickness_m / length_m
    flat = np.sqrt(4 * np.pi * (wanted.most + 8) / (area / 2))
    bulk = (3 * np.pi**2 * (wanted.most + 8) / (area * wall / 2)) ** (1 / 3)  # two shear waves fill a lump
    wave = 2 * np.pi / min(float(polynomials.wave_number(wanted.beyond * wanted.limit, wall, tensor)), max(flat, bulk))
    edge = min(PER_WAVE * wave, LARGEST)
    most = MOST_UNKNOWNS[edge > wall]
    least = edge_within_m(area * wall / 2, wall, most / UNKNOWNS_PER_TET[3])
    if edge < least:
        say(
            f"elements of {edge * length_m:.2g} m, for the shortest wave wanted, are about {(least / edge) ** 2:.1f} × "
            f"{most} unknowns: larger ones are used, unless edge_m gives their size"
        )
    return wall * length_m, max(edge, least) * length_m
