"""How an object is held: fingers as dashpots on its surface, to first order, so that its shapes and radiation stay.

    Δd_k = ½ Σ_j c_j |φ_k(p_j)|²            [Zheng & James 2011, section 5; Woodhouse 1998, eq. 12]

The two modes of one frequency that a round body has are any two of a plane: they turn so that the dashpots couple them
no more, φ' = φ Q with QᵀCQ diagonal, C = Σ_j c_j φᵀφ. `effects.support_damping` has dashpots of any strength.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.radiation.radiated import radiation_and_note
from sonic_bullet.records import Air, Array, ModalModel

FINGER_N_S_M = (1.0, 8.0)
"""c of a fingertip at audible frequencies, N·s/m: between a light touch and a firm grip [Hajian & Howe 1997, J.
Biomech. Eng. 119(1); Kern & Hatzfeld 2023, Engineering Haptic Devices, 3rd ed., ch. 3]."""
SAME_PITCH = 1e-3
"""Relative distance of two frequencies that a mesh makes of one; as `engine.bank.resonator`."""


def held_model(model: ModalModel, place_m: Array, damping_n_s_m: Array, air: Air) -> ModalModel:
    """Return a model under dashpots (j,) at places (j, 3), which act in every direction; its radiation is known.

    It is that of the model: pairs radiate alike, and turning them moves no energy between others.
    """
    if not model.mode_count or not len(place_m):
        return model
    nearest = np.linalg.norm(model.vertex_m[None] - np.asarray(place_m)[:, None], axis=2).argmin(axis=1)
    moved = model.shape[nearest].astype(float)  # (j, 3, m)
    loss = np.einsum("jxm,jxn,j->mn", moved, moved, damping_n_s_m)
    turn, added = np.eye(model.mode_count), 0.5 * np.diagonal(loss).copy()
    close = np.diff(model.freq_hz) < SAME_PITCH * model.freq_hz[:-1]
    first = 0
    while first < len(close):
        if close[first]:
            pair = slice(first, first + 2)
            value, vector = np.linalg.eigh(loss[pair, pair])
            turn[pair, pair], added[pair] = vector, 0.5 * value
            first += 1
        first += 1
    shape = (model.shape.reshape(-1, model.mode_count) @ turn.astype(np.float32)).reshape(model.shape.shape)
    ceiling = 0.5 * 2 * np.pi * model.freq_hz  # beyond, first order says nothing: such a mode is gone either way
    decay = np.nan_to_num(model.decay_per_s)
    made = replace(model, shape=shape, decay_per_s=decay + np.minimum(added, ceiling))
    radiation_and_note.put(made, radiation_and_note(model, air, "default"), air, "default")
    return made
