"""Modes of a free or clamped body: K u = λ M u by shift-and-invert block Lanczos.

    A = (K − σM)⁻¹ M,  A u = θ u,  λ = σ + 1/θ,
        σ < 0, so that K − σM is positive definite and the rigid modes (λ = 0) do no
    harm                                                                          [Ericsson & Ruhe 1980, eq. 1.3-1.5]
    A V_j = V_{j-1} B_jᵀ + V_j A_j + V_{j+1} B_{j+1},  VᵀMV = 1                   [Grimes, Lewis, Simon 1994, eq. 3.1]

The basis is kept fully orthogonal, so that degenerate modes of a symmetric body are found as such. It grows without
restart until the last mode asked for has converged. The start block is seeded: same body, same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.machine.progress import report_progress
from sonic_bullet.modal.sparse.factor import factorise
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import ModalError


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Elastic modes of a body.

    Attributes
    ----------
    lambda_per_s2 : (m,) elastic eigenvalues, ascending
    vector : (dof, m) with UᵀMU = 1
    rigid_per_s2 : (r,) eigenvalues of the rigid modes, zero but for round-off
    """

    lambda_per_s2: Array
    vector: Array
    rigid_per_s2: Array


def _orthonormal(block: Array, mass: Any) -> tuple[Array, Array, Array]:
    """Factor block (n, b) = Q R with QᵀMQ = 1, by Cholesky twice, into Q, MQ, R. Columns without weight become zero."""
    total = np.eye(block.shape[1])
    for _ in range(2):
        image = mass @ block
        gram = block.T @ image
        value, vector = np.linalg.eigh((gram + gram.T) / 2)
        good = value > 1e-14 * max(value[-1], 1e-300)
        root = np.sqrt(np.where(good, value, 1))
        inverse = vector * np.where(good, 1 / root, 0)
        block = block @ inverse
        total = (vector * np.where(good, root, 0)).T @ total
    return block, mass @ block, total


def solve(
    stiffness: Any,
    mass: Any,
    shift: float,
    *,
    rigid: int,
    enough: Callable[[Array], bool],
    most: int,
    report: bool = False,
    draft: bool = False,
) -> Modes:
    """Find the lowest elastic modes until ``enough(eigenvalues)``, at most ``most``; scipy sparse matrices (n, n).

    Parameters
    ----------
    shift : σ < 0 in 1/s², about as large as the first elastic eigenvalue
    rigid : number of rigid modes that the body has
    report : whether the number of modes found is reported as progress
    draft : whether λ to 1e-6 is enough, the square of its vector's error: a third of the processor less

    Raises
    ------
    ModalError
        The body has another number of rigid modes, or the iteration does not converge.
    """
    eigen_block = 16 if draft else 8
    tolerance = 1e-3 if draft else 1e-7  # of the residual bound, relative to θ
    size = stiffness.shape[0]
    factor = factorise(stiffness - shift * mass)
    block, image, _ = _orthonormal(np.random.default_rng(0).standard_normal((size, min(eigen_block, size))), mass)
    width = block.shape[1]
    longest = min(size // width * width, 4 * (most + rigid) + 64 * width)
    basis, images = np.zeros((size, longest), order="F"), np.zeros((size, longest), order="F")
    projected = np.zeros((longest, longest))
    coupling = np.zeros((width, width))
    used, check = 0, 4 * width
    while used < longest:
        here = slice(used, used + width)
        basis[:, here], images[:, here] = block, image
        used += width
        step = factor.solve(np.ascontiguousarray(image))
        for _ in range(2):  # twice is enough [Parlett 1980, ch. 6.9]
            weight = images[:, :used].T @ step
            step -= basis[:, :used] @ weight
            projected[:used, here] += weight
        block, image, coupling = _orthonormal(step, mass)
        if used < check and used < longest:
            continue
        check = used + max(width, used // 4 // width * width)
        theta, ritz = np.linalg.eigh(projected[:used, :used], UPLO="U")
        theta, ritz = theta[::-1], ritz[:, ::-1]
        residual = np.linalg.norm(coupling @ ritz[used - width :], axis=0)
        converged = int(np.argmax(np.append(residual > tolerance * np.abs(theta), True)))
        value = shift + 1 / theta[:converged]
        elastic = value[rigid:]
        if report:
            report_progress(f"{format_count(max(0, len(elastic)), 'mode')} found")
        if len(elastic) and (len(elastic) >= most or enough(elastic) or used >= size - width):
            return _check_modes(value[: rigid + most], basis[:, :used] @ ritz[:, : min(converged, rigid + most)], rigid)
    raise ModalError(f"only {max(0, converged - rigid)} of {most} modes converged", "give a smaller count or to_hz")


def _check_modes(value: Array, vector: Array, rigid: int) -> Modes:
    rigid_tolerance = 1e-4  # of the first elastic λ: 1e-5 is round-off in a sheet of thickness length/700
    elastic = value[rigid:]
    if elastic[0] <= 0 or (rigid and np.abs(value[:rigid]).max() > rigid_tolerance * elastic[0]):
        shown = ", ".join(f"{v:.3g}" for v in value[: rigid + 2])
        raise ModalError(
            f"body has not {rigid} rigid modes: eigenvalues start {shown}",
            "its parts must hang together, its walls be thicker than a 700th of its length: repair the mesh",
        )
    return Modes(np.array(elastic), vector[:, rigid:], np.array(value[:rigid]))
