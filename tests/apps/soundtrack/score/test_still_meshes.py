"""What never moves may be open, flat or hollow: what is in it or on it gets the impulses that solid walls gave it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.score.export import Export, ExportedObject, Rule, assemble_animation
from sonic_bullet.apps.soundtrack.score.impulse_fit import fit_steps
from sonic_bullet.records import Array, Shape
from sonic_bullet.simulators import direct_client, disconnect
from sonic_bullet.simulators.animated import AnimatedBody
from sonic_bullet.simulators.frames import LINK_STATE
from sonic_bullet.simulators.pybullet.staged.animated_world import AnimatedStage
from sonic_bullet.simulators.pybullet.staged.mesh_parts import pieces
from tests.made.animations import RADIUS_M, ball_body, box_mesh

SIDE_M, MASS_KG, WIDE_M, HIGH_M, THICK_M = 0.04, 0.2, 0.15, 0.2, 0.1
CORNERS = np.array([(x, y, z) for z in (0, HIGH_M) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
CORNERS = CORNERS * [WIDE_M, WIDE_M, 1.0]
Mesh = tuple[Array, Array]
Wall = tuple[Sequence[float], Sequence[float]]


def of_quads(vertex: Array, quads: Sequence[Sequence[int]]) -> Mesh:
    return vertex, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


PLANE = of_quads(np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]]), [(0, 1, 2, 3)])
BIN = of_quads(CORNERS, [(0, 1, 2, 3), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
GROUND: list[Wall] = [((2, 2, THICK_M), (0, 0, -THICK_M / 2))]
WALLS: list[Wall] = GROUND + [
    (edges, place)
    for sign in (-1, 1)
    for edges, place in (
        ((THICK_M, 2 * WIDE_M, HIGH_M), (sign * (WIDE_M + THICK_M / 2), 0, HIGH_M / 2)),
        ((2 * WIDE_M, THICK_M, HIGH_M), (0, sign * (WIDE_M + THICK_M / 2), HIGH_M / 2)),
    )
]


def thrown(walls: Sequence[Wall]) -> tuple[Array, Array, float]:
    """Positions (t, 3) and turns (t, 4) of a box among solid walls at 240 Hz, and the impulse that it got."""
    client = direct_client()
    try:
        client.setGravity(0, 0, -9.81)
        for edges, place in [*walls, ((SIDE_M,) * 3, (0, 0, 0.15))]:
            shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=[x / 2 for x in edges])
            mass = MASS_KG if edges[0] == SIDE_M else 0
            box = client.createMultiBody(
                mass, shape, -1, place, client.getQuaternionFromEuler([0.2 * (mass > 0), 0, 0])
            )
            client.changeDynamics(box, -1, restitution=0.7, lateralFriction=0.7, contactProcessingThreshold=0,
                                  linearDamping=0, angularDamping=0)  # fmt: skip
        client.resetBaseVelocity(box, [0.8, 0.3, 0])
        poses, given = [], 0.0
        for _ in range(120):
            poses.append(client.getBasePositionAndOrientation(box))
            client.stepSimulation()
            given += sum(point[9] for point in client.getContactPoints(box)) / 240
    finally:
        disconnect(client)
    return np.array([p for p, _ in poses]), np.array([q for _, q in poses]), given


def pushed(mesh: Mesh, place: Array, turn: Array) -> Array:
    """(t,) impulse on the box of each step, with the ground as this mesh."""
    still = np.zeros((len(place), 3)), np.tile([0, 0, 0, 1.0], (len(place), 1))
    ground = ExportedObject("ground", *still, mesh)
    box = ExportedObject("box", place, turn, box_mesh((SIDE_M,) * 3), stated=Rule("box", mass_kg=MASS_KG))
    made = assemble_animation(Export(240.0, (ground, box), np.array([0, 0, -9.81])), (), "wood")[0]
    steps: list[tuple[Array, Array]] = []
    with AnimatedStage(made.bodies, made.gravity_m_s2) as stage:
        fit_steps(made, stage, steps)
    return np.array([raw["force_n"].sum() / 240 for _, raw in steps])


@pytest.mark.parametrize(("mesh", "walls"), [(PLANE, GROUND), (BIN, WALLS)])
def test_an_open_mesh_gives_what_solid_walls_give(mesh: Mesh, walls: Sequence[Wall]) -> None:
    place, turn, given = thrown(walls)
    solids = [(vertex + at, face) for at, (vertex, face) in ((np.array(at), box_mesh(edges)) for edges, at in walls)]
    solid = np.concatenate([v for v, _ in solids]), np.concatenate([8 * i + f for i, (_, f) in enumerate(solids)])
    expected = pushed(solid, place, turn)
    assert expected.sum() == pytest.approx(given, rel=0.1)
    for winding in (1, -1):
        found = pushed((mesh[0], mesh[1][:, ::winding]), place, turn)
        assert np.abs(found - expected).max() < 0.01 * given


def test_a_solid_is_its_hull_and_a_fine_floor_is_one_face() -> None:
    (box,) = pieces(Shape("mesh", vertex_m=box_mesh((1, 2, 3))[0], face=box_mesh((1, 2, 3))[1]), "box", False)
    assert len(box) == 8
    side = np.linspace(-1, 1, 11)
    grid = np.array([[x, y, 0] for x in side for y in side])
    quads = [(a, a + 1, a + 12, a + 11) for a in range(109) if a % 11 < 10]
    (floor,) = pieces(Shape("mesh", vertex_m=grid, face=of_quads(grid, quads)[1]), "floor", False)
    assert sorted(map(tuple, floor.round(9).tolist())) == [(-1, -1, 0), (-1, 1, 0), (1, -1, 0), (1, 1, 0)]
    assert len(pieces(Shape("mesh", vertex_m=BIN[0], face=BIN[1]), "bin", False)) == 5


def test_a_fine_bowl_is_hollow() -> None:
    """Half a sphere, open: who hangs in it touches nobody; at its ground and at its side the wall is where it is."""
    lat, lon = np.meshgrid(np.linspace(0.05, 1.5, 14), np.arange(32) * np.pi / 16, indexing="ij")
    bowl = WIDE_M * np.stack([np.sin(lat) * np.cos(lon), np.sin(lat) * np.sin(lon), -np.cos(lat)], -1).reshape(-1, 3)
    quads = [(32 * i + j, 32 * i + (j + 1) % 32, 32 * i + 32 + (j + 1) % 32, 32 * i + 32 + j)
             for i in range(13) for j in range(32)]  # fmt: skip
    shape = Shape(
        "mesh", vertex_m=bowl, face=np.concatenate([of_quads(bowl, quads)[1], [(0, i, i + 1) for i in range(31)]])
    )
    assert pieces(shape, "bowl", False) == []
    motion = np.zeros(2, LINK_STATE)
    motion["quaternion_xyzw"][:, 3] = 1
    with AnimatedStage((AnimatedBody("bowl", (shape,), 0.0, np.zeros(3)), ball_body()), np.zeros(3)) as stage:
        for tilt in (0.0, 0.8):
            normal = np.array([np.sin(tilt), 0, np.cos(tilt)])
            place = (RADIUS_M - WIDE_M) * normal
            motion["position_m"][1] = 0.5 * place
            assert not len(stage.closest(motion, [(0, 1)], 1.5e-3))
            motion["position_m"][1] = place
            raw = stage.closest(motion, [(1, 0)], 1.5e-3)
            nearest = raw[raw["gap_m"].argmin()]
            assert abs(nearest["gap_m"]) < 1.5e-3
            assert nearest["normal"] @ normal > 0.98
