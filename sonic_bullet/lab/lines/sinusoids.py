"""Damped sinusoids of one recording: what they leave of it, and sums of their products.

x(n) = Re Σ_k A_k e^{p_k n} + noise,   p = (−d + iω)/sr
products of two of them are geometric sums Σ w^n, Σ n w^n, Σ n² w^n; only moments look at samples
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


def _subtract_sinusoids(signal: Array, pole: Array, amplitude: Array) -> Array:
    """Signal less Re Σ A e^{pn}; pole per sample. n = PHASOR_BLOCK·b + j: the sum is a product of matrices."""
    blocks = -(-len(signal) // PHASOR_BLOCK)
    coarse, fine = _powers(pole, PHASOR_BLOCK, blocks) * amplitude, _powers(pole, 1, PHASOR_BLOCK)
    sound = np.concatenate([coarse.real, -coarse.imag], axis=1) @ np.concatenate([fine.real, fine.imag], axis=1).T
    return np.asarray(signal - sound.ravel()[: len(signal)])


def moments(signals: Array, pole: Array) -> tuple[Array, Array]:
    """Σ x e^{pn} and Σ n x e^{pn}, both (s, k), of signals (s, n), by the same division of n."""
    blocks, k = -(-signals.shape[1] // PHASOR_BLOCK), len(pole)
    padded = np.zeros((len(signals), blocks * PHASOR_BLOCK))
    padded[:, : signals.shape[1]] = signals
    coarse, fine = _powers(pole, PHASOR_BLOCK, blocks), _powers(pole, 1, PHASOR_BLOCK)
    slope = np.arange(PHASOR_BLOCK)[:, None] * fine
    waves = np.concatenate([fine.real, fine.imag, slope.real, slope.imag], axis=1)
    sums = (padded.reshape(-1, PHASOR_BLOCK) @ waves).reshape(len(signals), blocks, 4 * k)
    plain = ((sums[..., :k] + 1j * sums[..., k : 2 * k]) * coarse).transpose(0, 2, 1)
    sloped = np.einsum("sbk,bk->sk", sums[..., 2 * k : 3 * k] + 1j * sums[..., 3 * k :], coarse)
    return plain.sum(axis=2), plain @ (PHASOR_BLOCK * np.arange(blocks)) + sloped


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


def residual(signal: Array, modes: Sinusoids, sr: int) -> Array:
    """Return what the modes leave of a signal (n,)."""
    return np.asarray(_subtract_sinusoids(signal, modes.pole / sr, modes.amplitude))
