"""A smooth law of damping below the decays of lines with dashpots.

d(ω) = ½[a + bω + cω² + Σ_j e_j (ωτ_j)²/(1 + (ωτ_j)²)]: a discrete spectrum of relaxations, as of a passive solid
    [Nowick & Berry 1972, ch. 3]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.robust import fit_nonnegative


def smooth_columns(omega: Array) -> Array:
    """Compute the columns (k, 3 + τ) of a smooth law of ω (k,) in rad/s."""
    # of relaxations that peak in what is heard, between slow ones, whose decay is a constant, and fast ones, whose goes
    # as ω²
    tau_s = (1e-5, 3e-5, 1e-4)
    peak = [(omega * tau) ** 2 / (1 + (omega * tau) ** 2) for tau in tau_s]
    return 0.5 * np.stack([np.ones(len(omega)), omega / 1e4, (omega / 1e4) ** 2, *peak], axis=1)


def least_law(omega: Array, decay: Array) -> Array:
    """Fit the smooth law (c,) that most lines (k,) lie above: an expectile [Newey & Powell 1987].

    A dashpot only adds to a decay.
    """
    low = 0.3  # of a line's spread where it lies under the least law
    column, above = smooth_columns(omega), np.ones(len(omega), bool)
    value = np.zeros(column.shape[1])
    for _ in range(10):
        value, _ = fit_nonnegative(decay, np.where(above, 1.0, low) * decay, column)
        above = decay > column @ value
    return value
