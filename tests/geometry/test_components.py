"""Labels of connected components against those of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from sonic_bullet.geometry import label_components


@pytest.mark.parametrize("seed", range(40))
def test_labels_are_those_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nodes = int(rng.integers(1, 200))
    one, other = rng.integers(0, nodes, (2, int(rng.integers(0, 2 * nodes))))
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(nodes, nodes))
    _, expected = connected_components(graph, directed=False)
    np.testing.assert_array_equal(label_components(nodes, one, other), expected)


def test_a_long_chain_in_any_order_is_one_component() -> None:
    order = np.random.default_rng(3).permutation(20_000)
    assert not label_components(20_000, order[:-1], order[1:]).any()


def test_no_nodes_have_no_labels() -> None:
    assert label_components(0, np.zeros(0, int), np.zeros(0, int)).shape == (0,)
