"""Misfit of the lines and the modes under dashpots.

    pairs: by ln f, ln d and c_kj (line_assignment.py)
    d_k = Δ_k(dashpots) + law(ω_k),
        law = ½[a + bω + cω² + Σ_j e_j (ωτ_j)²/(1 + (ωτ_j)²)] or as it is, a, b, c, e >= 0, refitted beside every trial
        by Huber's loss: a discrete spectrum of relaxations, as of a passive solid [Nowick & Berry 1972, ch. 3]
    left = Σ_k worth_k [ρ((d_k − Δ_k − law)/√(sd_k² + (scatter Δ_k)² + (law d_k)²)) + (1 − C_k²)/rough² + ρ(l_k/level)],
        each bounded, ρ Cauchy's;
        lines that no mode explains count as outliers, and so do modes that would be observable and have no line

c_kj: cosine of a line's amplitudes over the strikes with what one exponential at the mode's pole would take of all
modes, Σ_i a_i 2d_j/((d_i + d_j) − i(ω_i − ω_j)), or with the mode's own. C_k: with what exponentials at the lines'
poles take of all modes together (variable projection's linear half [Golub & Pereyra 1973]): modes that appear as one
line are one, those that a dashpot has split are not. l_k: ln of a line's level over that, less what is common to all:
which one of degenerate modes turned by a dashpot the sensor sees is the same in all strikes, so C_k cannot show it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.effects.common.dashpots import couple_modes
from sonic_bullet.effects.common.points import vertex_normals
from sonic_bullet.lab.effects.common.dashpots import split_into_runs
from sonic_bullet.lab.effects.common.line_assignment import Assignment, assign_lines, strongest_lines, weight_by_level
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.lab.effects.support_damping.dashpot_numbers import (
    ADDED_DECAY_ERROR,
    DAMPING_LAW_ERROR,
    DASHPOT_PAIR_WIDTH,
    DECAY_PAIR_WIDTH,
    LINE_LEVEL_ERROR,
    MISSED_COST,
    MOST_DECAY_COST,
    MOST_LINE_COST,
    PATTERN_ERROR,
    SILENT_MODE_COST,
)
from sonic_bullet.lab.effects.support_damping.smooth_law import least_law, smooth_columns
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.signal.robust import cauchy_loss, fit_nonnegative


@dataclass(frozen=True, slots=True)
class Dashpot:
    """c in N·s/m at a vertex of the model, along its "normal" or "every" direction."""

    vertex: int
    c: float
    along: str


Dashpots = tuple[Dashpot, ...]


@dataclass(frozen=True, slots=True, eq=False)
class DashpotFit:
    """Lines and modes of an object whose dashpots are fitted.

    Attributes
    ----------
    freq_hz, decay_per_s, sd, worth : (k,)
        The lines, spreads of their decays, weights.
    size : (s, k) complex
        Amplitudes.
    observed_hz, rings_per_s : (l,)
        Frequencies and decays of all lines, also those that are not fitted.
    through : (m,)
        Gain of pulse and path at each mode, relative.
    signed : bool
        Whether phases are true.
    model : ModalModel
        The body without dashpots.
    normal : (v, 3)
        Normals of all vertices.
    body : (b,)
        The surface's vertices.
    into, out : (s, m), (m,)
        J φ(p)·e of the strikes, φ(q)·n of the sensor.
    runs, wide : tuple of (r,)
        Neighbours that may couple, RUN and WIDE at most.
    least : (c,)
        The law that most lines lie above.
    untied : (k, k)
        Of the lines' exponentials, see `_invert_gram`.
    """

    freq_hz: Array
    decay_per_s: Array
    sd: Array
    size: Array
    worth: Array
    observed_hz: Array
    rings_per_s: Array
    through: Array
    signed: bool
    model: ModalModel
    normal: Array
    body: Array
    into: Array
    out: Array
    runs: tuple[Array, ...]
    wide: tuple[Array, ...]
    least: Array
    untied: Array = field(init=False)

    def __post_init__(self) -> None:
        """Compute `untied`."""
        object.__setattr__(self, "untied", _invert_gram(self.freq_hz, self.decay_per_s))

    @classmethod
    def of(cls, h: ObjectEvidence) -> DashpotFit:
        """Prepare the fit of an object."""
        # of the worth of a line that the model does not expect: it may be a click or another body's; near a mode, its
        # degenerate partner
        weak, half = 0.05, 0.5
        x = h.model
        assert x is not None
        sd = np.concatenate([h.decay_sd_per_s, np.zeros(len(h.foreign_hz))])
        index, rings = strongest_lines(h), h.every_decay_per_s
        index = index[np.isfinite(rings[index]) & (rings[index] > 0)]
        freq, amplitude, decay = h.every_hz[index], h.every_amplitude[:, index], rings[index]
        is_mode = index < len(h.freq_hz)
        at_home = np.abs(np.log(freq[:, None] / x.freq_hz)).min(axis=1) < DASHPOT_PAIR_WIDTH
        strength = np.nan_to_num(np.abs(amplitude)).max(axis=0)
        worth = weight_by_level(strength) * np.where(is_mode, 1, np.where(at_home, half, weak))
        into, out = h.participation(x.shape[h.places])
        known = into.any(axis=1)  # strikes of unknown place tell decays, no pattern
        amplitude, into = (amplitude[known], into[known]) if known.any() else (amplitude, into)
        through = np.nan_to_num(np.abs(h.push).max(axis=0) / np.maximum(np.abs(into * out).max(axis=0), 1e-300))
        # modes whose coupling is reckoned with in a first look, and in a closer one: what eigenvalues cost goes with
        # the cube
        run, wide = 10, 20
        return cls(
            freq,
            decay,
            np.hypot(np.nan_to_num(sd[index], posinf=1e9), DAMPING_LAW_ERROR * decay) + 1e-3,
            amplitude,
            worth,
            h.every_hz,
            rings,
            through / max(through.max(initial=0.0), 1e-300),
            h.signed,
            x,
            vertex_normals(x),
            np.unique(x.face),
            into,
            out,
            tuple(split_into_runs(x.freq_hz, run)),
            tuple(split_into_runs(x.freq_hz, wide)),
            least_law(h.omega, h.decay_per_s),
        )

    def left(self, dashpots: Dashpots, runs: tuple[Array, ...] | None = None, turns: int = 2) -> float:
        """Compute the misfit of decays, patterns and levels with the best law; runs: modes that couple, None: all."""
        x = self.model
        if not dashpots:
            return self.misfit(-x.decay_per_s + 2j * np.pi * x.freq_hz, np.eye(x.mode_count, dtype=complex), turns)
        return self.misfit(*self._poles([dashpots], runs or (np.arange(x.mode_count),))[0], turns)

    def plain(self) -> tuple[Array, Array]:
        """Pair lines (p,) and modes (p,) without any dashpot."""
        x, omega = self.model, 2 * np.pi * self.model.freq_hz
        pairs = self._pairs(omega, x.decay_per_s, self._alike(omega, x.decay_per_s, self.into * self.out))
        return pairs.line, pairs.mode

    def poles(self, trials: list[Dashpots], runs: tuple[Array, ...]) -> Iterator[tuple[Array, Array]]:
        """Yield poles (m,) and turns (m, m) of many trials; modes couple within runs only; at_once are in memory."""
        at_once = 100  # trials whose poles are found together: (100, m, m) complex, 64 MB of 200 modes
        for first in range(0, len(trials), at_once):
            yield from self._poles(trials[first : first + at_once], runs)

    def _poles(self, trials: list[Dashpots], runs: tuple[Array, ...]) -> list[tuple[Array, Array]]:
        """Compute poles and turns of some trials."""
        phi, m = self.rows(trials), self.model.mode_count
        lam, own = self.model.omega0_squared_per_s2, self.model.decay_per_s
        pole, turn = np.empty((len(trials), m), complex), np.zeros((len(trials), m, m), complex)
        for run in runs:
            part = couple_modes(lam[run], own[run], phi[:, :, run])
            pole[:, run], turn[:, run[:, None], run] = part.pole, part.turn
        return list(zip(pole, turn, strict=True))

    def rows(self, trials: list[Dashpots]) -> Array:
        """Compute √c φ (t, 3j, m) of trials of j dashpots each; unused rows are zero."""
        vertex = np.array([[d.vertex for d in t] for t in trials])
        root = np.sqrt(np.array([[d.c for d in t] for t in trials]))
        moved = self.model.shape[vertex].astype(float)
        every = np.array([[d.along == "every" for d in t] for t in trials])
        along = np.zeros_like(moved)
        along[:, :, 0] = np.einsum("tjx,tjxm->tjm", self.normal[vertex], moved)
        return np.asarray(
            (root[:, :, None, None] * np.where(every[:, :, None, None], moved, along)).reshape(
                len(trials), -1, moved.shape[-1]
            )
        )

    def price(self, pole: Array, turn: Array) -> float:
        """Compute the least price of pairs of lines and modes, with the least law: a first estimate."""
        pole, turn = _alive(pole, turn)
        decay = -pole.real - self._own(turn) + smooth_columns(pole.imag) @ self.least
        push = (self.into @ turn) * (self.out @ turn)
        return self._pairs(pole.imag, decay, self._alike(pole.imag, decay, push)).price

    def _own(self, turn: Array) -> Array:
        """Compute the material's part (m,) of the decays."""
        share = np.abs(turn) ** 2
        return np.asarray((share * self.model.decay_per_s[:, None]).sum(axis=0) / share.sum(axis=0))

    def misfit(self, pole: Array, turn: Array, turns: int) -> float:
        """Compute the misfit of poles (m,) and turns (m, m); turns: of pairing and law, and number of first laws."""
        pole, turn = _alive(pole, turn)
        own = self._own(turn)
        column = np.column_stack([smooth_columns(pole.imag), own])
        push = (self.into @ turn) * (self.out @ turn)
        starts = (smooth_columns(pole.imag) @ self.least, own)[:turns]
        return min(self._by_law(start, pole.imag, -pole.real - own, column, push, turns) for start in starts)

    def _by_law(self, law: Array, omega: Array, extra: Array, column: Array, push: Array, turns: int) -> float:
        """Compute the misfit where lines and modes are paired by a law (m,), then by the law fitted to the pairs."""
        nothing = MOST_LINE_COST * float(self.worth.sum())
        for _ in range(turns):
            alike = self._alike(omega, extra + law, push)
            pairs = self._pairs(omega, extra + law, alike)
            line, mode = pairs.line, pairs.mode
            if not len(line):
                return 2 * nothing  # nor is any mode observed
            worth, sd = (
                self.worth[line],
                np.hypot(self.sd[line], ADDED_DECAY_ERROR * np.minimum(extra[mode], self.decay_per_s[line])),
            )
            law = column @ fit_nonnegative(self.decay_per_s[line] - extra[mode], sd / np.sqrt(worth), column[mode])[0]
        off = np.abs(self.decay_per_s[line] - (extra + law)[mode]) / sd
        decays = np.minimum(cauchy_loss(off**2 / MISSED_COST, MISSED_COST), MOST_DECAY_COST)
        observed, modelled = (
            self._seen(self.size),
            self._seen(self._amplitudes_at_lines(line, omega[mode], omega, extra + law, push)),
        )
        patterns = np.minimum((1 - _cosine(observed, modelled)[line] ** 2) / PATTERN_ERROR**2, MISSED_COST)
        level = _level(observed[:, line], modelled[:, line] * self._through(self.freq_hz[line])) / LINE_LEVEL_ERROR
        levels = np.minimum(cauchy_loss(level**2 / MISSED_COST, MISSED_COST), MOST_DECAY_COST)
        return (
            nothing
            + float((worth * (decays + patterns + levels - MOST_LINE_COST)).sum())
            + self._cost_of_unobserved(mode, omega, extra + law, push)
        )

    def _through(self, freq_hz: Array) -> Array:
        """Compute the gain (k,) of pulse and path, relative."""
        return np.interp(freq_hz, self.model.freq_hz, self.through)

    def _cost_of_unobserved(self, mode: Array, omega: Array, decay: Array, push: Array) -> float:
        """Compute the cost of modes (m,) without a line that would be observable; mode (p,): those with a line."""
        # quantile of the energy of modes that are observed, for one that would be; times a line's decay, for one that
        # it hides
        clear, longer = 0.25, 2.0
        freq = omega / (2 * np.pi)
        level = np.abs(push).max(axis=0) * self._through(freq)
        paired = np.bincount(mode, minlength=len(omega)) > 0
        energy = level**2 / np.maximum(decay, 1e-3)
        loud = (
            ~paired
            & (energy > np.quantile(energy[paired], clear))
            & (freq > freq[paired].min())
            & (freq < freq[paired].max())
        )
        near = np.abs(np.log(self.observed_hz[:, None] / freq[loud])) < 2 * DASHPOT_PAIR_WIDTH
        # a line of unknown decay may be any
        hidden = (near & ~(self.rings_per_s[:, None] > longer * decay[loud])).any(axis=0)
        worth = weight_by_level(level[loud], level[paired].max())
        return float(SILENT_MODE_COST * worth[~hidden].sum())

    def _amplitudes_at_lines(self, line: Array, at: Array, omega: Array, decay: Array, push: Array) -> Array:
        """Compute amplitudes (s, k) at the lines' poles that fit all modes: Σ_l <e_k, e_l> A_l = Σ_i <e_k, e_i> a_i.

        Lines (p,) are at modes at (p,) in 1/s; the mesh's error there is taken out, of their neighbours too.
        """
        mine = np.sort(at)
        near = np.clip(np.searchsorted(mine, omega), 1, max(len(mine) - 1, 1))
        near = np.where(
            np.abs(mine[near - 1] - omega) < np.abs(mine[np.minimum(near, len(mine) - 1)] - omega),
            near - 1,
            np.minimum(near, len(mine) - 1),
        )
        shift = np.log(2 * np.pi * self.freq_hz[line] / at)[np.argsort(at)][near]
        z, size = _poles_of(self.freq_hz, self.decay_per_s)
        y = -decay + 1j * omega * np.exp(shift)
        return np.asarray((self.untied @ ((-size[:, None] / (z.conj()[:, None] + y)) @ push.T)).T * size)

    def _alike(self, omega: Array, decay: Array, push: Array) -> Array:
        """Compute c_kj (k, m) of the module's docstring."""
        share = 2 * decay[None, :] / (decay[:, None] + decay[None, :] - 1j * (omega[:, None] - omega[None, :]))
        observed = self._seen(self.size)
        return np.maximum(
            _cosine(observed, self._seen(push @ share), every=True), _cosine(observed, self._seen(push), every=True)
        )

    def _seen(self, amplitude: Array) -> Array:
        """Return amplitudes, or their magnitudes where phases are not true."""
        return amplitude if self.signed else np.abs(amplitude)

    def _pairs(self, omega: Array, decay: Array, alike: Array) -> Assignment:
        """Pair lines and modes by frequency, decay and pattern."""
        return assign_lines(
            np.log(2 * np.pi * self.freq_hz),
            np.log(omega),
            DASHPOT_PAIR_WIDTH,
            log_decay=(np.log(self.decay_per_s), np.log(np.maximum(decay, 1e-3))),
            decay_width=DECAY_PAIR_WIDTH,
            likeness=alike,
            weight=self.worth[:, None],
        )


