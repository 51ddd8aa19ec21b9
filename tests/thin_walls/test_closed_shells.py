"""CalculiX's kept frequencies against closed forms: bars, plates, tubes, a ring, caps of balls."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from sonic_bullet.records import Array
from studies.thin_walls import shell_formulas as shells
from studies.thin_walls.bodies import BODIES, BRASS, PORCELAIN, STEEL
from studies.thin_walls.reference import truth
from tests.few_cases import parametrize_few
from tests.made import closed_forms


def known(name: str) -> Array:
    return truth(name).frequency_hz


def has(name: str, frequency_hz: float, rel: float) -> None:
    """A body has a mode there."""
    nearest = known(name)[np.abs(known(name) - frequency_hz).argmin()]
    assert nearest == pytest.approx(frequency_hz, rel=rel), name


def test_a_square_bar_bends_twists_and_stretches() -> None:
    """Timoshenko's beam is off by some 1e-3 once a wave is five heights long; twist and stretch are not."""
    stuff = asdict(STEEL)
    bending = closed_forms.bar_bending_hz(0.3, 0.02, 0.02, **stuff, count=5)
    for frequency_hz, rel in zip(bending, (3e-4, 8e-4, 1.5e-3, 2.5e-3, 3.5e-3), strict=True):
        has("square-bar", frequency_hz, rel)
    for frequency_hz in closed_forms.square_bar_torsion_hz(0.3, 0.02, **stuff, count=2):
        has("square-bar", frequency_hz, 3e-4)
    has("square-bar", closed_forms.bar_longitudinal_hz(0.3, 0.02, 0.02, **stuff, count=1)[0], 1e-5)


@pytest.mark.parametrize(("name", "length_m", "count"), [("round-bar", 0.2, 2), ("tube-0.2", 0.2, 1)])
def test_what_is_round_twists_exactly(name: str, length_m: float, count: int) -> None:
    """n/2L √(G/ρ), whatever the radii [Love 1927, § 200]."""
    speed = np.sqrt(STEEL.youngs_pa / (2 * (1 + STEEL.poisson)) / STEEL.density_kg_m3)
    for n in range(1, count + 1):
        has(name, n * speed / (2 * length_m), 1e-4)


def test_thin_plates_are_kirchhoffs_and_thicker_ones_lower() -> None:
    """The thin theory's error goes with h/a: under h/a at 0.002 and 0.01, and never the other sign beyond rounding."""
    for share, thickness_m in ((0.002, 0.0006), (0.01, 0.003)):
        square = closed_forms.free_square_plate_hz(0.3, thickness_m, STEEL.youngs_pa, STEEL.density_kg_m3)
        round_plate = shells.round_plate_hz(0.15, thickness_m, **asdict(BRASS), count=15)
        for name, thin in ((f"square-plate-{share}", square), (f"round-plate-{share}", round_plate)):
            off = known(name)[: len(thin)] / thin - 1
            assert -share < off.min(), name
            assert off.max() < 1e-4, name


def test_a_ring_is_loves() -> None:
    for n, rel in ((2, 2e-4), (3, 1.5e-3), (4, 3e-3), (5, 5e-3)):
        frequency_hz = shells.ring_in_plane_hz(0.035, 0.0015, BRASS.youngs_pa, BRASS.density_kg_m3, n)
        has("ring", frequency_hz, rel)


@parametrize_few(
    ("name", "size", "orders", "rel"),
    [("tube-0.01", (0.03, 0.0003, 0.2), (2, 3, 4), 5e-3), ("tube-0.05", (0.02, 0.001, 0.3), (2, 3), 8e-3)],
    1,
)
def test_a_thin_tube_is_rayleighs_and_loves(
    name: str, size: tuple[float, float, float], orders: tuple[int, ...], rel: float
) -> None:
    for n in orders:
        for tilting in (False, True):
            has(name, shells.free_cylinder_hz(*size, **asdict(BODIES[name].stuff), n=n, tilting=tilting), rel)


@parametrize_few(
    ("name", "radius_m", "thickness_m", "half_deg", "stuff"),
    [("bowl", 0.07, 0.003, 90.0, PORCELAIN), ("dome", 0.2, 0.002, 50.0, STEEL)],
    1,
)
def test_a_cap_bends_nearly_without_stretching(
    name: str, radius_m: float, thickness_m: float, half_deg: float, stuff: object
) -> None:
    """Rayleigh's motion is constrained, so it is higher; a layer at the edge, √(rh) wide, is what it lacks."""
    assert stuff == BODIES[name].stuff
    thin = shells.cap_hz(radius_m, thickness_m, np.radians(half_deg), **asdict(BODIES[name].stuff), n=2)
    lacking = 1 - known(name)[0] / thin
    assert 0 < lacking < 0.4 * np.sqrt(thickness_m / radius_m)


def test_a_round_plates_thin_theory_has_the_known_figures() -> None:
    """λ² for ν = 0.3 [Amabili, Pasqualini & Dalpiaz 1995]: 5.358, 9.003, 12.439, 20.475, 21.835."""
    unit = 1 / np.sqrt(shells.bending_stiffness(1.0, 0.3, 1.0)) * 2 * np.pi
    found = shells.round_plate_hz(1.0, 1.0, 1.0, 0.3, 1.0, 9) * unit
    expected = [5.358, 5.358, 9.003, 12.439, 12.439, 20.475, 20.475, 21.835, 21.835]
    np.testing.assert_allclose(found, expected, rtol=1e-4)
