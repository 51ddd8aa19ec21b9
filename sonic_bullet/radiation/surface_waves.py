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

from sonic_bullet.machine.compiled import njit
from sonic_bullet.radiation.entrained_mass import static_kernels
from sonic_bullet.records import Array

RESOLVED = 2 * np.pi / 3
"""k times a triangle's edge: three edges a wavelength. Spheres are within 0.7 dB there, plates within 1.5."""
SERIES_NUMBERS = np.array(
    [1, 2, 0.5, 0.5 / np.pi, np.pi, 1e-30, 0.25 / np.pi]
    + [1 / sign for sign in (-6, 120, -5040, 362880, -39916800, 24, -720, 40320, -3628800, 479001600)],
    np.float32,
)


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
        self._place = np.concatenate([middle, normal, length / 2], axis=1).astype(np.float32)
        self._radius_m = float(np.linalg.norm(middle, axis=1).max())
        self._equal_radius_m = float(np.sqrt(length.sum() / (8 * np.pi)))
        self._static = _kept_kernels(np.ascontiguousarray(corner_m, dtype=float).tobytes())

    def potential(self, k: Array, speed: Array) -> Array:
        """Compute φ (f, m), complex, of normal speeds (f, m) at wave numbers k (m,) in 1/m.

        Units: φ in m times those of the speeds. Source: the module's equations.
        """
        from scipy.linalg import lu_factor, lu_solve

        found = np.empty(speed.shape, complex)
        for mine in _alike(k * self._radius_m):
            mean = float(k[mine].mean())
            b = -1 / max(mean, 1 / self._equal_radius_m)
            both = _at(np.float32(mean), np.float32(b), self._place, self._static, SERIES_NUMBERS)
            left, right = (one.view(np.complex64)[:, :, 0] for one in both)
            given = (speed[:, mine].T.astype(np.complex64) @ right).T
            factor = lu_factor(left.T, overwrite_a=True, check_finite=False)
            found[:, mine] = lu_solve(factor, given, check_finite=False)
        return found


@lru_cache(maxsize=1)
def _kept_kernels(corner: bytes) -> Array:
    """Compute `static_kernels` of triangles, in single precision; once for several materials of a shape."""
    corner_m = np.frombuffer(corner).reshape(-1, 3, 3).copy()  # read-only, it would have machine code of its own
    twice = np.cross(corner_m[:, 1] - corner_m[:, 0], corner_m[:, 2] - corner_m[:, 0])
    made = static_kernels(corner_m, twice / np.linalg.norm(twice, axis=1, keepdims=True))
    return np.asarray(made, np.float32)


def _alike(turns: Array) -> list[Array]:
    """Group modes (m,), by index, whose values lie within `alike` of the least of their group."""
    alike = 0.1  # of k times the body's radius: modes that differ by less share a solution; kernels turn by 0.1 at most
    order = np.argsort(turns, kind="stable")
    groups: list[list[int]] = []
    for at in order:
        if groups and turns[at] - turns[groups[-1][0]] <= alike:
            groups[-1].append(int(at))
        else:
            groups.append([int(at)])
    return [np.array(one) for one in groups]


@njit(nogil=True, fastmath=True)
def _at(k, b, place, static, numbers):
    """½ - K - βD and S + β(½ + K') at k, each (f, f, 2), [j, i]: real and imaginary parts; β = ib.

    place (f, 7): centroids, normals, areas. All in single precision, `SERIES_NUMBERS` too, and few arrays: it runs in
    vectors.
    """
    count = len(place)
    left, right = np.empty((count, count, 2), np.float32), np.empty((count, count, 2), np.float32)
    one, two, half, turn, pi, tiny, even, c3, c5, c7, c9, c11, c4, c6, c8, c10, c12 = numbers
    for j in range(count):
        y0, y1, y2, m0, m1, m2, w = place[j]
        known, row, given = static[j], left[j], right[j]
        for i in range(count):
            r0, r1, r2 = place[i, 0] - y0, place[i, 1] - y1, place[i, 2] - y2
            n0, n1, n2 = place[i, 3], place[i, 4], place[i, 5]
            square = r0 * r0 + r1 * r1 + r2 * r2 + tiny
            over = one / np.sqrt(square)
            kr = k * square * over
            rx, ry = (r0 * n0 + r1 * n1 + r2 * n2) * over, -(r0 * m0 + r1 * m1 + r2 * m2) * over
            both = n0 * m0 + n1 * m1 + n2 * m2
            turns = kr * turn
            t = pi * (turns - np.float32(np.int32(turns + half)))
            u = t * t
            # sine and cosine of half the angle, |t| ≤ π/2: Taylor to 1e-7, without calls
            sn = t * (one + u * (c3 + u * (c5 + u * (c7 + u * (c9 + u * c11)))))
            cs = one + u * (u * (c4 + u * (c6 + u * (c8 + u * (c10 + u * c12)))) - half)
            sine, cosine = two * sn * cs, one - two * sn * sn
            f_re, f_im = (one - cosine - kr * sine) * over * over, (sine - kr * cosine) * over * over
            g_re = (cosine * (two - kr * kr) + two * kr * sine - two) * over * over * over
            g_im = (two * kr * cosine - sine * (two - kr * kr)) * over * over * over
            d_re = known[i, 3] + half * k * k * known[i, 0] * both
            d_re += w * ((g_re - f_re * over) * rx * ry - (f_re + half * k * k) * over * both)
            d_im = w * ((g_im - f_im * over) * rx * ry - f_im * over * both)
            row[i, 0] = even * (b * d_im - known[i, 1] - w * f_re * ry)
            row[i, 1] = -even * (w * f_im * ry + b * d_re)
            given[i, 0] = even * (known[i, 0] + w * (cosine - one) * over - b * w * f_im * rx)
            given[i, 1] = even * (b * (known[i, 2] + w * f_re * rx) - w * sine * over)
        row[j, 0] = 0.5 - b * k**3 / 3 * w * even
        row[j, 1] = -b * (known[j, 3] + 0.5 * k * k * known[j, 0]) * even
        given[j, 0] = known[j, 0] * even
        given[j, 1] = -k * w * even + b * (0.5 + known[j, 2] * even)
    return left, right
