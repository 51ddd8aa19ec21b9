"""Force pulse of a strike: its shape and its spectrum.

    δ'' = -δ^(3/2),  F ∝ δ^(3/2)               the Hertz pulse's own shape; flat: F ∝ sin(πt/τ)
    Q(s) = ∫F over the fraction s of the pulse in [0, 1]

Its length, and how compliant bodies reduce its impulse: src/contact/pulse_shape.hpp.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sonic_bullet import _engine
from sonic_bullet._engine import PULSE_CELLS, SPECTRUM_CELLS_PER_F_TAU, fill_pulse_table
from sonic_bullet.records import Array
from sonic_bullet.signal import elementary


def pulse_spectrum(f_tau: Array, *, flat: bool = False) -> Array:
    """Compute |F̂(f)/F̂(0)| at the products f·τ, by fine quadrature (flat: |cos(πfτ)/(1-4f²τ²)|)."""
    s = (np.arange(4096) + 0.5) / 4096
    force = _force(s, flat)
    turn = 2 * np.pi * np.multiply.outer(np.asarray(f_tau, float), s)
    real, imaginary = (of(turn) * force for of in (elementary.cos, elementary.sin))
    return np.asarray(np.sqrt(real.sum(axis=-1) ** 2 + imaginary.sum(axis=-1) ** 2) / force.sum())


@lru_cache(maxsize=1)
def spectrum_table() -> Array:
    """Tabulate |F̂(f)/F̂(0)| (2, 321) of the Hertz and the flat pulse, at equidistant products f·τ from 0 to 8."""
    spectrum_to, stride = 8, 16
    count = spectrum_to * SPECTRUM_CELLS_PER_F_TAU + 1
    # e^{-2πi (16 a + b) Δ s} = e^{-2πi 16 a Δ s} e^{-2πi b Δ s}: 37 rows of exponentials, not 321
    s = (np.arange(4096) + 0.5) / 4096
    turn = -2 * np.pi / SPECTRUM_CELLS_PER_F_TAU * s
    coarse, fine = (
        elementary.complex_exp(1j * np.multiply.outer(k, turn))
        for k in (np.arange(0, count, stride), np.arange(stride))
    )
    force = np.stack([_force(s, flat) for flat in (False, True)])
    pushed = elementary.complex_product(force[:, None], coarse).reshape(-1, len(s))
    size = elementary.complex_size(elementary.matrix_product(pushed, fine.T))  # (2 · coarse, fine)
    return np.ascontiguousarray(size.reshape(2, -1)[:, :count] / force.sum(axis=1)[:, None])


def _force(s: Array, flat: bool) -> Array:
    """Compute the force at the fractions s, mean 1."""
    if flat:
        return np.asarray(np.pi / 2 * elementary.sin(np.pi * np.clip(s, 0, 1)))
    table = pulse_table()
    return np.asarray(np.interp(s, np.linspace(0, 1, PULSE_CELLS + 1), table[1], left=0, right=0))


@lru_cache(maxsize=1)
def pulse_table() -> Array:
    """Return Q and F (2, PULSE_CELLS + 1) of the Hertz pulse at equidistant fractions."""
    table = np.empty((2, PULSE_CELLS + 1))
    fill_pulse_table(table)
    table.setflags(write=False)
    return table


def interpolate_impulse(s: Array, *, flat: bool = False) -> Array:
    """Interpolate Q at the fractions s (n,) of the pulse: 0 before it, 1 after. flat: half-sine."""
    s = np.ascontiguousarray(s, float)
    q = np.empty(s.shape)
    _engine.cumulated(s, flat, q)
    return q
