"""Seed of a body's surface: which of all rough surfaces of its kind it has."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Body


def surface_seed(seed: int, body: Body) -> int:
    """Compute BODY.surface_seed from the seed and the body's id: the same in every run.

    A body that was not added is recorded at its first touch: whatever was removed before that is no matter of its own.
    """
    epoch = 0 if body.material is None else body.epoch
    who = np.random.SeedSequence([seed & 0xFFFFFFFF, body.body_id & 0xFFFFFFFF, (body.link + 1) & 0xFFFFFFFF, epoch])
    return int(who.generate_state(1)[0])
