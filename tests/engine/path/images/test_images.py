"""Images of bodies in faces of others: two coherent sources, what a soft face gives back, edges, what hides what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.channels.body_images import specific_admittance
from sonic_bullet.engine.runtime.replay import LATENCY_STEPS, log_frames, render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.geometry.flat_faces import flat_faces
from sonic_bullet.records import Air, Ambisonics, Array, Binaural, Material, Microphone, MicrophonePath, Shape
from sonic_bullet.records.contacts import Contacts
from tests.made import heads
from tests.made.models import STEEL, box_body, row, step, wall_body

UNBOUNDED_M = 1e6

SR, C, DT_S = 48_000, 343.0, 1 / 240
QUIET = replace(STEEL, alpha_per_s=1.0, beta_s=0.0)
FLOOR = flat_faces([Shape("plane")])
FOAM = Material.isotropic("foam", youngs_pa=1e5, poisson=0.0, density_kg_m3=100.0, alpha_per_s=1.0, beta_s=0.0)


def struck_over(
    faces: Array, place: Array, sensors: tuple[Microphone, ...], hertz: float = 1500.0, **how: object
) -> ContactLog:
    """A box at a place that is struck in step 2, and a body that rests at 0 and has these faces."""
    hit = row(0, 1, (0, 0, -0.01), normal=(0, 0, -1), point_a=(0, 0, 0.005))
    mirror = replace(wall_body(body_id=8), name="mirror", flat_faces_m=faces, material=how.pop("material", None))  # type: ignore[arg-type]
    bodies = box_body((0.2, 0.1, 0.01), (hertz,), QUIET), wall_body(), mirror
    poses = np.broadcast_to(place, (24, 3))
    made = [
        step([at, at + np.array([0, 0, 1.0]), np.zeros(3)], hit if i == 2 else Contacts.none(), dt_s=DT_S)
        for i, at in enumerate(poses)
    ]
    return ContactLog(bodies, tuple(made), sensors, SR, 0, image=True, **how)  # type: ignore[arg-type]


def tone(sound: Array, hertz: float) -> complex:
    """Complex amplitude over the later half."""
    n = np.arange(sound.shape[-1])
    late = n > sound.shape[-1] // 2
    window = np.hanning(late.sum())
    return complex((sound[..., late] * np.exp(-2j * np.pi * hertz / SR * n[late]) * window).sum())


def ratio_of(faces: Array, place: Array, ear: Array, hertz: float, **how: object) -> complex:
    """Pressure with images over that without."""
    log = struck_over(faces, place, (Microphone(ear),), hertz, **how)
    played = float(log.bodies[0].model.freq_hz[0])  # type: ignore[union-attr]
    with_image, without = render_log(log)[0], render_log(replace(log, image=False))[0]
    return tone(with_image, played) / tone(without, played)


@pytest.mark.parametrize("hertz", [300.0, 1500.0, 4000.0])
def test_a_rigid_floor_makes_two_coherent_sources(hertz: float) -> None:
    """1 + (r₁/r₂) exp(-jk(r₂ - r₁)), within 0.05 dB, 0.01 rad where they do not cancel."""
    place, ear = np.array([0.3, 0.1, 0.25]), np.array([-0.4, -0.6, 0.7])
    near, far = np.linalg.norm(ear - place), np.linalg.norm(ear * [1, 1, -1] - place)
    want = 1 + near / far * np.exp(-2j * np.pi * hertz / C * (far - near))
    found = ratio_of(FLOOR, place, ear, hertz)
    assert abs(found - want) < 0.006 * max(abs(want), 0.5)


def test_near_a_floor_low_tones_are_6_db_louder() -> None:
    found = ratio_of(FLOOR, np.array([0, 0, 0.005]), np.array([0.5, 0, 0.005]), 200.0)
    assert 20 * np.log10(abs(found)) == pytest.approx(6.02, abs=0.02)


@pytest.mark.parametrize("height_m", [0.0, 0.001, 0.02])
def test_near_a_board_it_is_so_where_its_edges_are_far(height_m: float) -> None:
    """Along the board, too: what an edge sends back has gone 4 m farther, 23 waves of 2 kHz."""
    board = np.array([[[0, 0, 0], [2.5, 0, 0], [0, 2.5, 0]]])
    found = ratio_of(board, np.array([0, 0, 0.005]), np.array([0.5, 0, height_m]), 200.0)
    assert 20 * np.log10(abs(found)) == pytest.approx(6.02, abs=0.02)


def test_a_soft_floor_sends_less_back() -> None:
    """Plane waves along the normal: (1 - β)/(1 + β), β = ρ₀c₀/√(ρM); steel gives back all but 2e-5."""
    place, ear = np.array([0, 0, 0.3]), np.array([0.0, 0, 0.9])
    beta = 1.2 * C / np.sqrt(100.0 * 1e5)
    assert specific_admittance(FOAM, Air()) == pytest.approx(beta, rel=1e-9)
    hard, soft = (ratio_of(FLOOR, place, ear, 1500.0, **how) - 1 for how in ({}, {"material": FOAM}))
    assert soft / hard == pytest.approx((1 - beta) / (1 + beta), abs=2e-3)
    assert 1 < 1 + 2 * specific_admittance(STEEL, Air()) < 1 + 5e-5


def test_a_board_mirrors_within_its_edges_alone_and_two_side_by_side_as_one() -> None:
    def board(x0: float, x1: float) -> Array:
        return np.array([[[(x0 + x1) / 2, 0, 0], [(x1 - x0) / 2, 0, 0], [0, 0.5, 0]]])

    ear = np.array([0.0, 0.3, 0.5])
    for x in (-0.3, -0.02, 0.0, 0.05, 0.4):
        place = np.array([x, -0.1, 0.05])
        whole, left, right = (
            ratio_of(faces, place, ear, 1500.0) - 1 for faces in (board(-1, 1), board(-1, 0), board(0, 1))
        )
        assert left + right == pytest.approx(whole, abs=1e-3)
    assert abs(ratio_of(board(-1, 0), np.array([0.4, 0, 0.05]), ear, 1500.0) - 1) < 1e-9
    assert abs(ratio_of(board(-1, 1), np.array([0.0, 0, -0.05]), ear, 1500.0) - 1) < 1e-9  # it lies beneath


def test_a_table_top_hides_the_floor_beneath_it() -> None:
    top = np.array([[0, 0, 0], [0.6, 0, 0], [0, 0.6, 0]])
    floor = FLOOR + np.array([[0, 0, -0.7], [0, 0, 0], [0, 0, 0]])
    place, ear = np.array([0.0, 0, 0.1]), np.array([0, -0.3, 0.6])
    both, alone = (ratio_of(faces, place, ear, 700.0) for faces in (np.array([top, floor[0]]), top[None]))
    assert both == pytest.approx(alone, abs=1e-9)
    aside = np.array([2.0, 0, 0.1])
    assert abs(ratio_of(np.array([top, floor[0]]), aside, ear, 700.0) - 1) > 0.1


def test_nothing_moves_without_a_face_or_without_images() -> None:
    ear = (Microphone(np.array([0, -0.5, 0.4])),)
    log = struck_over(np.zeros((0, 3, 3)), np.array([0, 0, 0.2]), ear)
    assert np.array_equal(render_log(log), render_log(replace(log, image=False)))
    mirrored = struck_over(FLOOR, np.array([0, 0, 0.2]), ear)
    assert np.array_equal(render_log(log), render_log(replace(mirrored, image=False)))
    assert not np.array_equal(render_log(log), render_log(mirrored))


def test_live_in_blocks_replayed_and_by_stems_it_is_the_same_sound() -> None:
    """Of microphones that stand, move, hear directions and have ears; stems sum to the mix."""
    at = np.array([0.1, -0.5, 0.4])
    path = MicrophonePath(np.array([0.0, 0.1]), at + np.array([[0, 0, 0], [0.3, 0, 0.2]]))
    sensors = (Microphone(at), Microphone(path=path), Ambisonics(at), Binaural(at, head=heads.head()))
    log = struck_over(FLOOR, np.array([0, 0, 0.2]), sensors)  # type: ignore[arg-type]
    whole = render_log(log)
    frames = np.concatenate([*log_frames(log)], axis=1)
    lag = LATENCY_STEPS * round(DT_S * SR)
    assert np.array_equal(frames[:, lag:], whole[:, : frames.shape[1] - lag])
    stems = np.concatenate([frame for _, frame in render_per_body(log)], axis=2).sum(axis=0)
    assert np.abs(stems - whole).max() < 1e-12 * np.abs(whole).max()
    assert np.array_equal(whole[2], whole[0])  # the first of ambiX is the plain microphone's


def test_a_microphone_on_a_body_hears_the_image_of_its_path() -> None:
    """It rides on the mirroring body's silent neighbour: here the box itself, which rests."""
    place, offset = np.array([0, 0, 0.3]), np.array([0.0, 0.2, 0.1])
    riding = struck_over(FLOOR, place, (Microphone(offset, body_id=0),))
    still = struck_over(FLOOR, place, (Microphone(place + offset),))
    assert np.abs(render_log(riding) - render_log(still)).max() < 1e-9 * np.abs(render_log(still)).max()


