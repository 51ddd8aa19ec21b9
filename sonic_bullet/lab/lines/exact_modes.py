"""Modes of a recording without noise, or with no more than float32 rounds off: its Hankel matrix has a rank.

    H (L, M), H_ij = x(i + j) = Σ_k c_k z_k^{i+j}  =>  rank H = 2 × modes, whatever lies close to what
        [Kronecker 1881]
    the singular values fall to the floor of rounding after that many: the last fall by `FALL` and more, below `EDGE` of
        the first
    z = eigenvalues of the shift between rows of the left vectors
        [Kung 1978; Roy & Kailath 1989]
    then Gauss and Newton by QR of the Jacobian itself, never of its normal equations: the condition is not squared

Only the first thousands of samples are looked at: without noise a tenth of a second says more than the rounding of 2πft
does later (at 20 kHz and one second that is 1e-11 of the sound). What the modes leave of the whole recording decides
whether they are its modes.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.lines import sinusoids
from sonic_bullet.lab.lines.sinusoids import Sinusoids
from sonic_bullet.records import Array

POLISHED_SAMPLES = 3000
POLISHED_SAMPLES_ROUNDED = 10_000  # where samples were rounded: more of them average it
POLISH_STEPS = 5


def modes(signal: Array, sr: int) -> Sinusoids | None:
    """All modes of a signal (n,) that starts with or after its onset; None where it has noise or is not modal."""
    sizes = ((64, 256), (500, 1000), (700, 2000))  # rows, columns
    left_most = 5e-7  # rms of what may be left of the whole, of the recording's
    rounded = 1e-10  # left more than this: noise, though little, and more samples average it
    rms = float(np.sqrt((signal**2).mean()))
    for rows, columns in sizes:
        if rows + columns - 1 > len(signal):
            break
        pole = _poles(signal[: rows + columns - 1], rows)
        if pole is None or not len(pole) or (pole.real * POLISHED_SAMPLES_ROUNDED > 1).any():
            continue
        sound = signal[:POLISHED_SAMPLES]
        found = _polish_modes(sound, _amplitudes(sound, pole * sr, sr), sr)
        if rounded * rms < _residual_rms(signal, found, sr) < 100 * left_most * rms:
            found = _polish_modes(signal[:POLISHED_SAMPLES_ROUNDED], found, sr)
        if _residual_rms(signal, found, sr) < left_most * rms:
            return found
    return None


def _residual_rms(signal: Array, found: Sinusoids, sr: int) -> float:
    """Rms that the modes leave; infinite where one grows or is none."""
    if (found.pole.real >= 0).any() or (found.pole.imag <= 0).any():
        return float("inf")
    return float(np.sqrt((sinusoids.residual(signal, found, sr) ** 2).mean()))


def _poles(signal: Array, rows: int) -> Array | None:
    """Poles per sample (k,) of the upper half plane, or None where the singular values do not fall to rounding."""
    hankel = np.lib.stride_tricks.sliding_window_view(signal, len(signal) - rows + 1)
    power = np.linalg.eigvalsh(hankel @ hankel.T)
    edge, least_fall = 1e-7, 5.0
    if power[0] > edge**2 * power[-1]:  # quickly: noise fills it
        return None
    size = np.linalg.svd(hankel, compute_uv=False)
    fall = (size[:-1] > least_fall * size[1:]) & (size[1:] < edge * size[0]) & (size[:-1] > 1e-15 * size[0])
    if not fall.any():
        return None
    order = int(np.flatnonzero(fall)[-1]) + 1
    if order > rows - 4:
        return None
    left = np.linalg.svd(hankel, full_matrices=False)[0]
    value = np.linalg.eigvals(np.linalg.lstsq(left[:-1, :order], left[1:, :order], rcond=None)[0])
    pole = np.log(value[np.abs(value) > 1e-6].astype(complex))
    return np.asarray(pole[(pole.imag > 0) & (pole.imag < np.pi * (1 - 1e-9))])


def _jacobian(pole: Array, amplitude: Array, sr: int, count: int) -> Array:
    """Columns (n, 4k) for (ω, d, Re A, Im A) of Re A e^{pn/sr}."""
    n = np.arange(count)[:, None]
    sound = np.exp(pole / sr * n)
    sloped = amplitude * sound * n / sr
    return np.concatenate([-sloped.imag, -sloped.real, sound.real, -sound.imag], axis=1)


def _amplitudes(signal: Array, pole: Array, sr: int) -> Sinusoids:
    k = len(pole)
    columns = _jacobian(pole, np.zeros(k), sr, len(signal))[:, 2 * k :]
    answer = _solve_columns(columns, signal)
    return Sinusoids(pole, answer[:k] + 1j * answer[k:])


def _solve_columns(columns: Array, wanted: Array) -> Array:
    scale = 1 / np.sqrt((columns**2).sum(axis=0))
    q, r = np.linalg.qr(columns * scale)
    return np.asarray(np.linalg.lstsq(r, q.T @ wanted, rcond=1e-15)[0] * scale)


def _polish_modes(signal: Array, start: Sinusoids, sr: int) -> Sinusoids:
    """Down to rounding: a step that does not lower the residual is the last."""
    k = len(start.pole)
    left = sinusoids.residual(signal, start, sr)
    for _ in range(POLISH_STEPS):
        step = _solve_columns(_jacobian(start.pole, start.amplitude, sr, len(signal)), left)
        if (np.abs(step[: 2 * k]).reshape(2, k) > 1e3 + np.abs(start.pole)).any():
            break
        moved = Sinusoids(
            start.pole - step[k : 2 * k] + 1j * step[:k], start.amplitude + step[2 * k : 3 * k] + 1j * step[3 * k :]
        )
        rest = sinusoids.residual(signal, moved, sr)
        if not float(rest @ rest) < float(left @ left):
            break
        start, left = moved, rest
    return start
