"""Order in which unknowns are eliminated: nested dissection by geometry.

    cut the nodes in two by a plane, number both halves first and the separating nodes last, and so on in each half
        [George 1973; Davis 2006, ch. 7.6]

Against minimum degree it halves the time of the factor on chunky bodies and costs a few tenths of a second.
Deterministic.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def _neighbours(tet: Array, n: int) -> tuple[Array, Array]:
    """Build the graph of the nodes as CSR (start (n+1,), neighbour): nodes of one tetrahedron are neighbours."""
    from scipy.sparse import csr_array

    width = tet.shape[1]
    row, column = np.repeat(tet, width, axis=1).ravel(), np.tile(tet, (1, width)).ravel()
    graph = csr_array((np.ones(len(row), np.int32), (row, column)), shape=(n, n))
    graph.sum_duplicates()
    return graph.indptr.astype(np.int64), graph.indices


def _mark_neighbours(nodes: Array, mask: Array, start: Array, neighbour: Array) -> Array:
    """Return which of ``nodes`` (k,) have a neighbour in ``mask`` (n,) bool."""
    first, length = start[nodes], start[nodes + 1] - start[nodes]
    ends = np.cumsum(length)
    flat = np.repeat(first - ends + length, length) + np.arange(ends[-1])
    return np.asarray(np.add.reduceat(mask[neighbour[flat]].astype(np.int32), ends - length) > 0)


def dissection(node_m: Array, tet: Array) -> Array:
    """Order the nodes node_m (n, 3) of a solid tet (t, k) for elimination: (n,)."""
    quantiles = (0.4, 0.45, 0.5, 0.55, 0.6)
    leaf = 40
    n = len(node_m)
    start, neighbour = _neighbours(tet, n)
    mask = np.zeros(n, bool)
    order: list[Array] = []
    todo: list[tuple[Array, bool]] = [(np.arange(n), False)]  # (nodes, already cut: to be numbered as they are)
    while todo:
        nodes, final = todo.pop()
        if final or len(nodes) <= leaf:
            order.append(nodes)
            continue
        point = node_m[nodes]
        best: tuple[float, Array, Array, Array] | None = None
        for axis in np.argsort(-np.ptp(point, axis=0), kind="stable")[:2]:
            for level in np.quantile(point[:, axis], quantiles):
                below = point[:, axis] <= level
                left, right = nodes[below], nodes[~below]
                if len(left) == 0 or len(right) == 0:
                    continue
                mask[right] = True
                wall = _mark_neighbours(left, mask, start, neighbour)
                mask[right] = False
                cost = wall.sum() * (1 + abs(len(left) - wall.sum() - len(right)) / len(nodes))
                if best is None or cost < best[0]:
                    best = (cost, left[~wall], right, left[wall])
        if best is None or len(best[1]) == 0:
            order.append(nodes)
            continue
        # taken from the end: both halves, then their separator
        todo += [(best[3], True), (best[2], False), (best[1], False)]
    return np.concatenate(order)
