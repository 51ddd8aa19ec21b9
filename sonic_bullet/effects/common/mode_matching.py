"""Match modes before and after a change, one to one: at the greatest sum of likeness [Kuhn 1955; Crouse 2016]."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def match_all(likeness: Array) -> Array:
    """Match each row (n,) to a column of its own, as alike as all can be."""
    from scipy.optimize import linear_sum_assignment

    return np.asarray(linear_sum_assignment(-likeness)[1])
