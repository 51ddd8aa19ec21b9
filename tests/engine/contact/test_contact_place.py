"""Contacts on true surfaces: faces, edges, modes; closed forms of what two bodies are to each other there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sonic_bullet._engine import (
    LONGEST_PULSE_S,
    SHORTEST_PULSE_S,
    add_modal_impulse,
    contact_modulus,
    effective_mass,
    find_contact_points,
    flat_area_m2,
    pulse_length,
)
from sonic_bullet.engine.runtime.tables import ROW
from sonic_bullet.geometry import closest_point
from sonic_bullet.records import TouchedSurface
from tests.made.models import GLASS, STEEL, ball_body, box_body, box_model, wall_body
from tests.made.stages import body_table

EDGES_M = (0.3, 0.2, 0.1)


def rows_at(point: Any, outward: Any, push: Any = (0, 0, 0), body: int = 0, other: int = 1) -> np.ndarray:
    """One row that touches ``body`` on side 0."""
    rows = np.zeros(1, ROW)
    rows["body"], rows["point_m"], rows["local_impulse_n_s"] = (body, other), point, push
    rows["outward"] = np.asarray(outward) / np.linalg.norm(outward)
    return rows


def test_touch_is_the_nearest_point_and_is_found_once() -> None:
    body = box_body(EDGES_M, (500.0, 900.0))
    table = body_table((body, wall_body()))
    assert body.model is not None
    rng = np.random.default_rng(0)
    for _ in range(50):
        rows = rows_at(rng.uniform(-0.15, 0.15, 3), rng.normal(size=3))
        find_contact_points(rows, table)
        _, weight, _ = closest_point(body.model.vertex_m, body.model.face, rows["point_m"][:, 0], rows["outward"][:, 0])
        vertex = table.faces["vertex"][rows["face"][0, 0]]
        assert rows["barycentric"][0, 0] == pytest.approx(weight[0], abs=0)
        assert rows["face"][0, 1] == -1 and not rows["barycentric"][0, 1].any()
        assert (np.sort(vertex) < 8).all() and rows["touched"][0] == 1
    before = rows.copy()
    rows["point_m"] = 7.0
    find_contact_points(rows, table)
    assert (rows["face"] == before["face"]).all() and (rows["barycentric"] == before["barycentric"]).all()


def test_faces_are_flat_edges_are_broken_and_a_sphere_is_round_everywhere() -> None:
    table = body_table((box_body(EDGES_M, (500.0,)), ball_body(0.03, body_id=1)))
    size = np.cbrt(np.prod(EDGES_M))
    for outward, bent in (((0, 0, 1), 0.0), ((0, 0.3, 1), 0.0), ((0, 0.5, 1), 1 / (0.005 * size))):
        rows = rows_at((0.05, 0.0, 0.05), outward)
        find_contact_points(rows, table)
        assert rows["curvature_per_m"][0] == pytest.approx([bent, 1 / 0.03])


def test_the_given_surface_says_whether_an_edge_is_touched() -> None:
    """Elements whose top leans by 34° where the body's is level; the place of the force on the modes stays theirs."""
    body = box_body(EDGES_M, (500.0,))
    model = body.model
    assert model is not None
    leans = np.array(model.vertex_m)
    leans[model.vertex_m[:, 0] > 0, 2] -= 0.2  # the top falls by 0.2 m over 0.3 m
    given = TouchedSurface(model.vertex_m, model.face, np.full(len(model.face), 0.07))
    coarse = replace(model, vertex_m=leans)
    rows = rows_at((0.05, 0.0, 0.0), (0, 0, 1))
    bent, face = [], []
    for one in (coarse, replace(coarse, touched=given)):
        table, row = body_table((replace(body, model=one), wall_body())), rows.copy()
        find_contact_points(row, table)
        bent.append(row["curvature_per_m"][0, 0])
        face.append(row["face"][0, 0])
    assert bent == pytest.approx([table.bodies["edge_per_m"][0], 0.07])
    assert face[0] == face[1]


