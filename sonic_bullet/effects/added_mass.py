"""`added-mass`: a sensor, a blob of wax, water: a small mass that rides on one point.

    (Λ − λ (1 + m ΦᵀΦ)) q = 0,  Φ = φ(p) (3, n)      to first order Δλ/λ = −m |φ(p)|²                [Rayleigh 1894, § 88-90; modal synthesis]

Read off frequencies and patterns together: for points all over the surface and masses up to a sixth of the body's, lines are paired with the loaded
body's modes anew; the pairs that agree best stand, where they agree better than the bare body's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.pairs import agreed, every_line, patterns
from sonic_bullet.effects.support_damping import nearest
from sonic_bullet.effects.values import Evidence, Heard, Owner, Stage
from sonic_bullet.records import Array, ModalModel

POINTS = 140
SHARES = (0.002, 0.006, 0.015, 0.035, 0.08, 0.16)  # of the body's mass
TRIES = 4
MATCHED, MOVED = 0.8, 2.5e-3  # share of lines, and how far nine in ten of them may lie off: a mesh's error
BETTER = (1.5, 0.12)  # in price: as much as a strong line and a half, paired well; and of the bare body's own


@dataclass(frozen=True)
class AddedMass:
    """mass_kg riding on position_m (3,) of the surface, in the mesh's frame."""

    id: ClassVar[str] = "added-mass"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.FIXTURE
    reference: ClassVar[str] = "Rayleigh 1894, § 88-90"

    position_m: tuple[float, float, float]
    mass_kg: float

    def apply(self, x: ModalModel) -> ModalModel:
        """The modes with the effect in them."""
        if not x.mode_count or self.mass_kg == 0:
            return x
        return loaded(x, x.shape[nearest(x, self.position_m)].astype(float), self.mass_kg)

    def parameters(self) -> dict[str, Any]:
        """What it says, for people and JSON, in SI units."""
        return {"mass_kg": self.mass_kg, "position_m": list(self.position_m)}

    def freedom(self) -> int:
        return 4

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        heard = max(evidence.heard, key=lambda h: len(h.freq_hz) if h.plain is not None else 0)
        if heard.plain is None or len(heard.freq_hz) + len(heard.foreign_hz) < 8 or not heard.plain.mass_kg:
            return None
        line, size, _, _ = every_line(heard)
        small = _at_points(heard.plain, heard)
        if isinstance(evidence.known, cls):
            at = int(np.argmin(((heard.plain.vertex_m - evidence.known.position_m) ** 2).sum(axis=1)))
            start = (_score(small, heard, heard.plain.shape[at].astype(float), evidence.known.mass_kg, line, size)[0], at, evidence.known.mass_kg)
            _, vertex, mass = _refined(small, heard, start, line, size)
            return cls._at(heard.plain, vertex, mass)
        none = agreed(line, size, heard.plain.freq_hz, patterns(heard, heard.plain))
        if _in_place(line, heard.plain.freq_hz, none):
            return None
        found = []
        for vertex in spread_out(heard.plain, POINTS):
            for share in SHARES:
                mass = share * heard.plain.mass_kg
                score = _score(small, heard, heard.plain.shape[vertex].astype(float), mass, line, size)[0]
                found.append((score, vertex, mass))
        found.sort()
        score, vertex, mass = min(_refined(small, heard, start, line, size) for start in found[:TRIES])
        if score > none[0] - max(BETTER[0], BETTER[1] * abs(none[0])):
            return None
        return cls._at(heard.plain, vertex, mass)

    @classmethod
    def _at(cls, x: ModalModel, vertex: int, mass_kg: float) -> Self:
        place = x.vertex_m[vertex]
        return cls((float(place[0]), float(place[1]), float(place[2])), float(mass_kg))


def _in_place(line_hz: Array, mode_hz: Array, none: tuple[float, Array, Array, float]) -> bool:
    """Whether the bare body's modes are where the lines are: nothing to look for."""
    _, row, column, shift = none
    off = np.abs(np.log(line_hz[row] / mode_hz[column]) - shift)
    return len(row) > MATCHED * len(line_hz) and float(np.quantile(off, 0.9)) < MOVED


