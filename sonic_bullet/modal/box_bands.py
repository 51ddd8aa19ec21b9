"""Banded form of a box's stiffness: the same polynomials, combined so that their slopes are orthogonal.

    ψ_0 = P_0,  ψ_k = ∫ P_{k-1} = P_k/√(4k²-1) - P_{k-2}/√((2k-1)(2k-3)),  ψ_k' = P_{k-1};  P orthonormal on -1..1
        [Szabó & Babuška 1991, eq. 3.19, 6.2]
    c = T a,   A = Tᵀ (K - σ) T block tridiagonal,   (K - σ)⁻¹ = T A⁻¹ Tᵀ
    S_0 = A_00,  S_i = A_ii - A_i,i-1 S_{i-1}⁻¹ A_i-1,i        [block elimination; Golub & Van Loan 2013, sec. 4.5.1]

T spans what the P span: nothing is left out, λ and vectors are those of the dense K to rounding. ψ_k meets only ψ_{k±2}
in M and ψ_{k±1} in what couples two components, so that a level, two degrees of the longest axis, meets only its
neighbours. Factor and solution cost n b² and n b in place of n³/3 and n²; b = n/levels, n unknowns of a parity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sonic_bullet.records import Array


class Bands(NamedTuple):
    """Unknowns of one parity in the combined basis.

    Attributes
    ----------
    order : (n,) components one after the other -> by level
    start : (levels + 1,) first unknown of each level
    combine : T (n, n) scipy sparse, columns by level
    mass : TᵀT (n, n), by level
    factor : of each component and axis ψ and ψ' in P, (terms, degrees) each
    """

    order: Array
    start: Array
    combine: Any
    mass: Any
    factor: tuple[tuple[tuple[Array, Array], ...], ...]

    def stiffness(self, stiffness_pa: Array) -> Any:
        """Compute TᵀKT (n, n), scipy sparse, by level, of a tensor (6, 6) without coupling between parities."""
        from scipy.sparse import block_array

        voigt = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
        block: list[list[Any]] = [[None] * 3 for _ in range(3)]
        for i in range(3):
            for j in range(i + 1):
                # σ:ε has (∂_a u_i)(∂_b u_j) C_ia,jb; of mirrored tensors a = i, b = j and a = j, b = i are left
                pairs = {(i, j), (j, i)} if i != j else {(a, a) for a in range(3)}
                block[i][j] = sum(
                    float(stiffness_pa[voigt[i, a], voigt[j, b]]) * self._product(i, j, a, b) for a, b in sorted(pairs)
                )
                block[j][i] = block[i][j].T
        return block_array(block, format="csr")[self.order][:, self.order]

    def _product(self, i: int, j: int, a: int, b: int) -> Any:
        """Compute ∫ ∂_a ψ ∂_b ψ over the box (n_i, n_j) of the components i and j."""
        from scipy.sparse import csr_array, kron

        table = [
            csr_array(self.factor[i][axis][int(axis == a)].T @ self.factor[j][axis][int(axis == b)])
            for axis in range(3)
        ]
        return kron(kron(table[0], table[1]), table[2], format="csr")

    def levels(self, matrix: Any) -> list[tuple[Array, Array]]:
        """Return A_ii and A_i+1,i of each level of a matrix (n, n), scipy sparse."""
        ends = [*self.start, self.start[-1]]
        both = []
        for a, b, c in zip(ends, ends[1:], ends[2:], strict=False):
            column = matrix[a:c, a:b].toarray()
            both.append((column[: b - a], column[b - a :]))
        return both


def bands(degree: tuple[Array, Array, Array], terms: Sequence[int], size: Array) -> Bands:
    """Build the combined basis of a parity.

    Parameters
    ----------
    degree : of its three components (k, 3), the degrees of their polynomials: all products of those of each axis
    terms, size : of each axis how many polynomials, and the box's edge
    """
    from scipy.sparse import block_diag, csr_array, kron

    each = [[np.unique(part[:, axis]) for axis in range(3)] for part in degree]
    psi = [_integrals(count) for count in terms]
    slope = [np.eye(count, k=1) * (2 / edge) for count, edge in zip(terms, size, strict=True)]
    factor = tuple(tuple((psi[k][:, own[k]], slope[k][:, own[k]]) for k in range(3)) for own in each)
    parts, masses = [], []
    for own, part in zip(each, factor, strict=True):
        square = [csr_array(part[k][0][own[k]]) for k in range(3)]
        parts.append(kron(kron(square[0], square[1]), square[2], format="csr"))
        gram = [csr_array(part[k][0].T @ part[k][0]) for k in range(3)]
        masses.append(kron(kron(gram[0], gram[1]), gram[2], format="csr"))
    long = int(np.argmax(terms))
    level = np.concatenate([part[:, long] // 2 for part in degree])
    order = np.argsort(level, kind="stable")
    start = np.searchsorted(level[order], np.arange(int(level.max(initial=-1)) + 2))
    combine = block_diag(parts, format="csr")[:, order]
    return Bands(order, start, combine, block_diag(masses, format="csr")[order][:, order], factor)


def _integrals(count: int) -> Array:
    """Build the table (count, count) of ψ_k, a column each, in orthonormal P."""
    k = np.arange(count)
    made = np.diag(1 / np.sqrt(np.maximum(4.0 * k**2 - 1, 1)))
    made[k[2:] - 2, k[2:]] = -1 / np.sqrt((2.0 * k[2:] - 1) * (2 * k[2:] - 3))
    return made


class Inverse:
    """(K - σ)⁻¹ for σ below all λ.

    Parameters
    ----------
    own, matrix
        The basis, and Tᵀ (K - σ) T.
    """

    def __init__(self, own: Bands, matrix: Any) -> None:
        self._combine, self._across = own.combine, own.combine.T.tocsr()
        self._start = own.start
        self._level: list[tuple[Array, Array]] = []
        """S_i⁻¹, and A_i+1,i S_i⁻¹."""
        rest: Any = 0.0
        for own_block, coupling_block in own.levels(matrix):
            inverse = np.linalg.inv(own_block - rest)
            self._level.append((inverse, coupling_block @ inverse))
            rest = self._level[-1][1] @ coupling_block.T

    def __call__(self, right: Array) -> Array:
        """Compute x (n,) of (K - σ) x = right."""
        part = np.split(self._across @ right, self._start[1:-1])
        for i, (_, down) in enumerate(self._level[:-1]):
            part[i + 1] = part[i + 1] - down @ part[i]
        part[-1] = self._level[-1][0] @ part[-1]
        for i in range(len(part) - 2, -1, -1):
            inverse, down = self._level[i]
            part[i] = inverse @ part[i] - part[i + 1] @ down
        return np.asarray(self._combine @ np.concatenate(part))


def count_below(own: Bands, matrix: Any) -> int:
    """Count the λ below a limit σ: the negative eigenvalues of Tᵀ (K - σ) T, which are its S_i's.

    Sylvester's inertia [Parlett 1980, ch. 3.3], added up over blocks [Haynsworth 1968].
    """
    from scipy.linalg.lapack import dsytrf, dsytrs

    found, rest = 0, np.zeros((1, 1))
    for own_block, coupling_block in own.levels(matrix):
        factor, pivot, _ = dsytrf(own_block - rest, lower=1)
        # a pivot of two rows, whose numbers are below zero, has one negative eigenvalue
        found += int((np.diag(factor)[pivot > 0] < 0).sum()) + int((pivot < 0).sum()) // 2
        rest = coupling_block @ dsytrs(factor, pivot, coupling_block.T, lower=1)[0] if len(coupling_block) else rest
    return found
