"""The bodies themselves: closed outward surfaces, sound bricks, and facets that are not the error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.suite import bricks
from benchmarks.suite.bricks import OFFSET, Bricks
from sonic_bullet import geometry
from studies.thin_walls.blocks import brick_volumes_m3, quad, swept, welded
from studies.thin_walls.bodies import BODIES, BRASS, FACETS, ThinBody

EDGE_ENDS = {
    k: [int(np.flatnonzero((np.where(at == 1, side, at) == OFFSET).all(axis=1))[0]) for side in (0, 2)]
    for k, at in enumerate(OFFSET)
    if 1 in at
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_the_surface_is_closed_and_holds_what_the_bricks_hold(body: ThinBody) -> None:
    vertex_m, face = body.surface()
    made = body.bricks(fine=False)
    volume_m3 = brick_volumes_m3(made)
    assert geometry.is_closed(face)
    assert volume_m3.min() > 0
    assert geometry.volume_m3(vertex_m, face) == pytest.approx(volume_m3.sum(), rel=2e-3)  # chords, of rims too
    assert len(np.unique(made.cell)) == len(made.node_m)


def test_kinds_and_materials_are_mixed() -> None:
    assert len(BODIES) >= 24
    assert len({body.stuff for body in BODIES.values()}) == 5


def tube(quarter: int) -> Bricks:
    """One millimetre of brass, 40 mm across."""
    return welded([swept(quarter, 2, 1, quad((0.0195, 0), (0.0195, 0.04), (0.0205, 0.04), (0.0205, 0)))])


def chorded(body: Bricks) -> Bricks:
    """The same with straight edges: the body that its facets enclose."""
    node = body.node_m.copy()
    for middle, ends in EDGE_ENDS.items():
        node[body.cell[:, middle]] = node[body.cell[:, ends]].mean(axis=1)
    return replace(body, node_m=node)


def test_facets_are_not_the_error() -> None:
    """A tube of flat facets has a round one's modes within 5e-4, a tenth of what ours may be off."""
    stiffness = bricks.isotropic(BRASS.youngs_pa, BRASS.poisson)
    true, flat = (
        bricks.modes(body, stiffness, BRASS.density_kg_m3, to_hz=4000.0).freq_hz
        for body in (tube(8), chorded(tube(FACETS // 4)))
    )
    assert len(true) >= 4
    np.testing.assert_allclose(flat, true, rtol=5e-4)
    assert not np.allclose(flat, true, rtol=1e-6)
