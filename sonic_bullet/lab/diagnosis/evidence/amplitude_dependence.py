"""Modes whose frequency depends on their level: how far it shifts, and how fast they decay.

A linear fit identifies such a mode as a chain of lines (recording_chain.py), none with its decay. But only its
frequency bends: its level falls as the linear mode's does. Degenerate modes beat once each shifts by its own level, so
their decay is identified by the synthesis: recorded over synthesized falls as e^{−δt}, δ the error of their decay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.lab.diagnosis.prediction.hypothesis import bends
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction
from sonic_bullet.lab.effects.common.envelope import Envelopes, alone, common_fall, extract_envelopes, falls
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array

TURNS_RAD = 0.2  # of phase, that a mode must gain or lose to count as amplitude-dependent


def turns_rad(p: Prediction, one: ObjectEvidence) -> Array:
    """Compute the phase (s, k) that each line's modes gain by the effects until they have decayed."""
    each = [(p.ring(i), p.impact(i)) for i in p.strikes_of(one)]
    level = [r.level * np.abs(b.spectrum(r.freq_hz)) for r, b in each]  # what a long pulse leaves of it
    turned = np.stack(
        [
            np.abs(r.bend) * a**2 * np.pi * r.freq_hz / np.maximum(r.decay_per_s, 1e-3)
            for (r, _), a in zip(each, level, strict=True)
        ]
    )
    return np.stack([turned[:, who[who < turned.shape[1]]].max(axis=1, initial=0.0) for who in one.mode], axis=1)


def amplitude_dependent(p: Prediction, one: ObjectEvidence) -> Array:
    """Decide for each line (k,) whether the effects turn its modes' phases by TURNS_RAD or more in some strike."""
    return np.asarray(turns_rad(p, one).max(axis=0) > TURNS_RAD)


def fallen(p: Prediction, one: ObjectEvidence) -> ObjectEvidence:
    """Identify the decays of isolated, amplitude-dependent lines by the fall of their own levels."""
    spread = 0.02  # of a level's own fall
    if not bends(p.hypothesis) or one.signal is None or one.dry or not len(one.freq_hz):
        return one  # in a room no line is one mode's alone
    dependent = amplitude_dependent(p, one)
    mine = [(k, width) for k, width in zip(*alone(one), strict=True) if dependent[k] and len(one.mode[k]) in (1, 2)]
    if not mine:
        return one
    selected, window = [k for k, _ in mine], [width for _, width in mine]
    e = extract_envelopes(one, one.signal if one.own is None else one.own, selected, window)
    made = None
    if any(len(one.mode[k]) == 2 for k in selected):
        played = p.sounds(p.strikes_of(one), one.signal.shape[1], one.sr)
        made, mode = extract_envelopes(one, played, selected, window), p.model.decay_per_s
    decay, sd = one.decay_per_s.copy(), one.decay_sd_per_s.copy()
    for q, k in enumerate(selected):
        if len(one.mode[k]) == 1:
            decay[k] = falls(e, q, float(decay[k]))
        elif made is not None and one.mode[k].max() < len(mode):
            decay[k] = beats(e, made, q, float(mode[one.mode[k]].mean()))
        sd[k] = spread * decay[k]
    return replace(one, decay_per_s=decay, decay_sd_per_s=sd)


def beats(e: Envelopes, made: Envelopes, q: int, decay_per_s: float) -> float:
    """Compute the decay of a degenerate pair in 1/s by the fall of the recorded over the synthesized level.

    Parameters
    ----------
    e, made : Envelopes
        Of the recordings, and of the synthesis.
    q : int
        Index of the line among them.
    decay_per_s : float
        Decay in the synthesis, returned where too little is clear in both.
    """
    least_frames = 8  # frames
    rows = []
    for s in range(len(e.z)):
        use = e.good[s, q] & made.good[s, q]
        if use.sum() < least_frames:
            continue
        left = np.log(np.abs(e.z[s, q, use]) / np.abs(made.z[s, q, use]))
        rows.append((e.time_s[q, use], left, e.worth(s, q)[use]))
    lacks = common_fall(rows, 0.0)
    most_lacking = 0.5  # of a decay, at most
    return decay_per_s + float(np.clip(lacks, -most_lacking * decay_per_s, most_lacking * decay_per_s))
