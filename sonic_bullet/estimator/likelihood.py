"""All damped sinusoids of one recording at once: Gauss and Newton on the sum of squares.

    x(n) = Re Σ_k A_k e^{p_k n} + noise,   p = (−d + iω)/sr,   unknowns (ω, d, Re A, Im A) of every mode
    (JᵀJ + μ diag JᵀJ) δ = Jᵀ r                                                      [Levenberg 1944; Marquardt 1963]
    columns of J are Re(c n^q e^{pn}), q = 0 or 1, so JᵀJ is made of geometric sums Σ w^n, Σ n w^n, Σ n² w^n; only Jᵀr looks at samples
    spread: √diag of N/2·(JᵀJ)⁻¹ at the end, the Cramér-Rao bound                    [Kay 1993, ch. 3.9]

Since r is the true residual, rounding in JᵀJ costs steps and no accuracy: noise-free modes come back to 1e-9 and better.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from sonic_bullet.records import Array

GONE = 41.0  # e^-41: a mode is silent below the rounding of its own start
STEPS_MOST = 60


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """pole (k,) −d + iω in 1/s, amplitude (k,) complex at sample 0."""

    pole: Array
    amplitude: Array

    def take(self, which: Array) -> Modes:
        """The modes of that index or mask."""
        return Modes(self.pole[which], self.amplitude[which])


@njit(cache=True, nogil=True)
def _subtracted(signal, pole, amplitude):
    """Signal less Re Σ A e^{pn}; pole per sample. Powers restart from the exponential every 1024 samples."""
    left = signal.copy()
    for k in range(len(pole)):
        z = np.exp(pole[k])
        end = min(len(left), int(GONE / max(-pole[k].real, 1e-12)) + 1)
        power = amplitude[k]
        for n in range(end):
            if n % 1024 == 0:
                power = amplitude[k] * np.exp(pole[k] * n)
            left[n] -= power.real
            power *= z
    return left


@njit(cache=True, nogil=True)
def _moments(signal, pole):
    """Σ x e^{pn} and Σ n x e^{pn}, both (k,)."""
    first, second = np.zeros(len(pole), np.complex128), np.zeros(len(pole), np.complex128)
    for k in range(len(pole)):
        z = np.exp(pole[k])
        end = min(len(signal), int(GONE / max(-pole[k].real, 1e-12)) + 1)
        power, a, b = 1.0 + 0.0j, 0.0 + 0.0j, 0.0 + 0.0j
        for n in range(end):
            if n % 1024 == 0:
                power = np.exp(pole[k] * n)
            term = signal[n] * power
            a += term
            b += n * term
            power *= z
        first[k], second[k] = a, b
    return first, second


def geometric(log_w: Array, count: int) -> tuple[Array, Array, Array]:
    """Σ wⁿ, Σ n wⁿ, Σ n² wⁿ over n < count, w = e^log_w [Graham, Knuth, Patashnik 1994, eq. 2.26]."""
    gap = -np.expm1(log_w)
    gap = np.where(np.abs(gap) < 1e-12, 1e-12, gap)
    w, last = np.exp(log_w), np.exp(log_w * count)
    zeroth = (1 - last) / gap
    first = (w * zeroth - count * last) / gap
    second = (w * (zeroth + 2 * first) - float(count) ** 2 * last) / gap
    return zeroth, first, second


def information(modes: Modes, sr: int, count: int) -> Array:
    """JᵀJ (4k, 4k) for (ω, d, Re A, Im A), blocks of k; ω and d in 1/s."""
    z, a, k = modes.pole / sr, modes.amplitude, len(modes.pole)
    even = geometric(z[:, None] + z[None, :].conj(), count)
    odd = geometric(z[:, None] + z[None, :], count)
    columns = ((1j * a / sr, 1), (-a / sr, 1), (np.ones(k, complex), 0), (np.full(k, 1j), 0))
    matrix = np.empty((4 * k, 4 * k))
    for i, (c, q) in enumerate(columns):
        for j, (e, r) in enumerate(columns):
            both = c[:, None] * e[None, :].conj() * even[q + r] + c[:, None] * e[None, :] * odd[q + r]
            matrix[i * k : i * k + k, j * k : j * k + k] = both.real / 2
    return matrix


def residual(signal: Array, modes: Modes, sr: int) -> Array:
    """What the modes leave of a signal (n,)."""
    return np.asarray(_subtracted(signal, modes.pole / sr, modes.amplitude))


def amplitudes(signal: Array, pole: Array, sr: int) -> Modes:
    """Least-squares amplitudes of given poles, refined until the residual no longer sees them."""
    modes = Modes(pole, np.zeros(len(pole), complex))
    k = len(pole)
    if not k:
        return modes
    matrix = information(modes, sr, len(signal))[2 * k :, 2 * k :]
    scale = 1 / np.sqrt(np.diag(matrix))
    matrix = matrix * scale[:, None] * scale + 1e-13 * np.eye(2 * k)
    for _ in range(3):
        first, _ = _moments(residual(signal, modes, sr), pole / sr)
        step = scale * np.linalg.solve(matrix, scale * np.concatenate([first.real, -first.imag]))
        modes = Modes(pole, modes.amplitude + step[:k] + 1j * step[k:])
    return modes


def fitted(signal: Array, start: Modes, sr: int, *, band: tuple[float, float], fastest_per_s: float, steps: int = STEPS_MOST, tolerance: float = 1e-4) -> Modes:
    """Modes at the least sum of squares near ``start``; band in rad/s. tolerance: relative fall of the sum of squares that ends it."""
    modes, k = start, len(start.pole)
    if not k:
        return modes
    left = residual(signal, modes, sr)
    cost, lift = float(left @ left), 1e-6
    for _ in range(steps):
        matrix = information(modes, sr, len(signal))
        scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        matrix = matrix * scale[:, None] * scale
        first, second = _moments(left, modes.pole / sr)
        gradient = np.concatenate([(1j * modes.amplitude * second).real / sr, (-modes.amplitude * second).real / sr, first.real, -first.imag])
        before = cost
        while lift < 1e6:
            step = scale * np.linalg.solve(matrix + (lift + 1e-14) * np.eye(4 * k), scale * gradient)
            reach = 0.5 * -modes.pole.real + 2.0
            turn, fade = np.clip(step[:k], -reach, reach), np.clip(step[k : 2 * k], -reach, reach)
            pole = np.clip(modes.pole.real - fade, -fastest_per_s, -1e-3) + 1j * np.clip(modes.pole.imag + turn, *band)
            whole = np.array_equal(fade, step[k : 2 * k]) and np.array_equal(turn, step[:k])
            moved = Modes(pole, modes.amplitude + step[2 * k : 3 * k] + 1j * step[3 * k :])
            trial = moved if whole else amplitudes(signal, pole, sr)
            rest = residual(signal, trial, sr)
            found = float(rest @ rest)
            if found < cost:
                modes, left, cost, lift = trial, rest, found, max(lift / 10, 1e-14)
                break
            lift = 10 * lift
        if lift >= 1e6 or before - cost < tolerance * cost:
            break
    return modes


def spreads(modes: Modes, sr: int, count: int) -> Array:
    """Standard errors (4, k) of ω, d, Re A, Im A in white noise of unit rms."""
    matrix = information(modes, sr, count)
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale, hermitian=True)
    return np.asarray((np.sqrt(np.maximum(np.diag(inverse), 0)) * scale).reshape(4, -1))