def spread_out(x: ModalModel, count: int) -> Array:
    """About ``count`` surface vertices (p,), each the farthest from those before it [Gonzalez 1985]."""
    body = np.unique(x.face)
    at = x.vertex_m[body]
    picked = [0]
    gap = ((at - at[0]) ** 2).sum(axis=1)
    for _ in range(min(count, len(body)) - 1):
        picked.append(int(gap.argmax()))
        gap = np.minimum(gap, ((at - at[picked[-1]]) ** 2).sum(axis=1))
    return np.asarray(body[picked])


def _at_points(x: ModalModel, heard: Heard) -> ModalModel:
    """The model at its strikes and sensor alone: what a trial needs."""
    rows = np.append(heard.strike_vertex, heard.sensor_vertex)
    return replace(x, shape=x.shape[rows], vertex_m=x.vertex_m[rows], face=np.zeros((0, 3), np.int32), curvature_per_m=np.zeros(0))


def loaded(x: ModalModel, phi: Array, mass_kg: float) -> ModalModel:
    """The model with a mass where its modes are phi (3, m)."""
    lam = x.omega0_squared_per_s2
    root = 1 / np.sqrt(lam)  # Λ^{-1/2}(1 + mΦᵀΦ)Λ^{-1/2} q' = q'/λ, so the lowest modes come out best
    value, vector = np.linalg.eigh((np.eye(len(lam)) + mass_kg * phi.T @ phi) * root[:, None] * root)
    value, vector = value[::-1], vector[:, ::-1]
    turn = root[:, None] * vector / np.sqrt(value)
    omega = 1 / np.sqrt(value)
    decay = np.minimum((turn**2 * x.decay_per_s[:, None]).sum(axis=0), 0.99 * omega)
    freq = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
    order = np.argsort(freq, kind="stable")
    shape = (x.shape.reshape(-1, x.mode_count) @ turn[:, order].astype(np.float32)).reshape(x.shape.shape)
    return replace(x, freq_hz=freq[order], decay_per_s=decay[order], shape=shape)


def _score(small: ModalModel, heard: Heard, phi: Array, mass: float, line: Array, size: Array) -> tuple[float, float]:
    """Price of the best pairs, and the misfit of their frequencies."""
    x = loaded(small, phi, mass)
    s = len(heard.strike_vertex)
    level = np.where(np.isfinite(heard.impulse_n_s), heard.impulse_n_s, 1.0)
    push = np.einsum("sxm,sx->sm", x.shape[:s].astype(float), heard.strike_way) * level[:, None]
    told = np.abs(push * np.einsum("xm,x->m", x.shape[s].astype(float), heard.sensor_way))
    score, row, column, shift = agreed(line, size, x.freq_hz, told, turns=1)
    off = np.log(line[row] / x.freq_hz[column]) - shift
    return score, float(np.minimum(np.abs(off), 0.01).mean()) if len(off) else 0.01


def _refined(small: ModalModel, heard: Heard, start: tuple[float, int, float], line: Array, size: Array) -> tuple[float, int, float]:
    """The best of nearby vertices and masses, in turns."""
    assert heard.plain is not None
    x = heard.plain
    body = np.unique(x.face)
    score, vertex, mass = start
    reach = np.linalg.norm(np.ptp(x.vertex_m[body], axis=0)) / np.sqrt(POINTS)
    for _ in range(4):
        near = body[((x.vertex_m[body] - x.vertex_m[vertex]) ** 2).sum(axis=1) < reach**2]
        near = near[:: max(1, len(near) // 24)]
        trials = [(_score(small, heard, x.shape[v].astype(float), mass, line, size)[0], int(v), mass) for v in near]
        trials += [
            (_score(small, heard, x.shape[vertex].astype(float), mass * f, line, size)[0], int(vertex), mass * f)
            for f in (0.8, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.25)
        ]
        best = min(trials)
        reach *= 0.6
        if best[0] < score:
            score, vertex, mass = best
    return score, vertex, mass
