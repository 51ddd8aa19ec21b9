"""A model with a mass on one of its points: what the point yields, what the body gives way as a whole, and the modes
that come of it.

(Λ − λ (1 + Φᵀ m' Φ)) q = 0,  Φ = (φ(p), √(λ_r R)) (3, n + 3),  m' = (1/m + G(p, p))⁻¹ (3, 3)
    [added_mass/__init__.py, free_body.py]
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.added_mass.free_body import FreeBody
from sonic_bullet.records import Array, ModalModel

FAR = 16.0  # of the highest mode's λ: where what is left of the modes is put


def attached(phi: Array, normal: Array, yield_m_n: tuple[float, float], x: ModalModel) -> Array:
    """Φ (3, m + 3) of a point where the modes are phi (3, m) and the rest yields so much along its normal (3,) and
    across.
    """
    axis = np.linalg.qr(np.column_stack([normal, np.eye(3)]))[0]
    root = np.sqrt(np.array([yield_m_n[0], yield_m_n[1], yield_m_n[1]]) * FAR * x.omega0_squared_per_s2.max())
    return np.concatenate([phi, axis * root], axis=1)


def loaded(
    x: ModalModel, phi: Array, mass_kg: float, place_m: Array | None = None, body: FreeBody | None = None
) -> ModalModel:
    """The model with a mass where its modes, and three far above them, are phi (3, m + 3).

    body: what gives way as a whole, at place_m (3,).
    """
    own = x.mode_count
    felt: Array = mass_kg * np.eye(3)
    if body is not None and place_m is not None:
        felt = np.linalg.inv(np.eye(3) / mass_kg + body.gives(place_m, place_m))
    lam = np.append(x.omega0_squared_per_s2, np.full(3, FAR * x.omega0_squared_per_s2.max()))
    root = 1 / np.sqrt(lam)  # Λ^{-1/2}(1 + mΦᵀΦ)Λ^{-1/2} q' = q'/λ, so the lowest modes come out best
    value, vector = np.linalg.eigh((np.eye(len(lam)) + phi.T @ felt @ phi) * root[:, None] * root)
    value, vector = value[::-1][:own], vector[:, ::-1][:, :own]
    turn = root[:, None] * vector / np.sqrt(value)
    omega = 1 / np.sqrt(value)
    # what yields more loses as the highest mode does: with its stiffness
    loss = np.append(x.decay_per_s, np.full(3, FAR * x.decay_per_s[-1]))
    decay = np.minimum((turn**2 * loss[:, None]).sum(axis=0), 0.99 * omega)
    drag = felt @ phi @ turn  # (3, m): what the mass's inertia asks of the body at its place
    turn = turn[:own]
    freq = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
    order = np.argsort(freq, kind="stable")
    shape = (x.shape.reshape(-1, own) @ turn[:, order].astype(np.float32)).reshape(x.shape.shape)
    if body is not None and place_m is not None:
        placed = np.any(x.shape[:, 1:], axis=(1, 2))  # what is observed at no place is a weight, not a motion
        shape[placed] -= (body.gives(x.vertex_m[placed], place_m) @ drag[:, order]).astype(np.float32)
    return replace(x, freq_hz=freq[order], decay_per_s=decay[order], shape=shape)
