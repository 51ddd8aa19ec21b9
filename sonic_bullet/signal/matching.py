"""Pairs of two lists, one to one, at the least price.

Σ w_ij (p_ij − 1) -> min over one-to-one pairs, those of p < 1 kept                    [Kuhn 1955; Crouse 2016]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def pairs_of_least_price(price: Array, weight: Array | float = 1.0) -> tuple[Array, Array]:
    """Find the pairs whose prices sum to the least.

    Parameters
    ----------
    price : (k, m)
        Of each pair less that of staying alone: below 0 where a pair is better.
    weight : (k, m), (k, 1), (1, m) or float
        Of each pair, above 0.

    Returns
    -------
    row, column : (p,)
        The pairs of a price below 0, rows ascending.
    """
    from scipy.optimize import linear_sum_assignment

    row, column = linear_sum_assignment(price * weight)
    good = price[row, column] < 0
    return row[good], column[good]


def cosines(a: Array, b: Array) -> Array:
    """Compute |aᵀb|/|a||b| (k, m), the cosines' magnitudes of columns (s, k) and (s, m); 0 of a column of zeros."""
    norms = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)[None, :]
    return np.asarray(np.abs(a.T @ b) / np.maximum(norms, 1e-300))
