"""Driving-point mobility of a body: its modes, its rigid motions, and what lies under it.

Y(s) = Σ_k s φ_k φ_kᵀ/(s² + 2 d_k s + λ_k) + Σ_r φ_r φ_rᵀ/s + n nᵀ (y₀ − y₂ s²),   λ = ω² + d²
φ_r = (1/√M, (r ×) J^{−1/2})                six rigid motions, mass-normalised as the modes are; n the normal
y₀ = 1/(8√(Dρh)),  D = Eh³/12(1 − ν²)       a wide plate         [Cremer, Heckl & Petersson 2005, sec. 5.2]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Data of a body's mobility.

    Attributes
    ----------
    omega_rad_s, decay_per_s : (m,) of its modes, as the bank has them without contacts
    mass_kg : 0: it has no rigid motion
    inertia_kg_m2 : (3, 3) body frame, about its centre
    plate_m_n_s, half_space_m_s_n : y₀ in m/(N·s) and y₂ in m·s/N, of what has neither modes nor mass
    turn : J^{−1/2}, by columns
    """

    omega_rad_s: Array
    decay_per_s: Array
    mass_kg: float = 0.0
    inertia_kg_m2: Array = field(default_factory=lambda: np.zeros((3, 3)))
    plate_m_n_s: float = 0.0
    half_space_m_s_n: float = 0.0
    turn: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Compute J^{−1/2}."""
        value, vector = np.linalg.eigh(self.inertia_kg_m2)
        least = max(1e-12 * float(value.max()), 1e-300)
        turn = vector / np.sqrt(np.maximum(value, least)) if value.max() > 0 else 0 * vector
        object.__setattr__(self, "turn", turn)  # J^{−1/2}, by columns

    @property
    def lam(self) -> Array:
        """λ (m + 6,) in 1/s², with those of the rigid motions."""
        return np.append(self.omega_rad_s**2 + self.decay_per_s**2, np.zeros(6))

    @property
    def decay(self) -> Array:
        """Decays d (m + 6,)."""
        return np.append(self.decay_per_s, np.zeros(6))

    def moves(self, places: Sequence[Place]) -> Array:
        """Compute Φ (3c, m + 6): motion along each place's axes of each mode and rigid motion; 0 where it has none."""
        rigid = np.zeros((len(places), 3, 6))
        if self.mass_kg > 0:
            x, y, z = np.array([place.arm_m for place in places]).T
            turn = np.zeros((len(places), 3, 3))  # turn × arm
            turn[:, 0, 1], turn[:, 1, 2], turn[:, 2, 0] = z, x, y
            rigid[:, :, :3] = np.eye(3) / np.sqrt(self.mass_kg)
            rigid[:, :, 3:] = (turn - turn.transpose(0, 2, 1)) @ self.turn
        whole = np.concatenate([np.stack([place.shape for place in places]), rigid], axis=2)
        return np.asarray((np.stack([place.axes for place in places]) @ whole).reshape(3 * len(places), -1))


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A point of a body, in its frame.

    Attributes
    ----------
    shape : (3, m) mode shapes in 1/√kg
    arm_m : (3,) from the centre of mass
    axes : (3, 3) the contact's normal and two tangents as rows, the same three directions in space for both bodies
    """

    shape: Array
    arm_m: Array
    axes: Array


def wide_plate_m_n_s(youngs_pa: float, poisson: float, density_kg_m3: float, thickness_m: float) -> float:
    """Compute y₀ of a plate whose edges are far, in m/(N·s)."""
    bending = youngs_pa * thickness_m**3 / (12 * (1 - poisson**2))
    return float(1 / (8 * np.sqrt(bending * density_kg_m3 * thickness_m)))
