"""What is a body of revolution, and what is none: ends with and without a middle, poles, hollow balls; handles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import read_mesh
from sonic_bullet.modal.revolution import rings
from sonic_bullet.records import Array, Shape

ASSETS = Path(__file__).resolve().parents[3] / "assets"
make = trimesh.creation


def as_shape(mesh: trimesh.Trimesh) -> Shape:
    return Shape("mesh", vertex_m=mesh.vertices, face=mesh.faces)


def cup(sections: int = 48) -> trimesh.Trimesh:
    profile = np.array([[0, 0], [0.03, 0], [0.04, 0.08], [0.037, 0.08], [0.027, 0.004], [0, 0.004]])
    mesh = make.revolve(profile, sections=sections)
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces())
    return mesh if mesh.volume > 0 else mesh.invert() or mesh


def rim_fanned(radius: float, height: float, sections: int) -> trimesh.Trimesh:
    """A cylinder whose flat ends are fans about a vertex of the rim, as triangulators without points inside do."""
    angle = np.arange(sections) * 2 * np.pi / sections
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    vertex = np.concatenate([np.column_stack([ring, np.full(sections, z)]) for z in (0, height)])
    face = [[0, k + 1, k] for k in range(1, sections - 1)]
    face += [[sections, sections + k, sections + k + 1] for k in range(1, sections - 1)]
    for k in range(sections):
        after = (k + 1) % sections
        face += [[k, after, sections + after], [k, sections + after, sections + k]]
    return trimesh.Trimesh(vertex, face, process=False)


def hollow_ball() -> trimesh.Trimesh:
    outer, inner = make.uv_sphere(0.05), make.uv_sphere(0.045)
    inner.invert()
    return trimesh.util.concatenate([outer, inner])


ROUND = {
    "cylinder": (make.cylinder(0.05, 0.1), np.pi * 0.05**2 * 0.1),
    "rim fanned": (rim_fanned(0.05, 0.1, 40), np.pi * 0.05**2 * 0.1),
    "cone": (make.cone(0.05, 0.1, sections=40), np.pi * 0.05**2 * 0.1 / 3),
    "tube": (make.annulus(0.03, 0.05, 0.02, sections=64), np.pi * (0.05**2 - 0.03**2) * 0.02),
    "torus": (make.torus(0.05, 0.01), None),
    "ball": (make.uv_sphere(0.05), None),
    "hollow ball": (hollow_ball(), None),
    "cup": (cup(), None),
}


@pytest.mark.parametrize("name", ROUND)
@pytest.mark.parametrize("turned", [False, True])
def test_rings_and_poles_are_found_wherever_the_body_lies(name: str, turned: bool) -> None:
    mesh, volume = ROUND[name]
    mesh = mesh.copy()
    if turned:
        turn = trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.7, 0.1]))
        turn[:3, 3] = (0.1, 0.2, -0.3)
        mesh.apply_transform(turn)
    found = rings.of_shape(as_shape(mesh))
    assert found is not None
    assert found.area_m2 > 0 and np.linalg.det(found.axes) == pytest.approx(1)
    assert found.volume_m3 == pytest.approx(volume, rel=1e-9) if volume else found.volume_m3 > mesh.volume
    assert found.volume_m3 == pytest.approx(mesh.volume, rel=0.03)  # facets lie within the circle
    local = (mesh.vertices - found.centre_m) @ found.axes
    flat = np.stack([np.hypot(local[:, 0], local[:, 1]), local[:, 2]], axis=1)
    away = np.linalg.norm(flat[:, None] - found.outline_m, axis=2).min(axis=1)
    assert away.max() < 1e-6


def test_a_hollow_ball_is_a_half_ring_of_two_axial_sides() -> None:
    found = rings.of_shape(as_shape(hollow_ball()))
    assert found is not None and found.on_axis.sum() == 2


@pytest.mark.parametrize("name", ["bowl", "plate", "tumbler"])
def test_assets_are_bodies_of_revolution(name: str) -> None:
    found = rings.of_shape(read_mesh(ASSETS / f"{name}.obj"))
    assert found is not None and found.on_axis.sum() == 1


def with_spout() -> trimesh.Trimesh:
    mesh = cup()
    rim = np.flatnonzero(
        (mesh.vertices[:, 2] > 0.07) & (np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0]) ** 2 < 0.04)
    )
    assert len(rim) >= 4
    mesh.vertices[rim, 0] += 0.004
    return mesh


def with_handle() -> trimesh.Trimesh:
    handle = make.torus(0.02, 0.004)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle.apply_translation([0.05, 0, 0.04])
    return trimesh.util.concatenate([cup(), handle])


def dented() -> trimesh.Trimesh:
    mesh = make.annulus(0.03, 0.05, 0.02, sections=64)
    mesh.vertices[5] *= 1.01
    return mesh


@pytest.mark.parametrize(
    "mesh",
    [
        make.cylinder(0.05, 0.1, sections=6),
        make.annulus(0.03, 0.05, 0.02, sections=8),
        make.box((0.1, 0.1, 0.02)),
        make.box((0.4, 0.3, 0.003)),
        make.box((0.32, 0.24, 0.002)),
        dented(),
        with_spout(),
        with_handle(),
    ],
    ids=["hexagon", "octagon", "box", "sheet", "foil", "dented", "spout", "handle"],
)
def test_what_is_not_round_is_none(mesh: trimesh.Trimesh) -> None:
    assert rings.of_shape(as_shape(mesh)) is None


def test_a_surface_with_a_hole_is_none() -> None:
    mesh = cup()
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    assert rings.of_shape(as_shape(mesh)) is None


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (Shape("sphere", [0.05, 0, 0]), 4 / 3 * np.pi * 0.05**3),
        (Shape("cylinder", [0.05, 0.1, 0]), np.pi * 0.05**2 * 0.1),
        (Shape("capsule", [0.05, 0.1, 0]), np.pi * 0.05**2 * 0.1 + 4 / 3 * np.pi * 0.05**3),
    ],
)
def test_named_shapes_have_their_outline_without_a_mesh(shape: Shape, volume: float) -> None:
    found = rings.of_shape(shape)
    assert found is not None and found.volume_m3 == pytest.approx(volume, rel=1e-4)


def curvature_of(outline: Array, at: float) -> Array:
    side = np.arange(len(outline))
    return rings.BodyOfRevolution(outline, np.eye(3), np.zeros(3)).curvature_per_m(side, np.full(len(side), at))


def test_corners_do_not_count_as_curvature() -> None:
    angle = np.linspace(-np.pi / 2, np.pi / 2, 65)
    arc = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    arc[[0, -1], 0] = 0
    for at in (0.2, 0.5, 0.8):
        assert curvature_of(arc, at)[:-1] == pytest.approx(10, rel=1e-3)
        assert (curvature_of(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), at) == 0).all()


def test_a_bend_is_as_long_as_its_shorter_side() -> None:
    lid = np.array([[0, 0], [1, 0], [1.1, 0.02], [1.1, 0.1], [0, 0.1]])
    assert curvature_of(lid, 0.5)[0] == 0 and curvature_of(lid, 0.99)[0] > 0


def as_cad_writes_it(profile_m: list[tuple[float, float]], side_m: float) -> trimesh.Trimesh:
    """A revolved profile, its surface triangulated by a mesher that knows nothing of rings."""
    from netgen.meshing import MeshingStep
    from netgen.occ import Axis, Face, OCCGeometry, Segment, Wire, Z, gp_Pnt

    ends = zip(profile_m, profile_m[1:] + profile_m[:1], strict=True)
    sides = [Segment(gp_Pnt(a[0], 0, a[1]), gp_Pnt(b[0], 0, b[1])) for a, b in ends]
    solid = Face(Wire(sides)).Revolve(Axis((0, 0, 0), Z), 360)
    made = OCCGeometry(solid).GenerateMesh(maxh=side_m, perfstepsend=MeshingStep.MESHSURFACE)
    face = [[v.nr - 1 for v in one.vertices] for one in made.Elements2D()]
    mesh = trimesh.Trimesh([list(one.p) for one in made.Points()], face)
    return mesh if mesh.volume > 0 else mesh.invert() or mesh


def pappus(profile_m: list[tuple[float, float]]) -> float:
    (r, z), (s, t) = np.array(profile_m).T, np.roll(profile_m, -1, axis=0).T
    return abs(float((np.pi / 3 * (r + s) * (r * t - s * z)).sum()))


CAN = [(0.0, 0.0), (0.033, 0.0), (0.033, 0.06), (0.0327, 0.06), (0.0327, 0.0003), (0.0, 0.0003)]
STEM = [(0.0, 0.0), (0.03, 0.0), (0.03, 0.002), (0.012, 0.004), (0.012, 0.05), (0.0, 0.05)]
RING = [(0.03, 0.0), (0.04, 0.0), (0.045, 0.01), (0.03, 0.01)]


@pytest.mark.parametrize("profile", [CAN, STEM, RING], ids=["can", "stem", "ring"])
def test_any_triangulation_of_a_round_body_has_its_outline(profile: list[tuple[float, float]]) -> None:
    mesh = as_cad_writes_it(profile, 0.003)
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.6, 0.8]))
    turn[:3, 3] = (0.1, -0.2, 0.3)
    mesh.apply_transform(turn)
    found = rings.of_shape(as_shape(mesh))
    assert found is not None
    assert found.volume_m3 == pytest.approx(pappus(profile), rel=1e-6)
    assert np.abs(found.axes[:, 2] @ turn[:3, 2]) == pytest.approx(1, abs=1e-9)
    assert np.linalg.norm(np.cross(found.centre_m - turn[:3, 3], turn[:3, 2])) < 1e-8


def test_the_axis_is_the_surface_s_where_triangles_pull_the_centre_aside() -> None:
    mesh = as_cad_writes_it(STEM, 0.003)
    centre = mesh.center_mass
    found = rings.of_shape(as_shape(mesh))
    assert found is not None and np.hypot(*centre[:2]) > 1e-7
    assert np.hypot(*found.centre_m[:2]) < 1e-9


def test_a_ball_of_any_triangulation_is_one() -> None:
    found = rings.of_shape(as_shape(make.icosphere(3, 0.05)))
    assert found is not None and found.volume_m3 == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.01)


def test_a_dent_in_any_triangulation_is_seen() -> None:
    mesh = as_cad_writes_it(STEM, 0.003)
    wall = np.abs(mesh.vertices[:, 2] - 0.02) + 10 * np.abs(np.hypot(*mesh.vertices[:, :2].T) - 0.012)
    mesh.vertices[np.argmin(wall), :2] *= 0.99
    assert rings.of_shape(as_shape(mesh)) is None
