"""Wedges as a method (methods.py): a free body that is a very thin sheet, or one whose rims have very many sides.

The first width comes from the shortest wave asked for, as of tetrahedra; wedges need fewer unknowns than these, for one
layer of them bends as smoothly as its deflection is (wedges.py). Wedges are too stiff. The change from wider ones tells
the error, of an order in the width that creases leave:

    |f(h) − f| <= |f(rh) − f(h)| / (r^p − 1)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal import cost, lanczos, polynomials
from sonic_bullet.modal.cost import FINER_EDGE, MOST_UNKNOWNS, UNKNOWNS_A_TET
from sonic_bullet.modal.elements import coarse
from sonic_bullet.modal.meshing.named_shapes import soup
from sonic_bullet.modal.meshing.solid import QUARTERS
from sonic_bullet.modal.meshing.surfaces import Skin, prepare_surface
from sonic_bullet.modal.meshing.tetrahedra import EndlessError
from sonic_bullet.modal.sectors import SHIFT_RATIO, Sector, SurfaceShapes, WantedModes
from sonic_bullet.modal.sheets import wedges
from sonic_bullet.modal.sheets.layers import layer_of
from sonic_bullet.modal.sheets.sheet_sides import Sides, rim, sides_of
from sonic_bullet.modal.sheets.wedges import Layer
from sonic_bullet.modal.sparse.ordering import dissection
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError, ModalError

DEGREE_ALONG = 3
# unknowns of a wedge by each degree through it, those that it shares counted in parts
UNKNOWNS_A_DEGREE = 14.0
# work (cost.py) of wedges over that of tetrahedra of degree 3: their factor is half as full
WEDGE_FACTOR = 1200.0
MOST_WEDGE_UNKNOWNS = 85_000  # 1.7 GB with those of the width before
ALIKE_WIDTHS = 1.15  # ratio of widths below which two meshes are too similar to compare


@dataclass(frozen=True, slots=True, eq=False)
class SheetElements:
    """A sheet meshed by wedges.

    Attributes
    ----------
    skin, sides : its closed surface, in m, and the sides of it
    length_m : what lengths are divided by
    layer : wedges, in m
    edge_m, scale : their width, and its scale where the sheet is bent
    along, through : degrees of their field along the sheet and through it
    modes : about how many modes are wanted
    spare : work (cost.py) left for it
    coarser : wider wedges
    known : λ (m,) found, by tensor
    """

    skin: Skin
    sides: Sides
    length_m: float
    layer: Layer
    edge_m: float
    scale: float
    along: int
    through: int
    modes: int
    spare: float = cost.MOST_WORK
    coarser: SheetElements | None = None
    known: dict[bytes, Array] = field(default_factory=dict)

    @property
    def _unit(self) -> Layer:
        return Layer(self.layer.outer_m / self.length_m, self.layer.inner_m / self.length_m, self.layer.triangle)

    @property
    def volume(self) -> float:
        """Volume in units of L³."""
        return wedges.volume(self._unit)

    @property
    def meshed(self) -> bool:
        """Whether λ carries a discretisation error: always, wedges are too stiff."""
        return True

    @property
    def _unknowns(self) -> float:
        return UNKNOWNS_A_DEGREE * (self.through + 1) * len(self.layer.triangle)

    def sectors(self, tensors: Sequence[Array], wanted: WantedModes) -> list[Sector]:
        """Solve for the modes wanted of each tensor (6, 6), in one sector. Raises ModalError, MeshError."""
        unit = self._unit
        made = wedges.field(unit, self.along, self.through)
        order = dissection(made.node_m, made.wedge)
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        nodes = made._replace(node_m=made.node_m[order], wedge=place[made.wedge])
        area = float(geometry.face_areas_m2(self.skin.vertex_m, self.skin.face).sum()) / self.length_m**2
        shift = -SHIFT_RATIO * (2 * self.volume / area) ** 2
        report_progress(f"assembling {3 * len(nodes.node_m)} unknowns")
        most, bound = min(wanted.most, max(1, len(nodes.node_m) - 6)), wanted.beyond * wanted.limit
        solved, stiff, mass = [], [], None
        for tensor in tensors:
            k_matrix, mass = wedges.assemble(unit, nodes, tensor, 1.0)
            modes = lanczos.solve(
                k_matrix, mass, shift, rigid=6, enough=lambda value: bool(value[-1] > bound), most=most, report=True
            )
            keep = modes.lambda_per_s2 <= bound
            self.known[np.asarray(tensor).tobytes()] = modes.lambda_per_s2
            solved.append((modes.lambda_per_s2[keep], modes.vector[:, keep]))
            stiff.append(k_matrix)
        return [Sector(tuple(solved), tuple(stiff), mass, 1, nodes)]

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Return the largest relative error estimated of the frequencies up to mode top[1].

        From wider wedges, or where these are much the same, what one degree less changes; NaN where neither is solved.
        """
        least_order = 1.5  # of frequencies in the width, along creases [measured on a can's lid]; smooth sheets have 4
        name = np.asarray(tensor).tobytes()
        fine = self.known[name][: top[1] + 1]
        try:
            wider = self.coarser or self._of_scale(1 / FINER_EDGE)
        except MeshError:  # too wide for its bends
            wider = self
        ratio = float(np.sqrt(len(self.layer.triangle) / len(wider.layer.triangle)))
        if ratio < ALIKE_WIDTHS:
            wider = replace(self, along=self.along - 1, coarser=None, known={})
        try:
            if len(wider.known.get(name, ())) < len(fine):
                wider.sectors([tensor], WantedModes(np.inf, len(fine)))
        except (MeshError, ModalError):
            return float("nan")
        coarse = wider.known[name][: len(fine)]
        lost = float(np.abs(np.log(coarse / fine[: len(coarse)])).max() / 2)
        return lost if ratio < ALIKE_WIDTHS else lost / (ratio**least_order - 1)

    def surface_error(self, sectors: Sequence[Sector], tensor: Array) -> float:
        """Return 0: the body is what its triangles enclose."""
        return 0.0

    def most_fall(self) -> float:
        """Return by how many times its error falls at most: unknowns bound it."""
        return np.inf

    def finer(self) -> SheetElements | None:
        """Return the sheet with wedges 0.7 times as wide, None where they may cost no more."""
        modes = max([len(value) for value in self.known.values()], default=self.modes)
        spare = self.spare - _work(self._unknowns, modes)
        if self.coarser is None:
            spare -= _work(coarse(thin=True) * self._unknowns, modes)
        most = min(_most_unknowns(spare, modes, 0.0), MOST_WEDGE_UNKNOWNS)
        times = max(FINER_EDGE, float(np.sqrt(self._unknowns / max(most, 1.0))))
        if spare <= 0 or times * ALIKE_WIDTHS > 1:
            return None
        try:
            made = self._of_scale(times)
        except MeshError:
            return None
        return replace(made, coarser=self, spare=spare) if made._unknowns < 1.1 * most else None

    def _of_scale(self, times: float) -> SheetElements:
        """Mesh the sheet with wedges ``times`` as wide. Raises MeshError."""
        edge_m, scale = self.edge_m * times, self.scale * times
        layer = _mesh_sheet(self.skin, self.sides, edge_m, scale)
        return replace(self, layer=layer, edge_m=edge_m, scale=scale, coarser=None, known={})

    def evaluate_on_surface(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> SurfaceShapes:
        """Evaluate vectors (n, b) on the surface."""
        (vector,) = vectors
        nodes, n, six = sectors[0].unknowns, len(self.layer.outer_m), self.layer.triangle
        rims = six[:, [[0, 3], [3, 1], [1, 4], [4, 2], [2, 5], [5, 0]]].reshape(-1, 2)
        whole = np.repeat(_single(six), 2)
        a, b = rims[whole].T
        outer = six[:, QUARTERS].reshape(-1, 3)
        face = np.concatenate(
            [outer, outer[:, ::-1] + n, np.stack([b, a, a + n], axis=1), np.stack([b, a + n, b + n], axis=1)]
        ).astype(np.int32)
        vertex_m = np.concatenate([self.layer.outer_m, self.layer.inner_m])
        on_skin = wedges.at_nodes(self.layer, nodes) @ vector.reshape(len(nodes.node_m), -1)
        shape = np.ascontiguousarray(on_skin.reshape(len(vertex_m), 3, -1), np.float32)
        given = geometry.face_curvature(self.skin.vertex_m, self.skin.face)
        nearest, _, _ = geometry.closest_point(
            self.skin.vertex_m, self.skin.face, vertex_m[face].mean(axis=1), geometry.outward_normals(vertex_m, face)
        )
        return SurfaceShapes(vertex_m, face, np.asarray(given[nearest]), shape)

    def note(self, sectors: Sequence[Sector]) -> str:
        """Describe how the modes were found."""
        wall_mm = 1e3 * float(np.median(self.sides.wall_m))
        return (
            f"sheet of {wall_mm:.3g} mm, {len(self.layer.triangle)} wedges, edge {self.edge_m:.3g} m{self.skin.note}; "
            f"degrees {self.along} along and {self.through} through it, {3 * len(sectors[0].unknowns.node_m)} unknowns"
        )


def _single(six: Array) -> Array:
    """Return which edges (3t,) of triangles (t, 6) one triangle only has."""
    middle = six[:, 3:].ravel()
    return np.asarray(np.bincount(middle)[middle] == 1)


def method_for(shape: Shape, length_m: float, tensor: Array, wanted: WantedModes) -> SheetElements | None:
    """Mesh a shape by wedges where it is a sheet that tetrahedra do not resolve, else return None."""
    if shape.kind != "mesh":
        return None
    skin = prepare_surface(*soup((shape,)), None)
    if skin.guessed or not geometry.is_closed(skin.face) or not _hard_to_fill(skin):
        return None
    sides = sides_of(skin.vertex_m, skin.face)
    if sides is None or not ((_very_thin(skin) and not _flat(sides)) or _many_sided(sides)):
        return None
    area = float(geometry.face_areas_m2(sides.vertex_m, sides.outer).sum()) / length_m**2
    wall = float(np.median(sides.wall_m)) / length_m
    edge_m, modes = _first(area, wall, tensor, wanted)
    through = 2 if _very_thin(skin) else 3
    # half of what it may have at last, so that a finer mesh can tell its error
    first = coarse(thin=True) * MOST_WEDGE_UNKNOWNS
    most = min(_most_unknowns(cost.MOST_WORK, modes, coarse(thin=True)), first)
    edge_m, scale, tries = edge_m * length_m, 1.0, 3
    try:
        for _ in range(tries):
            layer = _mesh_sheet(skin, sides, edge_m, scale)
            made = SheetElements(skin, sides, length_m, layer, edge_m, scale, DEGREE_ALONG, through, modes)
            over = made._unknowns / most
            if over <= 1:
                return made
            report_progress(f"wedges of {edge_m:.2g} m are {over:.1f} × {most:.0f} unknowns: wider ones are used")
            edge_m, scale = edge_m * 1.05 * over**0.5, scale * 1.05 * over**0.5
    except MeshError as error:
        report_progress(f"no wedges: {error.what}")
    return None


def _work(unknowns: float, modes: int) -> float:
    """Predict the work of one solution, as cost.py has it."""
    return unknowns * (unknowns / WEDGE_FACTOR + cost.START_WORK + modes)


def _most_unknowns(spare: float, modes: int, coarser: float) -> float:
    """Return how many unknowns the work ``spare`` allows, wider wedges of ``coarser`` times as many included."""
    square, line = (1 + coarser**2) / WEDGE_FACTOR, (1 + coarser) * (cost.START_WORK + modes)
    return float((np.sqrt(line**2 + 4 * square * max(spare, 0.0)) - line) / (2 * square))


def _first(area: float, wall: float, tensor: Array, wanted: WantedModes) -> tuple[float, int]:
    """Estimate the first width over L, and how many modes there are, for an area over L² of one side."""
    per_wave, largest = 0.2, 0.1  # width over the shortest wave; over the diagonal, at most
    number = float(polynomials.wave_number(wanted.beyond * wanted.limit, wall, tensor))
    number = min(number, float(np.sqrt(4 * np.pi * (wanted.most + 8) / area)))
    return min(per_wave * 2 * np.pi / number, largest), cost.modes_below(number, 2 * area, wall, wanted)


def _mesh_sheet(skin: Skin, sides: Sides, edge_m: float, scale: float) -> Layer:
    """Mesh a sheet, a little finer where that fails. Raises MeshError."""
    finer = (1.0, 0.95, 0.9)  # Netgen ends with an error at one size of a surface and not at the next
    for times in finer:
        report_progress(f"meshing a sheet with wedges of {times * edge_m:.3g} m")
        try:
            return layer_of(skin.vertex_m, skin.face, sides, times * edge_m, times * scale)
        except EndlessError:
            raise
        except MeshError:
            if times == finer[-1]:
                raise
    raise AssertionError


def _very_thin(skin: Skin) -> bool:
    """Return whether tetrahedra as wide as its wall would be far too many."""
    wall_part = (
        0.007  # of the diagonal: thinner plates get more unknowns (sizes.py), which is not enough where they bend
    )
    return skin.thickness_m < wall_part * float(np.linalg.norm(np.ptp(skin.vertex_m, axis=0)))


def _flat(sides: Sides) -> bool:
    """Return whether it is a plate, which prisms fill by rule."""
    normal = geometry.outward_normals(sides.vertex_m, sides.outer)
    return bool((normal @ normal[0]).min() > np.cos(1e-4))


def _most_sides() -> int:
    """Return how many sides of rims tetrahedra can have: two triangles a side, three tetrahedra each (prisms.py)."""
    return int(MOST_UNKNOWNS[True] / (6 * UNKNOWNS_A_TET[3]))


def _many_sided(sides: Sides) -> bool:
    return len(rim(sides.outer)) > _most_sides()


def _hard_to_fill(skin: Skin) -> bool:
    """Return whether it may be a sheet for wedges, as its thickness and its number of faces tell."""
    return _very_thin(skin) or len(skin.face) > 2 * _most_sides()