def _poles_of(freq_hz: Array, decay_per_s: Array) -> tuple[Array, Array]:
    """Compute z (k,) in 1/s and the factor (k,) by which e^{zt} has norm one."""
    return -decay_per_s + 2j * np.pi * freq_hz, np.sqrt(2 * decay_per_s)


def _invert_gram(freq_hz: Array, decay_per_s: Array) -> Array:
    """Compute the regularized inverse (k, k) of the Gram matrix of exponentials of norm one."""
    z, size = _poles_of(freq_hz, decay_per_s)
    return np.asarray(np.linalg.inv(-size[:, None] * size / (z.conj()[:, None] + z) + 1e-3 * np.eye(len(z))))


def _alive(pole: Array, turn: Array) -> tuple[Array, Array]:
    """Remove modes that no longer oscillate."""
    alive = np.isfinite(pole)
    return pole[alive], turn[:, alive]


def _cosine(a: Array, b: Array, *, every: bool = False) -> Array:
    """Compute cosines of columns (s, k) and (s, k), or of every two (k, m); 1 where they are not comparable."""
    if len(a) < 2 or not (np.isfinite(a).all() and np.isfinite(b).all() and b.any()):
        return np.ones((a.shape[1], b.shape[1]) if every else a.shape[1])
    one, two = a / np.maximum(np.linalg.norm(a, axis=0), 1e-300), b / np.maximum(np.linalg.norm(b, axis=0), 1e-300)
    return np.asarray(np.abs(one.conj().T @ two) if every else np.abs((one.conj() * two).sum(axis=0)))


def _level(observed: Array, modelled: Array) -> Array:
    """Compute ln of the level (k,) of columns (s, k) over others', less the median; 0 where not comparable."""
    if not (np.isfinite(observed).all() and np.isfinite(modelled).all() and modelled.any()):
        return np.zeros(observed.shape[1])
    ratio = np.log(np.maximum(np.linalg.norm(observed, axis=0), 1e-300)) - np.log(
        np.maximum(np.linalg.norm(modelled, axis=0), 1e-300)
    )
    return np.asarray(ratio - np.median(ratio))
