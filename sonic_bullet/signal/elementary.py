"""Elementary functions and small matrices of the same bits on every x86-64 machine: what decides a sample uses these.

NumPy's exp, sin, complex product and their like follow the processor (its vector instructions, and libm's), as BLAS and
LAPACK do. Here they are the engine's (src/math/elementary.hpp, dense.hpp). Sums, real products, quotients, square roots
and FFTs of NumPy are the same everywhere.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.records import Array


def _each(into: Callable[..., None], *values: object) -> Array:
    """Apply a function of the engine to each element of arrays, broadcast."""
    parts = np.broadcast_arrays(*(np.asarray(one, float) for one in values))
    out = np.empty(parts[0].shape)
    into(*(np.ascontiguousarray(one).ravel() for one in parts), out.reshape(-1))
    return out


def exp(x: object) -> Array:
    """Compute e^x of each element."""
    return _each(_engine.exp_into, x)


def expm1(x: object) -> Array:
    """Compute e^x - 1 of each element."""
    return _each(_engine.expm1_into, x)


def log(x: object) -> Array:
    """Compute the natural logarithm of each element."""
    return _each(_engine.log_into, x)


def log1p(x: object) -> Array:
    """Compute log(1 + x) of each element."""
    return _each(_engine.log1p_into, x)


def sin(x: object) -> Array:
    """Compute the sine of each element."""
    return _each(_engine.sin_into, x)


def cos(x: object) -> Array:
    """Compute the cosine of each element."""
    return _each(_engine.cos_into, x)


def cbrt(x: object) -> Array:
    """Compute the cube root of each element."""
    return _each(_engine.cbrt_into, x)


def power(x: object, y: object) -> Array:
    """Compute x^y of each element."""
    return _each(_engine.pow_into, x, y)


def arctan2(y: object, x: object) -> Array:
    """Compute the angle of (x, y) of each element."""
    return _each(_engine.atan2_into, y, x)


def arccos(x: object) -> Array:
    """Compute the angle of each cosine."""
    value = np.asarray(x, float)
    return 2 * arctan2(np.sqrt(1 - value), np.sqrt(1 + value))


def complex_exp(z: object) -> Array:
    """Compute e^z of each complex element."""
    value = np.asarray(z, complex)
    out = np.empty(value.shape, complex)
    _engine.cexp_into(np.ascontiguousarray(value).reshape(-1), out.reshape(-1))
    return out


def complex_product(a: object, b: object) -> Array:
    """Multiply complex arrays element by element; each part is rounded twice."""
    one, other = np.asarray(a), np.asarray(b)
    real = one.real * other.real - one.imag * other.imag
    out = np.empty(real.shape, complex)
    out.real, out.imag = real, one.real * other.imag + one.imag * other.real
    return out


def complex_size(z: object) -> Array:
    """Compute |z| of each complex element, √(x² + y²)."""
    value = np.asarray(z)
    return np.asarray(np.sqrt(value.real**2 + value.imag**2))


def complex_root(z: object) -> Array:
    """Compute the root of each complex element, of those with two the one whose real part is at least 0."""
    value = np.asarray(z)
    larger = np.sqrt((complex_size(value) + np.abs(value.real)) / 2)
    smaller = np.abs(value.imag) / np.where(larger > 0, 2 * larger, 1)
    root, ahead = np.empty(value.shape, complex), value.real >= 0
    root.real = np.where(ahead, larger, smaller)
    root.imag = np.copysign(np.where(ahead, smaller, larger), value.imag)
    return root


def matrix_product(a: object, b: object) -> Array:
    """Multiply matrices (p, q) and (q, r), real or complex; each sum runs in the order of q."""
    one, other = np.asarray(a), np.asarray(b)
    if not (np.iscomplexobj(one) or np.iscomplexobj(other)):
        left, right = (np.ascontiguousarray(matrix, float) for matrix in (one, other))
        product = np.empty((len(left), right.shape[1]))
        _engine.multiply(left, right, product)
        return product
    out = np.empty((len(one), other.shape[1]), complex)
    out.real, out.imag = matrix_product(one.real, other.real), matrix_product(one.real, other.imag)
    if np.iscomplexobj(one):
        out.real -= matrix_product(one.imag, other.imag)
        out.imag += matrix_product(one.imag, other.real)
    return out


def symmetric_eigenpairs(matrix: object) -> tuple[Array, Array]:
    """Compute the eigenvalues (n,) of a symmetric matrix, ascending, and its eigenvectors (n, n), by columns.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is not finite.
    """
    rows = np.array(matrix, float, order="C")
    value = np.empty(len(rows))
    scratch = np.empty((len(rows) + _engine.EIGEN_ROWS, len(rows)))
    if not np.isfinite(rows).all() or not _engine.eigenpairs(rows, value, scratch):
        raise np.linalg.LinAlgError("eigenvalues of a matrix that is not finite")
    return value, np.ascontiguousarray(rows.T)
