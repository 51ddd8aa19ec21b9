"""What a body may cost is counted before it is solved, and no clock decides what it is filled with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh

import sonic_bullet as sb
from sonic_bullet.modal import cost
from sonic_bullet.modal.elements import Elements
from sonic_bullet.modal.first_elements import fill_with_elements
from sonic_bullet.modal.meshing.filling import LATTICE_TETS, Filler
from sonic_bullet.modal.meshing.shape_meshes import FilledBody, fill
from sonic_bullet.modal.meshing.surfaces import prepare_surface
from sonic_bullet.modal.meshing.tetrahedra import EndlessError
from sonic_bullet.modal.modal_analysis import _scale_free_key
from sonic_bullet.modal.sectors import WantedModes
from sonic_bullet.records import Shape
from sonic_bullet.records.errors import MeshError
from sonic_bullet.records.modal_options import ModalOptions


def shape(mesh: trimesh.Trimesh) -> Shape:
    return Shape("mesh", vertex_m=np.array(mesh.vertices, float), face=np.array(mesh.faces, np.int32))


def ball(subdivisions: int = 3) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions, 0.1)


def lump() -> Shape:
    """Uneven, 5120 triangles."""
    made = ball(4)
    x, y, _ = np.array(made.vertices).T / 0.1
    return shape(trimesh.Trimesh(made.vertices * (1 + 0.15 * np.sin(18 * x) * np.cos(4 * y))[:, None], made.faces))


def dish(around: int = 64, rings: int = 40) -> Shape:
    """An elliptic plate with a turned rim, 3 mm on 0.5 m, 10 368 triangles."""
    s, angle = np.arange(1, rings + 1) / rings, 2 * np.pi * np.arange(around) / around
    r, z = 0.25 * np.minimum(1.1 * s, 1), -0.3 * np.maximum(s - 1 / 1.1, 0)
    ring = np.stack(
        [1.05 * np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle)), np.outer(z, np.ones(around))], axis=-1
    )
    top = np.concatenate([np.zeros((1, 3)), ring.reshape(-1, 3)])
    k, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = 1 + k * around + j, 1 + k * around + (j + 1) % around
    c, d = a + around, b + around
    fan = np.stack([np.zeros(around, int), 1 + np.arange(around), 1 + (np.arange(around) + 1) % around], axis=1)
    sides = [np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, c, d), (a, d, b))]
    sheet = trimesh.Trimesh(top, np.concatenate([fan, *sides]), process=False)
    thick = prepare_surface(np.array(sheet.vertices), np.array(sheet.faces), 0.003)
    return Shape("mesh", vertex_m=thick.vertex_m, face=thick.face.astype(np.int32))


def crossing(around: int = 24, layers: int = 5) -> Shape:
    """A tube like an eight, 0.2 m, open: its wall passes through itself, which Netgen fills by no means."""
    t = 2 * np.pi * (np.arange(around) + 0.5) / around
    flat = 0.1 * np.stack([np.sin(t), np.sin(t) * np.cos(t)], axis=1)
    z = np.linspace(0, 0.2, layers)
    vertex = np.concatenate([np.column_stack([flat, np.full(around, h)]) for h in z])
    k, j = np.meshgrid(np.arange(layers - 1), np.arange(around), indexing="ij")
    a, b = k * around + j, k * around + (j + 1) % around
    face = np.concatenate(
        [np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, b + around), (a, b + around, a + around))]
    )
    return Shape("mesh", vertex_m=vertex, face=face.astype(np.int32))


def elements(body: Shape, material: str) -> Elements:
    of = _scale_free_key((body,), sb.load_material(material), ModalOptions(20_000.0, None, (), None, 0.01), None)
    place = (None, of.solid)
    wanted = WantedModes(of.limit, 200)
    return fill_with_elements((body,), of.length_m, of.stiffness, wanted, of.clamp, (None, None), place)


@cache
def crossing_of_wood() -> Elements:
    """Filled once for all that ask what becomes of it."""
    return elements(crossing(), "wood")


@pytest.mark.parametrize(
    ("body", "material"),
    [
        pytest.param(lump, "glass", marks=pytest.mark.slow),
        pytest.param(dish, "steel", marks=pytest.mark.slow),
        (crossing, "wood"),
    ],
)
def test_no_body_costs_more_than_allowed(body: Callable[[], Shape], material: str) -> None:
    one = crossing_of_wood() if body is crossing else elements(body(), material)
    two = elements(body(), material)
    assert one.solid.node_m.tobytes() == two.solid.node_m.tobytes()
    unknowns = 3 * len(one.nodes.node_m)
    assert unknowns > 2_000 and cost.work(unknowns, one.modes, one.degree, one.thin) <= cost.MOST_WORK


def test_walls_that_nobody_gave_are_as_thick_in_a_draft() -> None:
    """Two hundredths of the diagonal, whatever fills them: thicker ones stand for them, and bend as they do."""
    made = crossing_of_wood().body.solid
    assert "bending as they do" in made.note and len(made.tet) < 1.5 * LATTICE_TETS
    walls = [
        float(x.note.split("given a wall of ")[1].split(" m")[0])
        for x in (made, fill((crossing(),), 0.05, None, filler="draft").solid)
    ]
    assert walls[0] == walls[1] == pytest.approx(0.02 * np.linalg.norm(np.ptp(crossing().vertex_m, axis=0)), rel=0.01)


@pytest.mark.slow
def test_walls_that_somebody_gave_keep_their_bending_and_mass() -> None:
    made = fill((crossing(),), None, 0.001).solid
    assert "walls of 0.001 m" in made.note and "bending as they do" in made.note and made.thickened > 1


@pytest.mark.parametrize("gap_m", [0.0, 1e-5, 1e-4])
def test_what_lacks_but_its_seams_is_a_solid(gap_m: float) -> None:
    """As CAD programs write patches: none shares an edge with its neighbour."""
    mesh = ball()
    corner = mesh.vertices[mesh.faces] - gap_m * mesh.face_normals[:, None]
    corner = corner + 1e-6 * np.arange(len(corner))[:, None, None] / len(corner)  # no two corners at one place
    skin = prepare_surface(corner.reshape(-1, 3), np.arange(3 * len(corner)).reshape(-1, 3), None)
    assert skin.note == "; holes filled"


@pytest.mark.parametrize(("height", "solid"), [(0.95, True), (0.8, False), (0.0, False)])
def test_a_hole_of_more_than_a_twentieth_makes_a_shell(height: float, *, solid: bool) -> None:
    mesh = ball(4)
    kept = mesh.faces[mesh.triangles_center[:, 2] < 0.1 * height]
    skin = prepare_surface(np.array(mesh.vertices), np.array(kept), None)
    assert (skin.note == "; holes filled") == solid and skin.guessed != solid


def test_what_a_clock_ended_is_an_error_and_chooses_nothing() -> None:
    one = crossing_of_wood()

    def ended(edge_m: float, filler: Filler) -> FilledBody:
        raise EndlessError("Netgen did not come to an end", "give a simpler mesh")

    def refused(edge_m: float, filler: Filler) -> FilledBody:
        raise MeshError("Netgen failed", "give a simpler mesh")

    with pytest.raises(EndlessError):
        replace(one, at_size=ended).within(1.0)
    assert replace(one, at_size=refused).within(1.0).body is one.body


@pytest.mark.parametrize("spare", [-1.0, 0.0, 1e-9, 1.0])
def test_nothing_finer_is_made_of_no_work(spare: float) -> None:
    assert replace(crossing_of_wood(), spare=spare).finer() is None
