"""A stiffness with axes along the mesh's, by numbers that a search can move: p (9,), and fewer under a symmetry.

    p = (ln E₁₂₃, n₂₃ n₁₃ n₁₂, ln G₂₃ G₁₃ G₁₂), per density;  n_ij = ν_ij √(E_j/E_i),  S = D^{-1/2} (n) D^{-1/2}
        [Bodig & Jayne 1982, eq. 3.8]

Isotropic 2, cubic 3, hexagonal about x, y or z (transversely isotropic) 5, orthorhombic (orthotropic) 9
    [Nye 1957, ch. VIII]
"""

from __future__ import annotations

SYMMETRIES = {"isotropic": 2, "cubic": 3, "hexagonal-x": 5, "hexagonal-y": 5, "hexagonal-z": 5, "orthorhombic": 9}
