"""What estimators of lines by subspaces share: the low-pass before a band, and poles of a basis.

basis U of a sum of damped sinusoids: pole = eigenvalue of the shift between its rows
[Roy & Kailath 1989, eq. 3.12-3.17; Hua & Sarkar 1990]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def low_pass(passed: float, stopped: float, stop_db: float) -> Array:
    """Taps (l,), l odd, of a linear-phase low-pass with gain 1 at 0 Hz.

    passed, stopped: edges of what goes through and of what is ``stop_db`` (> 50) lower, over the rate.
    """
    half = int((stop_db - 7.95) / (2.285 * 2 * np.pi * (stopped - passed))) // 2
    taps = np.sinc((passed + stopped) * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, 0.1102 * (stop_db - 8.7))
    return np.asarray(taps / taps.sum())


def shift_poles(basis: Array) -> Array:
    """Return poles per step (k,) of an orthonormal basis (n, k) of a sum of exponentials: the shift between its rows.

    Of its rows but the last, V₁ᴴV₁ = I − v̄ vᵀ, by which the shift needs no least squares.
    """
    last, shift = basis[-1], basis[:-1].conj().T @ basis[1:]
    shift = shift + np.outer(last.conj(), last @ shift) / max(1 - float(np.vdot(last, last).real), 1e-12)
    value = np.linalg.eigvals(shift)
    return np.asarray(np.log(value[np.abs(value) > 1e-12].astype(complex)))
