"""Meshes as they come: inside out, open, flat, hollow, extruded, overlapping, broken; and files that lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import analyse, read_mesh
from sonic_bullet.modal.meshing import filling, prisms, sizes, surfaces, tetrahedra
from sonic_bullet.records import Material, Shape
from sonic_bullet.records.errors import FileError, MeshError, ModalError


def as_mesh(mesh: trimesh.Trimesh) -> Shape:
    return Shape("mesh", vertex_m=mesh.vertices, face=mesh.faces)


def solid_of(shape: Shape, thickness_m: float | None = None):  # type: ignore[no-untyped-def]
    skin = surfaces.prepare_surface(shape.vertex_m, shape.face, thickness_m)
    return skin


def test_inside_out_and_mixed_meshes_are_turned() -> None:
    box = trimesh.creation.box((0.1, 0.05, 0.02)).subdivide()
    mixed = box.faces.copy()
    mixed[::3] = mixed[::3, ::-1]
    for faces in (box.faces[:, ::-1], mixed):
        skin = surfaces.prepare_surface(np.array(box.vertices), faces, None)
        assert prisms.as_box(skin.vertex_m, skin.face) is not None
        assert skin.thickness_m == pytest.approx(2 * box.volume / box.area)
        assert "turned" in skin.note


def test_a_box_is_recognised_however_it_lies() -> None:
    box = trimesh.creation.box((0.1, 0.05, 0.02))
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    box.apply_transform(turn)
    box.apply_translation([1, 2, 3])
    found = prisms.as_box(np.array(box.vertices), np.array(box.faces))
    assert found is not None
    assert sorted(found[0]) == pytest.approx([0.02, 0.05, 0.1])
    assert found[2] == pytest.approx([1, 2, 3])
    assert (
        prisms.as_box(
            *(np.array(x) for x in (trimesh.creation.cylinder(1, 1).vertices, trimesh.creation.cylinder(1, 1).faces))
        )
        is None
    )


def test_a_box_of_polygons_with_nodes_along_their_edges_is_one() -> None:
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float)
    middle = np.array([[0, 0, 1.5]])
    polygon = [[0, 8, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1, 8], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    # (0, 8, 1) lies on one edge
    fan = np.array([[p[0], p[k], p[k + 1]] for p in polygon for k in range(1, len(p) - 1)])
    found = prisms.as_box(np.concatenate([corner, middle]), fan)
    assert found is not None and sorted(found[0]) == pytest.approx([1, 2, 3])


def test_extruded_outlines_with_holes_keep_their_volume() -> None:
    ring = trimesh.creation.annulus(0.02, 0.05, 0.004, sections=24)
    made = prisms.as_prism(np.array(ring.vertices), np.array(ring.faces), 0.006, 20_000)
    assert made is not None and "prism" in made.note
    from sonic_bullet.modal.fem import volume_m3

    assert volume_m3(made) == pytest.approx(ring.volume, rel=1e-9)


def test_open_sheet_gets_a_wall_and_says_so(steel: Material) -> None:
    bowl = trimesh.creation.icosphere(3, radius=0.05)
    bowl.update_faces(bowl.triangles_center[:, 2] < 0)
    area = bowl.area
    skin = solid_of(as_mesh(bowl))
    assert "open surface given a wall" in skin.note
    thin = solid_of(as_mesh(bowl), 0.002)
    from sonic_bullet.geometry import is_closed, volume_m3

    assert is_closed(thin.face)
    assert volume_m3(thin.vertex_m, thin.face) == pytest.approx(0.002 * area, rel=0.02)


def test_flat_sheet_is_an_error_with_its_remedy_and_a_plate_with_it(steel: Material) -> None:
    square = Shape("mesh", vertex_m=[[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], face=[[0, 1, 2], [0, 2, 3]])
    with pytest.raises(MeshError, match="thickness_m"):
        analyse((square,), steel, count=1, cache=None)
    plate = analyse((square,), steel, count=3, thickness_m=0.002, edge_m=0.01, cache=None)
    same = analyse((Shape("box", [0.1, 0.1, 0.002]),), steel, count=3, edge_m=0.01, cache=None)
    assert np.allclose(plate.freq_hz, same.freq_hz, rtol=1e-6)


def test_thickness_makes_a_closed_mesh_hollow() -> None:
    ball = trimesh.creation.icosphere(3, radius=0.05)
    skin = solid_of(as_mesh(ball), 0.005)
    from sonic_bullet.geometry import volume_m3

    assert volume_m3(skin.vertex_m, skin.face) == pytest.approx(ball.volume * (1 - 0.9**3), rel=0.01)
    assert "hollow" in skin.note


def test_shapes_together_are_one_solid(steel: Material) -> None:
    """Two boxes that overlap: the union's mass, and the modes of the bar they make."""
    halves = tuple(Shape("box", [0.06, 0.02, 0.02], position_m=[x, 0, 0]) for x in (-0.02, 0.02))
    both = analyse(halves, steel, count=2, edge_m=0.01, cache=None)
    whole = analyse((Shape("box", [0.1, 0.02, 0.02]),), steel, count=2, edge_m=0.01, cache=None)
    assert both.volume_m3 == pytest.approx(4e-5, rel=0.01)
    assert np.allclose(both.freq_hz, whole.freq_hz, rtol=0.03)


