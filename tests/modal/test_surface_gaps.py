"""What a note tells of a bent surface that elements do not follow, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.modal.elements import Elements
from sonic_bullet.modal.meshing.shape_meshes import FilledBody
from sonic_bullet.modal.meshing.solid import TET_EDGE, Solid, surface
from sonic_bullet.modal.meshing.structured import box
from sonic_bullet.modal.sectors import WantedModes
from sonic_bullet.records import Array, isotropic_stiffness_pa


def told(solid: Solid, skin: tuple[Array, Array], count: int) -> tuple[Array, float]:
    """Return λ (m,), and the error that the surface leaves, of elements of degree 3."""
    tensor = isotropic_stiffness_pa(1.0, 0.3)
    made = Elements(
        FilledBody(solid, surface(solid), np.zeros(0)), 1.0, np.zeros((0, 4)), 3, False, 1.0, None, skin=skin
    )
    sectors = made.sectors([tensor], WantedModes(np.inf, count))
    return sectors[0].found[0][0], made.surface_error(sectors, tensor)


def skin_of(solid: Solid) -> tuple[Array, Array]:
    skin = surface(solid)
    return solid.node_m[skin.node], skin.face


@pytest.mark.parametrize("larger", [1.0, 1.002, 0.998])
def test_a_surface_that_is_larger_lowers_frequencies_by_as_much(larger: float) -> None:
    """f ∝ 1/L."""
    solid = box(np.array([1.0, 0.4, 0.3]), (5, 2, 2))
    corner, face = skin_of(solid)
    _, error = told(solid, (larger * corner, face), 8)
    assert error == pytest.approx(abs(larger - 1), rel=0.05, abs=1e-9)


def square_as_round(solid: Solid) -> Solid:
    """Place the nodes of a square bar so that those of its surface lie on a cylinder of the same width."""
    node_m = solid.node_m.copy()
    y, z = node_m[:, 1:].T
    far = np.hypot(y, z)
    stretch = np.maximum(np.abs(y), np.abs(z)) / np.maximum(far, 1e-12)
    node_m[:, 1:] *= stretch[:, None]
    return Solid(node_m, solid.tet, affine=False)


def test_a_bar_of_eight_flats_twists_more_easily_than_a_round_one_by_no_more_than_told() -> None:
    """f = √(K/J)/2L · √(G/ρ), K = J of a round bar alone; flats of the same area lie on its surface on the mean."""
    radius, length = 0.1, 1.0
    straight = square_as_round(box(np.array([length, 2 * radius, 2 * radius]), (8, 2, 2)))
    node_m = straight.node_m.copy()
    node_m[straight.tet[:, 4:]] = node_m[straight.tet[:, TET_EDGE]].mean(axis=2)
    area = 0.5 * 8 * np.sin(2 * np.pi / 8) * radius**2
    node_m[:, 1:] *= np.sqrt(np.pi * radius**2 / area)
    angle = np.linspace(0, 2 * np.pi, 97)[:-1]
    ring = radius * np.sqrt(2 * np.pi / 96 / np.sin(2 * np.pi / 96)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = [np.column_stack([np.full(96, x), ring]) for x in (-length / 2, length / 2)]
    corner = np.concatenate([*ends, [[-length / 2, 0, 0], [length / 2, 0, 0]]])
    i, j = np.arange(96), (np.arange(96) + 1) % 96
    face = np.concatenate(
        [
            np.stack([i, i + 96, j], axis=1)[:, ::-1],
            np.stack([j, i + 96, j + 96], axis=1)[:, ::-1],
            np.stack([np.full(96, 192), j, i], axis=1),
            np.stack([np.full(96, 193), i + 96, j + 96], axis=1),
        ]
    )
    value, error = told(Solid(node_m, straight.tet), (corner, face), 8)
    twist = np.pi / length * np.sqrt(1 / 2.6)  # E = 1, G = E/2(1 + ν), one half wave
    lost = 1 - np.sqrt(value) / twist
    (own,) = lost[np.abs(lost) < 0.05]
    assert 0.005 < own <= error < 2.5 * own  # twice, of what is of second order
