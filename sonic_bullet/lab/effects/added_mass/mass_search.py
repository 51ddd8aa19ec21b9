"""Search for the mass that explains the observed lines: its cost, and the best near a start.

price(vertex, m, R, s, ν) = pairs (line_assignment.py) + ((ν − ν_guess)/σ_ν)²/18      as a line so many widths off
places in turns, each with Gauss and Newton's steps of (ln m, ln R, s, ν) on the pairs' ln f, Cauchy's weights
    [Besl & McKay 1992; Holland & Welsch 1977]
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet.effects.added_mass.free_body import FreeBody
from sonic_bullet.effects.added_mass.mass_loaded_modes import attached, loaded
from sonic_bullet.effects.common.points import vertex_normals
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
from sonic_bullet.signal.robust import fit_linear

PLACES_POLISHED = 2  # of a turn's best
POLISHING_STEPS = 4  # of each
# of ln m, ln R along and across, ν: for slopes; with s: most at once
SLOPE_STEPS = (0.01, 0.1, 0.1, 0.004)
LARGEST_STEPS = (0.4, 1.0, 1.0, 0.03, 0.02)
LEAST_YIELD = 0.1  # of what the rest of the modes may yield
POISSON_STEP = 1e-3
NEARBY_VERTICES = 16  # of the search about one of them
MASS_TURNS = 5
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

    def loaded(self, vertex: int, mass: float, along: tuple[float, float], ratio: float) -> tuple[Array, Array]:
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
        phi = attached(phi if sums is None else phi @ sums, self.normal[vertex], along, small)
        x = loaded(small, phi, mass, self.bare.vertex_m[vertex], self.free)
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

    def sifted(self, vertex: int, mass: float, along: tuple[float, float], width: float) -> list[Scored]:
        """Compute the costs of a mass at each of the shifts that its lines suggest."""
        made = self.loaded(vertex, mass, along, self.fitted)
        return [self._scored(made, vertex, mass, along, shift, self.fitted, width) for shift in self.shifts(*made)]

    def scored(
        self, vertex: int, mass: float, along: tuple[float, float], shift: float, ratio: float, width: float
    ) -> Scored:
        """Compute the cost of a mass, near a common shift of ln f."""
        return self._scored(self.loaded(vertex, mass, along, ratio), vertex, mass, along, shift, ratio, width)

    def _scored(
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

    def refined(self, best: Scored, widths: tuple[float, ...] = PAIRING_WIDTHS) -> Scored:
        """Search nearby vertices, masses and compliances in turns, at each width of ln f."""
        for width in widths:
            best = self.scored(*best[1:], width)
            reach = 0.12 * float(np.linalg.norm(np.ptp(self.bare.vertex_m[self.bare.face], axis=(0, 1))))
            for _ in range(MASS_TURNS):
                first: dict[int, Scored] = {}
                for one in sorted(self._around(best, reach, width)):
                    first.setdefault(one[1], one)
                better = min(best, *(self.polished(one, width) for one in list(first.values())[:PLACES_POLISHED]))
                reach *= 0.5
                if better == best and reach < 0.02:
                    break
                best = better
        return best

    def _around(self, best: Scored, reach: float, width: float) -> list[Scored]:
        """Compute the costs of neighbouring vertices, masses, compliances and ν."""
        steps = (0.5, 0.8, 1.25, 2.0)
        ratios = (-0.03, 0.03)  # steps of ν
        _, vertex, mass, (up, side), shift, ratio = best
        at = self.bare.vertex_m
        body = np.unique(self.bare.face)
        near = body[((at[body] - at[vertex]) ** 2).sum(axis=1) < reach**2]
        least = [LEAST_YIELD * y for y in self.rest(vertex)]
        trials = [(int(v), mass, (up, side)) for v in near[:: max(1, len(near) // NEARBY_VERTICES)]]
        trials += [(vertex, mass * f, (up, side)) for f in steps]
        trials += [(vertex, mass, (max(up, least[0]) * f, side)) for f in (0, *steps)] + [
            (vertex, mass, (up, max(side, least[1]) * f)) for f in (0, *steps)
        ]
        found = [self.scored(*one, shift, ratio, width) for one in trials]
        other = [] if self.observed.poisson is None else [self._solid(ratio + s) for s in ratios]
        return found + [self.scored(vertex, mass, (up, side), shift, r, width) for r in other]

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

    def polished(self, best: Scored, width: float) -> Scored:
        """Fit mass, compliances, shift and ν at one vertex to its pairs, which are assigned anew with every step."""
        for _ in range(POLISHING_STEPS):
            step = self._step(best, width)
            better = best
            for share in (1.0, 0.3):
                better = min(best, self.scored(*self._stepped(best, share * step), width))
                if better != best:
                    break
            if better == best:
                break
            best = better
        return best

    def _stepped(self, best: Scored, step: Array) -> tuple[int, float, tuple[float, float], float, float]:
        """Apply a step of ln m, ln R along and across, ν and s."""
        _, vertex, mass, along, shift, ratio = best
        up, side = (
            max(y, LEAST_YIELD * r) * np.exp(d) for y, r, d in zip(along, self.rest(vertex), step[1:3], strict=True)
        )
        return (
            vertex,
            mass * float(np.exp(step[0])),
            (float(up), float(side)),
            shift + float(step[4]),
            self._solid(ratio + step[3]),
        )

    def _step(self, best: Scored, width: float) -> Array:
        """Compute the step (5,) of Gauss and Newton, at most `LARGEST_STEPS`.

        A number without influence on the lines stays.
        """
        _, _, _, _, shift, ratio = best
        made = self.loaded(best[1], best[2], best[3], ratio)
        pairs, shift = self.pair(*made, shift, width)
        column = pairs.mode
        off = np.log(self.line[pairs.line] / made[0][column]) - shift
        slope = np.zeros((len(column), 5))
        slope[:, 4] = 1.0
        for k in range(4 if self.observed.poisson is not None else 3):
            vertex, mass, along, _, other = self._stepped(best, SLOPE_STEPS[k] * np.eye(5)[k])
            if k == 3 and other == ratio:
                continue
            slope[:, k] = np.log(self.loaded(vertex, mass, along, other)[0][column] / made[0][column]) / SLOPE_STEPS[k]
        poisson_range = self.observed.poisson
        guess, sd = (ratio, 1.0) if poisson_range is None else (poisson_range.guess, poisson_range.sd)
        prior = np.diag(np.array([1.0, 1.0, 1.0, sd, 1.0]) ** -2)
        pull = prior @ (0.0, 0.0, 0.0, guess - ratio, 0.0)
        step = fit_linear(off, slope, np.full(len(off), width), prior, pull, scale=1.0)[0]
        return np.asarray(np.clip(step, -np.array(LARGEST_STEPS), LARGEST_STEPS))
