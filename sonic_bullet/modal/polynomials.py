"""Modes of a free box by Rayleigh-Ritz in Legendre polynomials: all but exact, and quicker than elements.

    u_i = Σ c_ilmn P_l(x/a) P_m(y/b) P_n(z/c),  ∫ P_l P_m = δ_lm,  K = Σ_pq C_pq E_pᵀ E_q,  M = 1
        [Demarest 1971, eq. 8-12; Visscher et al. 1991]

E_p are the strains in Voigt order xx yy zz yz xz xy. P_l' is a sum of lower P_m, so that E_p are products of small
tables and K is exact. A material whose axes are the box's own keeps the three mirrors: eight small problems, one for
each parity. Errors fall exponentially with the degree. K − σ is factored in a basis in which it is banded
(box_bands.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal.box_bands import Bands, Inverse, bands, count_below
from sonic_bullet.modal.meshing import prisms, structured
from sonic_bullet.modal.meshing.shape_meshes import rotation
from sonic_bullet.modal.meshing.solid import surface
from sonic_bullet.modal.sectors import Sector, SurfaceShapes, WantedModes
from sonic_bullet.records import Array, Shape

MOST_UNKNOWNS = 4000
"""Of one parity: 5 s of processor and 0.3 GB for all eight. 200 modes of a square plate or of a cube take 2600."""


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """Box in the body frame: size_m (3,), axes (3, 3) its directions as columns, centre_m (3,)."""

    size_m: Array
    axes: Array
    centre_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class Parity:
    """One of the eight problems of a box.

    Attributes
    ----------
    degree : for each of the three components, (k, 3) degrees of its polynomials
    strain : for each of the six strains its map (n, columns)
    own : the basis in which K is banded
    rigid : number of rigid motions that it holds: one translation or one rotation or none
    """

    degree: tuple[Array, Array, Array]
    strain: tuple[Any, ...]
    own: Bands
    rigid: int

    def stiffness(self, stiffness_pa: Array) -> Array:
        """Compute K (columns, columns) of a tensor (6, 6) without coupling between parities."""
        total: Any = 0
        for p, q in zip(*np.nonzero(stiffness_pa), strict=True):
            total = total + stiffness_pa[p, q] * (self.strain[p].T @ self.strain[q])
        return np.asarray(total.toarray())

    def as_operator(self, stiffness_pa: Array) -> Any:
        """Return the same K as a scipy linear operator."""
        from scipy.sparse.linalg import LinearOperator

        def apply(vector: Array) -> Array:
            moved = np.stack([part @ vector for part in self.strain])
            stress = np.tensordot(stiffness_pa, moved, 1)
            return np.asarray(sum(part.T @ one for part, one in zip(self.strain, stress, strict=True)))

        size = len(self.own.order)
        return LinearOperator((size, size), matvec=apply, matmat=apply, dtype=float)


def recognise_box(shape: Shape) -> Box | None:
    """Recognise the box that a shape is, by its kind or by its mesh, else return None."""
    if shape.kind == "box":
        return Box(
            np.asarray(shape.size_m, float), rotation(shape.quaternion_xyzw), np.asarray(shape.position_m, float)
        )
    if (
        shape.kind != "mesh"
        or not geometry.is_closed(shape.face)
        or not geometry.volume_m3(shape.vertex_m, shape.face) > 0
    ):
        return None
    found = prisms.as_box(shape.vertex_m, shape.face)
    if found is None:
        return None
    size, axes, centre = found
    turn = rotation(shape.quaternion_xyzw)
    return Box(size, turn @ axes, turn @ centre + shape.position_m)


def is_mirrored(stiffness: Array) -> bool:
    """Return whether a tensor (6, 6) is invariant under the box's three mirrors."""
    rest = stiffness.copy()
    rest[:3, :3] = 0
    rest[range(3, 6), range(3, 6)] = 0
    return not np.abs(rest).max() > 1e-9 * np.abs(stiffness).max()


def wave_number(omega2: Any, thickness: Any, stiffness: Array) -> Any:
    """Compute the largest wave number (1/length) of a plate at ω², density one, in the softest direction.

    Bending with shear and rotary inertia [Mindlin 1951, eq. 37].
    """
    compliance = np.linalg.inv(stiffness)
    omega2 = np.minimum(omega2, 1e150)  # without a limit: more than any
    plate, shear = float(1 / np.diag(compliance)[:3].max()), 5 / 6 * float(np.diag(stiffness)[3:].min())
    fast, slow = omega2 / plate, omega2 / shear
    return np.sqrt((fast + slow) / 2 + np.sqrt(12 * fast / thickness**2 + (slow / 2 - fast / 2) ** 2))


