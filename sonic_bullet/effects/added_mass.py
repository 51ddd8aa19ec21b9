"""`added-mass`: a sensor, a blob of wax, water: a small mass that rides on one point.

    (Λ − λ (1 + m ΦᵀΦ)) q = 0,  Φ = (φ(p), √(λ_r R)) (3, n + 3)      to first order Δλ/λ = −m |φ(p)|²                [Rayleigh 1894, § 88-90; modal synthesis]

R: what the modes above the band yield at the point, along its normal and across: residual attachment modes far above them [Rubin 1975]. Without it a
point mass is held too stiffly, and its higher modes come out several per cent high.
Read off frequencies and patterns together: for points all over the surface and masses up to a sixth of the body's, lines are paired with the loaded
body's modes anew; the pairs that agree best stand, where they agree better than the bare body's. E/ρ was fitted to lines that the mass had lowered, so
the common scale of all frequencies is looked for along with it, on the bare body as well: λ(Λ e^{2s}, R e^{−2s}) = e^{2s} λ(Λ, R).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.pairs import agreed, every_line, patterns
from sonic_bullet.effects.points import nearest, spread_out, vertex_normals
from sonic_bullet.effects.values import Evidence, Heard, Owner, Stage
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.side_by_side import side_by_side

POINTS = 100
SHARES = (0.002, 0.006, 0.015, 0.03, 0.055, 0.1, 0.16)  # of the body's mass
YIELDS = (0.0, 0.25, 0.8)  # of what the modes in the band yield along the normal, to begin with
ACROSS = 1 / 3  # of that along the normal, to begin with
FAR = 16.0  # of the highest mode's λ: where what is left of the modes is put
STEPS = (0.5, 0.8, 0.93, 0.98, 1.02, 1.07, 1.25, 2.0)
NEAR, TURNS = 16, 5  # vertices and turns of the search about one of them
TRIES = 6
WIDTHS = (0.016, 0.008, 0.004)  # of ln f: lines and modes are paired ever more closely
MATCHED, MOVED = 0.8, 2.5e-3  # share of lines, and how far nine in ten of them may lie off: a mesh's error
STAYED = 0.5  # of all lines' strength
REACH, BINS = (-0.1, 0.25), 0.008  # of ln f: common shifts of the baseline's modes that are looked at; a mass lowers lines, so up above all
FAR_OFF = 0.015  # of ln f: more than pairs alone find
PEAKS = 2  # of those shifts, tried further
BETTER = (1.5, 0.12)  # in price: as much as a strong line and a half, paired well; and of the bare body's own


@dataclass(frozen=True)
class AddedMass:
    """mass_kg riding on position_m (3,) of the surface, in the mesh's frame. yield_m_n: along the normal and across it, of what the model's modes leave out.

    stretch: ln of what all frequencies of the bare body are to the baseline's; the host takes it over.
    """

    id: ClassVar[str] = "added-mass"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.FIXTURE
    costly: ClassVar[bool] = True
    reference: ClassVar[str] = "Rayleigh 1894, § 88-90; Rubin 1975"

    position_m: tuple[float, float, float]
    mass_kg: float
    yield_m_n: tuple[float, float] = (0.0, 0.0)
    stretch: float = 0.0

    def apply(self, x: ModalModel) -> ModalModel:
        """The modes with the effect in them."""
        if not x.mode_count or self.mass_kg == 0:
            return x
        at = nearest(x, self.position_m)
        return loaded(x, attached(x.shape[at].astype(float), vertex_normals(x)[at], self.yield_m_n, x), self.mass_kg)

    def parameters(self) -> dict[str, Any]:
        """What it says, for people and JSON, in SI units."""
        return {"mass_kg": self.mass_kg, "position_m": list(self.position_m), "yield_m_n": list(self.yield_m_n), "stretch": self.stretch}

    def freedom(self) -> int:
        return 7

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        heard = max(evidence.heard, key=lambda h: len(h.freq_hz) if h.plain is not None else 0)
        if heard.plain is None or len(heard.freq_hz) + len(heard.foreign_hz) < 8 or not heard.plain.mass_kg:
            return None
        trial = _Trial.of(heard)
        x = heard.plain
        if isinstance(evidence.known, cls):
            known = evidence.known
            near = int(np.argmin(((x.vertex_m - known.position_m) ** 2).sum(axis=1)))
            up, side = (float(y * np.exp(2 * known.stretch)) for y in known.yield_m_n)
            return cls._at(x, trial.refined((0.0, near, known.mass_kg, (up, side), known.stretch), WIDTHS[-1:]))
        plain = patterns(heard, x)
        none = min((agreed(trial.line, trial.size, x.freq_hz, plain, shift=s) for s in trial.shifts(x.freq_hz, plain)), key=lambda one: one[0])
        if _in_place(trial.line, trial.size, x.freq_hz, none):
            return None

        def at(vertex: int) -> list[Scored]:
            most = trial.yields(vertex)
            return [one for s in SHARES for y in YIELDS for one in trial.sifted(vertex, s * x.mass_kg, (y * most, ACROSS * y * most), WIDTHS[0])]

        found = sorted(one for some in side_by_side(at, spread_out(x, POINTS).tolist()) for one in some)
        first: dict[bool, dict[tuple[int, bool], Scored]] = {False: {}, True: {}}
        for one in found:  # one light and one heavy start a vertex, where the baseline's scale may be right and where it is wrong
            first[abs(one[4]) > FAR_OFF].setdefault((one[1], one[2] > 0.02 * x.mass_kg), one)
        best = min(side_by_side(trial.refined, [start for some in first.values() for start in list(some.values())[:TRIES]]))
        again = sorted(trial.scored(int(v), *best[2:], WIDTHS[1]) for v in spread_out(x, 3 * POINTS))  # round bodies: as heavy, elsewhere
        best = min(best, *side_by_side(lambda start: trial.refined(start, WIDTHS[1:]), again[: TRIES // 2]))
        if best[0] > none[0] - max(BETTER[0], BETTER[1] * abs(none[0])):
            return None
        return cls._at(x, best)

    @classmethod
    def _at(cls, x: ModalModel, found: Scored) -> Self:
        _, vertex, mass_kg, along, shift = found
        place = x.vertex_m[vertex]
        up, side = (float(y * np.exp(-2 * shift)) for y in along)
        return cls((float(place[0]), float(place[1]), float(place[2])), float(mass_kg), (up, side), float(shift))


def _in_place(line_hz: Array, size: Array, mode_hz: Array, none: tuple[float, Array, Array, float]) -> bool:
    """Whether the bare body's modes are where the lines are, or half of all that sounds (s, k) is: a mass leaves few in place, and something else splits or bends the others."""
    _, row, column, shift = none
    off = np.abs(np.log(line_hz[row] / mode_hz[column]) - shift)
    if len(row) > MATCHED * len(line_hz) and float(np.quantile(off, 0.9)) < MOVED:
        return True
    loud = np.nan_to_num(size).max(axis=0)
    near = np.abs(np.log(line_hz)[:, None] - np.log(mode_hz) - shift).min(axis=1) < MOVED
    return bool(loud[near].sum() > STAYED * loud.sum() > 0)


