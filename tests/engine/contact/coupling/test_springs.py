"""Springs of contacts against closed forms and their scaling with the load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.engine.contact.coupling import ContactSide, Region, contact_spring
from sonic_bullet.records import Material
from sonic_bullet.records.errors import RecordError

STEEL = ContactSide(2e11, 0.3, 3e-4, 0.0)
OAK = ContactSide(1.1e9, 0.35, 0.02, 0.0)
POINT = Region((0.0, 0.0), (200.0, 200.0))


def modulus(*sides: ContactSide) -> float:
    return 1 / sum(side.compliance_per_pa for side in sides)


def exponent(region: Region, sides: tuple[ContactSide, ContactSide], load_n: float) -> float:
    """d ln K/d ln N"""
    low, high = (abs(contact_spring(region, sides, load_n * f).normal_n_m) for f in (0.5, 2.0))
    return float(np.log(high / low) / np.log(4))


def test_a_ball_has_hertz_stiffness() -> None:
    for load in (0.1, 1.0, 30.0):
        got = contact_spring(POINT, (STEEL, OAK), load).normal_n_m.real
        assert got == pytest.approx((6 * modulus(STEEL, OAK) ** 2 / 200 * load) ** (1 / 3), rel=1e-3)


def test_two_curvatures_are_hertz_ellipse() -> None:
    """Against Hertz' own equations of the ellipse, solved: κ₂/κ₁ = [(a/b)²E(e) − K(e)]/[K(e) − E(e)]."""
    from scipy.special import ellipe, ellipk

    ratio = 0.5  # b/a
    e2 = 1 - ratio**2
    curved = (ellipe(e2) / ratio**2 - ellipk(e2)) / (ellipk(e2) - ellipe(e2))
    region = Region((0.0, 0.0), (100.0, 100.0 * curved))
    a, b = region.half_axes_m(1e9, 1.0)
    assert b / a == pytest.approx(ratio, rel=0.05)  # what Johnson's power law is good for


@pytest.mark.parametrize("region", [POINT, Region((0.0, 0.0), (50.0, 700.0))])
def test_smooth_points_go_with_the_third_root_of_the_load(region: Region) -> None:
    assert exponent(region, (STEEL, OAK), 1.0) == pytest.approx(1 / 3, abs=0.02)


def test_rough_contacts_go_with_the_load() -> None:
    smooth = exponent(POINT, (STEEL, OAK), 1.0)
    rough = [exponent(POINT, (STEEL, replace(OAK, roughness_m=h)), 1.0) for h in (1e-6, 1e-5, 1e-3)]
    assert smooth < rough[0] < rough[1] < rough[2] and rough[2] > 0.98
    load_n, height = 2.0, 1e-3
    got = contact_spring(POINT, (STEEL, replace(OAK, roughness_m=height)), load_n).normal_n_m.real
    assert got == pytest.approx(load_n / (height / 2), rel=0.01)


def test_a_line_and_a_face_are_stiffer_than_a_point() -> None:
    point = contact_spring(POINT, (STEEL, OAK), 1.0).normal_n_m.real
    line = contact_spring(Region((0.08, 0.0), (0.0, 200.0)), (STEEL, OAK), 1.0).normal_n_m.real
    face = contact_spring(Region((0.08, 0.02), (0.0, 0.0)), (STEEL, OAK), 1.0).normal_n_m.real
    assert 5 * point < line < face
    assert contact_spring(Region((0.0, 0.08), (200.0, 0.0)), (STEEL, OAK), 1.0).normal_n_m.real == pytest.approx(line)


def test_a_face_is_the_flat_punch() -> None:
    """A square's side 2a on a half-space: k = 1.15 · 2a E*, measured on any side of 1.1 to 1.2 by boundary elements."""
    half = 0.01
    got = contact_spring(Region((half, half), (0.0, 0.0)), (STEEL, OAK), 1.0).normal_n_m.real
    assert got == pytest.approx(1.15 * 2 * half * modulus(STEEL, OAK), rel=0.03)


def test_loss_goes_by_the_share_of_the_compliance() -> None:
    spring = contact_spring(POINT, (STEEL, OAK), 1.0).normal_n_m
    soft = OAK.compliance_per_pa * modulus(STEEL, OAK)
    assert spring.imag / spring.real == pytest.approx(0.02 * soft + 3e-4 * (1 - soft), rel=1e-12)
    alone = contact_spring(POINT, (OAK, OAK), 1.0).normal_n_m
    assert alone.imag / alone.real == pytest.approx(0.02, rel=1e-12)


def test_sideways_as_mindlin() -> None:
    spring = contact_spring(POINT, (STEEL, STEEL), 1.0)
    assert spring.tangential_n_m / spring.normal_n_m == pytest.approx(2 * 0.7 / 1.7, rel=1e-12)


def test_wood_is_pressed_across_its_grain() -> None:
    grain = np.diag([1 / 12e9, 1 / 0.9e9, 1 / 0.5e9, 1 / 0.1e9, 1 / 0.7e9, 1 / 0.8e9])
    spruce = Material("spruce", 450.0, np.linalg.inv(grain), alpha_per_s=2.0, beta_s=5e-7)
    side = ContactSide.of(spruce)
    assert side.modulus_pa == pytest.approx(0.5e9)
    assert side.loss_factor == pytest.approx(2e-3)


def test_what_is_no_region_or_load() -> None:
    with pytest.raises(RecordError, match="half-length"):
        Region((0.0, 0.01), (0.0, 1.0))
    with pytest.raises(RecordError, match="load"):
        contact_spring(POINT, (STEEL, OAK), 0.0)
