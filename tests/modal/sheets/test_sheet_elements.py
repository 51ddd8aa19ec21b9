"""Sheets by wedges: closed forms, what wedges hold exactly, what a sheet is."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sonic_bullet import geometry
from sonic_bullet.modal import analyse
from sonic_bullet.modal.meshing.prisms import triangulate_polygons
from sonic_bullet.modal.sheets import wedges
from sonic_bullet.modal.sheets.sheet_sides import sides_of
from sonic_bullet.modal.sheets.strips import with_strips
from sonic_bullet.modal.sheets.wedges import Layer
from sonic_bullet.records import Array, Material, Shape, isotropic_stiffness_pa
from studies.thin_walls import shell_formulas as shells

STEEL = Material.isotropic("steel", youngs_pa=210e9, poisson=0.3, density_kg_m3=7850.0)


def _tube(radius_m: float, wall_m: float, length_m: float, sides: int, *, dent: float = 0.0) -> Shape:
    """Open tube of flat faces, one corner of its outer side moved outward by dent: no body of revolution any more."""
    rows = 5
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    up = np.linspace(0, length_m, rows)
    vertex = np.concatenate(
        [[r, r, 0] * ring + [0, 0, z] for r in (radius_m + wall_m / 2, radius_m - wall_m / 2) for z in up]
    )
    vertex[sides // 3 + 2 * sides] *= [1 + dent, 1 + dent, 1]

    def band(low: int, high: int) -> Array:
        k = np.arange(sides)
        n = (k + 1) % sides
        return np.concatenate(
            [np.stack([low + k, low + n, high + n], axis=1), np.stack([low + k, high + n, high + k], axis=1)]
        )

    at = [sides * k for k in range(2 * rows)]
    face = [band(at[k], at[k + 1]) for k in range(rows - 1)]
    face += [band(at[rows + k], at[rows + k + 1])[:, ::-1] for k in range(rows - 1)]
    face += [band(at[rows], at[0]), band(at[rows - 1], at[2 * rows - 1])]
    return Shape("mesh", vertex_m=vertex, face=np.concatenate(face).astype(np.int32))


def _perforated(columns: int, rows: int, pitch_m: float, wall_m: float) -> tuple[Shape, float]:
    """Plate with round holes of 42 sides, half a pitch wide, and the area of its holes."""
    hole = 2 * np.pi * np.arange(42) / 42
    ring = 0.25 * pitch_m * np.stack([np.cos(hole), -np.sin(hole)], axis=1)
    wide, high = columns * pitch_m, rows * pitch_m
    loops = [np.array([[0, 0], [wide, 0], [wide, high], [0, high]])]
    loops += [ring + pitch_m * (np.array([i, j]) + 0.5) for i in range(columns) for j in range(rows)]
    holes = columns * rows * 21 * np.sin(2 * np.pi / 42) * (0.25 * pitch_m) ** 2
    made = triangulate_polygons(loops, wide * high - holes, pitch_m)
    assert made is not None
    flat, three = made
    a, b, c = (flat[three[:, k]] for k in range(3))
    turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    three = np.where(turned[:, None], three[:, [0, 2, 1]], three)
    n = len(flat)
    edge = np.stack([three, np.roll(three, -1, axis=1)], axis=-1).reshape(-1, 2)
    rim = edge[~np.isin(edge[:, 0] * n + edge[:, 1], edge[:, 1] * n + edge[:, 0])]
    below, above = rim[:, 0], rim[:, 1]
    face = np.concatenate(
        [three + n, three[:, ::-1], np.stack([below, above, above + n], 1), np.stack([below, above + n, below + n], 1)]
    )
    vertex = np.concatenate([np.column_stack([flat, np.full(n, z)]) for z in (0.0, wall_m)])
    return Shape("mesh", vertex_m=vertex, face=face.astype(np.int32)), holes


def _flat_layer(turned: Array) -> Layer:
    """Square of two wedges with bent edges inside, turned in space."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    middle = np.array([[0.5, 0, 0], [1, 0.5, 0], [0.55, 0.45, 0], [0.5, 1, 0], [0, 0.5, 0]])
    outer = np.concatenate([corner, middle])
    six = np.array([[0, 1, 2, 4, 5, 6], [0, 2, 3, 6, 7, 8]])
    return Layer(outer @ turned.T, (outer - [0, 0, 0.1]) @ turned.T, six)


