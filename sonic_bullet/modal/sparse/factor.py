"""Cholesky factor of a sparse matrix in dense blocks, for solutions of many right sides.

    A = L Lᵀ,  x = L⁻ᵀ L⁻¹ b

Neighbouring columns of L that are alike below the diagonal are a supernode. Each gathers its columns of A and the rest
of its children in the elimination tree, and leaves its own rest to its parent   [Duff & Reid 1983; Liu 1992, ch. 2-4]

    [A₁₁ ·  ]    L₁₁ = chol(A₁₁),  L₂₁ = A₂₁ L₁₁⁻ᵀ,  left: A₂₂ − L₂₁ L₂₁ᵀ
    [A₂₁ A₂₂]

SuperLU, which scipy has, stores and processes L and U entry by entry: four times the processor, twice the memory.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from sonic_bullet._engine import add_triangle, pack_triangle
from sonic_bullet.records import Array
from sonic_bullet.records.errors import ModalError


class Supernode(NamedTuple):
    """Columns of L from ``start`` on: root (w, w) is L₁₁, below (r, w) is L₂₁, whose rows are ``row`` (r,)."""

    start: int
    row: Array
    root: Array
    below: Array


class Factor(NamedTuple):
    """Supernodes, children before parents."""

    supernodes: list[Supernode]

    def solve(self, right: Array) -> Array:
        """Solve A x = right for x (n, b)."""
        from scipy.linalg.blas import dtrsm

        x = np.array(right, order="C")
        for start, row, root, below in self.supernodes:
            here = slice(start, start + len(root))
            # in place, both transposed: B = X, Bᵀ L⁻ᵀ
            x[here] = top = dtrsm(1.0, root, x[here].T, side=1, lower=1, trans_a=1).T
            x[row] -= below @ top
        for start, row, root, below in reversed(self.supernodes):
            here = slice(start, start + len(root))
            x[here] = dtrsm(1.0, root, (x[here] - below.T @ x.take(row, axis=0)).T, side=1, lower=1).T
        return x


def factorise(matrix: Any) -> Factor:
    """Factor a symmetric positive definite matrix, scipy sparse (n, n), in the order it comes in (ordering.py).

    Raises ModalError where there is no factor.
    """
    from scipy.linalg import LinAlgError, cholesky
    from scipy.linalg.blas import dsyrk, dtrsm
    from scipy.sparse import tril

    lower = tril(matrix, format="csc")
    del matrix  # frees the caller's temporary sum, as large as K
    lower.sort_indices()
    left: dict[int, list[tuple[Array, Array]]] = {}  # parent -> rows of its children, and their rest, packed
    made = []
    try:
        pattern = lower.indptr.astype(np.int64).tobytes(), lower.indices.astype(np.int64).tobytes()
        for number, (start, end, row, parent) in enumerate(_supernodes(*pattern)):
            width, index = end - start, np.concatenate([np.arange(start, end), row])
            column, rest = np.zeros((len(index), width), order="F"), np.zeros((len(row), len(row)), order="F")
            entry = slice(lower.indptr[start], lower.indptr[end])
            each = np.repeat(np.arange(width), np.diff(lower.indptr[start : end + 1]))
            column[np.searchsorted(index, lower.indices[entry]), each] = lower.data[entry]
            children = left.pop(number, [])
            while children:  # each is freed once it is added
                child_row, child_rest = children.pop(0)
                add_triangle(child_rest, np.searchsorted(index, child_row), column.T, rest.T)
                del child_rest
            root = cholesky(column[:width], lower=True, check_finite=False)
            below = dtrsm(1.0, root, column[width:], side=1, lower=1, trans_a=1)
            if len(row):
                rest = dsyrk(-1.0, below, beta=1.0, c=rest, lower=1, overwrite_c=1)
                left.setdefault(parent, []).append((row, _pack_triangle(rest.T)))
            del column, rest
            made.append(Supernode(start, row, root, below))
    except (LinAlgError, MemoryError) as error:
        raise ModalError(
            f"stiffness of {lower.shape[0]} unknowns cannot be factorised ({error})", "give a simpler mesh"
        ) from error
    return Factor(made)


@lru_cache(maxsize=2)
def _supernodes(starts: bytes, rows: bytes) -> list[tuple[int, int, Array, int]]:
    """List each supernode's first and end column, its rows below them, and its parent's number, -1 for none.

    starts, rows: int64, of the triangle's columns (csc); by value, as waves around a body share one pattern.
    """
    start, row = np.frombuffer(starts, np.int64), np.frombuffer(rows, np.int64)
    size = len(start) - 1
    # unknowns of a node have the same neighbours: they are treated as one
    first = np.append(np.flatnonzero(~_mark_alike(start, row)), size)
    owner = np.repeat(np.arange(len(first) - 1), np.diff(first))
    children: dict[int, list[Array]] = {}
    found: list[tuple[int, int, Array]] = []
    begin, before = 0, np.zeros(0, int)  # the supernode that grows, and the rows below its last column
    for k in range(len(first) - 1):
        own = owner[row[start[first[k]] : start[first[k] + 1]]]
        below = np.unique(np.concatenate([own, *children.pop(k, [])]))
        below = below[below > k]
        if len(below):
            children.setdefault(int(below[0]), []).append(below)
        if k and not (len(before) == len(below) + 1 and before[0] == k):
            found.append((begin, k, before))
            begin = k
        before = below
    found.append((begin, len(first) - 1, before))
    number = np.repeat(np.arange(len(found)), [end - begin for begin, end, _ in found])
    width = np.diff(first)
    return [
        (int(first[begin]), int(first[end]), _concatenate_ranges(first[below], width[below]),
         int(number[below[0]]) if len(below) else -1)
        for begin, end, below in found
    ]  # fmt: skip


def _mark_alike(start: Array, row: Array) -> Array:
    """Mark columns (n,) whose rows are those of the column before, but for its first."""
    count = np.diff(start)
    alike = np.append(False, count[1:] == count[:-1] - 1)
    checked = np.flatnonzero(alike)
    length = count[checked]
    before = _concatenate_ranges(start[checked - 1] + 1, length)
    differ = row[_concatenate_ranges(start[checked], length)] != row[before]
    alike[np.repeat(checked, length)[differ]] = False
    return alike


def _concatenate_ranges(first: Array, length: Array) -> Array:
    """Return first, first + 1, … of so many numbers each, one range after the other."""
    return np.repeat(first - np.cumsum(length) + length, length) + np.arange(length.sum())


def _pack_triangle(rest: Array) -> Array:
    """Pack the rows of an upper triangle (c, c) one after the other: half the memory."""
    made = np.empty(len(rest) * (len(rest) + 1) // 2)
    pack_triangle(rest, made)
    return made
