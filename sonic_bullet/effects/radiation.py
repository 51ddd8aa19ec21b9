"""`radiation`: a mode loses energy to the air as it radiates, and its level follows the radiation.

Δd = s ½ ρ₀ c σ A,  A = ∮(φ·n)² dS,  σ = (ka)²/(1 + (ka)²) with a net flow of volume, (ka)⁴/(4 + (ka)⁴) without
    [k = ω/c; Kinsler et al. 2000, ch. 7;
Fahy & Gardonio 2007, ch. 3: the pulsating and the oscillating sphere]
level tilts as √σ where the sensor is in the far field
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Effect, Number, Owner, Stage, Traits, sort_modes
from sonic_bullet.geometry import area_vectors_m2
from sonic_bullet.records import Array, ModalModel

AIR_IMPEDANCE = 1.2 * 343.0  # ρ₀ c in kg/(m² s)
SOUND_M_S = 343.0
RADIATION_SCATTER = 0.03  # of a decay, relative: the law's own error
RADIATION_ORDERS = (2, 4)


@dataclass(frozen=True)
class Radiation(Effect):
    """Loss of modes by radiation, of one equivalent source."""

    id: ClassVar[str] = "radiation"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "Fahy & Gardonio 2007, ch. 3"
    traits: ClassVar[Traits] = Traits(needs_unknown_medium=True)

    radius_m: Annotated[float, Number("radius a of the source", least=0.0, free=1)]
    strength: Annotated[float, Number("s, 1 by the law", least=0.0, free=1)]
    tilt: Annotated[float, Number("exponent of σ in the level at the sensor, 0 or ½")] = 0.0
    order: Annotated[int, Number("of ka where it is small: 2 monopole, 4 dipole", known=(2, 4))] = 2

    def efficiency(self, freq_hz: Array) -> Array:
        """Compute σ (k,) at frequencies (k,) in Hz."""
        low = (2 * np.pi * np.asarray(freq_hz) * self.radius_m / SOUND_M_S) ** self.order
        return np.asarray(low / (self.order**2 / 4 + low))

    def apply(self, x: ModalModel) -> ModalModel:
        """Add the loss to the decays of a body's modes, and the tilt to their levels at the sensor."""
        sigma = self.efficiency(x.freq_hz)
        omega = np.sqrt(x.omega0_squared_per_s2)
        decay = np.minimum(x.decay_per_s + self.strength * 0.5 * AIR_IMPEDANCE * sigma * areas(x), 0.99 * omega)
        freq = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
        shape = x.shape.copy() if self.tilt else x.shape
        if self.tilt:
            shape[-1] *= (sigma**self.tilt).astype(np.float32)  # the last vertex is the sensor's
        return sort_modes(x, freq, decay, shape)


def areas(x: ModalModel) -> Array:
    """Compute A = ∮(φ·n)² dS (m,) in m²/kg of a model's modes."""
    from scipy.sparse import csr_array

    corner = x.vertex_m[x.face]
    normal = area_vectors_m2(x.vertex_m, x.face)
    size = np.linalg.norm(normal, axis=1)
    direction = np.broadcast_to(
        (normal / np.maximum(3 * size, 1e-300)[:, None])[:, None], corner.shape
    )  # of a triangle's middle: a third of each corner's motion
    place = 3 * x.face[:, :, None] + np.arange(3)
    normal_part = csr_array(
        (direction.ravel(), place.ravel(), np.arange(0, 9 * len(x.face) + 1, 9)), shape=(len(x.face), 3 * len(x.shape))
    )
    along = normal_part @ x.shape.reshape(-1, x.mode_count)
    return np.asarray((along**2 * size[:, None]).sum(axis=0))