def test_faces_of_shapes() -> None:
    """A box has six, of which the large ones count; a disc one at each end; a mesh those of the box that it is."""
    box = Shape("box", np.array([1.0, 0.6, 0.02]))
    faces = flat_faces([box])
    normals = np.cross(faces[:, 1], faces[:, 2])
    assert len(faces) == 2 and sorted(faces[:, 0, 2].tolist()) == [-0.01, 0.01]
    assert np.allclose(normals[:, 2] * np.sign(faces[:, 0, 2]), 0.15)
    disc = flat_faces([Shape("cylinder", np.array([0.4, 0.02, 0]))])
    assert len(disc) == 2 and np.allclose(4 * np.linalg.norm(np.cross(disc[:, 1], disc[:, 2]), axis=1), np.pi * 0.16)
    import trimesh

    turn = trimesh.transformations.rotation_matrix(0.4, [1, 2, 3])
    made = trimesh.creation.box([1.0, 0.6, 0.02]).subdivide().apply_transform(turn)
    mesh = flat_faces([Shape("mesh", vertex_m=np.array(made.vertices), face=np.array(made.faces))])
    assert len(mesh) == 2
    sides = np.sort(np.linalg.norm(mesh[:, 1:], axis=2), axis=1)
    assert np.allclose(sides, [0.3, 0.5])
    outward = np.cross(mesh[:, 1], mesh[:, 2])
    assert (np.einsum("ki,ki->k", outward, mesh[:, 0]) > 0).all()
    assert not len(flat_faces([Shape("sphere", np.array([3.0, 0, 0])), Shape("box", np.array([0.2, 3.0, 0.1]))]))
    assert flat_faces([Shape("plane")])[0, 1, 0] == UNBOUNDED_M
