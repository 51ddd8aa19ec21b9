"""Rigid motion of a free body with a point mass: the body moves against the mass.

    G(v, p) = 1/M + [r_v×]ᵀ J⁻¹ [r_p×]      ∂²u(v)/∂t² = G(v, p) f(p),   r about the centre of mass
        [Newton, Euler]

A free body's six rigid motions are modes of λ = 0: no sound, but a mass at p mixes them into the others. Eliminated,

    u_rigid(v) = −G(v, p) m' φ(p) q,   m' = (1/m + G(p, p))⁻¹ (3, 3)      from M̈ q_r + m φ_rᵀ(φ_r q̈_r + φ q̈) = 0
        [Guyan 1965, of no stiffness]

so the mass acts as less than it is: at the end of a bar, m/(1 + 4 m/M). A held body has none of this.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.geometry import inertia, volume_m3
from sonic_bullet.records import Array, ModalModel


@dataclass(frozen=True, slots=True, eq=False)
class FreeBody:
    """Mass properties of a free body.

    Attributes
    ----------
    mass_kg : float
        The mass.
    centre_m : (3,)
        Centre of mass.
    turns : (3, 3)
        Inverse of the inertia about it, 1/(kg m²).
    """

    mass_kg: float
    centre_m: Array
    turns: Array

    @classmethod
    def of(cls, x: ModalModel) -> FreeBody | None:
        """Compute the properties of a model's body; None where it is held, or its surface encloses nothing."""
        still = 1e-5  # of the largest motion on the surface: a vertex that moves less, in every mode, is held
        if not len(x.face) or not x.mode_count or x.mass_kg <= 0 or x.volume_m3 <= 0:
            return None
        open_share = 0.1  # of the volume: a surface that encloses another is no body's
        if abs(volume_m3(x.vertex_m, x.face) / x.volume_m3 - 1) > open_share:
            return None
        moves = np.abs(x.shape[np.unique(x.face)]).max(axis=(1, 2))
        if moves.min() < still * moves.max():
            return None
        _, centre, tensor = inertia(x.vertex_m, x.face, x.mass_kg / x.volume_m3)
        return cls(x.mass_kg, centre, np.linalg.inv(tensor))

    def gives(self, at_m: Array, place_m: Array) -> Array:
        """Compute the acceleration of points per force at another, rigid motion alone.

        Parameters
        ----------
        at_m : (v, 3)
            The points.
        place_m : (3,)
            Where the force acts.

        Returns
        -------
        (v, 3, 3)
            G in 1/kg, the module's first equation.
        """
        arm, lever = (_cross(np.asarray(p, float) - self.centre_m) for p in (at_m, place_m))
        return np.asarray(np.eye(3) / self.mass_kg + np.swapaxes(arm, -1, -2) @ self.turns @ lever)


def _cross(r: Array) -> Array:
    """Build the matrices [r×] (…, 3, 3)."""
    x, y, z = r[..., 0], r[..., 1], r[..., 2]
    none = np.zeros_like(x)
    return np.stack([np.stack([none, -z, y], -1), np.stack([z, none, -x], -1), np.stack([-y, x, none], -1)], -2)
