"""What has modes radiates: no surface is refused, cavities do not sound, and what stands for a near field is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonic_bullet.files.presets import load_material
from sonic_bullet.modal import analyse
from sonic_bullet.radiation import compact, far_field, near_mesh, radiated
from sonic_bullet.radiation.entrained_mass import PotentialMap, moved_air
from sonic_bullet.records import Air, Array, ModalModel, Shape
from tests.few_cases import parametrize_few
from tests.made.models import STEEL, box_model


def tube(inner_m: float, outer_m: float, height_m: float, sides: int) -> Shape:
    made = trimesh.creation.annulus(r_min=inner_m, r_max=outer_m, height=height_m, sections=sides)
    return Shape("mesh", vertex_m=np.array(made.vertices), face=np.array(made.faces))


TUBES = {
    "as given": tube(0.025, 0.028, 0.12, 32),
    "a millimetre thin": tube(0.025, 0.026, 0.12, 48),
    "long": tube(0.01, 0.011, 0.3, 24),
    "a ring of sheet": tube(0.058, 0.06, 0.02, 64),
}


@pytest.mark.slow
@parametrize_few("material", ["glass", "plastic", "wood", "steel"], 1)
@pytest.mark.parametrize("name", TUBES)
def test_a_tube_radiates_in_every_material(name: str, material: str) -> None:
    model = analyse((TUBES[name],), load_material(material), count=6)
    weight, damping, note = far_field.radiation_and_note(model, Air())
    assert np.isfinite(weight).all() and (np.abs(weight) > 0).all() and (damping > 0).all()
    assert note in ("", compact.COMPACT)


@pytest.mark.parametrize(("size", "degree"), [(0.05, 0), (0.05, 1), (0.2, 1), (0.2, 2)])
def test_the_compact_law_is_the_spheres_own(size: float, degree: int) -> None:
    """A sphere that breathes, moves or turns oval: what the law is made of, and so the near field's figures."""
    ball = trimesh.creation.icosphere(3, size)
    vertex, face = np.array(ball.vertices), np.array(ball.faces)
    shape = [vertex / size, np.tile([0.0, 0, 1], (len(vertex), 1)), vertex / size * [1, -1, 0]][degree][:, :, None]
    freq = np.array([300.0])
    model = ModalModel(freq, np.array([1.0]), shape, vertex, face, np.zeros(len(face)), 1e-3, 1.0)
    found = far_field.radiation(model, Air())[0]
    corner = vertex[face]
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(twice, axis=1) / 2
    k = 2 * np.pi * freq / Air().sound_speed_m_s
    law = compact.compact_weight(model, face, area, twice / (2 * area[:, None]), k, Air())
    assert np.abs(law) == pytest.approx(np.abs(found), rel=0.05)


def nested(outer: trimesh.Trimesh, inner: trimesh.Trimesh, motion: np.ndarray) -> tuple[ModalModel, ModalModel]:
    """A body with a cavity, and the same without it."""
    made = []
    for meshes in ((outer, inner), (outer,)):
        vertex = np.concatenate([m.vertices for m in meshes])
        face = np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)][: len(meshes)])
        shape = (vertex @ motion)[:, :, None]
        made.append(ModalModel(np.array([900.0]), np.array([1.0]), shape, vertex, face, np.zeros(len(face)), 1e-3, 1.0))
    return made[0], made[1]


@parametrize_few(
    ("outer", "inner"),
    [
        (trimesh.creation.icosphere(2, 0.1), trimesh.creation.icosphere(2, 0.09)),
        (trimesh.creation.box((0.2, 0.1, 0.05)).subdivide().subdivide(), trimesh.creation.box((0.18, 0.08, 0.03))),
        (trimesh.creation.cylinder(0.05, 0.2), trimesh.creation.cylinder(0.045, 0.19)),
    ],
    1,
)
def test_a_cavity_is_not_heard(outer: trimesh.Trimesh, inner: trimesh.Trimesh) -> None:
    """Nested shells: the air inside is shut in, and its near field has no answer ("Singular matrix")."""
    motion = np.diag([1.0, -1.0, 0.0])
    both, alone = nested(outer, inner, motion)
    for found, wanted in zip(far_field.radiation(both, Air()), far_field.radiation(alone, Air()), strict=True):
        assert np.abs(found) == pytest.approx(np.abs(wanted), rel=1e-6)


def test_faces_that_all_look_inward_sound_as_the_body_they_are() -> None:
    model = box_model((0.2, 0.1, 0.01), (740.0, 1230.0, 2950.0), STEEL)
    turned = replace(model, face=model.face[:, ::-1])
    assert np.abs(far_field.radiation(turned, Air())[0]) == pytest.approx(np.abs(far_field.radiation(model, Air())[0]))


def test_panels_that_lie_twice_fall_to_the_law_and_it_is_told(tmp_path: Path) -> None:
    """A box all of whose faces lie twice: no near field, whatever its triangles."""
    model = box_model((0.2, 0.1, 0.01), (740.0, 1230.0, 2950.0), STEEL)
    twice = replace(model, face=np.concatenate([model.face, model.face]), curvature_per_m=np.zeros(2 * len(model.face)))
    for _ in range(2):  # computed, and kept
        radiated.radiation_and_note.cache_clear()
        weight, damping, note = radiated.radiation_and_note(twice, Air(), tmp_path)
        assert note == compact.COMPACT and np.isfinite(weight).all() and (damping > 0).all()


