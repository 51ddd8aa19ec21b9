"""Radiation against closed forms of the sphere and the disc, and the laws every body must keep."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import spherical_jn, spherical_yn

from sonic_bullet.radiation.entrained_mass import moved_air
from sonic_bullet.radiation.far_field import directions, jerk_coefficient, radiation, spread_directions
from sonic_bullet.records import Air, Array, ModalModel
from tests.few_cases import parametrize_few

AIR = Air()
RHO_C = AIR.density_kg_m3 * AIR.sound_speed_m_s


def icosphere(levels: int) -> tuple[Array, Array]:
    """Unit sphere from an icosahedron halved ``levels`` times: vertices (v, 3), faces (f, 3) outward."""
    golden = (1 + 5**0.5) / 2
    vertex = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0),
              (0, -1, golden), (0, 1, golden), (0, -1, -golden), (0, 1, -golden),
              (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]  # fmt: skip
    face = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11),
            (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8),
            (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9),
            (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]  # fmt: skip
    points = [np.array(v) / np.linalg.norm(v) for v in vertex]
    for _ in range(levels):
        middle: dict[tuple[int, int], int] = {}

        def half(a: int, b: int, middle: dict[tuple[int, int], int] = middle) -> int:
            key = (min(a, b), max(a, b))
            if key not in middle:
                middle[key] = len(points)
                points.append((points[a] + points[b]) / np.linalg.norm(points[a] + points[b]))
            return middle[key]

        face = [
            t
            for a, b, c in face
            for ab, bc, ca in [(half(a, b), half(b, c), half(c, a))]
            for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
        ]
    return np.array(points), np.array(face, np.int32)


def box(size: tuple[float, float, float], cells: tuple[int, int, int] = (6, 6, 6)) -> tuple[Array, Array]:
    """A box, its edges divided into cells."""
    vertices, faces, count = [], [], 0
    for axis in range(3):
        u, v = np.meshgrid(*(np.linspace(-0.5, 0.5, cells[(axis + i) % 3] + 1) for i in (1, 2)), indexing="ij")
        a = np.arange(u.size).reshape(u.shape)
        quad = np.stack([a[:-1, :-1], a[1:, :-1], a[1:, 1:], a[:-1, 1:]], axis=-1).reshape(-1, 4)
        for side in (-0.5, 0.5):
            points = np.zeros((u.size, 3))
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3], points[:, axis] = u.ravel(), v.ravel(), side
            triangle = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
            faces.append(count + (triangle if side > 0 else triangle[:, ::-1]))
            vertices.append(points * size)
            count += u.size
    return np.concatenate(vertices), np.concatenate(faces).astype(np.int32)


def model(vertex: Array, face: Array, shape: Array, freq_hz: Array | float) -> ModalModel:
    """shape (v, 3, m) at frequencies (m,) or one for all."""
    m = shape.shape[2]
    return ModalModel(
        np.broadcast_to(np.asarray(freq_hz, float), (m,)),
        np.ones(m),
        shape,
        vertex,
        face,
        np.zeros(len(face)),
        1.0,
        1.0,
    )


SPHERE, SPHERE_FACE = icosphere(4)
HARMONIC = {0: np.ones(len(SPHERE)), 1: SPHERE[:, 2], 2: (3 * SPHERE[:, 2] ** 2 - 1) / 2}
"""Legendre polynomials of cosθ: radial motion that radiates as one multipole."""


def frequency_of(ka: Array | float, radius_m: float) -> Array:
    return np.asarray(ka) * AIR.sound_speed_m_s / radius_m / (2 * np.pi)


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("radius", [0.02, 0.3])
def test_sphere_harmonics_radiate_their_exact_power_and_pressure(degree: int, radius: float) -> None:
    """Far pressure of radial motion U·P_l: ρ₀cU P_l(cosθ) (-i) i^{l+1} e^{-ika}/(ka h_l'(ka)) a/r [Williams 1999, eq.
    6.122, e^{iωt}].
    """
    ka = np.array([0.05, 0.2, 1.0, 3.0, 8.0])
    shape = 0.7 * np.repeat((SPHERE * HARMONIC[degree][:, None])[:, :, None], len(ka), axis=2)
    weight, extra = radiation(model(radius * SPHERE, SPHERE_FACE, shape, frequency_of(ka, radius)), AIR)
    hankel = spherical_jn(degree, ka, True) - 1j * spherical_yn(degree, ka, True)
    pressure = (
        RHO_C * 0.7 * radius * -1j * 1j ** (degree + 1) * np.exp(-1j * ka) / (ka * hankel) / np.sqrt(2 * degree + 1)
    )
    assert np.abs(20 * np.log10(np.abs(weight / pressure))).max() < 0.5
    # which of two equal lobes leads is open
    either = np.angle(weight / pressure) if degree % 2 == 0 else np.angle((weight / pressure) ** 2) / 2
    assert np.abs(either)[ka > 0.1].max() < 0.15
    power = 4 * np.pi * np.abs(weight) ** 2 / RHO_C / 2
    assert 2 * extra * 0.5 == pytest.approx(power, rel=1e-9)  # modal energy ½|z|², |z| = 1


def efficiency(shape: Array, vertex: Array, face: Array, ka: Array) -> Array:
    """Power over that of a plane wave of the same normal motion; ka by the radius of the sphere of equal area."""
    corner = vertex[face]
    twice = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    square = np.einsum("fi,fci->f", twice, shape[face, :, 0]) ** 2 @ (1 / np.linalg.norm(twice, axis=1)) / 18
    radius = np.sqrt(np.linalg.norm(twice, axis=1).sum() / 2 / (4 * np.pi))
    case = model(vertex, face, np.repeat(shape, len(ka), axis=2), frequency_of(ka, radius))
    return np.asarray(radiation(case, AIR)[1] / (0.5 * RHO_C * square))


@pytest.mark.parametrize(("motion", "order"), [("breathes", 2), ("shifts", 4), ("stretches", 6)])
def test_orders_at_low_frequency_are_two_four_and_six(motion: str, order: int) -> None:
    """Net volume flow (ka)², none (ka)⁴, neither flow nor dipole (ka)⁶ [Pierce 1989, sec. 4-1 to 4-4], on a
    box, where nothing is exact by construction.
    """
    vertex, face = box((0.3, 0.2, 0.1))
    shape = {"breathes": vertex, "shifts": vertex * 0 + [0.2, 0.3, 1.0], "stretches": vertex * [1.0, -1.0, 0.0]}[
        motion
    ][:, :, None]
    ka = np.array([0.02, 0.04])
    low = efficiency(shape, vertex, face, ka)
    assert np.log2(low[1] / low[0]) == pytest.approx(order, abs=0.02)
    if motion == "breathes":
        surface, square = 2 * (0.06 + 0.03 + 0.02), 0.15**2 * 0.04 + 0.1**2 * 0.06 + 0.05**2 * 0.12
        assert low[0] == pytest.approx(ka[0] ** 2 * (3 * 0.006) ** 2 / surface / square, rel=0.01)


def test_high_above_all_waves_of_the_body_it_radiates_as_a_plane_wave() -> None:
    vertex, face = box((0.4, 0.4, 0.01), (16, 16, 1))
    shape = np.zeros((len(vertex), 3, 1))
    shape[:, 2, 0] = np.cos(np.pi * vertex[:, 0] / 0.4)
    assert efficiency(shape, vertex, face, np.array([8.0])) == pytest.approx([1.0], rel=0.2)


def test_a_disc_that_shifts_has_the_air_of_lamb() -> None:
    """Thin disc: added mass 8/3 ρa³ [Lamb 1932, art.

    102], so |p| = ρωk (8/3)a³/4π · cosθ; the square of equal area is within 1.5 dB.
    """
    vertex, face = box((1.0, 1.0, 0.002))
    shape = np.zeros((len(vertex), 3, 1))
    shape[:, 2] = 1.0
    omega = 2 * np.pi * 5.0
    weight, _ = radiation(model(vertex, face, shape, 5.0), AIR)
    exact = AIR.density_kg_m3 * omega * omega / AIR.sound_speed_m_s * (8 / 3 / np.pi**1.5) / (4 * np.pi) / np.sqrt(3)
    assert abs(20 * np.log10(np.abs(weight[0]) / exact)) < 1.5


def test_a_bars_fundamental_is_heard() -> None:
    """0.24 m of steel, 1 cm square: its ends and its middle are a third of a wavelength apart, not a multipole; per
    velocity the first three rise gently.
    """
    vertex, face = box((0.24, 0.01, 0.01), (48, 2, 2))
    beta = np.array([4.7300, 7.8532, 10.9956])
    place = (vertex[:, 0, None] / 0.24 + 0.5) * beta
    ratio = (np.cosh(beta) - np.cos(beta)) / (np.sinh(beta) - np.sin(beta))
    shape = np.zeros((len(vertex), 3, 3))
    shape[:, 2] = np.cosh(place) + np.cos(place) - ratio * (np.sinh(place) + np.sin(place))  # [Blevins 1979, tab. 8-1]
    level = 20 * np.log10(np.abs(radiation(model(vertex, face, shape, np.array([920.0, 2530.0, 4950.0])), AIR)[0]))
    assert 5 < level[1] - level[0] < 30
    assert 5 < level[2] - level[1] < 20


def test_rigid_oscillation_is_all_dipole_and_matches_acceleration_noise() -> None:
    """Shifted as a whole, the weight's mean over directions is that of K·jerk: |p| = K ω² cosθ per velocity, <cos²> =
    1/3 [Chadwick et al. 2012].
    """
    radius, freq = 0.04, 40.0
    shape = np.repeat(np.eye(3)[None], len(SPHERE), axis=0)
    weight, _ = radiation(model(radius * SPHERE, SPHERE_FACE, shape, freq), AIR)
    wanted = jerk_coefficient(4 / 3 * np.pi * radius**3, AIR) * (2 * np.pi * freq) ** 2 / np.sqrt(3)
    assert np.abs(weight) == pytest.approx(np.full(3, wanted), rel=0.03)


def random_case(seed: int) -> ModalModel:
    rng = np.random.default_rng(seed)
    vertex, face = box((0.3, 0.2, 0.1))
    slopes = rng.normal(size=(3, 4, 5))
    shape = np.einsum(
        "vi,iam->vam",
        np.concatenate([np.ones((len(vertex), 1)), vertex * 5, vertex**2 * 20], axis=1)[:, :4],
        slopes.transpose(1, 0, 2),
    )
    return model(vertex, face, shape, np.sort(rng.uniform(50, 8000, 5)))


def test_turning_the_body_changes_nothing_and_a_negative_shape_sounds_the_same() -> None:
    case = random_case(4)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    turned = ModalModel(
        case.freq_hz,
        case.decay_per_s,
        np.einsum("ij,vjm->vim", turn, case.shape),
        case.vertex_m @ turn.T,
        case.face,
        case.curvature_per_m,
        1.0,
        1.0,
    )
    # shapes are stored in single precision
    assert radiation(turned, AIR)[0] == pytest.approx(radiation(case, AIR)[0], rel=1e-4)
    negative = ModalModel(
        case.freq_hz, case.decay_per_s, -case.shape, case.vertex_m, case.face, case.curvature_per_m, 1.0, 1.0
    )
    assert radiation(negative, AIR)[0] == pytest.approx(-radiation(case, AIR)[0], rel=1e-12)


@parametrize_few("seed", range(4), 1)
def test_shapes_that_differ_a_little_radiate_alike_on_an_even_body_too(seed: int) -> None:
    """Bending waves over a box, as loud on both sides with opposite signs: what is picked must not be a matter of last
    bits.
    """
    rng = np.random.default_rng(seed)
    vertex, face = box((0.3, 0.2, 0.02))
    wave = np.array([[1, 0], [0, 1], [1, 1], [2, 0], [2, 1], [3, 2]])
    bent = np.prod(np.sin(np.pi * wave * vertex[:, None, :2] / [0.3, 0.2] + np.pi / 2 * (wave + 1)), axis=2)
    shape = np.zeros((len(vertex), 3, len(wave)))
    shape[:, 2] = bent
    freq = np.sort(rng.uniform(300, 6000, len(wave)))
    exact = radiation(model(vertex, face, shape, freq), AIR)
    moved = shape + 2.0**-11 * np.abs(bent).max(axis=0) * rng.uniform(-1, 1, shape.shape)
    for got, was in zip(radiation(model(vertex, face, moved, freq), AIR), exact, strict=True):
        assert np.abs(got / was - 1).max() < 0.03


def test_a_body_twice_as_large_radiates_as_scaling_says() -> None:
    """Size s: f/s, shapes s^{-3/2}, ka the same, so the weight scales as s^{-1/2}, damping as 1/s [physics of similar
    bodies].
    """
    case = random_case(9)
    large = ModalModel(
        case.freq_hz / 2,
        case.decay_per_s,
        case.shape * 2**-1.5,
        case.vertex_m * 2,
        case.face,
        case.curvature_per_m,
        1.0,
        1.0,
    )
    for got, was, power in zip(radiation(large, AIR), radiation(case, AIR), (-0.5, -1.0), strict=True):
        assert got == pytest.approx(was * 2.0**power, rel=1e-5)


def test_denser_and_faster_air() -> None:
    """At the same k all pressures per velocity go as ρ₀c: the same body in air twice as dense, and with frequencies and
    c doubled.
    """
    case = random_case(3)
    dense = Air(2.4, AIR.sound_speed_m_s)
    assert radiation(case, dense)[0] == pytest.approx(2 * radiation(case, AIR)[0], rel=1e-9)
    assert radiation(case, dense)[1] == pytest.approx(2 * radiation(case, AIR)[1], rel=1e-9)
    quick = model(case.vertex_m, case.face, case.shape, 2 * case.freq_hz)
    assert radiation(quick, Air(1.2, 2 * AIR.sound_speed_m_s))[0] == pytest.approx(
        2 * radiation(case, AIR)[0], rel=1e-9
    )


def test_moved_air_of_a_sphere_and_of_a_thin_disc() -> None:
    """Eigenvalues a/(l+1), 2l + 1 times each; a disc's added mass 8/3 ρa³ [Lamb 1932, art. 102]."""
    vertex, face = icosphere(2)
    moved = moved_air(0.5 * vertex[face])
    assert moved.length_m[::-1][:9] == pytest.approx(np.repeat([0.5, 0.25, 0.5 / 3], [1, 3, 5]), rel=0.08)
    ring = np.linspace(0, 1, 9)[1:]
    angle = 2 * np.pi * np.arange(24) / 24
    flat = np.concatenate(
        [[[0, 0]], (ring[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)).reshape(-1, 2)]
    )
    fan = [(0, 1 + i, 1 + (i + 1) % 24) for i in range(24)]
    band = [(1 + 24 * r + i, 25 + 24 * r + i, 25 + 24 * r + (i + 1) % 24) for r in range(7) for i in range(24)]
    band += [
        (1 + 24 * r + i, 25 + 24 * r + (i + 1) % 24, 1 + 24 * r + (i + 1) % 24) for r in range(7) for i in range(24)
    ]
    top = np.array(fan + band)
    n = len(flat)
    rim = [t for i in range(169, 193) for j in [169 + (i - 168) % 24] for t in ((n + i, n + j, j), (n + i, j, i))]
    vertex = np.concatenate([np.column_stack([flat, np.full(n, 0.005)]), np.column_stack([flat, np.full(n, -0.005)])])
    face = np.concatenate([top, n + top[:, ::-1], rim])
    moved = moved_air(vertex[face])
    normal = np.cross(vertex[face][:, 1] - vertex[face][:, 0], vertex[face][:, 2] - vertex[face][:, 0])
    speed = normal[:, 2] / np.linalg.norm(normal, axis=1) * np.sqrt(moved.area_m2)
    assert moved.length_m @ (moved.vector.T @ speed) ** 2 == pytest.approx(8 / 3, rel=0.12)