def omega2_of(wave: float, thickness: float, stiffness: Array) -> float:
    """Return ω² at which a plate's largest wave number is ``wave``."""
    tries = np.geomspace(1e-12, 1e12, 400)
    return float(tries[int(np.argmax(wave_number(tries, thickness, stiffness) > wave))])


def wave_number_of(count: int, size: Array) -> float:
    """Return a wave number (1/length) below which a box has at least ``count`` modes.

    Bending modes of its length, or of its face [Courant & Hilbert 1924, ch. VI.4]; shear waves in its volume [Weyl
    1912], which are fewer where it is thick.
    """
    _, wide, long = np.sort(size)
    plate = np.sqrt(4 * np.pi * (count + 8) / (wide * long))
    bulk = (3 * np.pi**2 * count / np.prod(size)) ** (1 / 3)
    return float(min((count + 1.5) * np.pi / long, plate, bulk))


def degrees(size: Array, wave: float, *, draft: bool = False) -> tuple[int, int, int]:
    """Return how many polynomials a box of size (3,) takes along each axis for waves up to ``wave``.

    π per wavelength and a margin (λ then to 1e-5; of a draft, to 1e-2).
    """
    reach = wave * np.asarray(size) / 2
    least, more = (3, 1) if draft else (4, 4)
    x, y, z = np.ceil(reach + least + more * np.minimum(1, reach / 4)).astype(int)
    return int(x), int(y), int(z)


def unknowns(terms: tuple[int, int, int]) -> int:
    """Estimate the unknowns of one parity."""
    return int(3 * np.prod(terms) / 8)


def parities(size: Array, terms: tuple[int, int, int], chosen: Sequence[int] = range(8)) -> Iterator[Parity]:
    """Build the eight problems of a box of size (3,) with ``terms`` polynomials along each axis, or some of them."""
    from scipy.sparse import csr_array, eye_array, kron

    steps = []
    for axis in range(3):
        table = [
            _slopes(terms[k]) * (2 / size[k]) if k == axis else eye_array(terms[k], format="csr") for k in range(3)
        ]
        steps.append(csr_array(kron(kron(table[0], table[1]), table[2])).tocsc())
    degree = np.stack(np.meshgrid(*[np.arange(n) for n in terms], indexing="ij"), axis=-1).reshape(-1, 3)
    every = list(product((0, 1), repeat=3))
    for parity in (every[number] for number in chosen):
        mine = [
            np.flatnonzero((degree % 2 == (np.array(parity) + np.eye(3, dtype=int)[k]) % 2).all(axis=1))
            for k in range(3)
        ]
        ends = np.cumsum([0, *(len(m) for m in mine)])

        def of(axis: int, k: int, mine: list[Array] = mine, ends: Array = ends) -> Any:
            """∂/∂axis of component k as a map from all unknowns of this parity."""
            slope = steps[axis][:, mine[k]].tocoo()
            return csr_array((slope.data, (slope.row, slope.col + ends[k])), shape=(len(degree), ends[3]))

        strain = (of(0, 0), of(1, 1), of(2, 2), of(1, 2) + of(2, 1), of(0, 2) + of(2, 0), of(0, 1) + of(1, 0))
        each = (degree[mine[0]], degree[mine[1]], degree[mine[2]])
        yield Parity(each, strain, bands(each, terms, size), int(sum(parity) in (1, 2)))


def _slopes(n: int) -> Any:
    """Build the derivative table (n, n) of orthonormal P on -1..1: P_m' = Σ_l table[l, m] P_l.

    P_m' = Σ (2l+1) P_l over l = m-1, m-3, … [Abramowitz & Stegun 8.5.3, summed].
    """
    from scipy.sparse import csr_array

    low, m = np.arange(n)[:, None], np.arange(n)
    return csr_array(np.where((low < m) & ((low + m) % 2 == 1), np.sqrt((2 * low + 1.0) * (2 * m + 1.0)), 0))


