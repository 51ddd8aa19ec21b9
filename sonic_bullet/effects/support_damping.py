"""`support-damping`: a fixture takes energy where it touches.

    Δd_k = ½ Σ_j c_j |φ_k(p_j)|²      c in N·s/m, φ mass-normalised                    [Zheng & James 2011; physics of a viscous contact]

Read off the decays: what Rayleigh's law, refitted beside it, leaves goes as φ² at one or a few points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.points import best_spot, candidates, vertex_normals
from sonic_bullet.effects.values import Evidence, Heard, Owner, Stage, ascending
from sonic_bullet.records import Array, ModalModel

SCATTER = 0.03
MOST = 4
BETTER = 12.0  # in BIC, for another point


@dataclass(frozen=True)
class SupportDamping:
    """Dashpots of strength (j,) in N·s/m at position_m (j, 3) on the surface, in the mesh's frame; along: "normal" to it, or "every" direction."""

    id: ClassVar[str] = "support-damping"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.FIXTURE
    reference: ClassVar[str] = "Zheng & James 2011, section 5 (contact damping)"

    position_m: tuple[tuple[float, float, float], ...]
    strength_n_s_m: tuple[float, ...]
    along: str = "normal"

    def apply(self, x: ModalModel) -> ModalModel:
        """The modes with the effect in them."""
        extra = np.zeros(x.mode_count)
        normal = vertex_normals(x) if self.along == "normal" else None
        for place, c in zip(self.position_m, self.strength_n_s_m, strict=True):
            vertex = nearest(x, place)
            moved = x.shape[vertex].astype(float)
            extra += 0.5 * c * ((moved**2).sum(axis=0) if normal is None else (normal[vertex] @ moved) ** 2)
        omega = np.sqrt(x.omega0_squared_per_s2)
        decay = np.minimum(x.decay_per_s + extra, 0.99 * omega)
        freq = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
        return ascending(x, freq, decay)

    def parameters(self) -> dict[str, Any]:
        """What it says, for people and JSON, in SI units."""
        return {"position_m": [list(p) for p in self.position_m], "c_n_s_m": list(self.strength_n_s_m)}

    def freedom(self) -> int:
        return 3 * len(self.strength_n_s_m)

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        heard = max(evidence.heard, key=lambda h: len(h.freq_hz) if h.model is not None else 0)
        if heard.model is None or len(heard.freq_hz) < 6 or not np.isfinite(heard.decay_per_s).all():
            return None
        decay = heard.decay_per_s
        sd = np.hypot(heard.decay_sd_per_s, SCATTER * decay) + 1e-3
        columns = np.stack([np.full(len(decay), 0.5), 0.5 * heard.omega**2], axis=1)
        found = [(_points(heard, decay, sd, columns, normal=along == "normal", sure=evidence.known is None), along) for along in ("normal", "every")]
        (_, chosen, strength), along = min(found, key=lambda pair: pair[0][0])
        if not len(chosen):
            return None
        places = heard.model.vertex_m[chosen]
        return cls(tuple((float(a), float(b), float(c)) for a, b, c in places), tuple(float(c) for c in strength), along)


def _points(heard: Heard, decay: Array, sd: Array, columns: Array, *, normal: bool, sure: bool = True) -> tuple[float, Array, Array]:
    """What is left, vertices (j,) and strengths (j,) of the dashpots that earn their place, one after another."""
    vertex, square = candidates(heard, normal=normal)
    chosen: list[int] = []
    strength, left = np.zeros(0), np.inf
    need = (BETTER + 3 * np.log(len(decay)), 0.6) if sure else (0.5 * BETTER, 0.8)
    for _ in range(MOST):
        spot = best_spot(decay, sd, columns, vertex, 0.5 * square)
        if spot is None or spot.before - spot.left < need[0] or spot.left > need[1] * spot.before:
            break
        chosen.append(spot.vertex)
        columns = np.column_stack([columns, 0.5 * square[np.searchsorted(vertex, spot.vertex)]])
        strength, left = np.append(spot.nuisance[2:], spot.strength), spot.left
    keep = strength > 0
    return left, np.array(chosen, int)[keep], strength[keep]


def nearest(x: ModalModel, place: tuple[float, float, float]) -> int:
    """The surface vertex nearest to a place."""
    body: Array = np.unique(x.face)
    return int(body[np.argmin(((x.vertex_m[body] - np.array(place)) ** 2).sum(axis=1))])
