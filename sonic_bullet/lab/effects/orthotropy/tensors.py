"""A stiffness with axes along the mesh's, by numbers that a search can move: p (9,), and fewer under a symmetry.

    p = (ln E₁₂₃, n₂₃ n₁₃ n₁₂, ln G₂₃ G₁₃ G₁₂), per density;  n_ij = ν_ij √(E_j/E_i),  S = D^{-1/2} (n) D^{-1/2}
        [Bodig & Jayne 1982, eq. 3.8]

Isotropic 2, cubic 3, hexagonal about x, y or z (transversely isotropic) 5, orthorhombic (orthotropic) 9
    [Nye 1957, ch. VIII]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import ORTHOTROPIC, Array

NAMES = ("youngs_x", "youngs_y", "youngs_z", "n_yz", "n_xz", "n_xy", "shear_yz", "shear_xz", "shear_xy")
RATIOS = (0.04, 0.1, 0.25, 0.6, 1.5, 4.0, 10.0)

LEAST_SPREAD = 3e-4  # of ln f: less is not identifiable
TENSOR_WIDTHS = (0.04, 0.025, 0.016, 0.01, 0.007, 0.005, 0.004, 0.004)  # of ln f, of a pair: ever closer
# of those sifted, taken further; without patterns
TENSOR_STARTS = 24
TENSOR_STARTS_BLIND = 12
# in BIC: over isotropy, so that a nearer end is looked for; over the last end, so that it is gone on from
HINTED_BIC = 10.0
HOP_BIC = 2.0
# ends that are gone on from, and how often
ENDS_HOPPED_FROM = 3
MOST_HOPS = 6
DECIDING_LINES = 10  # where no pattern does
# of TENSOR_WIDTHS, from which on what a symmetry ties is freed: pairing wide, less so, and near
FREED_FROM = (0, 1, 3)
# of ln E/ρ in the sieve: an isotropic body may have been fitted to what goes along a plank, or across; of ln f
SIEVE_REACH = 2.0
SIEVE_WIDTH = 0.014


def _normal_compliance(p: Array) -> Array:
    """Compute √(E_i E_j) S_ij (3, 3) of p (9,): 1, and −n_ij between axes."""
    return np.array([[1, -p[5], -p[4]], [-p[5], 1, -p[3]], [-p[4], -p[3], 1]])


def isotropic_shear(p: Array) -> Array:
    """Compute ln √(E_i E_j)/2(1 + n_ij) (3,) of p (9,): ln G_ij of a body whose planes were each isotropic."""
    e = p[:3]
    return np.asarray(0.5 * np.array([e[1] + e[2], e[0] + e[2], e[0] + e[1]]) - np.log(2 * (1 + p[3:6])))


def stiffness(p: Array) -> Array:
    """Compute C/ρ (6, 6) of p (9,) in m²/s²."""
    root = np.exp(-0.5 * p[:3])
    found = np.zeros((6, 6))
    found[:3, :3] = np.linalg.inv(_normal_compliance(p) * np.outer(root, root))
    found[range(3, 6), range(3, 6)] = np.exp(p[6:])
    return found


def sound(p: Array) -> bool:
    """Decide whether the tensor of p is positive definite."""
    return bool(np.linalg.eigvalsh(_normal_compliance(p))[0] > 0.02)


def constants(p: Array) -> Array:
    """Compute the nine constants (9,) of C/ρ, as `Elastic.look` orders them."""
    c = stiffness(p)
    return np.array([c[i, j] for i, j in ORTHOTROPIC])


def expand_numbers(symmetry: str, q: Array) -> Array:
    """Compute p (9,) of a symmetry's own numbers.

    They are (ln E, n), (ln E, n, ln G), (ln E_along, ln E_across, n_along, n_across, ln G_along), or p itself.
    """
    if symmetry == "isotropic":
        return np.concatenate([np.full(3, q[0]), np.full(3, q[1]), np.full(3, q[0] - np.log(2 * (1 + q[1])))])
    if symmetry == "cubic":
        return np.repeat(q, 3)
    if symmetry == "orthorhombic":
        return np.array(q)
    along = "xyz".index(symmetry[-1])
    p = np.array([q[1]] * 3 + [q[2]] * 3 + [q[4]] * 3)
    p[along], p[3 + along], p[6 + along] = q[0], q[3], q[1] - np.log(2 * (1 + q[3]))
    return p


def reduce_numbers(symmetry: str, p: Array) -> Array:
    """Compute the symmetry's own numbers nearest to p."""
    if symmetry == "isotropic":
        return np.array([p[:3].mean(), p[3:6].mean()])
    if symmetry == "cubic":
        return np.asarray(p.reshape(3, 3).mean(axis=1))
    if symmetry == "orthorhombic":
        return np.array(p)
    along = "xyz".index(symmetry[-1])
    rest = [k for k in range(3) if k != along]
    return np.array([p[along], p[rest].mean(), p[3:6][rest].mean(), p[3 + along], p[6:][rest].mean()])


def p_of(stiffness_m2_s2: Array) -> Array:
    """Compute p (9,) of C/ρ (6, 6), the inverse of `stiffness`."""
    compliance = np.linalg.inv(stiffness_m2_s2)
    youngs = 1 / np.diag(compliance)[:3]
    normal = [-compliance[i, j] * np.sqrt(youngs[i] * youngs[j]) for i, j in ((1, 2), (0, 2), (0, 1))]
    return np.concatenate([np.log(youngs), normal, np.log(np.diag(stiffness_m2_s2)[3:])])


def cubes(start: Array) -> list[Array]:
    """Return cubic tensors p to start a search from, about an isotropic one."""
    zener = (0.4, 0.5, 0.62, 0.77, 0.9, 1.0, 1.15, 1.35, 1.6, 2.0, 2.5)
    poisson = (-0.1, 0.0, 0.1)  # beside the guess'
    found = []
    for ratio in zener:
        for more in poisson:
            p = np.array(start)
            p[3:6] = np.clip(p[3:6] + more, 0.05, 0.42)
            p[6:] = p[:3] - np.log(2 * (1 + p[3:6])) + np.log(ratio)
            found.append(p)
    return found


def bricks(start: Array, ratios: tuple[float, ...] = RATIOS) -> list[Array]:
    """Return orthorhombic tensors p to start from: E along y and z over that along x, and G as isotropic or softer."""
    found = []
    for y in ratios:
        for z in ratios:
            for soft in (1.0, 0.6):
                e = np.log(np.array([1.0, y, z]))
                p = np.array(start)
                p[:3] += e - e.mean()
                p[6:] = isotropic_shear(p) + np.log(soft)
                found.append(p)
    return found
