"""Connected components of a graph: pieces of a surface, islands of contact, lines that belong together.

SciPy has it in `scipy.sparse.csgraph`, whose import costs a fifth of a second that a first sound should not wait for.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def label_components(count: int, one: Array, other: Array) -> Array:
    """Label the connected components of an undirected graph, numbered in the order of their first nodes.

    Every node points at the least node that it is known to hang together with. Each round, the roots of an edge's two
    ends are hooked to the lesser of them, and all pointers are followed to their ends
    [Shiloach, Vishkin, "An O(log n) parallel connectivity algorithm", J. Algorithms 3, 1982].

    Parameters
    ----------
    count : int
        Number of nodes.
    one, other : (e,) int
        The ends of each edge.

    Returns
    -------
    (count,) int
        The component of each node.

    Examples
    --------
    >>> label_components(5, np.array([3, 4]), np.array([1, 3]))
    array([0, 1, 2, 1, 1])
    """
    root = np.arange(count)
    one, other = np.asarray(one, np.intp), np.asarray(other, np.intp)
    while True:
        a, b = root[one], root[other]
        apart = a != b
        if not apart.any():
            return np.unique(root, return_inverse=True)[1]
        one, other, a, b = one[apart], other[apart], a[apart], b[apart]
        np.minimum.at(root, np.maximum(a, b), np.minimum(a, b))
        while (root[root] != root).any():
            root = root[root]
