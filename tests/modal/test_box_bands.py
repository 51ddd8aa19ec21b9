"""A box's problem in bands against the same problem in full."""

from __future__ import annotations

import numpy as np

from sonic_bullet.files.presets import load_material
from sonic_bullet.modal import analyse, polynomials
from sonic_bullet.modal.box_bands import Inverse, count_below
from sonic_bullet.records import Shape
from tests.few_cases import parametrize_few

SIZE, TERMS = np.array([0.8, 0.55, 0.1]), (9, 7, 5)


def orthotropic() -> np.ndarray:
    """Return a mirrored tensor whose nine constants all differ."""
    made = np.diag([1.0, 0.6, 0.4, 0.11, 0.15, 0.2])
    made[0, 1] = made[1, 0] = 0.21
    made[0, 2] = made[2, 0] = 0.17
    made[1, 2] = made[2, 1] = 0.13
    return made


def test_the_bands_are_the_full_problem() -> None:
    tensor = orthotropic()
    for parity in polynomials.parities(SIZE, TERMS):
        combine = parity.own.combine.toarray()
        full = parity.stiffness(tensor)
        scale = np.abs(full).max()
        np.testing.assert_allclose(
            parity.own.stiffness(tensor).toarray(), combine.T @ full @ combine, atol=1e-12 * scale
        )
        np.testing.assert_allclose(parity.own.mass.toarray(), combine.T @ combine, atol=1e-13)
        vector = np.random.default_rng(0).standard_normal((len(full), 2))
        np.testing.assert_allclose(parity.as_operator(tensor) @ vector, full @ vector, atol=1e-11 * scale)


def test_levels_meet_only_their_neighbours() -> None:
    for parity in polynomials.parities(SIZE, TERMS):
        level = np.searchsorted(parity.own.start, np.arange(len(parity.own.order)), side="right")
        entry = parity.own.stiffness(orthotropic()).tocoo()
        assert len(parity.own.start) > 4
        assert np.abs(level[entry.row] - level[entry.col]).max() == 1


def test_inverse_and_count_are_those_of_the_full_matrix() -> None:
    tensor = orthotropic()
    for parity in polynomials.parities(SIZE, TERMS):
        own, full = parity.own, parity.stiffness(tensor)
        value = np.linalg.eigvalsh(full)
        banded = own.stiffness(tensor)
        for limit in (value[10] * 1.001, value[40] * 1.001):
            assert count_below(own, banded - limit * own.mass) == (value < limit).sum()
        shift = -0.01 * value[10]
        right = np.random.default_rng(1).standard_normal(len(full))
        found = Inverse(own, banded - shift * own.mass)(right)
        wanted = np.linalg.solve(full - shift * np.eye(len(full)), right)
        np.testing.assert_allclose(found, wanted, atol=1e-10 * np.abs(wanted).max())


def test_shapes_are_products_of_polynomials_at_any_points() -> None:
    (parity,) = polynomials.parities(SIZE, TERMS, [5])
    rng = np.random.default_rng(2)
    point = (rng.random((40, 3)) - 0.5) * SIZE
    vector = rng.standard_normal((len(parity.own.order), 3))
    ends = np.cumsum([0, *(len(part) for part in parity.degree)])
    wanted = np.empty((40, 3, 3))
    for k, degree in enumerate(parity.degree):
        value = np.ones((40, len(degree)))
        for axis in range(3):
            table = np.polynomial.legendre.legvander(2 * point[:, axis] / SIZE[axis], TERMS[axis])
            value *= table[:, degree[:, axis]] * np.sqrt((2 * degree[:, axis] + 1) / SIZE[axis])
        wanted[:, k] = value @ vector[ends[k] : ends[k + 1]]
    np.testing.assert_allclose(polynomials.shapes_at(point, SIZE, parity, vector), wanted, atol=1e-12)


@parametrize_few("size, material", [((0.6, 0.4, 0.02), "made-spruce"), ((0.5, 0.45, 0.4), "wood")], 1)
def test_boards_and_blocks_of_200_modes_take_polynomials(size: tuple[float, ...], material: str) -> None:
    model = analyse((Shape("box", np.array(size)),), load_material(material), cache=None)
    assert model.mode_count == 200
    assert "polynomials" in model.note
    assert "under 0.01 %" in model.note