def lowest(parity: Parity, stiffness_pa: Array, limit: float, banded: Any = None) -> tuple[Array, Array]:
    """Find the elastic λ (m,) of a parity up to limit, ascending, and vectors (n, m), M = 1, of a tensor (6, 6).

    banded: its `Bands.stiffness`, where it is known.

    They are counted first, so none is missed. Then shift-and-invert Lanczos finds them.
    """
    from scipy.linalg import eigh
    from scipy.sparse.linalg import LinearOperator, eigsh

    n, rigid = len(parity.own.order), parity.rigid
    own = parity.own
    banded = own.stiffness(stiffness_pa) if banded is None else banded
    count = count_below(own, banded - limit * own.mass)
    if count <= rigid:
        return np.zeros(0), np.zeros((n, 0))
    value, vector = np.full(count, np.inf), np.zeros((n, count))
    if count < n / 8:
        shift = -1e-3 * limit
        operator = LinearOperator((n, n), matvec=Inverse(own, banded - shift * own.mass), dtype=float)
        start = np.random.default_rng(0).standard_normal(n)
        value, vector = eigsh(operator, count, sigma=shift, OPinv=operator, v0=start, tol=1e-12)
    if not value.max() <= limit:  # Lanczos took a degenerate pair for one
        value, vector = eigh(parity.stiffness(stiffness_pa), subset_by_index=(0, count - 1), check_finite=False)
    order = np.argsort(value)[rigid:]
    return value[order], vector[:, order]


