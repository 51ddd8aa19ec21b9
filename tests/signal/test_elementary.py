"""Elementary functions and small matrices against NumPy's: as exact, for one number as for arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sonic_bullet import _engine
from sonic_bullet.signal import elementary

RNG = np.random.default_rng(5)
WIDE, POSITIVE, UNIT = RNG.normal(size=(7, 11)) * 9, RNG.uniform(1e-9, 1e9, (7, 11)), RNG.uniform(-1, 1, (7, 11))
FUNCTIONS: dict[str, tuple[Callable[..., np.ndarray], Callable[..., np.ndarray], tuple[np.ndarray, ...]]] = {
    "exp": (elementary.exp, np.exp, (WIDE,)),
    "expm1": (elementary.expm1, np.expm1, (UNIT,)),
    "log": (elementary.log, np.log, (POSITIVE,)),
    "log1p": (elementary.log1p, np.log1p, (POSITIVE,)),
    "sin": (elementary.sin, np.sin, (WIDE,)),
    "cos": (elementary.cos, np.cos, (WIDE,)),
    "cbrt": (elementary.cbrt, np.cbrt, (WIDE,)),
    "power": (elementary.power, np.power, (POSITIVE, UNIT[:1])),
    "arctan2": (elementary.arctan2, np.arctan2, (WIDE, UNIT)),
    "arccos": (elementary.arccos, np.arccos, (np.append(UNIT.ravel(), [-1, 1]),)),
    "complex_exp": (elementary.complex_exp, np.exp, (UNIT + 1j * WIDE,)),
    "complex_product": (elementary.complex_product, np.multiply, (UNIT + 1j * WIDE, WIDE[:1] - 2j)),
    "complex_size": (elementary.complex_size, np.abs, (UNIT + 1j * WIDE,)),
    "complex_root": (elementary.complex_root, np.sqrt, (POSITIVE + 1j * WIDE,)),
    "matrix_product": (elementary.matrix_product, np.matmul, (UNIT, WIDE.T)),
    "complex matrix_product": (elementary.matrix_product, np.matmul, (UNIT + 1j * WIDE, WIDE.T - 2j)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_as_exact_as_numpys(name: str) -> None:
    own, numpys, at = FUNCTIONS[name]
    wanted = numpys(*at)
    assert np.abs(own(*at) - wanted).max() <= 4e-15 * np.abs(wanted).max()
    if "matrix" not in name:
        one = own(*(x.ravel()[0] for x in at))
        assert np.shape(one) == () and one == own(*at).ravel()[0]


@pytest.mark.parametrize("modes", [0, 1, 2, 3, 40, 130])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_eigenpairs_of_a_stiffness(modes: int, level: int) -> None:
    """Few springs on many modes, of equal ones too; by each vector level the same bits."""
    best = _engine.best_vector_level()
    if level > best:
        pytest.skip("this processor has no such level")
    spring = np.random.default_rng(modes).normal(size=(modes, 4))
    matrix = np.diag(np.repeat(np.linspace(0, 1e10, modes), 2)[:modes]) + 1e8 * spring @ spring.T
    value, vector = elementary.symmetric_eigenpairs(matrix)
    assert (np.diff(value) >= 0).all()
    assert np.abs(vector.T @ vector - np.eye(modes)).max(initial=0) < 1e-14 * (modes + 1)
    most = np.abs(matrix).max(initial=1)
    assert np.abs(matrix @ vector - vector * value).max(initial=0) < 1e-14 * (modes + 1) * most
    assert np.abs(value - np.linalg.eigvalsh(matrix)).max(initial=0) < 1e-14 * (modes + 1) * most
    _engine.force_vector_level(level)
    try:
        value_there, vector_there = elementary.symmetric_eigenpairs(matrix)
    finally:
        _engine.force_vector_level(best)
    assert value_there.tobytes() == value.tobytes() and vector_there.tobytes() == vector.tobytes()


def test_eigenpairs_of_fewer_springs_than_motions() -> None:
    """Two thirds of the values are 0 but for rounding: many things on a plate that has many modes."""
    spring = np.random.default_rng(0).normal(size=(120, 40))
    matrix = 1e10 * spring @ spring.T
    value, vector = elementary.symmetric_eigenpairs(matrix)
    most = np.abs(matrix).max()
    assert np.abs(matrix @ vector - vector * value).max() < 1e-13 * len(matrix) * most
    assert np.abs(vector.T @ vector - np.eye(len(matrix))).max() < 1e-14 * len(matrix)
    assert np.abs(value - np.linalg.eigvalsh(matrix)).max() < 1e-14 * len(matrix) * most


def test_a_matrix_that_is_not_finite_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        elementary.symmetric_eigenpairs(np.array([[1.0, np.nan], [np.nan, 1.0]]))
