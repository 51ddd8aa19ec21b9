"""What no filler can fill rings by thicker walls that bend as its own do, and unions of named solids are solids."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from sonic_bullet import geometry
from sonic_bullet.modal import analyse
from sonic_bullet.modal.meshing.shape_meshes import fill
from sonic_bullet.modal.meshing.solid import corner_volume_m3
from sonic_bullet.modal.meshing.surfaces import prepare_surface
from sonic_bullet.records import Material, Shape
from sonic_bullet.records.errors import MeshError

STEEL = Material.isotropic("steel", youngs_pa=200e9, poisson=0.3, density_kg_m3=7850, alpha_per_s=5, beta_s=1e-8)


def box(size: tuple[float, float, float], place: tuple[float, float, float], turn: float = 0.0) -> Shape:
    quaternion = np.array([np.sin(turn / 2), 0, 0, np.cos(turn / 2)])
    return Shape("box", size_m=np.array(size), position_m=np.array(place), quaternion_xyzw=quaternion)


def plate() -> Shape:
    """A steel plate as triangles, 1 mm by 0.2 m by 0.3 m."""
    corner = np.array([[x, y, z] for x in (0, 0.3) for y in (0, 0.2) for z in (0, 0.001)], float)
    face = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]
    )  # fmt: skip
    return Shape("mesh", vertex_m=corner, face=face)


def test_a_draft_of_a_thin_plate_bends_as_the_plate(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = analyse((plate(),), STEEL, count=4, cache=None)
    # what is for boxes alone would take it: a plate whose corners are broken is none
    monkeypatch.setattr("sonic_bullet.modal.polynomials.method_for", lambda *_, **__: None)
    monkeypatch.setattr("sonic_bullet.modal.meshing.filling.by_rule", lambda skin, edge_m: None)
    draft = analyse((plate(),), STEEL, count=4, cache=None, draft=True)
    assert draft.solution == "draft" and "bending as they do" in draft.note
    assert draft.mass_kg == pytest.approx(whole.mass_kg, rel=0.01)
    # semitones: shear makes a wall 80 times as thick too soft
    assert np.abs(12 * np.log2(draft.freq_hz / whole.freq_hz)).max() < 8


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (1, 0, 2), (2, 1, 0)])
def test_a_draft_of_a_lump_is_filled_whichever_way_it_lies(axes: tuple[int, int, int]) -> None:
    """An egg, turned: its principal axes may come as a mirror image, in which what is inside would lie outside."""
    egg = trimesh.creation.icosphere(2, 0.05)
    vertex = egg.vertices * [1.0, 0.8, 0.6]
    vertex[:, 1] *= 1 + 4 * vertex[:, 0]
    turn = np.eye(3)[list(axes)]
    turn[0] *= np.linalg.det(turn)
    shape = Shape("mesh", vertex_m=vertex @ turn.T, face=np.asarray(egg.faces))
    made = fill((shape,), 0.02, None, filler="draft").solid
    filled = np.abs(corner_volume_m3(made.node_m, made.tet)).sum() / made.thickened
    assert filled == pytest.approx(geometry.volume_m3(vertex, shape.face), rel=0.1)


def test_a_draft_is_touched_where_its_body_is() -> None:
    """Elements of a draft bevel the rims of a block, so its surface as given says how it is curved there."""
    tilt = trimesh.transformations.rotation_matrix(0.4, [1, 2, 3])
    block = trimesh.creation.box((0.1, 0.1, 0.07)).apply_transform(tilt)
    block = trimesh.util.concatenate(block, trimesh.creation.icosphere(2, 0.04).apply_translation([0, 0, 0.05]))
    shape = Shape("mesh", vertex_m=np.asarray(block.vertices), face=np.asarray(block.faces))
    draft, given = analyse((shape,), STEEL, cache=None, draft=True), prepare_surface(shape.vertex_m, shape.face, None)
    assert draft.touched is not None
    assert (draft.touched.vertex_m == given.vertex_m).all() and (draft.touched.face == given.face).all()
    assert (draft.touched.curvature_per_m == geometry.face_curvature(given.vertex_m, given.face)).all()
    corner = np.array([[x, y, z] for x in (0, 0.1) for y in (0, 0.08) for z in (0, 0.06)])
    cube = replace(plate(), vertex_m=corner)  # elements follow its rims
    assert fill((cube,), 0.02, None).touched is None


def refuse(*_: object) -> None:
    raise MeshError("Netgen failed on the mesh", "repair the mesh")


def test_a_tray_of_overlapping_boxes_is_one_solid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonic_bullet.modal.meshing.filling._by_netgen", refuse)  # as it does PyBullet's, of five
    tray = (
        box((0.6, 0.6, 0.02), (0, 0, 0.005)),
        box((0.6, 0.02, 0.15), (0, -0.25, 0.059), 0.575469961),
        box((0.6, 0.02, 0.15), (0, 0.25, 0.059), -0.575469961),
    )
    made = fill(tray, 0.1, None)
    assert "of 3 solids united exactly" in made.solid.note
    volume = geometry.volume_m3(made.solid.node_m[made.skin.node], made.skin.face)
    floor, wall = 0.6 * 0.6 * 0.02, 0.6 * 0.02 * 0.15
    assert floor + wall < volume < floor + 2 * wall


def test_a_surface_through_itself_with_thin_walls_rings() -> None:
    rng = np.random.default_rng(3)
    sheets = [plate().vertex_m @ np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(6)]
    vertex = np.concatenate(sheets)
    face = np.concatenate([plate().face + 8 * k for k in range(6)])
    face[0, 0] = 8  # torn, and joined where nothing joins
    model = analyse((Shape("mesh", vertex_m=vertex, face=face),), STEEL, count=8, cache=None, draft=True)
    assert model.mode_count == 8 and np.isfinite(model.freq_hz).all()
    assert geometry.is_closed(model.face)