def test_pushes_are_the_shapes_linear_in_the_triangle_times_the_force() -> None:
    """Uᵀj with lines that follow modes 1 and 0; the box shares its model with another that comes later."""
    from sonic_bullet.engine.bank.resonator import build_resonator
    from sonic_bullet.engine.runtime.body_table import BodyTable
    from sonic_bullet.records import Air

    body, follows = box_body(EDGES_M, np.linspace(300, 9000, 21)), np.array([1, 0])
    resonator, table = build_resonator(body, (), 48_000, Air()), BodyTable()
    wall = build_resonator(wall_body(), (), 48_000, Air())
    for one, lines in ((wall, follows[:0]), (resonator, follows), (resonator, follows[:0]), (resonator, follows)):
        table.add(one, lines, 0)
    assert len(table.faces) == 2 * 12  # with lines and without
    assert table.bodies["shape_at"][1] == table.bodies["shape_at"][3] != table.bodies["shape_at"][2]
    rows = rows_at((0.04, -0.02, 0.05), (0, 0, 1), (0.2, -1.0, 3.0), body=3, other=0)
    find_contact_points(rows, table)
    face, weight = table.faces[table.bodies["face_at"][3] + rows["face"][0, 0]], rows["barycentric"][0, 0]
    expected = np.einsum(
        "c,cxm,x->m", weight, resonator.shape[face["vertex"]].astype(float), rows["local_impulse_n_s"][0, 0]
    )
    out = np.ones(table.columns)
    add_modal_impulse(rows, 0, 0, 0.5, table, out)
    assert out[:21] == pytest.approx(1 + 0.5 * expected, rel=1e-12)
    assert (out[21:] == out[follows]).all()
    add_modal_impulse(rows, 0, 1, 0.5, table, out[:0])  # a wall has no modes


def test_a_table_grows_and_what_was_in_it_stays() -> None:
    bodies = [box_body(EDGES_M, np.linspace(300, 9000, 3 + i), body_id=i) for i in range(9)]
    one, all_ = body_table(bodies[:1]), body_table(bodies)
    for name in ("bodies", "faces", "nodes", "shapes", "frequency_hz"):
        few, many = getattr(one, name), getattr(all_, name)
        assert few.tobytes() == many[: len(few)].tobytes()
        assert many.flags.c_contiguous and many.flags.writeable
    for i, body in enumerate(bodies):
        row = all_.bodies[i]
        assert body.model is not None
        shape = all_.shapes[row["shape_at"] :][: 24 * (3 + i)].reshape(8, 3, 3 + i)
        assert (shape == body.model.shape).all()
        assert all_.frequency_hz[row["frequency_at"] :][: 3 + i] == pytest.approx(
            body.model.freq_hz, rel=1e-4
        )  # radiation detunes them
        assert sorted(all_.faces["vertex"][row["face_at"] :][:12].tolist()) == sorted(body.model.face.tolist())


def test_effective_mass_of_closed_forms() -> None:
    ball, heavy = ball_body(0.1, mass_kg=2.0), ball_body(0.1, body_id=1, mass_kg=2.0)
    point = ball_body(0.1, body_id=3, mass_kg=2.0)
    bodies = body_table((ball, heavy, wall_body(), point)).bodies
    bodies["inertia_kg_m2"][3] = 0.0
    zero, arm = np.zeros(3), np.array([0.0, 0.1, 0.0])
    turned = np.random.default_rng(1).normal(size=(4, 4))
    up, across = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])

    def mass(high: int, normal: np.ndarray, low: int = 0) -> float:
        return effective_mass(bodies, low, high, turned, arm, zero, normal)

    assert mass(2, across) == pytest.approx(2.0)  # through the centre, against a wall
    assert mass(1, across) == pytest.approx(1.0)  # two equal masses
    assert mass(2, up) == pytest.approx(2.0 / 3.5)  # tangential on a sphere: m/(1 + 5/2)
    assert mass(2, up, low=3) == pytest.approx(2.0)  # a point mass does not turn
    assert mass(2, up, low=2) == 0.0  # neither moves


