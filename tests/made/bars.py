"""A bar that bends, by Hermite elements, as matrices and as modes: what a body in place is proven against.

K, M of Euler and Bernoulli's beam               [Przemieniecki 1968, Theory of Matrix Structural Analysis, eq. 11.6]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig, eigh

from sonic_bullet.engine.contact.coupling import BodyMobility, BodyPoint, ContactPoint, ContactSpring
from sonic_bullet.records import Array

AXES = np.eye(3)[[2, 0, 1]]
"""Normal z, along which the bar bends; x along it."""


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """stiffness, mass (2n, 2n) of w and w' at n nodes x_m (n,); lam, shape (2n, 2n) of all modes, two rigid first."""

    x_m: Array
    stiffness: Array
    mass: Array
    lam: Array
    shape: Array

    def row(self, node: int) -> Array:
        """B (2n,): what picks w of a node."""
        return np.asarray(np.eye(len(self.lam))[2 * node])

    def place(self, node: int, modes: int | None = None) -> BodyPoint:
        shape = np.zeros((3, len(self.lam[2:][:modes])))
        shape[2] = self.shape[2 * node, 2:][:modes]
        return BodyPoint(shape, np.array([self.x_m[node], 0.0, 0.0]), AXES)

    def mobility(self, loss: float = 1e-3, modes: int | None = None) -> BodyMobility:
        """The bar free in the air, d = ηω₀/2 of each mode; modes: how many, all of them by default."""
        root = np.sqrt(self.lam[2:][:modes])
        ones = np.ones(len(self.x_m) * 2)
        ones[1::2] = 0
        mass = float(ones @ self.mass @ ones)
        turn = np.empty(2 * len(self.x_m))
        turn[::2], turn[1::2] = self.x_m, 1
        about_y = float(turn @ self.mass @ turn)
        decay = loss * root / 2
        return BodyMobility(np.sqrt(root**2 - decay**2), decay, mass, np.diag([1.0, about_y, 1.0]))

    def damping(self, loss: float = 1e-3) -> Array:
        """The matrix (2n, 2n) with which each mode has d = ηω₀/2."""
        root = np.sqrt(np.append([0.0, 0.0], self.lam[2:]))
        moved = self.mass @ self.shape
        return np.asarray(moved @ np.diag(loss * root) @ moved.T)


def bar(
    elements: int = 8, length_m: float = 0.3, width_m: float = 0.03, height_m: float = 0.006, youngs_pa: float = 2e11,
    density_kg_m3: float = 7860.0,
) -> Bar:  # fmt: skip
    """A steel bar, free."""
    h = length_m / elements
    bending, line = youngs_pa * width_m * height_m**3 / 12, density_kg_m3 * width_m * height_m
    k = bending / h**3 * np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4.0]])
    m = line * h / 420 * np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4.0]])
    size = np.tile([1, h], 2)
    stiffness, mass = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        stiffness[at, at] += k * np.outer(size, size)
        mass[at, at] += m * np.outer(size, size)
    lam, shape = eigh(stiffness, mass)
    return Bar(np.linspace(-length_m / 2, length_m / 2, elements + 1), stiffness, mass, lam, shape)


def stood(bar: Bar, nodes: tuple[int, ...], spring_n_m: complex, modes: int | None = None) -> list[ContactPoint]:
    """Touches of a bar at these nodes with a partner without motions of its own; they slide."""
    nowhere = BodyPoint(np.zeros((3, 0)), np.zeros(3), AXES)
    return [ContactPoint(0, bar.place(node, modes), nowhere, ContactSpring(spring_n_m, 0.0)) for node in nodes]


def exact_poles(bar: Bar, node: int, spring_n_m: complex, plate_m_n_s: float) -> Array:
    """Poles of Mẅ + Cẇ + Kw + Bᵀf = 0, f = k(Bw − p), ṗ = y₀f, in the bar's own coordinates."""
    n, b = len(bar.lam), bar.row(node)
    scale = 1e4  # 1/s
    a, mass = np.zeros((2, 2 * n + 1, 2 * n + 1), complex)
    mass[:n, :n], mass[n : 2 * n, n : 2 * n], mass[-1, -1] = np.eye(n), bar.mass, 1
    a[:n, n : 2 * n] = scale * np.eye(n)
    a[n : 2 * n, :n] = -(bar.stiffness + spring_n_m * np.outer(b, b)) / scale
    a[n : 2 * n, n : 2 * n] = -bar.damping()
    a[n : 2 * n, -1] = spring_n_m * b / scale
    a[-1, :n], a[-1, -1] = plate_m_n_s * spring_n_m * b, -plate_m_n_s * spring_n_m
    s = eig(a, mass, right=False)
    return np.asarray(s[(s.imag > 1.0) & np.isfinite(s)])
