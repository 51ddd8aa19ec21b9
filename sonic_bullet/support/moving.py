"""What a body yields where it is pushed: its modes, its motion as a whole, and what lies under it.

Y(s) = Σ_k s φ_k φ_kᵀ/(s² + 2 d_k s + λ_k) + Σ_r φ_r φ_rᵀ/s + y₀ − y₂ s²,   λ = ω² + d²
φ_r: (axes/√M, (axis × r)·J^{−1/2})            its six rigid motions, mass-normalised like the modes
y₀ = 1/(8√(Dρh)), D = Eh³/12(1 − ν²)           a wide plate      [Cremer, Heckl & Petersson 2005, eq. 4.45]
y₂ = c(ν)/(ρ c_s³)                             a half-space radiates  [Miller & Pursey 1955; see half_space_y2]
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """A body as something that gives way. omega_rad_s, decay_per_s (m,): its own, as the bank has them, free in air
    (mounted, where it is). mass_kg 0: it does not move as a whole. inertia_kg_m2 (3, 3): body frame, about the centre.
    plate_m_n_s: y₀; half_space_m_s_n: y₂, both along the normal, 0 for what is described by its modes, or rigid.
    """

    omega_rad_s: Array
    decay_per_s: Array
    mass_kg: float = 0.0
    inertia_kg_m2: Array = field(default_factory=lambda: np.zeros((3, 3)))
    plate_m_n_s: float = 0.0
    half_space_m_s_n: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A point of a body, in its frame: shape (3, m) mass-normalised mode shapes, arm_m (3,) from the centre of mass,
    axes (3, 3): rows the contact's normal and two tangents. The same three directions in space for both bodies.
    """

    shape: Array
    arm_m: Array
    axes: Array
