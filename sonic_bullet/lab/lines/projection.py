"""Amplitudes at given poles, and the equations of the poles with the amplitudes projected out.

    x_s(t) = Re Σ_k A_sk e^{(−d_k + iω_k) t} + noise: A_sk linear, by the Gram matrix of Re zⁿ and Re i zⁿ
    Gauss-Newton for (ω, d), A_sk projected out                                     [Golub & Pereyra 1973; Kaufman 1975]

All inner products of damped sinusoids over N samples are geometric sums, closed in w = z_j z_k*: Σ wⁿ, Σ n wⁿ, Σ n² wⁿ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.lab.lines.sinusoids import geometric, moments
from sonic_bullet.records import Array

ANGLE_AND_DECAY = (1j, -1.0)
"""By how much ω and d move a pole."""


class NormalEquations(NamedTuple):
    """Matrix (2k, 2k) and gradient (2k,) of Gauss-Newton for (ω, d), amplitudes projected out; cost: ½ Σ r²."""

    matrix: Array
    gradient: Array
    cost: float


def products(pole: Array, count: int) -> tuple[list[Array], list[Array]]:
    """Geometric sums of z_j z_k* and z_j z_k, poles per sample."""
    return list(geometric(pole, pole.conj(), count)), list(geometric(pole, pole, count))


def _inner(a: Array, b: Array, even: Array, odd: Array) -> Array:
    """<Re(a_j z_jⁿ), Re(b_k z_kⁿ)> (j, k)."""
    return np.asarray(np.real(a[:, None] * b[None, :].conj() * even + a[:, None] * b[None, :] * odd) / 2)


def basis_gram(even: Array, odd: Array) -> Array:
    """Gram matrix (2k, 2k) of Re zⁿ and Re i zⁿ."""
    one, turn = np.ones(len(even), complex), np.full(len(even), 1j)
    return np.block(
        [
            [_inner(one, one, even, odd), _inner(one, turn, even, odd)],
            [_inner(turn, one, even, odd), _inner(turn, turn, even, odd)],
        ]
    )


def _factor(gram: Array) -> tuple[Array, Array]:
    """Cholesky factor of a Gram matrix scaled to unit diagonal, slightly lifted, and the scale.

    Poles that all but coincide take a larger lift.
    """
    from scipy.linalg import LinAlgError, cholesky

    scale = 1 / np.sqrt(np.diag(gram))
    unit = gram * scale[:, None] * scale
    if not np.isfinite(unit).all():  # a tone without noise: poles that grow or stand
        raise LinAlgError("poles out of range")
    for lift in (1e-10, 1e-8, 1e-6):
        try:
            return cholesky(unit + lift * np.eye(len(gram)), lower=True), scale
        except LinAlgError:
            continue
    return cholesky(unit + 1e-3 * np.eye(len(gram)), lower=True), scale


def _solve(factor: tuple[Array, Array], right: Array) -> Array:
    """Solve for several right sides (2k, r)."""
    from scipy.linalg import cho_solve

    lower, scale = factor
    return np.asarray(scale[:, None] * cho_solve((lower, True), scale[:, None] * right))


def amplitudes_at(signals: Array, noise: Array, pole: Array, sr: int) -> tuple[Array, float, Array, Array]:
    """Return amplitude (s, k), half the sum of squares over the noise, energy (k,), residual rms (s,)."""
    z, n, k = pole / sr, signals.shape[1], len(pole)
    even, odd = products(z, n)
    a, explained = _projected(_factor(basis_gram(even[0], odd[0])), moments(signals, z)[0])
    residual = np.maximum((signals**2).sum(axis=1) - explained, 0.0)
    amplitude = (a[:k] + 1j * a[k:]).T
    power = np.real(np.diag(even[0])) / 2
    energy = ((np.abs(amplitude) / noise[:, None]) ** 2).sum(axis=0) * power
    return amplitude, float((residual / noise**2).sum() / 2), energy, np.sqrt(residual / n)


def _projected(factor: tuple[Array, Array], first: Array) -> tuple[Array, Array]:
    """Return weights (2k, s) of Re zⁿ and Re i zⁿ by moments (s, k), and the energy (s,) that these say."""
    right = np.concatenate([first.real, -first.imag], axis=1).T
    a = _solve(factor, right)
    return a, (right * a).sum(axis=0)


def normal_equations(signals: Array, noise: Array, pole: Array, sr: int) -> NormalEquations:
    """Compute the equations of poles (k,) in 1/s by signals (s, n) over white noise (s,).

    What moves a pole is Re m n zⁿ, m = iA and −A: of all strikes a sum of Re n zⁿ and Re i n zⁿ, which are projected
    once.
    """
    z, n, k = pole / sr, signals.shape[1], len(pole)
    even, odd = products(z, n)
    factor = _factor(basis_gram(even[0], odd[0]))
    first, second = moments(signals, z)
    a, explained = _projected(factor, first)
    amplitude = (a[:k] + 1j * a[k:]).T
    cross = basis_gram(even[1], odd[1])
    apart = basis_gram(even[2], odd[2]) - cross.T @ _solve(factor, cross)
    share = cross.T @ a  # (2k, s)
    # (u, s, 2k): factors of Re n zⁿ and of Re i n zⁿ where ω and d move
    move = np.concatenate([1j * amplitude, -amplitude], axis=1) / (sr * noise[:, None])
    factors = np.stack([move.real, move.imag])
    matrix, gradient = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
    for u in range(2):
        held = np.tile(share[u * k : (u + 1) * k].T / noise[:, None], 2)
        gradient -= (factors[u] * held).sum(axis=0)
        for v in range(2):
            there = apart[u * k : (u + 1) * k, v * k : (v + 1) * k]
            matrix += (factors[u].T @ factors[v]) * np.tile(there, (2, 2))
    gradient += (np.real(move * np.tile(second, 2)) / noise[:, None]).sum(axis=0)
    residual = np.maximum((signals**2).sum(axis=1) - explained, 0.0)
    return NormalEquations(matrix, gradient, float((residual / noise**2).sum() / 2))


def spreads(matrix: Array) -> Array:
    """Spreads (n,) that go with an information matrix (n, n).

    Of two poles that all but coincide rounding may turn a variance's sign; it is as large for that.
    """
    return np.asarray(np.sqrt(np.abs(np.diag(np.linalg.pinv(matrix)))))
