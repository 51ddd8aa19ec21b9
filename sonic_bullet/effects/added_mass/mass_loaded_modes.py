"""Modes of a model with a mass at one of its points, with the point's compliance and the body's rigid motion.

(Λ − λ (1 + Φᵀ m' Φ)) q = 0,  Φ = (φ(p), √(λ_r R)) (3, n + 3),  m' = (1/m + G(p, p))⁻¹ (3, 3)
    [added_mass/__init__.py, free_body.py]
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.added_mass.free_body import FreeBody
from sonic_bullet.records import Array, ModalModel

FAR = 16.0  # of the highest mode's λ: where what is left of the modes is put


def attach_modes(phi: Array, normal: Array, yield_m_n: tuple[float, float], x: ModalModel) -> Array:
    """Extend a point's mode shapes by residual attachment modes.

    Parameters
    ----------
    phi : (3, m)
        Shapes at the point.
    normal : (3,)
        Unit normal there.
    yield_m_n : (2,)
        Compliance along the normal and across it of the modes above the model's, m/N.
    x : ModalModel
        The model.

    Returns
    -------
    (3, m + 3)
        Φ, in 1/√kg.
    """
    axis = np.linalg.qr(np.column_stack([normal, np.eye(3)]))[0]
    root = np.sqrt(np.array([yield_m_n[0], yield_m_n[1], yield_m_n[1]]) * FAR * x.omega0_squared_per_s2.max())
    return np.concatenate([phi, axis * root], axis=1)


def load_modes(
    x: ModalModel, phi: Array, mass_kg: float, place_m: Array | None = None, body: FreeBody | None = None
) -> ModalModel:
    """Compute the modes of a model with a mass.

    Parameters
    ----------
    x : ModalModel
        The bare body.
    phi : (3, m + 3)
        Φ of `attach_modes`, at the mass's place.
    mass_kg : float
        The mass.
    place_m : (3,)
        Its place, for a free body.
    body : FreeBody
        Rigid motion of the body; None where it is held.

    Returns
    -------
    ModalModel
        As many modes, ascending.
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
