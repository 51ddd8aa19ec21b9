"""Whether a body's pitch ratios ask for another elasticity, before one is searched for.

    E_k = Σ_s |A_sk|² f_s/(4 d_k σ²): energy of a mode as it is played, over the noise's density

Each loud mode is somewhere among the lines, within what a mesh leaves, or it is not. Lines that are no mode say nothing
here: what else rings, a room and noise make such, whatever the body's elasticity is.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.evidence import ObjectEvidence

AT_A_LINE = 5e-3
"""Of a frequency: what split pairs and a mesh leave between a line and its mode, as in the search for a tensor."""
LOUD_ENERGY = 600.0
"""Over the noise's density: ten times what makes a line, for the model's levels are right within a factor."""


def modes_off_lines(h: ObjectEvidence) -> bool:
    """Decide whether more than a little of an object's loud modes, between its lines, have none of these near."""
    model = h.plain
    if model is None or not len(h.every_hz) or len(model.freq_hz) != h.push.shape[1]:
        return True  # nothing to tell it by
    known = len(h.noise) == len(h.push)
    noise = np.maximum(h.noise_at(h.all_hz), 1e-12) if known else np.full((len(h.push), 1), np.inf)
    decay = np.maximum(h.model.decay_per_s if h.model is not None else model.decay_per_s, 1e-3)
    energy = (np.abs(h.push / noise) ** 2).sum(axis=0) * h.sr / (4 * decay)
    lines, freq = np.sort(h.every_hz), model.freq_hz
    shift = float(np.median(np.log(h.freq_hz / h.model_hz))) if len(h.freq_hz) else 0.0
    loud = (energy > LOUD_ENERGY) & (freq > lines[0] * (1 - AT_A_LINE)) & (freq < lines[-1] * (1 + AT_A_LINE))
    if not loud.any():
        return True
    off = np.abs(np.log(lines[:, None] / freq[loud]) - shift).min(axis=0)
    return bool((off > AT_A_LINE).mean() > RULES.little_share)