def test_broken_meshes_are_named(steel: Material) -> None:
    def shape(vertex: list[list[float]]) -> Shape:
        return Shape("mesh", vertex_m=vertex, face=[[0, 1, 2]])

    for vertex in (
        [[0, 0, 0]] * 3,
        [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
        [[0, 0, 0], [1e9, 0, 0], [0, 1e9, 0]],
        [[0, 0, 0], [1e-9, 0, 0], [0, 1e-9, 0]],
    ):
        with pytest.raises(MeshError):
            analyse((shape(vertex),), steel, cache=None)
    with pytest.raises(MeshError):
        analyse((), steel)
    with pytest.raises(MeshError):
        analyse((Shape("sphere", [0.0, 0, 0]),), steel, cache=None)


def test_a_hang_is_cut_and_named() -> None:
    ball = trimesh.creation.icosphere(4, radius=0.05)
    with pytest.raises(MeshError, match="Netgen did not come to an end"):
        tetrahedra.tetrahedra(np.array(ball.vertices), np.array(ball.faces), 0.0005, guard_s=1)


def test_clamps_on_budget() -> None:
    assert sizes.dof_budget(0.1, 0.5) < sizes.dof_budget(0.01, 0.5) < sizes.dof_budget(0.001, 0.5)


def test_mesh_files(tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    for name in ("a.obj", "a.stl", "a.ply"):
        box.export(tmp_path / name)
        found = read_mesh(tmp_path / name, 0.001)
        assert (len(found.vertex_m), len(found.face)) == (8, 12)
        assert np.ptp(found.vertex_m, axis=0) == pytest.approx([0.001, 0.002, 0.003])
    (tmp_path / "quad.obj").write_text(
        "o one\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\no two\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 5 6 7\n"
    )
    assert len(read_mesh(tmp_path / "quad.obj").face) == 3
    whole = (tmp_path / "a.stl").read_bytes()
    (tmp_path / "lies.stl").write_bytes(whole[:80] + (10**6).to_bytes(4, "little") + whole[84:])
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "nan.obj").write_text("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "a.xyz3").write_text("x")
    for name in ("lies.stl", "empty.obj", "nan.obj", "a.xyz3"):
        with pytest.raises(MeshError, match=name):
            read_mesh(tmp_path / name)
    with pytest.raises(FileError):
        read_mesh(tmp_path / "none.obj")


def test_what_netgen_refuses_is_filled_by_the_lattice_and_told(
    monkeypatch: pytest.MonkeyPatch, steel: Material
) -> None:
    """A fill that loses its volume is one it refuses: as it is, simplified, finer, then the lattice."""
    crumb = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) * 0.02
    asked: list[float] = []

    def crumbs(vertex_m: object, face: object, edge_m: float, *_: object) -> object:
        asked.append(edge_m)
        return crumb, np.array([[0, 1, 2, 3]])

    monkeypatch.setattr(filling, "tetrahedra", crumbs)
    ball = trimesh.creation.icosphere(2, 0.05)
    model = analyse((as_mesh(ball),), steel, count=1, edge_m=0.02, cache=None)
    assert asked == pytest.approx([0.02, 0.02, 0.012])
    assert "lattice" in model.note and "volume to 0%" in model.note
    assert model.volume_m3 == pytest.approx(ball.volume, rel=0.04)


def test_clamps_that_hold_everything_are_refused() -> None:
    with pytest.raises(ModalError, match="hold the whole body"):
        analyse(
            (Shape("box", size_m=[0.1, 0.05, 0.02]),),
            Material.isotropic("x", youngs_pa=1e9, poisson=0.3, density_kg_m3=1e3),
            fixed=((0, 0, 0, 9),),
            cache=None,
        )