def test_directions_integrate_polynomials() -> None:
    """<x⁴> = 1/5, <x²y²z²> = 1/105, <1> = 1, over the directions and their negatives."""
    for vector, share, tolerance in (
        (*directions(6), 1e-12),
        (*directions(11), 1e-12),
        (*spread_directions(256), 1e-2),
    ):
        assert np.linalg.norm(vector, axis=1) == pytest.approx(np.ones(len(vector)))
        assert 2 * share.sum() == pytest.approx(1)
        assert 2 * share @ vector**4 == pytest.approx(np.full(3, 0.2), rel=tolerance)
        assert 2 * share @ np.prod(vector**2, axis=1) == pytest.approx(1 / 105, rel=tolerance)


def test_a_fine_mesh_is_gathered_without_changing_what_is_heard() -> None:
    """A bent plate of 480 triangles, nothing gathered, and of 5168: the same within 2 dB."""
    level = []
    for cells in ((10, 10, 1), (34, 34, 2)):
        vertex, face = box((0.2, 0.2, 0.004), cells)
        shape = np.zeros((len(vertex), 3, 2))
        shape[:, 2, 0] = vertex[:, 0] ** 2 - vertex[:, 1] ** 2
        shape[:, 2, 1] = np.cos(np.pi * vertex[:, 0] / 0.1) + np.cos(np.pi * vertex[:, 1] / 0.1)
        level.append(20 * np.log10(np.abs(radiation(model(vertex, face, shape, np.array([480.0, 1500.0])), AIR)[0])))
    assert level[1] == pytest.approx(level[0], abs=2)


def test_power_radiated_is_what_the_damping_takes() -> None:
    case = random_case(2)
    weight, extra = radiation(case, AIR)
    mean_square_pressure = np.abs(weight) ** 2 / 2
    assert 4 * np.pi * mean_square_pressure / RHO_C == pytest.approx(2 * extra * 0.5, rel=1e-12)


def test_a_model_without_modes_or_surface_is_legal() -> None:
    vertex, face = box((1, 1, 1))
    weight, extra = radiation(model(vertex, face, np.zeros((len(vertex), 3, 0)), np.zeros(0)), AIR)
    assert weight.shape == extra.shape == (0,)
    plane = ModalModel(
        np.zeros(0), np.zeros(0), np.zeros((0, 3, 0)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), 0.0, 0.0
    )
    assert radiation(plane, AIR)[0].shape == (0,)