def test_effective_mass_of_a_turned_box() -> None:
    """1/m + (r×n)·R I⁻¹ Rᵀ(r×n), and it does not hang on how the world is turned."""
    body = box_body(EDGES_M, (500.0,))
    bodies = body_table((body, wall_body())).bodies
    rng = np.random.default_rng(2)
    skew = rng.normal(size=(3, 3))
    bodies["inertia_kg_m2"][0] += 0.2 * body.inertia_kg_m2.max() * (skew @ skew.T)
    for _ in range(20):
        q, arm, normal = rng.normal(size=(2, 4)), rng.normal(size=3), rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        turn = Rotation.from_quat(q[0]).as_matrix()
        moment = np.cross(arm, normal)
        inertia = turn @ bodies["inertia_kg_m2"][0] @ turn.T
        expected = 1 / (1 / body.mass_kg + moment @ np.linalg.solve(inertia, moment))
        assert effective_mass(bodies, 0, 1, q, arm, arm, normal) == pytest.approx(expected, rel=1e-12)


def test_flat_contacts_have_the_area_of_their_points() -> None:
    bodies = body_table(
        (box_body(EDGES_M, (500.0,)), box_body((0.1, 0.1, 0.1), (500.0,), body_id=1), wall_body())
    ).bodies
    assert flat_area_m2(bodies, 0, 2, 0.04, 0.0, 0.02) == pytest.approx(np.pi * 0.04**2)
    assert flat_area_m2(bodies, 0, 1, 0.0, 0.0, 0.02) == pytest.approx(np.pi * 0.002**2)  # of the smaller body
    assert flat_area_m2(bodies, 2, 2, 0.0, 0.0, 0.02) == pytest.approx(np.pi * 0.002**2)  # nobody has a size
    assert flat_area_m2(bodies, 0, 1, 0.04, 1.01, 0.02) == 0.0


def test_moduli_in_series() -> None:
    assert contact_modulus(1e11, np.inf) == pytest.approx(1e11)
    assert contact_modulus(np.inf, np.inf) == np.inf
    assert contact_modulus(STEEL.plane_strain_pa, GLASS.plane_strain_pa) == pytest.approx(
        1 / (1 / STEEL.plane_strain_pa + 1 / GLASS.plane_strain_pa)
    )


def test_contact_times_of_closed_forms() -> None:
    tau, flat = pulse_length(0.0329, 4.98e10, 100.0, 0.0, 1.0)
    assert tau == pytest.approx(96.7e-6, rel=1e-3) and not flat
    assert pulse_length(0.0329, 4.98e10, 100.0, 0.0, 0.1)[0] / pulse_length(0.0329, 4.98e10, 100.0, 0.0, 3.2)[
        0
    ] == pytest.approx(2.0)  # v^(-1/5)
    tau, flat = pulse_length(0.5, 1e9, -3.0, 1e-4, 0.1)
    assert tau == pytest.approx(np.pi * np.sqrt(0.5 / (2e9 * np.sqrt(1e-4 / np.pi)))) and flat


def test_contact_times_stay_finite_at_every_edge() -> None:
    grid = np.array(
        np.meshgrid([1e-9, 1.0, np.inf], [1e-3, 1e11, np.inf], [-1.0, 0.0, 1e3], [0.0, 1e-4], [-1.0, 0.0, 1e-300, 1e3])
    ).reshape(5, -1)
    tau = np.array([pulse_length(*column)[0] for column in grid.T])
    assert np.isfinite(tau).all() and len(tau) == 216
    assert tau.min() >= SHORTEST_PULSE_S
    assert tau.max() <= LONGEST_PULSE_S


def test_models_are_told_apart_by_themselves() -> None:
    """Two models of the same numbers are two; one model of two bodies is one."""
    same = [box_body(EDGES_M, (500.0,), body_id=0) for _ in range(2)]
    assert len(body_table(same).faces) == 24
    assert len(body_table((same[0], same[0])).faces) == 12
    assert len(box_model(EDGES_M, (500.0,)).face) == 12
