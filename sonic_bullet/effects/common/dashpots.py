"""Modes under dashpots, at any strength.

    (s² + s (2d + ΦᵀcΦ) + Λ) q = 0,   qᵀ(2s + 2d + ΦᵀcΦ) q = 2i Im s
        [Tisseur & Meerbergen 2001, § 3; Woodhouse 1998, eq. 12; Adhikari 1999 for the norm]

To first order a single mode's decay grows by ½ Σ c φ². Of modes at one frequency (a ring's, a bowl's) one dashpot makes
a mode that takes all of it, and others with a node there; neighbours whose distance in ω is not far above ½ΦᵀcΦ mix; a
strong dashpot holds its point, and decays fall again. With this norm Σ (φ(p)·q)(φ(x)·q)(1 + id/ω) e^{st} is the
velocity after a unit impulse: of q, the real part is kept; the imaginary is a per cent of the sound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.effects.common.mode_matching import match_all
from sonic_bullet.effects.protocol import sort_modes
from sonic_bullet.records import Array, ModalModel


@dataclass(frozen=True, slots=True, eq=False)
class DashpotModes:
    """Modes under dashpots, by rising frequency.

    Attributes
    ----------
    pole : (…, m) complex
        s in 1/s; NaN for a mode that no longer oscillates.
    turn : (…, m, m) complex
        Old modes in a new one, by columns; zeros for a mode that no longer oscillates.
    """

    pole: Array
    turn: Array


def couple_modes(lam: Array, decay_per_s: Array, phi: Array) -> DashpotModes:
    """Solve the modes under dashpots.

    Parameters
    ----------
    lam : (m,)
        Eigenvalues λ in 1/s².
    decay_per_s : (m,)
        Decays without dashpots.
    phi : (…, r, m)
        √c φ of the dashpots, c in N·s/m.
    """
    still = 1e-6  # of ω: what swings slower does not swing
    tie = 1e-9  # relative: modes at one frequency that no dashpot tells apart stay the mesh's own
    m = len(lam)
    omega, at = np.sqrt(lam) * (1 + tie * np.arange(m)), np.arange(m)
    loss = np.swapaxes(phi, -1, -2) @ phi
    loss[..., at, at] += 2 * decay_per_s
    state = np.zeros((*loss.shape[:-2], 2 * m, 2 * m))  # of (ωq, q̇)
    state[..., at, m + at], state[..., m + at, at] = omega, -omega
    state[..., m:, m:] = -loss
    s, vector = np.linalg.eig(state)
    order = np.argsort(-s.imag, axis=-1, kind="stable")[..., :m][..., ::-1]
    s, q = (
        np.take_along_axis(s, order, -1),
        np.take_along_axis(vector[..., :m, :], order[..., None, :], -1) / omega[:, None],
    )
    alive = s.imag > still * omega[0]
    norm = 2 * s * (q * q).sum(axis=-2) + (q * (loss @ q)).sum(axis=-2)
    turn = q * np.sqrt(2j * s.imag / np.where(norm == 0, 1, norm))[..., None, :]
    turn *= np.where((turn.real * np.abs(turn.real)).sum(axis=-2) < 0, -1, 1)[..., None, :]
    return DashpotModes(np.where(alive, s, np.nan), np.where(alive[..., None, :], turn, 0))


def damp_model(x: ModalModel, phi: Array) -> ModalModel:
    """Return a model under dashpots √c φ (r, m), with as many modes; those that no longer oscillate are silent."""
    found = couple_modes(x.omega0_squared_per_s2, x.decay_per_s, phi)
    alive = np.isfinite(found.pole)
    omega = np.sqrt(x.omega0_squared_per_s2)
    lost = omega[np.setdiff1d(np.arange(x.mode_count), _kin(found)[alive])]
    decay, rate = np.empty(x.mode_count), np.empty(x.mode_count)
    decay[alive], rate[alive] = np.maximum(-found.pole.real[alive], 0.0), found.pole.imag[alive]
    decay[~alive], rate[~alive] = 0.99 * lost, np.sqrt(1 - 0.99**2) * lost
    turned = (x.shape.reshape(-1, x.mode_count) @ found.turn.real.astype(np.float32)).reshape(x.shape.shape)
    return sort_modes(x, rate / (2 * np.pi), decay, turned)


def _kin(found: DashpotModes) -> Array:
    """Match each new mode (m,) to the old one that it comes from."""
    return match_all(np.abs(found.turn.T) ** 2)
