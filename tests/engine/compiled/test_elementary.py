"""Elementary functions of the engine against exact arithmetic: each within 1 ulp."""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
import pytest

from sonic_bullet import _engine
from sonic_bullet.records import Array

PER_RANGE = 400


def drawn(low: float, high: float, seed: int) -> Array:
    """Draw numbers over a range: evenly where it crosses zero, else by magnitude."""
    rng = np.random.default_rng(seed)
    if low > 0:
        return np.exp(rng.uniform(np.log(low), np.log(high), PER_RANGE))
    return rng.uniform(low, high, PER_RANGE)


def ulps(found: Array, exact: list[mpmath.mpf]) -> float:
    """Return the largest distance in units of the last place."""
    return max(
        float(abs(mpmath.mpf(float(a)) - e) / mpmath.mpf(float(np.spacing(abs(float(e)))))) if e != 0 else abs(float(a))
        for a, e in zip(found, exact, strict=True)
    )


ONE = [
    ("exp", _engine.exp_into, mpmath.exp, [(-1e-3, 1e-3), (-0.4, 0.4), (-5, 5), (-700, 700), (-740, -700)]),
    ("expm1", _engine.expm1_into, mpmath.expm1, [(1e-20, 1e-3), (-1e-3, 0), (-1, 1), (-30, 60), (60, 700)]),
    ("log", _engine.log_into, mpmath.log, [(0.5, 2), (0.9999, 1.0001), (1e-300, 1e300), (1e-320, 1e-308)]),
    ("log1p", _engine.log1p_into, mpmath.log1p, [(-0.999, -0.3), (-1e-3, 1e-3), (0.1, 10), (1e-18, 1e300)]),
    ("sin", _engine.sin_into, mpmath.sin, [(-0.7, 0.7), (-10, 10), (-1e4, 1e4), (1e5, 1e7), (1e7, 1e300)]),
    ("cos", _engine.cos_into, mpmath.cos, [(-0.7, 0.7), (-10, 10), (-1e4, 1e4), (1e5, 1e7), (1e7, 1e300)]),
    ("cbrt", _engine.cbrt_into, mpmath.cbrt, [(1, 8), (1e-300, 1e300), (1e-320, 1e-308)]),
]  # fmt: skip


@pytest.mark.parametrize("name, function, reference, ranges", ONE, ids=[one[0] for one in ONE])
def test_one_argument(
    name: str, function: Callable[..., None], reference: Callable[..., mpmath.mpf], ranges: list[tuple[float, float]]
) -> None:
    """Each value lies within 1 ulp of the exact one, in every range."""
    with mpmath.workprec(1300):
        for seed, (low, high) in enumerate(ranges):
            x = drawn(low, high, seed)
            out = np.empty_like(x)
            function(x, out)
            worst = ulps(out, [reference(mpmath.mpf(float(one))) for one in x])
            assert worst < 1.0, f"{name} in {low} … {high}: {worst:.3f} ulp"


def test_power() -> None:
    """x^y lies within 1 ulp of the exact one, with the powers that the physics has and any others."""
    with mpmath.workprec(300):
        for seed, y in enumerate([0.2, 0.4, 0.6, 1.5, -1.5, 2.0, 1 / 3, 0.5, 7.3, -40.25]):
            x = drawn(1e-6, 1e6, seed)
            out = np.empty_like(x)
            _engine.pow_into(x, np.full_like(x, y), out)
            assert ulps(out, [mpmath.power(mpmath.mpf(float(one)), mpmath.mpf(y)) for one in x]) < 1.0, y


def test_angle() -> None:
    """The angle of a point lies within 1 ulp of the exact one, in all quadrants and on the axes."""
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=400) * 10 ** rng.uniform(-9, 9, 400), rng.normal(size=400)
    x[:4], y[:4] = (0, 0, 3, -3), (2, -2, 0, 0)
    out = np.empty_like(x)
    _engine.atan2_into(y, x, out)
    with mpmath.workprec(300):
        exact = [mpmath.atan2(mpmath.mpf(float(b)), mpmath.mpf(float(a))) for a, b in zip(x, y, strict=True)]
        assert ulps(out, exact) < 1.0


def test_error_function() -> None:
    """Erf lies within 32 ulp, on both sides of the place where its form changes, and is odd."""
    x = np.concatenate([drawn(1e-8, 8.0, 1), drawn(2.9, 3.1, 2)])
    out, mirrored = np.empty_like(x), np.empty_like(x)
    _engine.erf_into(x, out)
    _engine.erf_into(-x, mirrored)
    assert ulps(out, [mpmath.erf(mpmath.mpf(float(one))) for one in x]) < 32.0
    np.testing.assert_array_equal(out, -mirrored)


def test_special_values() -> None:
    """Infinities, zeros and what is no number give what IEEE 754 says."""
    x = np.array([0.0, np.inf, -np.inf, np.nan, 710.0, -746.0])
    out = np.empty_like(x)
    _engine.exp_into(x, out)
    np.testing.assert_array_equal(out, [1.0, np.inf, 0.0, np.nan, np.inf, 0.0])
    x = np.array([0.0, np.inf, -1.0, np.nan, 1.0])
    out = np.empty_like(x)
    _engine.log_into(x, out)
    np.testing.assert_array_equal(out, [-np.inf, np.inf, np.nan, np.nan, 0.0])
    _engine.pow_into(x, np.array([2.0, -1.0, 3.0, 0.0, np.nan]), out)
    np.testing.assert_array_equal(out, [0.0, 0.0, -1.0, 1.0, 1.0])
