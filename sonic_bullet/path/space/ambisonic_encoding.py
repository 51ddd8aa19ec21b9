"""Ambisonics: what a body sends to a point, on spherical harmonics of the direction it comes from.

    B_i(t) = Σ_b Y_i(u_b(t)) p_b(t),   i = l² + l + m (ACN), Y_i real, SN3D: Y_0 = 1, |Y_l|² sums to 1 over m
        [Nachbar, Zotter, Deleflie, Sontacchi: ambiX, Ambisonics Symposium 2011, eq. 1-3]

Plane waves: p_b has the 1/r of the true distance, its curvature is left out. Y is made every 32 samples of a step
and is straight between. b bodies, n samples, i channels.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit


@njit(nogil=True, error_model="numpy")
def harmonics(x, y, z, order, out):  # pragma: no cover - compiled
    """Evaluate Y (i,) of the direction of (x, y, z), of any length; but the first 0 where that is 0."""
    length = np.sqrt(x * x + y * y + z * z)
    inverse = 1.0 / length if length > 1e-9 else 0.0
    x, y, z = x * inverse, y * inverse, z * inverse
    out[0], out[1], out[2], out[3] = 1.0, y, z, x
    if order > 1:
        here = 1.0 if inverse > 0.0 else 0.0
        out[4], out[5] = np.sqrt(3.0) * x * y, np.sqrt(3.0) * y * z
        out[6], out[7] = 0.5 * (3.0 * z * z - here), np.sqrt(3.0) * x * z
        out[8] = np.sqrt(0.75) * (x * x - y * y)
    if order > 2:
        out[9], out[10] = np.sqrt(0.625) * y * (3.0 * x * x - y * y), np.sqrt(15.0) * x * y * z
        out[11], out[12] = np.sqrt(0.375) * y * (5.0 * z * z - 1.0), 0.5 * z * (5.0 * z * z - 3.0)
        out[13], out[14] = np.sqrt(0.375) * x * (5.0 * z * z - 1.0), np.sqrt(3.75) * z * (x * x - y * y)
        out[15] = np.sqrt(0.625) * x * (x * x - 3.0 * y * y)


@njit(nogil=True, error_model="numpy")
def encode(first, count, along, pressure, away, order, out, apart):  # pragma: no cover - compiled
    """Add what bodies send, pressure (b, n), to out (1, i, n), or apart 1: (b, i, n).

    first, count (k,): of each step; along (n,): where between its ends each sample lies; away (k + 1, b, 3): to each
    body at its start.
    """
    # samples: a body that passes at 10 m/s in 0.2 m moves by 2°, and a straight line misses Y of order 3 by 1e-3
    piece = 32
    channels = (order + 1) ** 2
    begin, end = np.empty(16), np.empty(16)
    for k in range(len(first)):
        stop = first[k] + count[k]
        for b in range(len(pressure)):
            at = first[k]
            while at < stop and pressure[b, at] == 0.0:
                at += 1
            if at == stop:
                continue
            at = first[k]
            u, v = away[k, b], away[k + 1, b]
            while at < stop:
                n = min(piece, stop - at)
                for edge in range(2):
                    s = along[at] if edge == 0 else along[at + n] if at + n < stop else 1.0
                    harmonics(
                        u[0] + s * (v[0] - u[0]), u[1] + s * (v[1] - u[1]), u[2] + s * (v[2] - u[2]), order,
                        begin if edge == 0 else end,
                    )  # fmt: skip
                row = b if apart else 0
                for i in range(channels):
                    gain, slope = begin[i], (end[i] - begin[i]) / n
                    for j in range(n):
                        out[row, i, at + j] += pressure[b, at + j] * (gain + slope * j)
                at += n
