"""Mode shapes as whole multiples of a power of two, one for each mode, so that files hold them small and exact.

    q = round(φ / 2^e),   2^e = 2^(E − B),   2^(E−1) <= max |φ| < 2^E over the mode;     φ := q·2^e

|q| <= 2^B is a whole number, and q·2^e a float32, to the last bit. The error is at most half a multiple: 2^−B of the
mode's largest component. Modes are rounded once, when they are computed: all that is derived from them later, live or
from a file, has the same numbers. Eleven bits keep the sound of every scene within −60 dB of its peak, with a margin:
studies/shape_rounding.py.

A file holds differences, which are smaller: of each vertex from the first of its neighbours that precedes it,
d_i = q_i − q_parent(i) modulo 2^16, as 2d for d >= 0 and −2d − 1 else.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import round_shapes
from sonic_bullet.records.arrays import Array

TINIEST = -126  # exponent of the smallest normal float32


def quantize_shapes(shape: Array, bits: int = 11) -> Array:  # B; 10 would do for three of the six scenes
    """Round shapes (v, 3, m) to whole multiples of each mode's power of two, as float32; read-only, a record's own."""
    made = np.array(shape, np.float32, order="C")
    round_shapes(made.reshape(made.shape[0] * made.shape[1], made.shape[2]), bits)
    made.setflags(write=False)
    return made


def whole_multiples(shape: Array) -> tuple[Array, Array] | None:
    """Return q (v, 3, m) int16 and the largest e (m,) int16 of shapes (v, 3, m) float32, or None.

    None where they are not such multiples; else `from_multiples` restores the same bytes.
    """
    most_bits = 15  # of whole numbers in a file, int16 with its sign
    exponent = np.maximum(_exponent(shape) - most_bits, TINIEST)
    scaled = np.ldexp(shape, -exponent)
    if not (np.abs(scaled) < 2**most_bits).all():
        return None
    whole = scaled.astype(np.int16)
    bits = np.bitwise_or.reduce(whole, axis=(0, 1), initial=0).astype(int)
    spare = np.where(bits, np.log2(np.maximum(bits & -bits, 1)), 0).astype(int)  # zeros at the end of all of them
    found = (whole >> spare.astype(np.int16)).astype(np.int16), (exponent + spare).astype(np.int16)
    return found if from_multiples(*found).tobytes() == np.ascontiguousarray(shape).tobytes() else None


def from_multiples(whole: Array, exponent: Array) -> Array:
    """Return the shapes (v, 3, m) float32 of q and e."""
    with np.errstate(over="ignore"):  # of a forged file: the record refuses what is infinite
        return np.asarray(np.ldexp(whole.astype(np.float32), exponent.astype(np.int32)))


def differences(whole: Array, face: Array) -> Array:
    """Return (v, 3, m) uint16 of q (v, 3, m) int16 on a surface of faces (f, 3); `sum_differences` restores q."""
    parent = _parents(len(whole), face)
    step = whole - np.concatenate([whole, np.zeros((1, *whole.shape[1:]), np.int16)])[parent]
    return np.asarray((step << 1) ^ (step >> 15)).view(np.uint16)


def sum_differences(step: Array, face: Array) -> Array:
    """Return q (v, 3, m) int16 of its `differences`; faces must name existing vertices.

    Sums a vertex and its first 1, 2, 4 … ancestors at a time [Hillis & Steele 1986]: a chain of n takes log n rounds.
    """
    parent = np.append(_parents(len(step), face), len(step))  # the last: beyond the first ancestor
    signed = ((step >> 1) ^ -(step & 1)).view(np.int16)
    whole = np.concatenate([signed, np.zeros((1, *step.shape[1:]), np.int16)])
    while (parent < len(step)).any():
        whole = whole + whole[parent]
        parent = parent[parent]
    return whole[:-1]


def _parents(count: int, face: Array) -> Array:
    """Return (count,) the first of each vertex's neighbours, where it precedes the vertex, else ``count``."""
    parent = np.arange(count)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        np.minimum.at(parent, face[:, a], face[:, b])
        np.minimum.at(parent, face[:, b], face[:, a])
    return np.where(parent < np.arange(count), parent, count)


def _exponent(shape: Array) -> Array:
    """Return E (m,) of the largest component of each mode, 0 without one."""
    return np.asarray(np.frexp(np.abs(shape).max(axis=(0, 1), initial=0).astype(float))[1])
