"""A head's two ears: what a body sends, through the responses of the direction that it comes from.

    h_e(u) = F⁻¹[ Σ_i w_i A_ei(ω) exp(-iω Σ_i w_i d_ei) ],   A_ei = H_ei exp(iω d_ei)

i: the measured directions at the corners of the triangle that holds u, w_i its barycentric weights; d_ei the delay of
the ear's response (its onset), so that responses are mixed in step and the delay between ears glides with the direction
[Hartung, Braasch, Sterbing, AES 16th Conf. 1999; Begault 1994, ch. 4]. At a measured direction it is that response.
Within a step the sound fades from the filter of its start to that of its end (src/path/ear_filters.hpp). b bodies, n
samples, t taps.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np

from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.records import Array, Head
from sonic_bullet.signal.elementary import complex_exp, complex_product, matrix_product

ONSET_SHARE = 0.1
"""Of a response's peak: where it begins. 20 dB is what ITD is measured by [Katz, Noisternig, JASA 2014, table I]."""
FILTER_MARGIN = 16
"""Samples before and behind a response, for what delays that are no whole samples spread."""


@dataclass(frozen=True, slots=True, eq=False)
class EarFilters:
    """Filters of a head by direction.

    spectrum (d, 2, f): responses in step; delay (d, 2): in samples; corner (s, 3), inverse (s, 3, 3): triangles of
    directions and the inverse of their corners; direction (d, 3); size: taps of a filter; transformed: samples of the
    spectra, a power of two: such a transform has the same bits on every machine.
    """

    spectrum: Array
    delay: Array
    direction: Array
    corner: Array
    inverse: Array
    size: int
    transformed: int

    def at(self, away: Array) -> Array:
        """Make filters (k, 2, t) for directions (k, 3), of any length."""
        length = np.linalg.norm(away, axis=-1, keepdims=True)
        unit = np.where(length > 1e-9, away / np.maximum(length, 1e-9), [1.0, 0.0, 0.0])
        index, weight = self._weights(unit)
        late = (weight[:, :, None] * self.delay[index]).sum(axis=1)
        spectrum = self.spectrum[index]
        mixed = 1j * (weight[:, :, None, None] * spectrum.imag).sum(axis=1)
        mixed += (weight[:, :, None, None] * spectrum.real).sum(axis=1)
        turn = complex_exp(1j * (-2 * np.pi / self.transformed * late[..., None] * np.arange(mixed.shape[-1])))
        whole = np.fft.irfft(complex_product(mixed, turn), self.transformed)
        return np.ascontiguousarray(whole[..., : self.size])

    def _weights(self, unit: Array) -> tuple[Array, Array]:
        """Find three measured directions (k, 3) for each, and their shares; one alone where it is the direction."""
        nearest = np.argmax(matrix_product(unit, self.direction.T), axis=1)
        index, share = np.repeat(nearest[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (len(unit), 1))
        if len(self.corner):
            part = matrix_product(unit, self.inverse.reshape(-1, 3).T).reshape(len(unit), -1, 3)
            best = np.argmax(part.min(axis=-1), axis=1)
            found = np.maximum(part[np.arange(len(unit)), best], 0)
            total = found.sum(axis=1, keepdims=True)
            apart = np.linalg.norm(unit - self.direction[nearest], axis=1) > 1e-6
            use = apart & (total[:, 0] > 0)
            index[use], share[use] = self.corner[best[use]], (found / np.maximum(total, 1e-300))[use]
        return index, share


@WhileAlive
def ear_filters(head: Head, sr: int) -> EarFilters:
    """Prepare a head at a rate of sr Hz; its responses are resampled where they have another."""
    response = np.asarray(head.response)
    if head.sr != sr:
        response = resample_response(response, head.sr, sr)
    taps = response.shape[2]
    size = 2 * -(-(taps + 2 * FILTER_MARGIN) // 2)
    transformed = 1 << (size - 1).bit_length()
    spectrum = np.fft.rfft(np.pad(response, ((0, 0), (0, 0), (FILTER_MARGIN, transformed - taps - FILTER_MARGIN))))
    delay = onsets(response)
    turn = complex_exp(1j * (2 * np.pi / transformed * delay[..., None] * np.arange(spectrum.shape[-1])))
    corner = triangles(head.direction)
    inverse = _inverse(head.direction[corner])
    return EarFilters(complex_product(spectrum, turn), delay, head.direction, corner, inverse, size, transformed)


def _inverse(corner: Array) -> Array:
    """Compute (s, 3, 3) the inverse of three columns, corners (s, 3, 3) by rows, by Cramer's rule."""
    one, other, third = corner.transpose(1, 0, 2)
    rows = np.stack([np.cross(other, third), np.cross(third, one), np.cross(one, other)], axis=1)
    return np.asarray(rows / (one * rows[:, 0]).sum(axis=1)[:, None, None])


def resample_response(response: Array, sr: int, to: int) -> Array:
    """Resample responses (…, n) to another rate, of the same spectrum: samples are weighed by their length."""
    from scipy.signal import resample_poly

    common = gcd(sr, to)
    return np.asarray(resample_poly(response, to // common, sr // common, axis=-1, window=("kaiser", 10.0))) * (sr / to)


def onsets(response: Array) -> Array:
    """Find (…) samples after which a response (…, n) first passes `ONSET_SHARE` of its peak."""
    finer = 16  # Onsets are found at so many times the rate: 1.3 µs at 48 kHz
    from scipy.signal import resample_poly

    fine = np.abs(resample_poly(response, finer, 1, axis=-1))
    peak = fine.max(axis=-1, keepdims=True)
    return np.asarray(np.argmax(fine >= ONSET_SHARE * np.maximum(peak, 1e-300), axis=-1) / finer)


def triangles(direction: Array) -> Array:
    """Find corners (s, 3) of triangles that directions (d, 3) span, their convex hull's; none where that is flat."""
    from scipy.spatial import ConvexHull, QhullError

    unique = np.unique(np.round(direction, 9), axis=0, return_index=True)[1]
    if len(unique) < 4:
        return np.zeros((0, 3), int)
    try:
        hull = unique[ConvexHull(direction[unique]).simplices]
    except QhullError:
        return np.zeros((0, 3), int)
    volume = np.linalg.det(direction[hull])
    return np.asarray(hull[np.abs(volume) > 1e-9])
