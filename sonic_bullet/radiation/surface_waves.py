"""Potential on a vibrating surface at one frequency: the exterior Helmholtz problem, solved by boundary elements.

    Δφ + k²φ = 0 outside, ∂φ/∂n = -v on the surface, φ outgoing; near field p = iωρ₀φ, G = e^{-ikr}/4πr

    (½ - K - βD) φ = (S + β(½ + K')) v,   β = -i/max(k, 1/a)        [Burton & Miller 1971, eq. 3.5]
        S v = ∮ v G dS,  K φ = ∮ φ ∂G/∂n_y dS,  K', D: their derivatives along n_x;  a = √(S/4π)

β complex: no irregular frequencies, which thin bodies have at every sound wave that fits into them. Triangles of
constant φ and v, collocated at their centroids, as in `entrained_mass`. The kernels at k = 0, and what k adds to D in
½k² n·n'/r, are in closed form; the smooth rest is taken at centroids. Sound of modes below coincidence is what edges
and corners leave of waves that cancel. These couple all shapes of air motion, so a law of each shape by itself lacks
it.
f triangles, m modes.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from functools import lru_cache

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.radiation.entrained_mass import static_kernels
from sonic_bullet.records import Array

RESOLVED = 2 * np.pi / 3
"""k times a triangle's edge: three edges a wavelength. Spheres are within 0.7 dB there, plates within 1.5."""

ALIKE = 0.1
"""Of k times the body's radius: modes that differ by less share a solution; kernels turn by so much at most."""
DRAWN_ALIKE = 0.4
"""The same of resonators, whose shapes are drawn: they change by 1.2 dB (rms), neighbours differ by 3."""


class SurfaceWaves:
    """Exterior Helmholtz problem of one surface.

    Parameters
    ----------
    corner_m : (f, 3, 3)
        Triangles of a closed surface, outward.
    """

    def __init__(self, corner_m: Array) -> None:
        twice = np.cross(corner_m[:, 1] - corner_m[:, 0], corner_m[:, 2] - corner_m[:, 0])
        length = np.linalg.norm(twice, axis=1, keepdims=True)
        normal, middle = twice / length, corner_m.mean(axis=1)
        middle = middle - middle.mean(axis=0)
        self._place = np.concatenate([middle, normal, length / 2], axis=1).T.astype(np.float32, order="C")
        self._radius_m = float(np.linalg.norm(middle, axis=1).max())
        self._equal_radius_m = float(np.sqrt(length.sum() / (8 * np.pi)))
        self._static = _kept_kernels(np.ascontiguousarray(corner_m, dtype=float).tobytes())

    def potential(self, k: Array, speed: Array, alike: float = ALIKE) -> Array:
        """Compute φ (f, m), complex, of normal speeds (f, m) at wave numbers k (m,) in 1/m.

        Units: φ in m times those of the speeds. Source: the module's equations. alike: as `ALIKE`.
        """
        from scipy.linalg import lu_factor, lu_solve

        found = np.empty(speed.shape, complex)
        for mine in _alike(k * self._radius_m, alike):
            mean = float(k[mine].mean())
            b = -1 / max(mean, 1 / self._equal_radius_m)
            left, right = np.empty((2, *self._static.shape[1:]), np.complex64)
            parts = [one.view(np.float32).reshape(*one.shape, 2) for one in (left, right)]
            _engine.surface_wave_matrices(mean, b, self._place, self._static, *parts)
            given = (speed[:, mine].T.astype(np.complex64) @ right).T
            factor = lu_factor(left.T, overwrite_a=True, check_finite=False)
            found[:, mine] = lu_solve(factor, given, check_finite=False)
        return found


@lru_cache(maxsize=1)
def _kept_kernels(corner: bytes) -> Array:
    """Compute `static_kernels` of triangles, in single precision; once for several materials of a shape."""
    corner_m = np.frombuffer(corner).reshape(-1, 3, 3)
    twice = np.cross(corner_m[:, 1] - corner_m[:, 0], corner_m[:, 2] - corner_m[:, 0])
    made = static_kernels(corner_m, twice / np.linalg.norm(twice, axis=1, keepdims=True))
    return np.asarray(made, np.float32)


def _alike(turns: Array, alike: float) -> list[Array]:
    """Group modes (m,), by index, whose values lie within ``alike`` of the least of their group."""
    order = np.argsort(turns, kind="stable")
    groups: list[list[int]] = []
    for at in order:
        if groups and turns[at] - turns[groups[-1][0]] <= alike:
            groups[-1].append(int(at))
        else:
            groups.append([int(at)])
    return [np.array(one) for one in groups]