@dataclass(frozen=True, slots=True, eq=False)
class Ritz:
    """A free box as a method (methods.py).

    Attributes
    ----------
    terms : polynomials along each axis
    wave : the largest wave number
    high : λ up to which it is solved where only a number of modes is wanted
    draft : whether the skin is coarse
    """

    box: Box
    length_m: float
    terms: tuple[int, int, int]
    wave: float
    high: float
    draft: bool = False

    @property
    def size(self) -> Array:
        """Edges (3,) over L."""
        return self.box.size_m / self.length_m

    @property
    def volume(self) -> float:
        """Volume in units of L³."""
        return float(np.prod(self.size))

    @property
    def meshed(self) -> bool:
        """Whether λ carries an element's error: never."""
        return False

    def sectors(self, tensors: Sequence[Array], wanted: WantedModes) -> list[Sector]:
        """Solve for the modes wanted of each tensor (6, 6), a sector a parity."""
        from scipy.sparse import eye_array

        report_progress(f"solving {8 * unknowns(self.terms)} unknowns of a box")
        problems = list(parities(self.size, self.terms))
        banded = [[parity.own.stiffness(tensor) for tensor in tensors] for parity in problems]
        high = min(wanted.limit, self.high)
        while high < wanted.limit:
            every = zip(problems, banded, strict=True)
            counts = [[count_below(parity.own, k - high * parity.own.mass) for k in of] for parity, of in every]
            few = int(np.sum(counts, axis=0).min()) - 6  # rigid motions
            if few >= wanted.most:
                break
            high *= float(np.clip((1.05 * wanted.most / max(few, 1)) ** 2, 1.2, 4))  # a plate's bending: N ~ √λ
        found: list[Sector] = []
        for parity, of in zip(problems, banded, strict=True):
            solved = []
            for k, tensor in enumerate(tensors):
                bound = wanted._replace(limit=high).bound([(sector.found[k][0], 1) for sector in found])
                solved.append(lowest(parity, tensor, bound, of[k]))
            stiff = tuple(parity.as_operator(tensor) for tensor in tensors)
            found.append(Sector(tuple(solved), stiff, eye_array(len(parity.own.order)), 1, parity))
        return found

    def evaluate_on_surface(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> SurfaceShapes:
        """Evaluate vectors (n, b), a matrix a sector, on the surface."""
        shell = structured.box(self.box.size_m, skin_cells(self.size, self.wave, draft=self.draft))
        skin = surface(shell)
        point = shell.node_m[skin.node]
        shape = np.empty((len(point), 3, sum(vector.shape[1] for vector in vectors)), np.float32)
        end = 0
        for sector, vector in zip(sectors, vectors, strict=True):
            moved = shapes_at(point / self.length_m, self.size, sector.unknowns, vector)
            if not np.array_equal(self.box.axes, np.eye(3)):
                moved = np.einsum("ij,vjb->vib", self.box.axes, moved)
            shape[:, :, end : end + vector.shape[1]] = moved
            end += vector.shape[1]
        vertex = point @ self.box.axes.T + self.box.centre_m
        return SurfaceShapes(vertex, skin.face, np.zeros(len(skin.face)), shape)

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Estimate the relative error of the frequency of mode top[1] of sector top[0] by two more degrees.

        NaN of a draft.
        """
        if self.draft:
            return np.nan
        mine = sectors[top[0]]
        value = float(mine.found[0][0][top[1]])
        x, y, z = (n + 2 for n in self.terms)
        (more,) = parities(self.size, (x, y, z), [top[0]])
        other, _ = lowest(more, tensor, value * (1 + 1e-9))
        return abs(value / float(other[top[1]]) - 1) / 2

    def surface_error(self, sectors: Sequence[Sector], tensor: Array) -> float:
        """Return 0: a box has no other surface."""
        return 0.0

    def most_fall(self) -> float:
        """Return by how many times its error falls at most: it converges exponentially."""
        return np.inf

    def finer(self) -> Ritz | None:
        """Return the box with two more polynomials along each axis, None where that takes too many unknowns."""
        x, y, z = (n + 2 for n in self.terms)
        return replace(self, terms=(x, y, z)) if unknowns((x, y, z)) <= MOST_UNKNOWNS else None

    def note(self, sectors: Sequence[Sector]) -> str:
        """Describe how the modes were found."""
        return f"box of {' x '.join(str(n) for n in self.terms)} polynomials"


def method_for(
    shape: Shape, length_m: float, tensor: Array, wanted: WantedModes, *, draft: bool = False
) -> Ritz | None:
    """Return the method of a free box with enough polynomials for what is wanted.

    None where the shape is no box, where its material's axes are not its own, or where it takes too many unknowns.
    """
    box = recognise_box(shape)
    if box is None or not is_mirrored(tensor) or not (isotropic(tensor) or np.allclose(box.axes, np.eye(3), atol=1e-9)):
        return None
    size = box.size_m / length_m
    thin, most = float(size.min()), wave_number_of(wanted.most, size)
    wave = float(min(wave_number(wanted.limit, thin, tensor), most))
    terms = degrees(size, wave, draft=draft)
    if unknowns(terms) > MOST_UNKNOWNS:
        return None
    return Ritz(box, length_m, terms, wave, omega2_of(most, thin, tensor), draft)


def isotropic(stiffness: Array) -> bool:
    """Return whether a tensor (6, 6) is isotropic."""
    return bool(np.allclose(stiffness, _isotropic(stiffness), atol=1e-9 * np.abs(stiffness).max()))


def _isotropic(stiffness: Array) -> Array:
    """Build the isotropic tensor (6, 6) with the same C_11 and C_44."""
    made = np.zeros((6, 6))
    made[:3, :3] = stiffness[0, 0] - 2 * stiffness[3, 3]
    made[range(6), range(6)] = [stiffness[0, 0]] * 3 + [stiffness[3, 3]] * 3
    return made


def shapes_at(point: Array, size: Array, parity: Parity, vector: Array) -> Array:
    """Compute displacements (v, 3, b) at points (v, 3) of the box about its centre, from coefficients (columns, b).

    In the box's frame; ∫|u|² over the box is one.
    """
    top = [max(int(d[:, axis].max(initial=0)) for d in parity.degree) for axis in range(3)]
    # a factor at a time: points of a skin share lines, and lines planes
    long, wide, thin = (int(axis) for axis in np.argsort(top)[::-1])
    plane, on_plane = np.unique(point[:, long], return_inverse=True)
    across, on_line = np.unique(point[:, wide], return_inverse=True)
    line, of_point = np.unique(on_plane * len(across) + on_line, return_inverse=True)
    first = np.searchsorted(line, np.arange(1, len(plane)) * len(across))
    table = {
        axis: np.polynomial.legendre.legvander(np.clip(2 * place / size[axis], -1, 1), top[axis])
        * np.sqrt((2 * np.arange(top[axis] + 1) + 1) / size[axis])
        for axis, place in ((long, plane), (wide, across[line % len(across)]), (thin, point[:, thin]))
    }
    made = np.zeros((len(point), 3, vector.shape[1]))
    start = 0
    for k, degree in enumerate(parity.degree):
        each = [np.unique(degree[:, axis]) for axis in range(3)]
        weight = vector[start : start + len(degree)].reshape(*(len(one) for one in each), -1)
        weight = weight.transpose(long, wide, thin, 3)
        start += len(degree)
        of_plane = np.tensordot(table[long][:, each[long]], weight, 1)
        parts = np.split(table[wide][:, each[wide]], first)
        of_line = np.concatenate([np.tensordot(*both, 1) for both in zip(parts, of_plane, strict=True)])
        for number, n in enumerate(each[thin]):
            made[:, k] += table[thin][:, n, None] * of_line[of_point, number]
    return made


def skin_cells(size: Array, wave: float, *, draft: bool = False) -> tuple[int, int, int]:
    """Return the cells of the skin along each axis, so that a parabola in each follows the shortest wave."""
    per_wave = 4.0 if draft else 7.0  # cells of the skin to the shortest wave
    most_skin_cells = 64  # along an axis of the skin, at most
    x, y, z = np.clip(np.ceil(np.asarray(size) * wave * per_wave / (2 * np.pi)), 1, most_skin_cells).astype(int)
    return int(x), int(y), int(z)