def _at_points(x: ModalModel, heard: Heard) -> ModalModel:
    """The model at its strikes and sensor alone: what a trial needs."""
    rows = np.append(heard.strike_vertex, heard.sensor_vertex)
    return replace(x, shape=x.shape[rows], vertex_m=x.vertex_m[rows], face=np.zeros((0, 3), np.int32), curvature_per_m=np.zeros(0))


def attached(phi: Array, normal: Array, yield_m_n: tuple[float, float], x: ModalModel) -> Array:
    """Φ (3, m + 3) of a point where the modes are phi (3, m) and the rest yields so much along its normal (3,) and across."""
    axis = np.linalg.qr(np.column_stack([normal, np.eye(3)]))[0]
    root = np.sqrt(np.array([yield_m_n[0], yield_m_n[1], yield_m_n[1]]) * FAR * x.omega0_squared_per_s2.max())
    return np.concatenate([phi, axis * root], axis=1)


def loaded(x: ModalModel, phi: Array, mass_kg: float) -> ModalModel:
    """The model with a mass where its modes, and three far above them, are phi (3, m + 3)."""
    own = x.mode_count
    lam = np.append(x.omega0_squared_per_s2, np.full(3, FAR * x.omega0_squared_per_s2.max()))
    root = 1 / np.sqrt(lam)  # Λ^{-1/2}(1 + mΦᵀΦ)Λ^{-1/2} q' = q'/λ, so the lowest modes come out best
    value, vector = np.linalg.eigh((np.eye(len(lam)) + mass_kg * phi.T @ phi) * root[:, None] * root)
    value, vector = value[::-1][:own], vector[:, ::-1][:, :own]
    turn = root[:, None] * vector / np.sqrt(value)
    omega = 1 / np.sqrt(value)
    loss = np.append(x.decay_per_s, np.full(3, FAR * x.decay_per_s[-1]))  # what yields more loses as the highest mode does: with its stiffness
    decay = np.minimum((turn**2 * loss[:, None]).sum(axis=0), 0.99 * omega)
    turn = turn[:own]
    freq = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
    order = np.argsort(freq, kind="stable")
    shape = (x.shape.reshape(-1, own) @ turn[:, order].astype(np.float32)).reshape(x.shape.shape)
    return replace(x, freq_hz=freq[order], decay_per_s=decay[order], shape=shape)


