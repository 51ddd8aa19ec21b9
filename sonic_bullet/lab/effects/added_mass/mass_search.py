"""Search for the mass that explains the observed lines: its cost, and the best near a start.

price(vertex, m, R, s, ν) = pairs (line_assignment.py) + ((ν − ν_guess)/σ_ν)²/18      as a line so many widths off
at ever narrower widths: place and m, then R and ν with them (fitting.py); s in turns with the pairs
    [Besl & McKay 1992]
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet.effects.added_mass.free_body import FreeBody
from sonic_bullet.effects.added_mass.mass_loaded_modes import attach_modes, load_modes
from sonic_bullet.effects.common.points import vertex_normals
from sonic_bullet.lab.effects.common.fitting import search_places
from sonic_bullet.lab.effects.common.line_assignment import (
    Assignment,
    assign_lines,
    cosines,
    patterns,
    strongest_lines,
    weight_by_level,
)
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.signal.peaks import local_peaks

MASS_REACH = 0.1  # of a place, in sizes of the body, as lines and modes are paired widest
MASS_STEPS = np.array([0.3, 0.5, 0.5, 0.01])  # of ln m, ln R along and across, ν
LEAST_YIELD = 0.1  # of what the rest of the modes may yield
POISSON_STEP = 1e-3
PAIRING_WIDTHS = (0.016, 0.008, 0.004)  # of ln f: lines and modes are paired ever more closely


def _at_points(x: ModalModel, observed: ObjectEvidence) -> ModalModel:
    """Restrict a model to its strikes and sensor, as a trial needs no more."""
    rows = np.append(observed.strike_vertex, observed.sensor_vertex)
    return replace(
        x, shape=x.shape[rows], vertex_m=x.vertex_m[rows], face=np.zeros((0, 3), np.int32), curvature_per_m=np.zeros(0)
    )


# price, vertex, mass in kg, yields in m/N of the baseline's stiffness, ln of the scale, ν
Scored = tuple[float, int, float, tuple[float, float], float, float]


@dataclass(frozen=True, slots=True, eq=False)
class MassFit:
    """Costs of masses on one object.

    Attributes
    ----------
    observed : ObjectEvidence
        The object.
    line : (k,)
        Frequencies of its lines in Hz.
    size : (s, k)
        Magnitudes of their amplitudes.
    bare : ModalModel
        The model without mass.
    small : ModalModel
        The same at strikes and sensor alone.
    normal : (v, 3)
        Unit normals of `bare`.
    free : FreeBody
        Rigid motion; None where the body is held.
    kept : dict
        Cache of `at` by ν.
    """

    observed: ObjectEvidence
    line: Array
    size: Array
    bare: ModalModel
    small: ModalModel
    normal: Array
    free: FreeBody | None
    kept: dict[float, tuple[ModalModel, Array | None]] = field(default_factory=dict)  # by ν

    @classmethod
    def of(cls, observed: ObjectEvidence) -> MassFit:
        """Prepare the fit of an object."""
        assert observed.plain is not None
        line = strongest_lines(observed)
        return cls(
            observed,
            observed.every_hz[line],
            np.abs(observed.every_amplitude[:, line]),
            observed.plain,
            _at_points(observed.plain, observed),
            vertex_normals(observed.plain),
            FreeBody.of(observed.plain),
        )

    def rest(self, vertex: int) -> tuple[float, float]:
        """Compute the compliance of the modes above the band at a vertex, along its normal and across, in m/N.

        It is Σ φ²/λ, if as many modes with as much motion follow above the band in every hertz.
        """
        motion = (self.bare.shape[vertex].astype(float) ** 2).sum(axis=0)
        up = (self.normal[vertex] @ self.bare.shape[vertex].astype(float)) ** 2
        top = self.bare.omega0_squared_per_s2.max()
        return float(up.sum() / top), float((motion - up).sum() / 2 / top)

    @property
    def fitted(self) -> float:
        """Return the baseline's ν."""
        return self.observed.poisson.fitted if self.observed.poisson is not None else 0.0

    def unlikely(self, ratio: float) -> float:
        """Compute the cost of a ν by its distance from the previous estimate."""
        poisson_range = self.observed.poisson
        return 0.0 if poisson_range is None else ((ratio - poisson_range.guess) / poisson_range.sd) ** 2 / 18

    def at(self, ratio: float) -> tuple[ModalModel, Array | None]:
        """Return the bare model at strikes and sensor at a ν, and its modes as sums (m, m) of the baseline's.

        None stands for the baseline's own modes.
        """
        poisson_range = self.observed.poisson
        if poisson_range is None or ratio == poisson_range.fitted:
            return self.small, None
        if ratio not in self.kept:
            x = self.small
            freq, sums = poisson_range.at(ratio)
            freq = np.sqrt(np.maximum(freq**2 - (x.decay_per_s / (2 * np.pi)) ** 2, (0.1 * freq) ** 2))
            order = np.argsort(freq, kind="stable")
            self.kept[ratio] = (
                replace(x, freq_hz=freq[order], shape=x.shape @ sums[:, order].astype(np.float32)),
                sums[:, order],
            )
        return self.kept[ratio]

    def modes_with_mass(
        self, vertex: int, mass: float, along: tuple[float, float], ratio: float
    ) -> tuple[Array, Array]:
        """Compute frequencies (m,) and patterns (s, m) with a mass.

        Parameters
        ----------
        vertex : int
            Where the mass is.
        mass : float
            In kg.
        along : (2,)
            Compliance along the normal and across, m/N.
        ratio : float
            ν of the body.
        """
        small, sums = self.at(ratio)
        phi = self.bare.shape[vertex].astype(float)
        phi = attach_modes(phi if sums is None else phi @ sums, self.normal[vertex], along, small)
        x = load_modes(small, phi, mass, self.bare.vertex_m[vertex], self.free)
        return x.freq_hz, patterns(self.observed, x.shape)

    def shifts(self, freq_hz: Array, pattern: Array) -> list[float]:
        """Find common shifts of ln f at which most lines and modes of like patterns (s, m) agree, and none.

        By correlation of the two spectra on a logarithmic axis.
        """
        # of ln f: common shifts of the baseline's modes that are looked at; a mass lowers lines, so up above all
        reach, bins = (-0.1, 0.25), 0.008
        peaks = 2  # of those shifts, tried further
        alike = np.ones(1)
        if len(self.size) > 1 and np.isfinite(self.size).all() and np.isfinite(pattern).all():
            alike = cosines(self.size, pattern) ** 4
        gap = np.log(self.line)[:, None] - np.log(freq_hz)
        edge = np.arange(reach[0] - bins, reach[1] + 2 * bins, bins)
        count = np.histogram(gap, edge, weights=np.broadcast_to(alike, gap.shape))[0]
        count = np.convolve(count, (0.5, 1.0, 0.5), "same")
        peak = local_peaks(count)
        best = peak[np.argsort(-count[peak])][:peaks]
        return [0.0, *(float(edge[i] + bins / 2) for i in best)]

    def score_shifts(self, vertex: int, mass: float, along: tuple[float, float], width: float) -> list[Scored]:
        """Compute the costs of a mass at each of the shifts that its lines suggest."""
        made = self.modes_with_mass(vertex, mass, along, self.fitted)
        return [self._score_modes(made, vertex, mass, along, shift, self.fitted, width) for shift in self.shifts(*made)]

    def score_mass(
        self, vertex: int, mass: float, along: tuple[float, float], shift: float, ratio: float, width: float
    ) -> Scored:
        """Compute the cost of a mass, near a common shift of ln f."""
        return self._score_modes(
            self.modes_with_mass(vertex, mass, along, ratio), vertex, mass, along, shift, ratio, width
        )

    def _score_modes(
        self,
        made: tuple[Array, Array],
        vertex: int,
        mass: float,
        along: tuple[float, float],
        shift: float,
        ratio: float,
        width: float,
    ) -> Scored:
        """Compute the cost of modes at hand, near a common shift."""
        pairs, found = self.pair(*made, shift, width)
        return pairs.price + self.unlikely(ratio), vertex, mass, along, found, ratio

    def pair(
        self, mode_hz: Array, pattern: Array, shift: float, width: float, turns: int = 1
    ) -> tuple[Assignment, float]:
        """Pair its lines with modes (m,) of patterns (s, m), and find the common shift of ln f in turns with the pairs.

        The price of unlike patterns grows as the square of the frequencies' weight: in the end a mode's amplitude may
        be off by 8 % of its strongest.
        """
        size = self.size
        # lists of frequencies, or strikes of unknown place
        if not (np.isfinite(size).all() and size.any() and np.isfinite(pattern).all() and pattern.any()):
            size, pattern = np.ones((1, len(self.line))), np.ones((1, len(mode_hz)))
        likeness = cosines(size, pattern) if len(size) > 1 else 1.0
        weight = weight_by_level(size.max(axis=0))[:, None] * weight_by_level(pattern.max(axis=0))
        line, mode = np.log(self.line), np.log(mode_hz)
        unlike = (PAIRING_WIDTHS[0] / width) ** 2
        for turn in range(turns + 1):
            pairs = assign_lines(
                line, mode, width, shift=(shift,), likeness=likeness, pattern_price=unlike, weight=weight
            )
            if turn < turns and len(pairs.line):
                off = line[pairs.line] - mode[pairs.mode] - shift
                shift += float(np.clip(np.median(off), -0.01, 0.01))
        return pairs, shift

    def refine_mass(self, best: Scored, widths: tuple[float, ...] = PAIRING_WIDTHS) -> Scored:
        """Refine place and mass, then compliances and ν with them, at each width of ln f."""
        every = 3 if self.observed.poisson is None else 4
        for width in widths:
            for free, trials in ((1, 40), (every, 110)):
                best = self._nearby(self.score_mass(*best[1:], width), width, free, trials)
        return best

    def _nearby(self, best: Scored, width: float, free: int, trials: int) -> Scored:
        """Search about a mass, over its place and the first few of ln m, ln R along and across, ν."""
        _, vertex, mass, along, shift, ratio = best
        least = [max(LEAST_YIELD * y, 1e-30) for y in self.rest(vertex)]
        start = np.array([np.log(mass), *np.log(np.maximum(along, least)), ratio])

        def trial(place: tuple[int, ...], x: Array) -> Scored:
            *ln, ratio = np.append(x, start[free:]).tolist()
            mass, up, side = np.exp(ln).tolist()
            return self.score_mass(place[0], mass, (up, side), shift, self._solid(ratio), width)

        size = float(np.linalg.norm(np.ptp(self.bare.vertex_m[self.bare.face], axis=(0, 1))))
        reach_m = MASS_REACH * size * width / PAIRING_WIDTHS[0] / free**0.5
        return min(
            best, search_places(trial, self.bare, (vertex,), start[:free], MASS_STEPS[:free], reach_m, most=trials)
        )

    def _solid(self, ratio: float) -> float:
        """Limit a ν to the range of its previous estimate, in steps, so that few models are cached."""
        most_sd, solid = 2.0, 0.48  # of the guess' spread; of ν
        poisson_range = self.observed.poisson
        if poisson_range is None:
            return ratio
        return float(
            np.clip(
                round(ratio / POISSON_STEP) * POISSON_STEP,
                poisson_range.guess - most_sd * poisson_range.sd,
                min(poisson_range.guess + most_sd * poisson_range.sd, solid),
            )
        )
