"""Pairs of lines and modes of a body that an effect has changed, by frequency and by pattern over the strikes.

    price_kj = ((ln f_k − ln f_j − s)/w)²/18 + κ (1 − c_kj),  at most 1;  Σ worth_k (price − 1) -> min over one-to-one
        pairs     [Kuhn 1955; Crouse 2016]

c: cosine of the amplitudes' magnitudes over the strikes, κ: its weight; s: the common shift ln f, found in turns with
the pairs; worth: a line's strength, in logarithm.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array
from sonic_bullet.signal.matching import cosines, pairs_of_least_price


def strongest_lines(h: ObjectEvidence) -> Array:
    """Select the strongest of all lines of an object, ascending in frequency: indices (k,)."""
    most_lines = 48
    strong = np.argsort(-np.nan_to_num(np.abs(h.every_amplitude)).max(axis=0))[:most_lines]
    return np.asarray(strong[np.argsort(h.every_hz[strong])])


def patterns(h: ObjectEvidence, shape: Array) -> Array:
    """Compute |J φ(p)·e φ(q)·n| (s, m) of the strikes by shapes (s + 1, 3, m) at strikes and sensor."""
    into, out = h.participation(shape)
    return np.asarray(np.abs(into * out))


def worth_of(level: Array, loudest: float) -> Array:
    """Compute what lines or modes (k,) are worth by their levels: a quarter less a decade below the loudest."""
    return np.asarray(np.clip(1 + 0.25 * np.log10(np.maximum(level / max(loudest, 1e-300), 1e-6)), 0.1, 1))


def agreed(
    line_hz: Array,
    size: Array,
    mode_hz: Array,
    pattern: Array,
    *,
    shift: float = 0.0,
    turns: int = 2,
    width: float = 0.004,
    strict: float = 1.0,
) -> tuple[float, Array, Array, float]:
    """Pair lines and modes at the least price.

    Parameters
    ----------
    line_hz : (k,)
        Frequencies of the lines.
    size : (s, k)
        Magnitudes of their amplitudes.
    mode_hz : (m,)
        Frequencies of the modes.
    pattern : (s, m)
        Magnitudes of the modes' amplitudes.
    shift : float
        Common shift of ln f to start from.
    turns : int
        Updates of the shift.
    width : float
        w, of ln f.
    strict : float
        κ.

    Returns
    -------
    score : float
        0 where no pair is found and −Σ worth where all lines have one.
    line, mode : (p,)
        Indices of the pairs.
    shift : float
        The common shift.
    """
    # lists of frequencies, or strikes of unknown place
    if not (np.isfinite(size).all() and size.any() and np.isfinite(pattern).all() and pattern.any()):
        size, pattern = np.ones((1, len(line_hz))), np.ones((1, len(mode_hz)))
    strength = size.max(axis=0)
    participation = pattern.max(axis=0)
    worth, force = worth_of(strength, strength.max()), worth_of(participation, participation.max())
    alike = cosines(size, pattern) if len(size) > 1 else np.ones((size.shape[1], pattern.shape[1]))
    x, y = np.log(line_hz)[:, None], np.log(mode_hz)[None, :]
    row = column = np.zeros(0, int)
    score = 0.0
    for turn in range(turns + 1):
        price = np.minimum(((x - y - shift) / width) ** 2 / 18 + strict * (1 - alike), 1.0) - 1.0
        price = price * worth[:, None] * force[None, :]
        row, column = pairs_of_least_price(price)
        score = float(price[row, column].sum())
        if turn < turns and len(row):
            shift += float(np.clip(np.median((x - y)[row, column] - shift), -0.01, 0.01))
    return score, row, column, shift
