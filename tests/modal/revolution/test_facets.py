"""What a note tells of facets, against closed forms: a ring of round wire, a ball, and what has none."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sonic_bullet.modal import analyse
from sonic_bullet.records import Array, Material, Shape

STEEL = Material.isotropic("steel", youngs_pa=2e11, poisson=0.3, density_kg_m3=7850)


def turned(outline_m: Array, around: int = 48) -> Shape:
    """Turn a closed walk of (r, z), all r > 0, counter-clockwise, about the z axis."""
    sides = len(outline_m)
    angle = 2 * np.pi * np.arange(around) / around
    r, z = outline_m.T
    corner = np.stack([np.outer(np.cos(angle), r), np.outer(np.sin(angle), r), np.tile(z, (around, 1))], axis=-1)
    i, j = (index.ravel() for index in np.indices((around, sides)))
    a, b, c, d = (((i + k) % around) * sides + (j + n) % sides for k, n in ((0, 0), (1, 0), (1, 1), (0, 1)))
    face = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Shape("mesh", vertex_m=corner.reshape(-1, 3), face=face.astype(np.int32))


def told(note: str) -> float:
    found = re.search(r"arcs in place of its facets change frequencies by up to ([\d.]+) %", note)
    return float(found[1]) / 100 if found else 0.0


@pytest.mark.parametrize("sides", [16, 24])
def test_a_ring_of_a_wire_with_flats_tells_what_they_take(sides: int) -> None:
    """f ∝ √(I/A): of a regular polygon in a circle √((2 + cos 2π/n)/3) of the circle's [Young & Budynas, table A.1]."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    wire = np.stack([0.05 + 0.003 * np.cos(angle), 0.003 * np.sin(angle)], axis=1)
    model = analyse((turned(wire),), STEEL, count=4, cache=None)
    flats = 1 - np.sqrt((2 + np.cos(2 * np.pi / sides)) / 3)
    assert told(model.note) == pytest.approx(flats, rel=0.05)
    stated = re.search(r"error up to \d+ Hz about ([\d.]+) %", model.note)
    assert stated is not None and float(stated[1]) / 100 >= 0.95 * flats  # the elements' and the facets' together
    assert ("more than the 1 % asked for: give a mesh of finer facets" in model.note) == (flats > 0.01)


def test_a_ball_of_flats_tells_how_much_too_small_it_is() -> None:
    """f ∝ 1/R, and chords of a turn θ each lie Rθ²/12 inside on the mean."""
    sides = 16
    angle = np.linspace(-np.pi / 2, np.pi / 2, sides + 1)[1:-1]
    ring = turned(0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    poles = np.array([[0, 0, -0.05], [0, 0, 0.05]])
    rings, around = sides - 1, 48
    i = np.arange(around)
    low, high = len(ring.vertex_m), len(ring.vertex_m) + 1
    after = (i + 1) % around
    caps = [
        np.stack([np.full(around, low), after * rings, i * rings], axis=1),
        np.stack([np.full(around, high), i * rings + rings - 1, after * rings + rings - 1], axis=1),
    ]
    strips = ring.face[~_closes(ring.face, rings)]
    ball = Shape("mesh", vertex_m=np.concatenate([ring.vertex_m, poles]), face=np.concatenate([strips, *caps]))
    model = analyse((ball,), STEEL, count=5, cache=None)
    assert told(model.note) == pytest.approx((np.pi / sides) ** 2 / 12, rel=0.15)


def _closes(face: Array, rings: int) -> Array:
    """Say which triangles lead from the last ring back to the first."""
    place = face % rings
    return np.asarray((place.max(axis=1) == rings - 1) & (place.min(axis=1) == 0))


def test_a_tube_of_flat_walls_has_no_facets() -> None:
    wall = np.array([[0.018, 0], [0.02, 0], [0.02, 0.1], [0.018, 0.1]])
    assert "facets" not in analyse((turned(wall),), STEEL, count=4, cache=None).note
