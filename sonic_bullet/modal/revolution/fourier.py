"""A free isotropic body of revolution as a method (methods.py): section, series, skin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal import lanczos, polynomials
from sonic_bullet.modal.revolution import facets, rings, skin
from sonic_bullet.modal.revolution.rings import BodyOfRevolution
from sonic_bullet.modal.revolution.section import Section, mesh_section
from sonic_bullet.modal.revolution.series import Series, series
from sonic_bullet.modal.sectors import SHIFT_RATIO, Sector, SurfaceShapes, WantedModes
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import ModalError

FEWEST_NODES = 120  # fewer save no time


@dataclass(frozen=True, slots=True, eq=False)
class Fourier:
    """A free isotropic body of revolution.

    Attributes
    ----------
    body : in units of length_m
    wave : largest wave number in walls of thickness (k,)
    section : cut accordingly, its sides finer_by times shorter than usual
    high : λ up to which it is solved at first where only a number of modes is wanted
    """

    body: BodyOfRevolution
    length_m: float
    wave: Callable[[Array], Array]
    section: Section
    high: float = np.inf
    finer_by: float = 1.0

    @property
    def volume(self) -> float:
        """Volume in units of L³."""
        return self.body.volume_m3

    @property
    def meshed(self) -> bool:
        """Whether λ carries an element's error that matters: never."""
        return False

    @property
    def thickness(self) -> float:
        """Thickness 2V/A, over L."""
        outline, after = self.body.outline_m, np.roll(self.body.outline_m, -1, axis=0)
        area = np.pi * (outline + after)[:, 0] * np.linalg.norm(after - outline, axis=1)
        return float(2 * self.volume / area.sum())

    def sectors(self, tensors: Sequence[Array], wanted: WantedModes) -> list[Sector]:
        """Solve for the modes wanted of each tensor (6, 6), a sector a wave number. Raises ModalError."""
        higher = 4.0  # factor on λ where the last try held too few modes
        report_progress(f"solving {3 * self.section.nodes} unknowns of a section for each wave around")
        problems = series(self.section, list(tensors))
        high = self.high
        while True:
            tried = wanted._replace(limit=min(high, wanted.limit))
            found = self._up_to(problems, len(tensors), tried)
            few = min(
                sum(len(sector.found[k][0]) * sector.multiplicity for sector in found) for k in range(len(tensors))
            )
            if high >= wanted.limit or few >= wanted.most:
                return found
            high *= higher

    def _up_to(self, problems: Series, tensors: int, wanted: WantedModes) -> list[Sector]:
        """Solve for one wave number around after another, until none holds a mode that is wanted."""
        most_around = 400  # waves around
        found: list[Sector] = []
        before = np.full(tensors, np.inf)
        for m in count():
            bounds = [
                wanted.bound([(sector.found[k][0], sector.multiplicity) for sector in found]) for k in range(tensors)
            ]
            sector, lowest = self._around(problems, m, wanted.most, bounds)
            if any(len(value) for value, _ in sector.found):
                found.append(sector)
            elif m > 1 and (lowest > before).all():
                break
            before = lowest
            if m == most_around:
                raise ModalError(f"body has modes of more than {m} waves around", "ask for fewer, or for a lower to_hz")
        return found

    def _around(self, problems: Series, m: int, most: int, bounds: Sequence[float]) -> tuple[Sector, Array]:
        """Solve for the modes of m waves around, up to each tensor's bound, and return the lowest λ of each too."""
        multiplicity = 1 if m == 0 else 2
        stiff, mass = problems.problem(m)
        solved, lowest = [], []
        for matrix, bound in zip(stiff, bounds, strict=True):
            modes = lanczos.solve(
                matrix,
                mass,
                -SHIFT_RATIO * self.thickness**2,
                rigid=2 if m < 2 else 0,
                enough=lambda value, bound=bound: bool(value[-1] > bound),  # type: ignore[misc]
                most=-(-most // multiplicity),
            )
            keep = modes.lambda_per_s2 <= bound
            lowest.append(float(modes.lambda_per_s2[0]))
            solved.append((modes.lambda_per_s2[keep], modes.vector[:, keep]))
        return Sector(tuple(solved), stiff, mass, multiplicity, (m, problems)), np.array(lowest)

    def evaluate_on_surface(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> SurfaceShapes:
        """Evaluate vectors (n, b), a matrix a sector, on the surface."""
        around = max((sector.unknowns[0] for sector in sectors), default=0)
        cells = int(np.clip(skin.AROUND_WAVE * around, *skin.AROUND_CELLS))
        wave = float(self.wave(np.array([self.thickness]))[0])
        circles = skin.rows(self.section, 2 * np.pi / wave)
        point, face, curvature, grid = skin.surface(circles, cells)
        moved = [np.zeros((len(point), 3, 0), np.float32)]
        for sector, vector in zip(sectors, vectors, strict=True):
            m, problems = sector.unknowns
            moved += list(skin.displacements(self.section, circles, problems.whole(m, vector), m, cells)[:, grid])
        shape = np.einsum("yx,vxb->vyb", self.body.axes.astype(np.float32), np.concatenate(moved, axis=2))
        vertex = point * self.length_m @ self.body.axes.T + self.body.centre_m
        return SurfaceShapes(vertex, face, curvature / self.length_m, np.ascontiguousarray(shape))

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Estimate the largest relative error of the frequencies up to mode top[1] of sector top[0] by a finer section.

        Of that sector and of those of few waves around, whose modes strain corners and joints as a whole.
        """
        left = 1.75  # 1/(1 - 1.5^-q), which is 1.1 to 2.8
        few_around = 2  # swelling and twist, bending, ovals
        finer = self.finer()
        if finer is None:
            return float("nan")
        problems, highest, most = series(finer.section, [tensor]), sectors[top[0]].found[0][0][top[1]], 0.0
        for sector in sectors:
            value = sector.found[0][0][sector.found[0][0] <= highest]
            if len(value) and (sector.unknowns[0] <= few_around or sector is sectors[top[0]]):
                count = len(value) * sector.multiplicity
                (true, _), *_ = finer._around(problems, sector.unknowns[0], count, [np.inf])[0].found
                most = max(most, float(np.abs(value / true[: len(value)] - 1).max()))
        return left * most / 2

    def surface_error(self, sectors: Sequence[Sector], tensor: Array) -> float:
        """Estimate by how much frequencies change where the facets of the meridian are arcs."""
        return facets.facets_error(self.body, self.section, sectors, tensor)

    def most_fall(self) -> float:
        """Return by how many times its error falls at most: it converges exponentially."""
        return np.inf

    def finer(self) -> Fourier | None:
        """Return the body on a section with sides `finer_sides` times shorter, None where that takes too many nodes."""
        finer_sides = 1.5  # sides shorter by this leave 1.5^-q of the error, q from 1.1 at notches to 6
        by = self.finer_by * finer_sides
        section = mesh_section(self.body, self.wave, by)
        return None if section is None else replace(self, section=section, finer_by=by)

    def note(self, sectors: Sequence[Sector]) -> str:
        """Describe how the modes were found."""
        around = max((sector.unknowns[0] for sector in sectors), default=0)
        return f"body of revolution, section of {self.section.nodes} nodes, up to {around} waves around"


def method_for(shape: Shape, length_m: float, tensor: Array, wanted: WantedModes) -> Fourier | None:
    """Return the method of a free body of revolution, its section fine enough for what is wanted.

    None where the shape is no such body, its material not isotropic, or its walls so thin that it takes too many nodes.
    """
    body = rings.of_shape(shape) if polynomials.isotropic(tensor) else None
    if body is None:
        return None
    unit = body.scale(1 / length_m)
    bare = Fourier(unit, length_m, lambda wall: wall, None)  # type: ignore[arg-type]
    shortest = _wave_number_of(wanted.most, unit, bare.thickness)

    def wave(wall: Array) -> Array:
        return np.asarray(np.minimum(polynomials.wave_number(wanted.beyond * wanted.limit, wall, tensor), shortest))

    high = polynomials.omega2_of(shortest, bare.thickness, tensor)
    section = mesh_section(unit, wave)
    found = None if section is None else Fourier(unit, length_m, wave, section, high)
    while found is not None and found.section.nodes < FEWEST_NODES:
        found = found.finer()
    return found


def _wave_number_of(count: int, body: BodyOfRevolution, thickness: float) -> float:
    """Return a wave number below which a body has at least ``count`` modes.

    Bending modes of its wall [Courant & Hilbert 1924, ch. VI.4], shear waves in its volume [Weyl 1912], or bending
    modes of its length, in pairs.
    """
    # wave number of a curved wall over that of a flat one of as many modes: membranes take the low ones away
    curved = 1.3
    wall = curved * np.sqrt(4 * np.pi * (count + 8) * thickness / body.volume_m3)
    bulk = (3 * np.pi**2 * (count + 8) / body.volume_m3) ** (1 / 3)
    bar = (count / 2 + 2) * np.pi / float(np.ptp(body.outline_m[:, 1]))
    return float(min(wall, bulk, bar))
