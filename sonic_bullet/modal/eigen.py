"""Modes of a free or clamped body: K u = λ M u by shift and invert.

(K − σM)⁻¹ M u = u / (λ − σ),  σ < 0, so that K − σM is positive definite and the rigid modes (λ = 0) do no harm
                                                                    [Ericsson & Ruhe 1980, eq. 1.3]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.errors import ModalError
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """lambda_per_s2 (m,) ascending, elastic only; vector (dof, m) with UᵀMU = 1; rigid_per_s2 (r,) the eigenvalues of the rigid modes."""

    lambda_per_s2: Array
    vector: Array
    rigid_per_s2: Array


def solve(stiffness: Any, mass: Any, shift: float, rigid: int, wanted: Callable[[Array], bool], most: int) -> Modes:
    """Lowest modes until ``wanted(elastic eigenvalues)`` says enough, at most ``most`` of them.

    shift < 0 in 1/s², about as large as the first elastic eigenvalue. rigid: how many rigid modes the body has.
    Raises ModalError where the number of rigid modes is another.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    size = stiffness.shape[0]
    factor = splu((stiffness - shift * mass).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    inverse = LinearOperator((size, size), factor.solve)
    start = np.random.default_rng(0).standard_normal(size)
    ask = min(24, most)
    while True:
        ask = min(ask, size - 2 - rigid)
        value, vector = eigsh(stiffness, k=ask + rigid, M=mass, sigma=shift, OPinv=inverse, v0=start)
        order = np.argsort(value)
        value, vector = value[order], vector[:, order]
        elastic = value[rigid:]
        if len(elastic) == 0 or elastic[0] <= 0 or (rigid and np.abs(value[:rigid]).max() > 1e-6 * elastic[0]):
            raise ModalError(f"body has not {rigid} rigid modes: eigenvalues start {value[: rigid + 2]}", "its parts must hang together")
        if wanted(elastic) or ask >= most or ask >= size - 2 - rigid:
            return Modes(elastic, vector[:, rigid:], value[:rigid])
        ask = min(2 * ask, most)
