"""Whence sound comes: from where a body was when it sent what a microphone hears now.

    x_b(t - D) - M(t),  |x_b(t - D) - M(t)| = c D     by fixed point, at each step's start, in the microphone's frame

Within a step the direction goes straight from one to the other. A body that was moved by hand is heard from between its
two places for that one step.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.engine.path.space.receiver_places import FIXED_POINT_ROUNDS, ReceiverPlaces, turn_back
from sonic_bullet.records import Array


def hearing_directions(
    time_s: Array, places: ReceiverPlaces, known_s: Array, known_m: Array, speed_m_s: float
) -> Array:
    """Compute (k, b, c, 3) from microphones at time_s (k,) to bodies, in m.

    known_m (h, b, 3): bodies at times known_s (h,).
    """
    bodies, here = np.arange(known_m.shape[1])[None, :, None], places.position_m[:, None]
    sent_s = np.broadcast_to(time_s[:, None, None], (len(time_s), known_m.shape[1], here.shape[2]))
    away = np.zeros((*sent_s.shape, 3))
    for _ in range(FIXED_POINT_ROUNDS):
        at = np.clip(np.searchsorted(known_s, sent_s, side="right") - 1, 0, len(known_s) - 1)
        after = np.minimum(at + 1, len(known_s) - 1)
        length = np.where(after > at, known_s[after] - known_s[at], 1.0)
        part = np.clip((sent_s - known_s[at]) / length, 0, 1)[..., None]
        before_m = known_m[at, bodies]
        away = before_m + part * (known_m[after, bodies] - before_m) - here
        sent_s = time_s[:, None, None] - np.linalg.norm(away, axis=-1) / speed_m_s
    return turn_back(places.quaternion_xyzw[:, None], away)
