"""Radiation against closed forms of the sphere and the disc, and the laws every body must keep."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import spherical_jn, spherical_yn

from sonic_bullet.records import Air, Array, ModalModel
from sonic_bullet.synth.radiation import jerk_coefficient, radiation

AIR = Air()
RHO_C = AIR.density_kg_m3 * AIR.sound_speed_m_s


def icosphere(levels: int) -> tuple[Array, Array]:
    """Unit sphere from an icosahedron halved ``levels`` times: vertices (v, 3), faces (f, 3) outward."""
    golden = (1 + 5**0.5) / 2
    vertex = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden), (0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]  # fmt: skip
    face = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]  # fmt: skip
    points = [np.array(v) / np.linalg.norm(v) for v in vertex]
    for _ in range(levels):
        middle: dict[tuple[int, int], int] = {}

        def half(a: int, b: int, middle: dict[tuple[int, int], int] = middle) -> int:
            key = (min(a, b), max(a, b))
            if key not in middle:
                middle[key] = len(points)
                points.append((points[a] + points[b]) / np.linalg.norm(points[a] + points[b]))
            return middle[key]

        face = [t for a, b, c in face for ab, bc, ca in [(half(a, b), half(b, c), half(c, a))] for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
    return np.array(points), np.array(face, np.int32)


def box(size: tuple[float, float, float]) -> tuple[Array, Array]:
    """A box, each side divided 6 by 6."""
    vertices, faces = [], []
    grid = np.linspace(-0.5, 0.5, 7)
    u, v = (x.ravel() for x in np.meshgrid(grid, grid, indexing="ij"))
    for axis in range(3):
        for side in (-0.5, 0.5):
            points = np.zeros((49, 3))
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3], points[:, axis] = u, v, side
            for i in range(6):
                for j in range(6):
                    a, b, c, d = (len(vertices) * 49 + k for k in (7 * i + j, 7 * i + j + 7, 7 * i + j + 8, 7 * i + j + 1))
                    faces += [(a, b, c), (a, c, d)] if side > 0 else [(a, c, b), (a, d, c)]
            vertices.append(points * size)
    return np.concatenate(vertices), np.array(faces, np.int32)


def model(vertex: Array, face: Array, shape: Array, freq_hz: Array | float) -> ModalModel:
    """shape (v, 3, m) at frequencies (m,) or one for all."""
    m = shape.shape[2]
    return ModalModel(np.broadcast_to(np.asarray(freq_hz, float), (m,)), np.ones(m), shape, vertex, face, np.zeros(len(face)), 1.0, 1.0)


SPHERE, SPHERE_FACE = icosphere(4)
HARMONIC = {0: np.ones(len(SPHERE)), 1: SPHERE[:, 2], 2: (3 * SPHERE[:, 2] ** 2 - 1) / 2}
"""Legendre polynomials of cosθ: radial motion that radiates as one multipole."""


def frequency_of(ka: Array | float, radius_m: float) -> Array:
    return np.asarray(ka) * AIR.sound_speed_m_s / radius_m / (2 * np.pi)


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("radius", [0.02, 0.3])
def test_sphere_harmonics_radiate_their_exact_power_and_pressure(degree: int, radius: float) -> None:
    """Far pressure of radial motion U·P_l: ρ₀cU P_l(cosθ) (-i) i^{l+1} e^{-ika}/(ka h_l'(ka)) a/r [Williams 1999, eq. 6.122, e^{iωt}]."""
    ka = np.array([0.05, 0.2, 1.0, 3.0, 8.0])
    shape = 0.7 * np.repeat((SPHERE * HARMONIC[degree][:, None])[:, :, None], len(ka), axis=2)
    weight, extra = radiation(model(radius * SPHERE, SPHERE_FACE, shape, frequency_of(ka, radius)), AIR)
    hankel = spherical_jn(degree, ka, True) - 1j * spherical_yn(degree, ka, True)
    pressure = RHO_C * 0.7 * radius * -1j * 1j ** (degree + 1) * np.exp(-1j * ka) / (ka * hankel) / np.sqrt(2 * degree + 1)
    tolerance = 0.01 if degree < 2 else 0.02
    assert np.abs(weight) == pytest.approx(np.abs(pressure), rel=tolerance)
    lead = slice(0, None) if degree < 2 else slice(2, None)  # at tiny ka a trace of a lower multipole of the polyhedron leads
    assert np.abs(np.angle(weight / pressure))[lead].max() < 0.02
    power = 4 * np.pi * np.abs(pressure) ** 2 / RHO_C / 2
    assert 2 * extra * 0.5 == pytest.approx(power, rel=2 * tolerance)  # modal energy ½|z|², |z| = 1


def test_efficiencies_are_those_of_the_sphere() -> None:
    x = np.geomspace(0.01, 30, 40)
    for degree in range(3):
        derivative = spherical_jn(degree, x, True) - 1j * spherical_yn(degree, x, True)
        assert efficiency(x)[degree] == pytest.approx(1 / (x * np.abs(derivative)) ** 2, rel=1e-9)


def test_orders_at_low_frequency_are_two_four_and_six() -> None:
    x = np.array([1e-3, 2e-3])
    low = efficiency(x)
    assert np.log2(low[:, 1] / low[:, 0]) == pytest.approx([2, 4, 6], abs=1e-4)
    assert efficiency(np.array([100.0]))[:, 0] == pytest.approx([1, 1, 1], rel=1e-3)


def test_rigid_oscillation_is_all_dipole_and_matches_acceleration_noise() -> None:
    """Shifted as a whole, the weight's mean over directions is that of K·jerk: |p| = K ω² cosθ per velocity, <cos²> = 1/3 [Chadwick et al. 2012]."""
    radius, freq = 0.04, 40.0
    shape = np.repeat(np.eye(3)[None], len(SPHERE), axis=0)
    weight, _ = radiation(model(radius * SPHERE, SPHERE_FACE, shape, freq), AIR)
    wanted = jerk_coefficient(4 / 3 * np.pi * radius**3, AIR) * (2 * np.pi * freq) ** 2 / np.sqrt(3)
    assert np.abs(weight) == pytest.approx(np.full(3, wanted), rel=0.01)


def test_a_disc_that_moves_as_a_whole_is_within_3_2_db() -> None:
    """Exact dipole of a thin disc: added mass 8/3 ρa³ each way [Lamb 1932, art. 102]; ours takes a sphere's of the same area."""
    vertex, face = box((1.0, 1.0, 0.002))
    radius = np.sqrt(1 / np.pi)  # disc of the plate's area
    shape = np.zeros((len(vertex), 3, 1))
    shape[:, 2] = 1.0
    omega = 2 * np.pi * 5.0
    weight, _ = radiation(model(vertex, face, shape, 5.0), AIR)
    k = omega / AIR.sound_speed_m_s
    exact = AIR.density_kg_m3 * omega * k * (8 / 3 * radius**3) / (4 * np.pi) / np.sqrt(3)
    assert abs(20 * np.log10(np.abs(weight[0]) / exact)) < 3.25


def test_a_bending_plate_has_neither_monopole_nor_dipole_and_nears_the_plane_wave() -> None:
    vertex, face = box((0.4, 0.4, 0.002))
    shape = np.zeros((len(vertex), 3, 2))
    shape[:, 2] = (np.cos(2 * np.pi * vertex[:, 0] / 0.4) * np.cos(2 * np.pi * vertex[:, 1] / 0.4))[:, None]
    plate = model(vertex, face, shape, np.array([20.0, 20_000.0]))
    area, parts, _ = surface_motion(plate)
    assert parts[:2].max() < 1e-6 * parts[2].max()
    weight, extra = radiation(plate, AIR)
    square = parts.sum(axis=0)[1]
    assert np.abs(weight[1]) == pytest.approx(RHO_C * np.sqrt(square / (4 * np.pi)), rel=1e-3)
    assert extra[1] == pytest.approx(0.5 * RHO_C * square, rel=1e-3)
    assert np.abs(weight[0]) < 1e-3 * np.abs(weight[1])
    assert area == pytest.approx(2 * 0.16 + 4 * 0.4 * 0.002)


def test_quadrature_is_exact_for_linear_shapes() -> None:
    """u = x·e_x on a box: ∮(u·n)² = 2·(a/2)²·bc and Q = abc, the volume's growth."""
    a, b, c = 0.3, 0.2, 0.1
    vertex, face = box((a, b, c))
    shape = np.zeros((len(vertex), 3, 1))
    shape[:, 0, 0] = vertex[:, 0]
    area, parts, sign = surface_motion(model(vertex, face, shape, 100.0))
    assert parts.sum() == pytest.approx(2 * (a / 2) ** 2 * b * c, rel=1e-6)
    assert parts[0, 0] == pytest.approx((a * b * c) ** 2 / area, rel=1e-6)
    assert sign[0] == 1


def random_case(seed: int) -> ModalModel:
    rng = np.random.default_rng(seed)
    vertex, face = box((0.3, 0.2, 0.1))
    slopes = rng.normal(size=(3, 4, 5))
    shape = np.einsum("vi,iam->vam", np.concatenate([np.ones((len(vertex), 1)), vertex * 5, vertex**2 * 20], axis=1)[:, :4], slopes.transpose(1, 0, 2))
    return model(vertex, face, shape, np.sort(rng.uniform(50, 8000, 5)))


def test_turning_the_body_changes_nothing_and_a_negative_shape_sounds_the_same() -> None:
    case = random_case(4)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    turned = ModalModel(
        case.freq_hz, case.decay_per_s, np.einsum("ij,vjm->vim", turn, case.shape), case.vertex_m @ turn.T, case.face, case.curvature_per_m, 1.0, 1.0
    )
    assert radiation(turned, AIR)[0] == pytest.approx(radiation(case, AIR)[0], rel=1e-5)  # shapes are stored in single precision
    negative = ModalModel(case.freq_hz, case.decay_per_s, -case.shape, case.vertex_m, case.face, case.curvature_per_m, 1.0, 1.0)
    assert radiation(negative, AIR)[0] == pytest.approx(-radiation(case, AIR)[0], rel=1e-12)


def test_a_body_twice_as_large_radiates_as_scaling_says() -> None:
    """Size s: f/s, shapes s^{-3/2}, ka the same, so the weight scales as s^{-1/2}, damping as 1/s [physics of similar bodies]."""
    case = random_case(9)
    large = ModalModel(case.freq_hz / 2, case.decay_per_s, case.shape * 2**-1.5, case.vertex_m * 2, case.face, case.curvature_per_m, 1.0, 1.0)
    for got, was, power in zip(radiation(large, AIR), radiation(case, AIR), (-0.5, -1.0), strict=True):
        assert got == pytest.approx(was * 2.0**power, rel=1e-5)


def test_power_radiated_is_what_the_damping_takes() -> None:
    case = random_case(2)
    weight, extra = radiation(case, AIR)
    mean_square_pressure = np.abs(weight) ** 2 / 2
    assert 4 * np.pi * mean_square_pressure / RHO_C == pytest.approx(2 * extra * 0.5, rel=1e-12)


def test_a_model_without_modes_or_surface_is_legal() -> None:
    vertex, face = box((1, 1, 1))
    weight, extra = radiation(model(vertex, face, np.zeros((len(vertex), 3, 0)), np.zeros(0)), AIR)
    assert weight.shape == extra.shape == (0,)
    plane = ModalModel(np.zeros(0), np.zeros(0), np.zeros((0, 3, 0)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), 0.0, 0.0)
    assert radiation(plane, AIR)[0].shape == (0,)