def thin_bowl(radius_m: float = 0.08, wall_m: float = 0.0008) -> Shape:
    """A half sphere of sheet with both its sides; its wall is a third of how far chords of 1 cm stand off."""
    angle = np.linspace(0, np.pi / 2, 24)[1:]
    round_off = np.c_[np.sin(angle), -np.cos(angle)]
    outer, inner = radius_m * round_off, (radius_m - wall_m) * round_off
    ends = np.array([[0, -radius_m]]), np.array([[0, wall_m - radius_m]])
    made = trimesh.creation.revolve(np.concatenate([ends[0], outer, inner[::-1], ends[1]]), sections=48)
    return Shape("mesh", vertex_m=np.array(made.vertices), face=np.array(made.faces))


def test_a_thin_bowl_hardly_radiates_below_coincidence() -> None:
    """Steel of 0.8 mm coincides at 15 kHz. Taken as compact, it lost in 0.2 s at 1 kHz what it keeps for seconds."""
    model = analyse((thin_bowl(),), load_material("steel"), count=10)
    weight, damping, note = far_field.radiation_and_note(model, Air())
    corner, face = far_field.sound_faces(model)
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(twice, axis=1) / 2
    k = 2 * np.pi * model.freq_hz / Air().sound_speed_m_s
    law = compact.compact_weight(model, face, area, twice / (2 * area[:, None]), k, Air())
    assert note == ""
    assert (np.abs(weight) < 0.3 * np.abs(law))[model.freq_hz > 500].all()
    assert (damping > 0).all()


def test_a_thickened_plate_radiates_as_it_does() -> None:
    model = analyse((Shape("box", size_m=np.array([0.25, 0.2, 0.0015])),), load_material("steel"), count=12)

    def thickened(corner: Array, area: Array, normal: Array, _least: int) -> tuple[PotentialMap, Array] | None:
        coarse, nearest = near_mesh.near_mesh(corner, area, normal, 700, near_mesh.THICKENED)
        moved = moved_air(coarse)
        return None if moved is None else (moved, nearest)

    own, moved = far_field.radiation(model, Air())[1], far_field.radiation_and_note(model, Air(), thickened)[1]
    assert np.median(np.abs(10 * np.log10(moved / own))) < 1.5


def two_boxes() -> trimesh.Trimesh:
    """Their surfaces pass through each other."""
    one, other = trimesh.creation.box((0.1, 0.03, 0.03)), trimesh.creation.box((0.03, 0.1, 0.02))
    other.apply_translation((0.02, 0.01, 0.003))
    return trimesh.util.concatenate([one, other])


def open_bowl(radius_m: float = 0.05) -> trimesh.Trimesh:
    """A half sphere of sheet: no volume."""
    angle = np.linspace(0.15, np.pi / 2, 10)
    return trimesh.creation.revolve(radius_m * np.c_[np.sin(angle), 1 - np.cos(angle)], sections=24)


def spoon() -> trimesh.Trimesh:
    """A bowl of sheet that passes through its handle."""
    handle = trimesh.creation.box((0.1, 0.008, 0.003))
    handle.apply_translation((0.065, 0, 0.02))
    return trimesh.util.concatenate([open_bowl(0.02), handle])


PANDA = "franka_panda/meshes/collision"
SURFACES = {
    "two boxes through each other": two_boxes,
    "a racing car's wheel": "racecar/meshes/left_rear_wheel.obj",
    "Panda's finger": f"{PANDA}/finger.obj",
    "Panda's link1": f"{PANDA}/link1.obj",
}
SLOW = {
    "a spoon": spoon,
    "an open bowl": open_bowl,
    "Husky's wheel": "husky/meshes/wheel.stl",
    "a bicycle's wheel": "bicycle/files/wheel_scaled.stl",
    "Panda's hand": f"{PANDA}/hand.obj",
    **{f"Panda's link{i}": f"{PANDA}/link{i}.obj" for i in (0, 2, 3, 4, 5, 6, 7)},
}


@pytest.mark.parametrize("name", [*SURFACES, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_surfaces_that_others_made_radiate_in_wood(name: str) -> None:
    """Some are open, some pass through themselves: what has modes has a weight and a loss."""
    made = {**SURFACES, **SLOW}[name]
    if isinstance(made, str):
        pybullet_data = pytest.importorskip("pybullet_data")
        mesh = trimesh.load(Path(pybullet_data.getDataPath(), made), force="mesh")
    else:
        mesh = made()
    shape = Shape("mesh", vertex_m=np.array(mesh.vertices), face=np.array(mesh.faces))
    model = analyse((shape,), load_material("wood"), count=6)
    weight, damping, note = far_field.radiation_and_note(model, Air())
    assert model.mode_count == 6 and note in ("", compact.COMPACT)
    assert np.isfinite(weight).all() and (np.abs(weight) > 0).all() and (damping > 0).all()