@pytest.mark.parametrize("degrees", [(2, 2), (3, 2), (3, 3)])
def test_wedges_hold_rigid_motions_and_uniform_strain_exactly(degrees: tuple[int, int]) -> None:
    turned, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    turned *= np.sign(np.linalg.det(turned))
    layer = _flat_layer(turned)
    nodes = wedges.field(layer, *degrees)
    tensor = isotropic_stiffness_pa(1.0, 0.3)
    stiff, mass = wedges.assemble(layer, nodes, tensor, 2.0)
    x = nodes.node_m
    spun = np.cross([0.3, -0.2, 0.5], x) + np.arange(3)
    assert np.abs(stiff @ spun.ravel()).max() < 1e-12
    strain = np.array([[0.2, 0.1, 0.0], [0.1, -0.3, 0.4], [0.0, 0.4, 0.5]])
    voigt = np.array([0.2, -0.3, 0.5, 0.8, 0.0, 0.2])
    stretched = (x @ strain).ravel()
    assert stretched @ (stiff @ stretched) == pytest.approx(0.1 * voigt @ tensor @ voigt, rel=1e-12)
    along = np.tile([1.0, 0, 0], len(x))
    assert along @ (mass @ along) == pytest.approx(0.2, rel=1e-12)
    assert wedges.volume(layer) == pytest.approx(0.1, rel=1e-12)


@pytest.mark.slow
def test_a_dented_tube_has_the_modes_of_rayleigh() -> None:
    radius, wall, length = 0.04, 2e-4, 0.1
    model = analyse((_tube(radius, wall, length, 96, dent=1e-3),), STEEL, count=4, cache=None)
    assert model.note.startswith("sheet of 0.2 mm")
    flat, tilted = (
        shells.free_cylinder_hz(radius, wall, length, 210e9, 0.3, 7850.0, 2, tilting=tilting)
        for tilting in (False, True)
    )
    assert model.freq_hz[:4] == pytest.approx([flat, flat, tilted, tilted], rel=0.01)


@pytest.mark.slow
def test_a_plate_of_many_holes_states_an_error_within_what_is_asked() -> None:
    shape, holes = _perforated(4, 4, 0.02, 0.002)
    model = analyse((shape,), STEEL, count=3, cache=None)
    assert model.volume_m3 == pytest.approx(0.002 * (0.08 * 0.08 - holes), rel=1e-3)
    told = re.search(r"error up to \d+ Hz (?:about|under) ([\d.e-]+) %", model.note)
    assert told is not None
    assert float(told[1]) < 1


def test_strips_follow_creases_and_leave_the_area_as_it_is() -> None:
    """A sheet folded along a line: two strips a side, at the widths asked for."""
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(0, 1, 4))
    corner = np.stack([np.minimum(x, 0), y, np.maximum(x, 0)], axis=-1).reshape(-1, 3)
    k = np.array([5 * j + i for j in range(3) for i in range(4)])
    triangle = np.concatenate([np.stack([k, k + 1, k + 6], axis=1), np.stack([k, k + 6, k + 5], axis=1)])
    crease = np.array([[2 + 5 * j, 7 + 5 * j] for j in range(3)])
    area = geometry.face_areas_m2(corner, triangle).sum()
    made = with_strips(corner, triangle, crease, [0.08, 0.02])
    assert geometry.face_areas_m2(made.corner_m, made.triangle).sum() == pytest.approx(area, rel=1e-12)
    assert len(made.triangle) == len(triangle) + 2 * 2 * 2 * 3
    beside = np.unique(np.round(np.linalg.norm(made.corner_m[:, [0, 2]], axis=1), 9))
    assert set(beside) >= {0.0, 0.02, 0.08}
    assert len(made.strip) == 12


def test_a_sheet_has_two_sides_and_a_lump_or_a_rib_has_none() -> None:
    tube = _tube(0.04, 2e-4, 0.1, 48)
    sides = sides_of(np.asarray(tube.vertex_m), np.asarray(tube.face))
    assert sides is not None
    assert len(sides.outer) == len(sides.inner) == 8 * 48
    assert sides.wall_m == pytest.approx(np.full(len(sides.wall_m), 2e-4), rel=0.01)
    thick = _tube(0.04, 0.04, 0.1, 48)
    assert sides_of(np.asarray(thick.vertex_m), np.asarray(thick.face)) is None
