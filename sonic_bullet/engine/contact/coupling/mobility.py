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
from sonic_bullet.signal.elementary import matrix_product, symmetric_eigenpairs


@dataclass(frozen=True, slots=True, eq=False)
class BodyMobility:
    """Data of a body's mobility.

    Attributes
    ----------
    omega_rad_s, decay_per_s : (m,) of its modes, as the bank has them without contacts
    mass_kg : 0: it has no rigid motion
    inertia_kg_m2 : (3, 3) body frame, about its centre
    plate_m_n_s, half_space_m_s_n : y₀ in m/(N·s) and y₂ in m·s/N, of what has neither modes nor mass
    turn : J^{−1/2}, by columns
    pairs : (p,) modes that are alike with the next one, see `alike_pairs`
    lam, decay : λ in 1/s² and d in 1/s (m + 6,), with those of the rigid motions
    """

    omega_rad_s: Array
    decay_per_s: Array
    mass_kg: float = 0.0
    inertia_kg_m2: Array = field(default_factory=lambda: np.zeros((3, 3)))
    plate_m_n_s: float = 0.0
    half_space_m_s_n: float = 0.0
    turn: Array = field(init=False, repr=False)
    pairs: Array = field(init=False, repr=False)
    lam: Array = field(init=False, repr=False)
    decay: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Compute J^{−1/2}, λ and d."""
        value, vector = symmetric_eigenpairs(self.inertia_kg_m2)
        least = max(1e-12 * float(value.max()), 1e-300)
        turn = vector / np.sqrt(np.maximum(value, least)) if value.max() > 0 else 0 * vector
        object.__setattr__(self, "turn", turn)
        object.__setattr__(self, "pairs", alike_pairs(self.omega_rad_s))
        object.__setattr__(self, "lam", np.append(self.omega_rad_s**2 + self.decay_per_s**2, np.zeros(6)))
        object.__setattr__(self, "decay", np.append(self.decay_per_s, np.zeros(6)))

    def moves(self, places: Sequence[BodyPoint | Array]) -> Array:
        """Compute Φ (3c, m + 6): motion along each place's axes of each mode and rigid motion; 0 where it has none.

        places: or, where they are known, these rows (3, m + 6) themselves.
        """
        points = [one for one in places if isinstance(one, BodyPoint)]
        if not points:
            return np.concatenate([np.asarray(one) for one in places])
        rigid = np.zeros((len(points), 3, 6))
        if self.mass_kg > 0:
            x, y, z = np.array([point.arm_m for point in points]).T
            turn = np.zeros((len(points), 3, 3))  # turn × arm
            turn[:, 0, 1], turn[:, 1, 2], turn[:, 2, 0] = z, x, y
            rigid[:, :, :3] = np.eye(3) / np.sqrt(self.mass_kg)
            rigid[:, :, 3:] = [matrix_product(one, self.turn) for one in turn - turn.transpose(0, 2, 1)]
        whole = np.concatenate([np.stack([point.shape for point in points]), rigid], axis=2)
        return np.concatenate([matrix_product(point.axes, one) for point, one in zip(points, whole, strict=True)])


@dataclass(frozen=True, slots=True, eq=False)
class BodyPoint:
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


def alike_pairs(omega_rad_s: Array) -> Array:
    """Find pairs (p,) of neighbouring modes (m,) almost alike, by the first of each; the nearest pair up first."""
    # relative difference of two frequencies below which modes are a pair that turns: meshes and made things split those
    # of a round body by less
    pair_split = 0.01
    apart = np.abs(np.diff(omega_rad_s)) / omega_rad_s[1:]
    found: set[int] = set()
    for k in np.argsort(apart, kind="stable").tolist():
        if apart[k] < pair_split and not found & {k - 1, k + 1}:
            found.add(k)
    return np.array(sorted(found), np.int64)
