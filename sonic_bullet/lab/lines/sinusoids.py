"""Damped sinusoids of one recording: what they leave of it, their amplitudes and their information.

x(n) = Re Σ_k A_k e^{p_k n} + noise,   p = (−d + iω)/sr,   unknowns (ω, d, Re A, Im A) of every mode
columns of J are Re(c n^q e^{pn}), q = 0 or 1, so JᵀJ is made of geometric sums Σ w^n, Σ n w^n, Σ n² w^n; only Jᵀr
    looks at samples
spread: √diag of N/2·(JᵀJ)⁻¹, the Cramér-Rao bound                               [Kay 1993, ch. 3.9]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array

PHASOR_BLOCK = 256  # about the square root of a second's samples


@dataclass(frozen=True, slots=True, eq=False)
class Sinusoids:
    """pole (k,) −d + iω in 1/s, amplitude (k,) complex at sample 0."""

    pole: Array
    amplitude: Array

    def take(self, which: Array) -> Sinusoids:
        """Return the modes of that index or mask."""
        return Sinusoids(self.pole[which], self.amplitude[which])


def _powers(pole: Array, step: int, count: int) -> Array:
    """e^{pole·step·m} (count, k), zero once below e^-gone: no subnormal numbers."""
    gone = 41.0  # e^-41: a mode is silent below the rounding of its own start
    fine = 16
    outer = -(-count // fine)
    above, below = (
        np.exp(np.maximum(e.real, -gone) + 1j * e.imag)
        for e in (pole * (step * m)[:, None] for m in (fine * np.arange(outer), np.arange(fine)))
    )
    power = (above[:, None] * below).reshape(outer * fine, len(pole))[:count]
    last = np.minimum(gone / np.maximum(-pole.real * step, 1e-12), count).astype(int)
    for k in np.flatnonzero(last < count):
        power[last[k] :, k] = 0
    return np.asarray(power)


def _subtracted(signal: Array, pole: Array, amplitude: Array) -> Array:
    """Signal less Re Σ A e^{pn}; pole per sample. n = PHASOR_BLOCK·b + j: the sum is a product of matrices."""
    blocks = -(-len(signal) // PHASOR_BLOCK)
    coarse, fine = _powers(pole, PHASOR_BLOCK, blocks) * amplitude, _powers(pole, 1, PHASOR_BLOCK)
    sound = np.concatenate([coarse.real, -coarse.imag], axis=1) @ np.concatenate([fine.real, fine.imag], axis=1).T
    return np.asarray(signal - sound.ravel()[: len(signal)])


def moments(signal: Array, pole: Array) -> tuple[Array, Array]:
    """Σ x e^{pn} and Σ n x e^{pn}, both (k,), by the same division of n."""
    blocks, k = -(-len(signal) // PHASOR_BLOCK), len(pole)
    padded = np.zeros((blocks, PHASOR_BLOCK))
    padded.ravel()[: len(signal)] = signal
    coarse, fine = _powers(pole, PHASOR_BLOCK, blocks), _powers(pole, 1, PHASOR_BLOCK)
    slope = np.arange(PHASOR_BLOCK)[:, None] * fine
    sums = padded @ np.concatenate([fine.real, fine.imag, slope.real, slope.imag], axis=1)
    plain, sloped = (
        coarse * (sums[:, :k] + 1j * sums[:, k : 2 * k]),
        coarse * (sums[:, 2 * k : 3 * k] + 1j * sums[:, 3 * k :]),
    )
    return plain.sum(axis=0), (PHASOR_BLOCK * np.arange(blocks)) @ plain + sloped.sum(axis=0)


def geometric(first: Array, second: Array, count: int) -> tuple[Array, Array, Array]:
    """Σ wⁿ, Σ n wⁿ, Σ n² wⁿ over n < count, w (k, k) = e^{first + second} [Graham, Knuth, Patashnik 1994, eq. 2.26]."""
    w, last = np.outer(np.exp(first), np.exp(second)), np.outer(np.exp(first * count), np.exp(second * count))
    gap, log_w = 1 - w, first[:, None] + second
    near = np.abs(gap) < 0.05  # where 1 − w has lost digits
    gap[near] = -np.expm1(log_w[near])
    gap = np.where(np.abs(gap) < 1e-12, 1e-12, gap)
    zeroth = (1 - last) / gap
    first_moment = (w * zeroth - count * last) / gap
    second_moment = (w * (zeroth + 2 * first_moment) - float(count) ** 2 * last) / gap
    return zeroth, first_moment, second_moment


def information(modes: Sinusoids, sr: int, count: int) -> Array:
    """JᵀJ (4k, 4k) for (ω, d, Re A, Im A), blocks of k; ω and d in 1/s."""
    z, a, k = modes.pole / sr, modes.amplitude, len(modes.pole)
    even, odd = geometric(z, z.conj(), count), geometric(z, z, count)
    columns = ((1j * a / sr, 1), (-a / sr, 1), (np.ones(k, complex), 0), (np.full(k, 1j), 0))
    matrix = np.empty((4 * k, 4 * k))
    for i, (c, q) in enumerate(columns):
        for j, (e, r) in enumerate(columns):
            both = c[:, None] * e[None, :].conj() * even[q + r] + c[:, None] * e[None, :] * odd[q + r]
            matrix[i * k : i * k + k, j * k : j * k + k] = both.real / 2
    return matrix


def residual(signal: Array, modes: Sinusoids, sr: int) -> Array:
    """Return what the modes leave of a signal (n,)."""
    return np.asarray(_subtracted(signal, modes.pole / sr, modes.amplitude))


def amplitudes(signal: Array, pole: Array, sr: int, *, passes: int = 3) -> Sinusoids:
    """Least-squares amplitudes of given poles, refined ``passes`` times on what they leave."""
    modes = Sinusoids(pole, np.zeros(len(pole), complex))
    k = len(pole)
    if not k:
        return modes
    matrix = information(modes, sr, len(signal))[2 * k :, 2 * k :]
    scale = 1 / np.sqrt(np.diag(matrix))
    matrix = matrix * scale[:, None] * scale + 1e-13 * np.eye(2 * k)
    for _ in range(passes):
        first, _ = moments(residual(signal, modes, sr), pole / sr)
        step = scale * np.linalg.solve(matrix, scale * np.concatenate([first.real, -first.imag]))
        modes = Sinusoids(pole, modes.amplitude + step[:k] + 1j * step[k:])
    return modes


def alone(signal: Array, pole: Array, sr: int) -> Array:
    """Energy (k,) that each pole would take from a signal (n,) by itself, others left out of account."""
    first, _ = moments(signal, pole / sr)
    power = np.expm1(2 * pole.real / sr * len(signal)) / np.expm1(2 * pole.real / sr)
    return np.asarray(2 * np.abs(first) ** 2 / power)


def spreads(modes: Sinusoids, sr: int, count: int) -> tuple[Array, Array]:
    """Return standard errors (4, k) of ω, d, Re A, Im A, and energies (k,) of each mode given the others.

    In white noise of unit rms. The energy is |A|² in the metric of A's own covariance at fixed poles [Kay 1998, eq.
    7.36].
    """
    k = len(modes.pole)
    matrix = information(modes, sr, count)
    variance = np.diag(_inverse(matrix))
    inverse, pair = _inverse(matrix[2 * k :, 2 * k :]), np.arange(k)
    a, b, c = inverse[pair, pair], inverse[pair, pair + k], inverse[pair + k, pair + k]
    x, y = modes.amplitude.real, modes.amplitude.imag
    energy = (c * x * x - 2 * b * x * y + a * y * y) / np.maximum(a * c - b * b, 1e-300)
    return np.sqrt(np.maximum(variance, 0)).reshape(4, k), np.asarray(energy)


def _inverse(matrix: Array) -> Array:
    """Of a positive matrix, scaled to a diagonal of one and lifted by what rounding has taken."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.asarray(
        np.linalg.inv(matrix * scale[:, None] * scale + 1e-13 * np.eye(len(matrix))) * scale[:, None] * scale
    )
