"""`added-mass`: a sensor, a blob of wax, water: a small mass that rides on one point.

    (Λ − λ (1 + m ΦᵀΦ)) q = 0,  Φ = φ(p) (3, n)      to first order Δλ/λ = −m |φ(p)|²                [Rayleigh 1894, § 88-90; modal synthesis]

Read off the frequencies: what is left beside a common factor and a little of ν goes as −φ² at one point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.points import best_spot, candidates
from sonic_bullet.effects.support_damping import nearest
from sonic_bullet.effects.values import Evidence, Owner, Stage
from sonic_bullet.records import ModalModel

MESH = 1.2e-3  # relative error of a mode's frequency, the mesh's
BETTER = 20.0
LEAST = 2e-3  # the largest shift, relative, that is worth a name


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
        if not x.mode_count or self.mass_kg == 0:
            return x
        lam = x.omega0_squared_per_s2
        phi = x.shape[nearest(x, self.position_m)].astype(float)
        root = 1 / np.sqrt(lam)  # Λ^{-1/2}(1 + mΦᵀΦ)Λ^{-1/2} q' = q'/λ, so the lowest modes come out best
        flex = (np.eye(len(lam)) + self.mass_kg * phi.T @ phi) * root[:, None] * root
        value, vector = np.linalg.eigh(flex)
        value, vector = value[::-1], vector[:, ::-1]
        turn = root[:, None] * vector / np.sqrt(value)
        new = 1 / value
        share = turn**2 * 1.0
        decay = (share * x.decay_per_s[:, None]).sum(axis=0)  # ΦᵀCΦ of modes that mix; mass-proportional parts fall with the mass added
        omega = np.sqrt(new)
        decay = np.minimum(decay, 0.99 * omega)
        freq = np.sqrt(new - decay**2) / (2 * np.pi)
        order = np.argsort(freq, kind="stable")
        shape = np.einsum("vxm,mn->vxn", x.shape, turn.astype(np.float32))
        return replace(x, freq_hz=freq[order], decay_per_s=decay[order], shape=shape[:, :, order])

    def parameters(self) -> dict[str, Any]:
        return {"mass_kg": self.mass_kg, "position_m": list(self.position_m)}

    def freedom(self) -> int:
        return 4

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        heard = max(evidence.heard, key=lambda h: len(h.freq_hz) if h.model is not None else 0)
        if heard.model is None or len(heard.freq_hz) < 8:
            return None
        shift = 2 * np.log(heard.freq_hz / heard.model_hz)
        sd = 2 * np.hypot(heard.freq_sd_hz / heard.freq_hz, MESH)
        x = np.log(heard.freq_hz)
        columns = np.stack([np.ones(len(x)), x - x.mean()], axis=1)
        vertex, square = candidates(heard)
        spot = best_spot(shift, sd, columns, vertex, -square, not_negative=False)
        if spot is None or spot.strength <= 0 or spot.before - spot.left < BETTER + 4 * np.log(len(x)):
            return None
        i = int(np.searchsorted(vertex, spot.vertex))
        if 0.5 * spot.strength * square[i].max() < LEAST or spot.left > 0.5 * spot.before:
            return None
        place = heard.model.vertex_m[spot.vertex]
        return cls((float(place[0]), float(place[1]), float(place[2])), spot.strength)
