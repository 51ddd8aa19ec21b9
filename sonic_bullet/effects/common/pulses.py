"""Force pulses of finite length: the fraction of an impulse that a mode takes.

    F̂(f)/F̂(0) = ∫ s(t/τ) e^{−2πift} dt / ∫ s dt,   s(x) on 0 ≤ x ≤ 1:
        half-sine sin πx · hertz sin^{3/2} πx · raised-cosine 1 − cos 2πx

Half-sine in closed form: |cos(πfτ)/(1 − 4f²τ²)|; raised cosine: |sinc(fτ)/(1 − f²τ²)|; the Hertz pulse by quadrature.
The phase is the delay of the pulse's centre, −πfτ. [Hunter 1957; physics of the half-sine: Graff, Wave Motion in
Elastic Solids 1975, ch. 2]
"""

from __future__ import annotations

from functools import cache

import numpy as np

from sonic_bullet.records import Array


def magnitude(pulse: str, x: Array) -> Array:
    """Compute F̂(f)/F̂(0) about the pulse's centre (real, as pulses are symmetric).

    Parameters
    ----------
    pulse : str
        One of "half-sine", "hertz", "raised-cosine", or "impulse".
    x : array
        fτ.
    """
    x = np.asarray(x, float)
    if pulse == "half-sine":
        near = np.abs(2 * np.abs(x) - 1) < 1e-6
        return np.where(near, np.pi / 4, np.cos(np.pi * x) / np.where(near, 1, 1 - 4 * x**2))
    if pulse == "raised-cosine":
        near = np.abs(np.abs(x) - 1) < 1e-6
        return np.where(near, 0.5, np.sinc(x) / np.where(near, 1, 1 - x**2))
    if pulse == "hertz":
        at, weight = _rule()
        return np.asarray(np.cos(2 * np.pi * np.multiply.outer(x, at)) @ weight)
    return np.ones_like(x)


@cache
def _rule() -> tuple[Array, Array]:
    """Return Gauss-Legendre points about the centre, and weights sin^{3/2} there, summing to one."""
    at, weight = np.polynomial.legendre.leggauss(96)
    weight = weight * np.cos(np.pi * at / 2) ** 1.5
    return at / 2, weight / weight.sum()


def spectrum(pulse: str, tau_s: float, freq_hz: Array) -> Array:
    """Compute F̂(f)/F̂(0) (f,) complex of a pulse that begins at 0.

    Parameters
    ----------
    pulse : str
        One of "half-sine", "hertz", "raised-cosine", or "impulse".
    tau_s : float
        Its duration.
    freq_hz : (f,)
        Frequencies.
    """
    f = np.asarray(freq_hz, float)
    if pulse == "impulse" or tau_s <= 0:
        return np.ones(f.shape, complex)
    return np.asarray(magnitude(pulse, f * tau_s) * np.exp(-1j * np.pi * f * tau_s))
