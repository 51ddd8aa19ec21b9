"""Rounded shapes: whole multiples of a power of two, exact in float32 and in a file, off by what is said at most."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.records.mode_shapes import (
    differences,
    from_multiples,
    quantize_shapes,
    sum_differences,
    whole_multiples,
)

SHAPE_BITS = 11


def shapes(seed: int = 0, v: int = 50, m: int = 6) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (rng.normal(size=(v, 3, m)) * 10.0 ** rng.uniform(-6, 6, m)).astype(np.float32)


@pytest.mark.parametrize("bits", [4, SHAPE_BITS, 15])
def test_the_error_is_half_a_multiple_at_most(bits: int) -> None:
    exact = shapes()
    made = quantize_shapes(exact, bits)
    largest = np.abs(exact).max(axis=(0, 1))
    error = np.abs(made.astype(float) - exact).max(axis=(0, 1)) / largest
    assert made.dtype == np.float32 and (error <= 2.0**-bits).all() and (error > 2.0**-bits / 10).all()


def test_rounding_twice_is_rounding_once_and_zeros_have_no_sign() -> None:
    made = quantize_shapes(shapes())
    assert quantize_shapes(made).tobytes() == made.tobytes()
    assert not np.signbit(quantize_shapes(np.full((1, 3, 1), -0.0, np.float32))).any()
    assert not np.signbit(made[made == 0]).any()


@pytest.mark.parametrize("bits", [4, SHAPE_BITS, 14])
def test_rounded_shapes_are_whole_numbers_and_come_back_as_the_same_bytes(bits: int) -> None:
    made = quantize_shapes(shapes(), bits).copy()
    made[..., 2] = 0
    made[0, 0, 3] = 2 * np.abs(made[..., 3]).max()  # as effects may turn them
    found = whole_multiples(made)
    assert found is not None
    whole, exponent = found
    assert whole.dtype == exponent.dtype == np.int16 and np.abs(whole).max() <= 2 ** min(bits + 1, 15)
    assert from_multiples(whole, exponent).tobytes() == made.tobytes()
    odd = np.bitwise_or.reduce(whole, axis=(0, 1))
    assert (odd[[0, 1, 3, 4, 5]] & 1 == 1).all()  # no coarser power of two would do


def test_a_component_that_rounds_up_to_the_next_power_of_two_is_kept() -> None:
    made = quantize_shapes(np.array([[[0.99999], [0.3], [-0.7]]], np.float32), 4)
    assert made[0, 0, 0] == 1 and (found := whole_multiples(made)) is not None
    assert from_multiples(*found).tobytes() == made.tobytes()


@pytest.mark.parametrize("shape", [(0, 3, 2), (5, 3, 0), (0, 3, 0)])
def test_bodies_without_modes_or_surface(shape: tuple[int, int, int]) -> None:
    none = np.zeros(shape, np.float32)
    assert quantize_shapes(none).shape == shape and (found := whole_multiples(none)) is not None
    assert from_multiples(*found).shape == shape


@pytest.mark.parametrize("other", [1 / 3, -0.0, 1e-44, 2.0**-120 * (1 + 2.0**-20)])
def test_what_is_no_such_multiple_is_said_and_not_changed(other: float) -> None:
    made = np.ones((4, 3, 1), np.float32)
    made[1, 1, 0] = other
    assert whole_multiples(made) is None


def test_tiny_shapes_are_rounded_to_what_float32_holds_whole() -> None:
    made = quantize_shapes(np.array([[[3e-38], [1e-40], [2e-38]]], np.float32))
    assert np.isfinite(made).all() and (found := whole_multiples(made)) is not None
    assert from_multiples(*found).tobytes() == made.tobytes()


CHAIN = np.stack([np.arange(198), np.arange(1, 199), np.arange(2, 200)], axis=1)


@pytest.mark.parametrize(
    "face",
    [CHAIN, CHAIN[::-1, ::-1], 199 - CHAIN, np.random.default_rng(1).integers(0, 200, (90, 3)), np.zeros((0, 3), int)],
)
def test_differences_along_the_surface_add_up_again_also_where_they_overflow(face: np.ndarray) -> None:
    whole = np.random.default_rng(0).integers(-(2**15), 2**15, (200, 3, 4)).astype(np.int16)
    step = differences(whole, face)
    assert step.dtype == np.uint16 and sum_differences(step, face).tobytes() == whole.tobytes()
    even = differences(np.full_like(whole, -7), CHAIN)
    assert (even[1:] == 0).all() and (even[0] == 13).all()


def test_smooth_shapes_have_small_differences() -> None:
    """Over a strip of 200 vertices a half wave of 2047 changes by 2047 π/200 from one to the next, and twice that to
    the one behind it."""
    wave = np.rint(2047 * np.sin(np.pi * np.arange(200) / 200)).astype(np.int16)
    step = differences(np.repeat(wave[:, None, None], 3, axis=1), CHAIN)
    assert step.max() <= 2 * (2 * 2047 * np.pi / 200 + 1)
