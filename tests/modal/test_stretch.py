"""How modes move as a body grows along one axis: against families of longer boxes, by polynomials and by elements."""

from __future__ import annotations

import numpy as np
import trimesh

from sonic_bullet.modal.isotropic_family import Family, stretch_slopes
from sonic_bullet.modal.reduced import family
from sonic_bullet.records import Shape

GAMMA, NU = 2.7e7, 0.29
SIZE = np.array([0.016, 0.021, 0.15])  # shortest first, as principal axes come


def made(shape: Shape, to_hz: float) -> Family:
    return family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=to_hz, cache=None)


def test_as_families_of_longer_boxes() -> None:
    grown, to_hz = 1e-3, 12e3
    found = stretch_slopes(made(Shape("box", SIZE), to_hz), NU)
    for axis in range(3):
        ends = [
            made(Shape("box", SIZE * np.exp(s * grown * (np.arange(3) == axis))), to_hz).modes(GAMMA, NU)[0]
            for s in (-1, 1)
        ]
        count = min(len(found), *map(len, ends))
        assert count >= 4
        moved = np.log(ends[1][:count] / ends[0][:count]) / (2 * grown)
        np.testing.assert_allclose(found[:count, axis], moved, atol=0.1)


def test_elements_as_polynomials() -> None:
    turned = trimesh.creation.box(SIZE).subdivide().subdivide()
    turned.vertices[:, 0] += 1e-4 * np.sin(40 * turned.vertices[:, 2])  # no box any more: elements
    solid = made(Shape("mesh", vertex_m=turned.vertices, face=turned.faces), 9e3)
    assert solid.meshed
    box = stretch_slopes(made(Shape("box", SIZE), 9e3), NU)
    count = min(len(box), solid.count)
    np.testing.assert_allclose(stretch_slopes(solid, NU)[:count], box[:count], atol=0.2)
