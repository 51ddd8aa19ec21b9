"""Surfaces that are not closed, or pass through themselves, filled by a lattice."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal.meshing.solid import TET_FACE, corner_volume_m3, largest_component
from sonic_bullet.modal.meshing.stuffing import stuff_lattice, winding_number
from sonic_bullet.records.errors import MeshError
from tests.few_cases import parametrize_few

BOX = trimesh.creation.box((0.1, 0.05, 0.03))
BALL = trimesh.creation.icosphere(3, 0.05)


def given(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    return np.array(mesh.vertices), np.array(mesh.faces)


@parametrize_few(("mesh", "edge_m"), [(BALL, 0.01), (BOX, 0.01), (BOX, 0.006)], (0, 1))
def test_elements_fit_together_without_a_gap(mesh: trimesh.Trimesh, edge_m: float) -> None:
    """Every face belongs to one or two elements, the boundary is closed, and no element is flat."""
    node, tet = stuff_lattice(*given(mesh), edge_m)
    volume = corner_volume_m3(node, tet)
    faces = np.sort(tet[:, TET_FACE[:, :3]].reshape(-1, 3), axis=1)
    face, count = np.unique(faces, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    outer = face[count == 1]
    _, met = np.unique(
        np.concatenate([outer[:, [0, 1]], outer[:, [1, 2]], outer[:, [0, 2]]]), axis=0, return_counts=True
    )
    assert set(met) == {2}
    assert largest_component(node, tet)[1] == ""
    assert np.abs(volume).min() > 0.005 * edge_m**3
    assert np.abs(volume).sum() == pytest.approx(mesh.volume, rel=0.025)


def test_a_box_on_the_lattice_is_exact() -> None:
    node, tet = stuff_lattice(*given(trimesh.creation.box((0.1, 0.06, 0.04))), 0.02)
    assert np.abs(corner_volume_m3(node, tet)).sum() == pytest.approx(0.1 * 0.06 * 0.04, rel=1e-9)


def test_the_volume_converges_in_second_order() -> None:
    lost = [
        1 - np.abs(corner_volume_m3(*stuff_lattice(*given(BALL), edge))).sum() / BALL.volume for edge in (0.02, 0.01)
    ]
    assert lost[0] / lost[1] == pytest.approx(4, rel=0.3)


def test_holes_and_soup_are_filled_as_if_they_were_none() -> None:
    vertex, face = given(BALL)
    whole = np.abs(corner_volume_m3(*stuff_lattice(vertex, face, 0.01))).sum()
    open_face = np.delete(face, np.arange(0, len(face), 60), axis=0)
    soup = vertex[open_face].reshape(-1, 3), np.arange(3 * len(open_face)).reshape(-1, 3)
    assert np.abs(corner_volume_m3(*stuff_lattice(*soup, 0.01))).sum() == pytest.approx(whole, rel=0.03)


def test_winding_numbers_are_those_of_every_face() -> None:
    """Groups as dipoles cost less than a tenth of the threshold ½; inside, outside, and twice inside."""
    vertex, face = given(BALL)
    order = np.argsort(vertex[face].mean(axis=1)[:, 0])
    corner = np.concatenate([vertex[face][order], vertex[face][order] + [0.02, 0, 0]])
    point = np.array([[0.01, 0, 0], [-0.045, 0, 0], [0.2, 0, 0], [0.065, 0, 0]])
    assert winding_number(corner, point) == pytest.approx([2, 1, 0, 1], abs=0.05)


def test_same_surface_same_bytes() -> None:
    one, two = stuff_lattice(*given(BALL), 0.012), stuff_lattice(*given(BALL), 0.012)
    assert one[0].tobytes() == two[0].tobytes() and one[1].tobytes() == two[1].tobytes()


def test_a_wall_too_thin_for_the_lattice_is_named() -> None:
    with pytest.raises(MeshError, match="too thin for a lattice"):
        stuff_lattice(*given(BALL), 0.0005)
