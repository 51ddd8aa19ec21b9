"""The sparse factor against dense linear algebra: any pattern, what hangs together and what does not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import block_diag, csc_array, diags_array, kron, random_array

from sonic_bullet.modal.sparse.factor import factorise
from sonic_bullet.records.errors import ModalError


def chain(length: int, nodes_of: int = 1) -> csc_array:
    """1D Poisson, each unknown ``nodes_of`` times over."""
    made = diags_array([-1.0, 2.1, -1.0], offsets=[-1, 0, 1], shape=(length, length))
    full = np.eye(nodes_of) + 0.1
    return csc_array(kron(made, full))


def cube(side: int) -> csc_array:
    """Poisson in three dimensions, three unknowns a node."""
    one, line = diags_array(np.ones(side)), diags_array([-1.0, 2.1, -1.0], offsets=[-1, 0, 1], shape=(side, side))
    grid = kron(kron(line, one), one) + kron(kron(one, line), one) + kron(kron(one, one), line)
    return csc_array(kron(grid, np.eye(3) + 0.2))


def scattered(size: int, density: float) -> csc_array:
    """Of no pattern at all."""
    made = random_array((size, size), density=density, rng=np.random.default_rng(3))
    return csc_array(made @ made.T + diags_array(np.ones(size)))


@pytest.mark.parametrize(
    "matrix",
    [
        csc_array([[4.0]]),
        csc_array(diags_array(np.arange(1.0, 8))),
        chain(60),
        chain(20, 3),
        cube(6),
        scattered(90, 0.02),
        scattered(40, 0.5),
        csc_array(block_diag([chain(7), cube(3), chain(5, 2)])),
    ],
)
def test_solves_as_dense_algebra_does(matrix: csc_array) -> None:
    right = np.random.default_rng(0).standard_normal((matrix.shape[0], 8))
    found = factorise(matrix).solve(right)
    np.testing.assert_allclose(found, np.linalg.solve(matrix.toarray(), right), rtol=1e-9, atol=1e-12)
    assert found.tobytes() == factorise(matrix).solve(right).tobytes()


def test_what_is_not_positive_definite_is_named() -> None:
    with pytest.raises(ModalError, match="60 unknowns cannot be factorised"):
        factorise(chain(60) - 1.0 * diags_array(np.ones(60)))


def test_columns_that_are_alike_make_one_panel() -> None:
    factor = factorise(chain(20, 3))
    assert [len(one.root) for one in factor.supernodes] == [3] * 17 + [9]
