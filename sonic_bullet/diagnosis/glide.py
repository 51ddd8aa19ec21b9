"""Modes whose frequency goes with their level: how far they glide, and how fast they fall.

A linear fit tells such a mode as a chain of lines (chains.py), none with its decay. But only its frequency bends: its level falls as the linear mode's does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.diagnosis.bodies import Struck
from sonic_bullet.diagnosis.play import Hypothesis, bends, blow_of, ring_of
from sonic_bullet.effects.envelope import alone, falls, shifted
from sonic_bullet.effects.values import Heard
from sonic_bullet.records import Array

TURNS_RAD = 0.2  # of phase, that a mode must gain or lose to be told as one that glides
SPREAD = 0.02  # of a level's own fall


def turns_rad(h: Hypothesis, body: Struck, one: Heard) -> Array:
    """By how much the effects turn the phases of each line's modes (s, k) until they have rung down."""
    each = [(ring_of(h, body, body.fitted[i]), blow_of(h, body, body.fitted[i])) for i in one.strike]
    level = [r.level * np.abs(b.spectrum(r.freq_hz)) for r, b in each]  # what a long pulse leaves of it
    turned = np.stack([np.abs(r.bend) * a**2 * np.pi * r.freq_hz / np.maximum(r.decay_per_s, 1e-3) for (r, _), a in zip(each, level, strict=True)])
    return np.stack([turned[:, who[who < turned.shape[1]]].max(axis=1, initial=0.0) for who in one.mode], axis=1)


def gliding(h: Hypothesis, body: Struck, one: Heard) -> Array:
    """Whether each line (k,) is of modes whose phases the effects turn by TURNS_RAD or more in the end, at the strike that moves them most."""
    return np.asarray(turns_rad(h, body, one).max(axis=0) > TURNS_RAD)


def fallen(h: Hypothesis, body: Struck, one: Heard) -> Heard:
    """The evidence, the decays of lines that glide told by their levels' own fall, where they stand alone."""
    if not bends(h) or one.signal is None or one.dry or not len(one.freq_hz):
        return one  # in a room no line is one mode's alone
    glides = gliding(h, body, one)
    mine = [(k, width) for k, width in zip(*alone(one), strict=True) if glides[k] and len(one.mode[k]) == 1]  # twins beat
    if not mine:
        return one
    e = shifted(one, one.signal if one.own is None else one.own, [k for k, _ in mine], [width for _, width in mine])
    decay, sd = one.decay_per_s.copy(), one.decay_sd_per_s.copy()
    for q, (k, _) in enumerate(mine):
        decay[k] = falls(e, q, float(decay[k]))
        sd[k] = SPREAD * decay[k]
    return replace(one, decay_per_s=decay, decay_sd_per_s=sd)
