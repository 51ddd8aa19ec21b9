"""Pairs of lines and modes, or of the lines of two states: one assignment of all at once, at the least price.

    price_kj = x²/18 + (ln d_k/d_j)²/18e² + κ (1 − c_kj),  at most 1, less 1;       x = (ln f_k/f_j − s)/w
    Σ weight_kj price_kj -> min over one-to-one pairs; those below 0 are pairs           [Kuhn 1955; Crouse 2016]

w, e: spreads of ln f and ln d; a line 4.2 spreads from a mode is not that mode's, whatever else agrees. s: a common
shift. c: likeness, as the cosine of amplitudes over the strikes; κ: the price of two that have nothing in common.
Where most lines stay and few go far, Cauchy's law takes the place of x²/18: ln(1 + x²)/ln(1 + X²), X the farthest.
By chance: the same lines at random places near theirs, those close to one another moved together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array

BEYOND_WIDTHS = float(np.sqrt(18.0))
"""Spreads of ln f from where on a line and a mode are no pair."""


@dataclass(frozen=True, slots=True, eq=False)
class Assignment:
    """Pairs (p,) of lines and modes by index, lines ascending, and their price: 0 without pairs, below 0 with some."""

    line: Array
    mode: Array
    price: float


def assign_lines(
    line_log_hz: Array,
    mode_log_hz: Array,
    width: float,
    *,
    shift: Sequence[float] = (0.0,),
    farthest: float | None = None,
    log_decay: tuple[Array, Array] | None = None,
    decay_width: float = 1.0,
    likeness: Array | float = 1.0,
    pattern_price: float = 1.0,
    weight: Array | float = 1.0,
) -> Assignment:
    """Pair lines and modes at the least price.

    Parameters
    ----------
    line_log_hz, mode_log_hz : (k,), (m,)
        ln f.
    width : float
        w, of ln f.
    shift : sequence of float
        s, of the lines' ln f over the modes'; of several the nearest.
    farthest : float
        Of ln f: as far as a line may go, where few go far.
    log_decay : (k,), (m,)
        ln d of both; what is not finite costs nothing.
    decay_width : float
        e, of ln d.
    likeness : (k, m)
        c, 0 to 1.
    pattern_price : float
        κ.
    weight : (k, m), (k, 1) or float
        Of each pair, 0 where there may be none.
    """
    from scipy.optimize import linear_sum_assignment

    apart = line_log_hz[:, None] - mode_log_hz[None, :]
    square = np.min([((apart - s) / width) ** 2 for s in shift], axis=0)
    price = square / 18 if farthest is None else np.log1p(square) / np.log1p((farthest / width) ** 2)
    if log_decay is not None:
        with np.errstate(invalid="ignore"):
            off = log_decay[0][:, None] - log_decay[1][None, :]
        price = price + (np.where(np.isfinite(off), off, 0.0) / decay_width) ** 2 / 18
    price = (np.minimum(price + pattern_price * (1 - likeness), 1.0) - 1.0) * weight
    line, mode = linear_sum_assignment(price)
    good = price[line, mode] < 0
    return Assignment(line[good], mode[good], float(price[line[good], mode[good]].sum()))


def cosines(a: Array, b: Array) -> Array:
    """Compute |aᵀb|/|a||b| (k, m), the cosines' magnitudes of columns (s, k) and (s, m); 0 of a column of zeros."""
    norms = np.linalg.norm(a, axis=0)[:, None] * np.linalg.norm(b, axis=0)[None, :]
    return np.asarray(np.abs(a.T @ b) / np.maximum(norms, 1e-300))


def weight_by_level(level: Array, loudest: float | None = None, per_decade: float = 0.25) -> Array:
    """Compute the weight (k,) of lines or modes by their levels: 1 of the loudest, less per decade below, 0.1 at least.

    A faint line is more often a click's, a neighbour's or noise.
    """
    top = level.max(initial=0.0) if loudest is None else loudest
    relative = np.maximum(level / max(top, 1e-300), 1e-12)
    return np.asarray(np.clip(1 + per_decade * np.log10(relative), 0.1, 1))


def move_at_random(log_hz: Array, random: np.random.Generator) -> Array:
    """Move lines (k,) at random, by up to ten times what a pair may be apart, close ones together as modes stay close.

    The pairs that they make with modes are those that chance makes.
    """
    most, together = 0.06, 0.02  # of ln f: how far, and lines nearer than this move as one
    order = np.argsort(log_hz)
    cluster = np.cumsum(np.diff(log_hz[order], prepend=0.0) > together)
    moved = log_hz.copy()
    moved[order] += random.uniform(-most, most, len(order) + 1)[cluster]
    return moved


def strongest_lines(h: ObjectEvidence) -> Array:
    """Select the strongest of all lines of an object, ascending in frequency: indices (k,)."""
    most_lines = 48
    strong = np.argsort(-np.nan_to_num(np.abs(h.every_amplitude)).max(axis=0))[:most_lines]
    return np.asarray(strong[np.argsort(h.every_hz[strong])])


def patterns(h: ObjectEvidence, shape: Array) -> Array:
    """Compute |J φ(p)·e φ(q)·n| (s, m) of the strikes by shapes (s + 1, 3, m) at strikes and sensor."""
    into, out = h.participation(shape)
    return np.asarray(np.abs(into * out))