Scored = tuple[float, int, float, tuple[float, float], float]  # price, vertex, mass in kg, yields in m/N of the baseline's stiffness, ln of the scale


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """Prices of masses on one object: its lines and sizes, its bare model, that at strikes and sensor alone, and its normals."""

    heard: Heard
    line: Array
    size: Array
    bare: ModalModel
    small: ModalModel
    normal: Array

    @classmethod
    def of(cls, heard: Heard) -> _Trial:
        assert heard.plain is not None
        line, size, _, _ = every_line(heard)
        return cls(heard, line, size, heard.plain, _at_points(heard.plain, heard), vertex_normals(heard.plain))

    def yields(self, vertex: int) -> float:
        """What the model's own modes yield along a vertex' normal, in m/N."""
        return float(((self.normal[vertex] @ self.bare.shape[vertex].astype(float)) ** 2 / self.bare.omega0_squared_per_s2).sum())

    def loaded(self, vertex: int, mass: float, along: tuple[float, float]) -> tuple[Array, Array]:
        """Frequencies (m,) with the mass on, and patterns (s, m)."""
        x = loaded(self.small, attached(self.bare.shape[vertex].astype(float), self.normal[vertex], along, self.bare), mass)
        s, heard = len(self.heard.strike_vertex), self.heard
        level = np.where(np.isfinite(heard.impulse_n_s), heard.impulse_n_s, 1.0)
        push = np.einsum("sxm,sx->sm", x.shape[:s].astype(float), heard.strike_way) * level[:, None]
        return x.freq_hz, np.abs(push * np.einsum("xm,x->m", x.shape[s].astype(float), heard.sensor_way))

    def shifts(self, freq_hz: Array, told: Array) -> list[float]:
        """None, and the common shifts of modes that most lines of their patterns (s, m) agree on, as two spectra on a logarithmic axis."""
        alike = 1.0
        if len(self.size) > 1 and np.isfinite(self.size).all() and np.isfinite(told).all():
            long = np.linalg.norm(self.size, axis=0)[:, None] * np.linalg.norm(told, axis=0)
            alike = (self.size.T @ told / np.maximum(long, 1e-300)) ** 4
        gap = np.log(self.line)[:, None] - np.log(freq_hz)
        edge = np.arange(REACH[0] - BINS, REACH[1] + 2 * BINS, BINS)
        count = np.histogram(gap, edge, weights=np.broadcast_to(alike, gap.shape))[0]
        count = np.convolve(count, (0.5, 1.0, 0.5), "same")
        peak = np.flatnonzero((count[1:-1] >= count[:-2]) & (count[1:-1] > count[2:])) + 1
        best = peak[np.argsort(-count[peak])][:PEAKS]
        return [0.0, *(float(edge[i] + BINS / 2) for i in best)]

    def sifted(self, vertex: int, mass: float, along: tuple[float, float], width: float) -> list[Scored]:
        """At each of its shifts."""
        made = self.loaded(vertex, mass, along)
        return [self._scored(made, vertex, mass, along, shift, width) for shift in self.shifts(*made)]

    def scored(self, vertex: int, mass: float, along: tuple[float, float], shift: float, width: float) -> Scored:
        """The price of the best pairs first; near a shift."""
        return self._scored(self.loaded(vertex, mass, along), vertex, mass, along, shift, width)

    def _scored(self, made: tuple[Array, Array], vertex: int, mass: float, along: tuple[float, float], shift: float, width: float) -> Scored:
        price, _, _, found = agreed(self.line, self.size, *made, shift=shift, turns=1, width=width)
        return price, vertex, mass, along, found

    def refined(self, best: Scored, widths: tuple[float, ...] = WIDTHS) -> Scored:
        """The best of nearby vertices, masses and yields, in turns."""
        for width in widths:
            best = self.scored(*best[1:], width)
            reach = 0.12 * float(np.linalg.norm(np.ptp(self.bare.vertex_m[self.bare.face], axis=(0, 1))))
            for _ in range(TURNS):
                better = min(best, *self._around(best, reach, width))
                reach *= 0.5
                if better == best and reach < 0.02:
                    break
                best = better
        return best

    def _around(self, best: Scored, reach: float, width: float) -> list[Scored]:
        _, vertex, mass, (up, side), shift = best
        at = self.bare.vertex_m
        body = np.unique(self.bare.face)
        near = body[((at[body] - at[vertex]) ** 2).sum(axis=1) < reach**2]
        least = 0.02 * self.yields(vertex)
        trials = [(int(v), mass, (up, side)) for v in near[:: max(1, len(near) // NEAR)]]
        trials += [(vertex, mass * f, (up, side)) for f in STEPS]
        trials += [(vertex, mass, (max(up, least) * f, side)) for f in (0, *STEPS)] + [(vertex, mass, (up, max(side, least) * f)) for f in (0, *STEPS)]
        trials += [(vertex, mass * f, (max(up, least) * g, max(side, least) * g)) for f in (0.93, 1.07) for g in (0.6, 1.0, 1.5)]
        return [self.scored(*one, shift, width) for one in trials]
