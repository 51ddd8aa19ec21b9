"""Several closed pieces that mean one body: overlap, touch, a hair apart, far apart, a cavity."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet import geometry
from sonic_bullet.modal import analyse
from sonic_bullet.modal.meshing.surfaces import pieces_of_faces, prepare_surface
from sonic_bullet.modal.meshing.unions import unite_pieces
from sonic_bullet.records import Material, Shape
from tests.few_cases import parametrize_few


def two_boxes(gap_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Boxes 0.1 × 0.02 × 0.01 m end to end, gap_m between them (negative: they overlap)."""
    left, right = trimesh.creation.box((0.1, 0.02, 0.01)), trimesh.creation.box((0.1, 0.02, 0.01))
    right.apply_translation([0.1 + gap_m, 0, 0])
    return np.concatenate([left.vertices, right.vertices]), np.concatenate(
        [left.faces, right.faces + len(left.vertices)]
    )


def united(vertex: np.ndarray, face: np.ndarray) -> tuple[np.ndarray, np.ndarray, str, bool]:
    return unite_pieces(vertex, face, pieces_of_faces(face))


@parametrize_few("overlap_m", [0.02, 0.05], 1)
def test_overlapping_pieces_count_their_common_volume_once(overlap_m: float) -> None:
    vertex, face, said, grown = united(*two_boxes(-overlap_m))
    assert geometry.is_closed(face)
    assert geometry.volume_m3(vertex, face) == pytest.approx((0.2 - overlap_m) * 0.02 * 0.01, rel=1e-9)
    assert said == "; 2 pieces united" and not grown


def test_a_hair_between_pieces_is_closed_and_told() -> None:
    gap_m = 1e-4  # 5e-4 of the diagonal: grown by 3e-4 on either side it is gone
    vertex, face, said, grown = united(*two_boxes(gap_m))
    assert pieces_of_faces(face).max() == 0
    assert grown
    assert "2 pieces united, each grown by 6e-05 m" in said
    assert geometry.volume_m3(vertex, face) == pytest.approx(0.2 * 0.02 * 0.01, rel=0.05)


def test_pieces_far_apart_stay_apart_and_are_told() -> None:
    vertex, face, said, _ = united(*two_boxes(0.05))
    assert "into 2 that lie apart" in said
    assert geometry.volume_m3(vertex, face) == pytest.approx(2 * 0.1 * 0.02 * 0.01, rel=1e-9)


def test_a_cavity_stays_a_cavity() -> None:
    outer, inner = trimesh.creation.icosphere(2, 0.05), trimesh.creation.icosphere(2, 0.04)
    vertex = np.concatenate([outer.vertices, inner.vertices])
    face = np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)])
    skin = prepare_surface(vertex, face, None)
    same_vertex, same_face, said, _ = united(skin.vertex_m, skin.face)
    assert said == "" and same_face is skin.face and same_vertex is skin.vertex_m


def test_a_bar_in_two_pieces_rings_as_one_bar() -> None:
    """The union of the halves of a bar, a hair apart, has the bar's own modes, not the half's (four times as high)."""
    plastic = Material.isotropic(
        "plastic", youngs_pa=2.4e9, poisson=0.37, density_kg_m3=1050.0, alpha_per_s=30.0, beta_s=1e-6
    )
    vertex, face = two_boxes(5e-5)
    whole = analyse((Shape("box", size_m=np.array((0.20005, 0.02, 0.01))),), plastic, count=4, cache=None)
    halves = analyse((Shape("mesh", vertex_m=vertex, face=face),), plastic, count=4, edge_m=0.006, cache=None)
    assert "2 pieces united" in halves.note
    # grown by 6e-5 m on every side, 1.2 % of the bar's thickness
    np.testing.assert_allclose(halves.freq_hz, whole.freq_hz, rtol=0.025)


def test_outlines_side_by_side_ring_as_the_largest_of_them(steel: Material) -> None:
    """Two bars a gap apart are one extruded outline of two polygons; a link of Minitaur's chassis is such a pair."""
    places = np.array([[0, 0.035, 0], [0, -0.035, 0]])
    pair = tuple(Shape("box", np.array([0.34, 0.01, 0.04]), place) for place in places)
    both = analyse(pair, steel, to_hz=3000.0, cache=None)
    alone = analyse(pair[:1], steel, to_hz=3000.0, cache=None)
    assert "largest of 2 separate pieces kept" in both.note
    assert both.freq_hz == pytest.approx(alone.freq_hz, rel=0.01)
