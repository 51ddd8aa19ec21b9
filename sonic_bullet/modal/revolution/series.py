"""Modes of a free isotropic body of revolution: a Fourier series around its axis.

    u_r = U cos mθ,  u_z = W cos mθ,  u_θ = V sin mθ
        [Zienkiewicz & Taylor, The Finite Element Method (2000), vol. 2, ch. 9.4-9.5]
    ε_rr = U,r   ε_zz = W,z   ε_θθ = (U + mV)/r   γ_zθ = V,z − mW/r   γ_rθ = V,r − (V + mU)/r   γ_rz = U,z + W,r
    on the axis: U = V = 0 (m = 0);  V = −U, W = 0 (m = 1);  U = V = W = 0 (m > 1): the displacement has one value there
    B = B₀ + m B₁,  K(m) = K₀ + m K₁ + m² K₂

Each m is a small plane problem, each mode of m > 0 has a degenerate partner turned by π/2m, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.modal.revolution.section import Section
from sonic_bullet.modal.sparse.ordering import dissection
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Problems of all m on one section: sparse matrices of U, V, W of each node (3n) in elimination order.

    Attributes
    ----------
    power : for each tensor K₀, K₁, K₂
    axis : (a,) nodes on the axis, by their place in the order
    place : (n,) place of each of the basis' nodes in the order
    """

    power: tuple[tuple[Any, Any, Any], ...]
    mass: Any
    axis: Array
    place: Array

    def problem(self, m: int) -> tuple[tuple[Any, ...], Any]:
        """Build K of each tensor and M for wave number m, without the unknowns that the axis removes."""
        free = self.free(m)
        stiff = tuple((free.T @ (k0 + m * k1 + m * m * k2) @ free).tocsr() for k0, k1, k2 in self.power)
        return stiff, (free.T @ self.mass @ free).tocsr()

    def whole(self, m: int, vector: Array) -> Array:
        """Expand vectors (f, b) to displacements (n, 3, b) U, V, W at the basis' nodes."""
        return np.asarray((self.free(m) @ vector).reshape(len(self.place), 3, -1)[self.place])

    def free(self, m: int) -> Any:
        """Build the map (3n, f) of all unknowns from the free ones."""
        from scipy.sparse import csr_array, eye_array

        n = 3 * len(self.place)
        whole = eye_array(n, format="csr")
        u, v, w = (3 * self.axis + k for k in range(3))
        gone = {0: [u, v], 1: [v, w]}.get(m, [u, v, w])
        if m == 1:
            whole = whole - csr_array((np.ones(len(u)), (v, u)), shape=(n, n))
        return whole.tocsc()[:, np.setdiff1d(np.arange(n), np.concatenate(gone))]


def series(section: Section, tensors: list[Array]) -> Series:
    """Assemble the problems on a section for isotropic tensors (6, 6) in order rr zz θθ zθ rθ rz, at density one."""
    basis = section.basis
    order = dissection(basis.doflocs.T, basis.element_dofs.T)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    power, mass = assemble_series(basis, np.ones(len(basis.dx)), tensors, place)
    return Series(power, mass, place[np.unique(section.dof[section.on_axis])], place)


def assemble_series(basis: Any, factor: Array, tensors: list[Array], place: Array) -> tuple[tuple[Any, ...], Any]:
    """Assemble K₀, K₁, K₂ of each tensor and M on a basis, each of its parts (t,) times a factor of any sign."""
    from scipy.sparse import csr_array

    r = np.asarray(basis.global_coordinates())[0]  # (t, q)
    t, q = r.shape
    value = np.stack([np.broadcast_to(basis.basis[i][0], (t, q)) for i in range(10)], axis=-1)  # (t, q, 10)
    slope = np.stack([basis.basis[i][0].grad for i in range(10)], axis=-1)  # (2, t, q, 10)
    weight = np.sqrt(basis.dx * r)[..., None]
    over = value / r[..., None]
    strain = np.zeros((2, t, q, 6, 10, 3))  # of m to the power 0 and 1; unknowns U, V, W
    strain[0, :, :, 0, :, 0] = strain[0, :, :, 5, :, 2] = strain[0, :, :, 4, :, 1] = slope[0]
    strain[0, :, :, 1, :, 2] = strain[0, :, :, 5, :, 0] = strain[0, :, :, 3, :, 1] = slope[1]
    strain[0, :, :, 2, :, 0] = strain[1, :, :, 2, :, 1] = over
    strain[0, :, :, 4, :, 1] -= over
    strain[1, :, :, 4, :, 0] = strain[1, :, :, 3, :, 2] = -over
    strain *= weight[..., None, None]
    plain, turned = strain.reshape(2, t, q * 6, 30)
    column = (3 * place[basis.element_dofs.T][:, :, None] + np.arange(3)).reshape(t, 30)
    where = np.repeat(column, 30, axis=1).ravel(), np.tile(column, (1, 30)).ravel()
    n = 3 * len(place)

    def sparse_of(blocks: Array) -> Any:
        return csr_array(((blocks * factor[:, None, None]).ravel(), where), shape=(n, n))

    power = []
    for tensor in tensors:
        one, two = (np.matmul(tensor, s.reshape(t, q, 6, 30)).reshape(t, q * 6, 30) for s in (plain, turned))
        first, third = plain.transpose(0, 2, 1) @ one, turned.transpose(0, 2, 1) @ two
        mixed = plain.transpose(0, 2, 1) @ two
        power.append((sparse_of(first), sparse_of(mixed + mixed.transpose(0, 2, 1)), sparse_of(third)))
    heavy = value * weight
    block = np.einsum("tqi,tqj->tij", heavy, heavy)
    mass = sparse_of(np.einsum("tij,ab->tiajb", block, np.eye(3)).reshape(t, 30, 30))
    return tuple(power), mass
