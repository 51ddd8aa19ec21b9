"""Faces of a body that radiate, and the compact law, used where its near field cannot be computed."""

from __future__ import annotations

import numpy as np

from sonic_bullet.geometry import label_components
from sonic_bullet.records import Air, Array, ModalModel

MODES_AT_ONCE = 32
COMPACT = "radiates by the law of compact bodies: its surface is too involved for the near field"


def sound_faces(model: ModalModel) -> tuple[Array, Array]:
    """Return corners (f, 3, 3) and faces (f, 3), outward, with an area and air beyond: a cavity's sound stays in."""
    face = _outer(model.vertex_m, model.face) if len(model.face) else model.face
    corner = model.vertex_m[face]
    twice = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=-1)
    keep = twice > 1e-12 * twice.max(initial=0.0)
    return corner[keep], face[keep]


def _outer(vertex_m: Array, face: Array) -> Array:
    """Remove the faces of cavities, pieces that enclose a negative volume; turn all faces where they look inward."""
    of_vertex = label_components(len(vertex_m), face[:, [0, 1]].T.ravel(), face[:, [1, 2]].T.ravel())
    piece = of_vertex[face[:, 0]]
    corner = vertex_m[face] - vertex_m[face].mean(axis=(0, 1))
    six = np.einsum("fi,fi->f", np.cross(corner[:, 0], corner[:, 1]), corner[:, 2])
    volume = np.bincount(piece, six)
    if volume.sum() < 0:
        face, volume = face[:, ::-1], -volume
    return np.asarray(face[(volume >= 0)[piece]])


def compact_weight(model: ModalModel, face: Array, area: Array, normal: Array, k: Array, air: Air) -> Array:
    """Compute the pressure weight (m,) of a body taken as a sphere of its area.

    The mean flow through faces (f, 3) is its monopole, what moves as a whole its dipole, the rest its quadrupole.

        |p|² = (ρ₀c)²/4π [A₀ x²/(1 + x²) + A₁ x⁴/(4 + x⁴) + (A - A₀ - A₁) x⁶/(81 + 9x² - 2x⁴ + x⁶)]
        x = ka, a = √(S/4π), A = ∮v²dS, A₀ = (∮v dS)²/S, A₁ = gᵀG⁻¹g, g = ∮v n dS, G = ∮n nᵀdS
        each 1/|x h_l'(x)|² of a sphere's harmonic l                                    [Pierce 1989, sec. 4-1, 4-2]

    A free body's modes have no momentum, so little of them is a dipole. Limit: those of short waves, whose flow cancels
    more than a quadrupole's, are too loud below coincidence.
    """
    m, weight = model.mode_count, np.zeros(model.mode_count, complex)
    x2 = k**2 * area.sum() / (4 * np.pi)
    monopole, dipole = x2 / (1 + x2), x2**2 / (4 + x2**2)
    quadrupole = x2**3 / (81 + 9 * x2 - 2 * x2**2 + x2**3)
    spread = np.linalg.pinv((normal.T * area) @ normal)
    for lo in range(0, m, MODES_AT_ONCE):
        some = slice(lo, min(lo + MODES_AT_ONCE, m))
        v = np.einsum("fi,fim->fm", normal, model.shape[:, :, some].astype(float)[face].mean(axis=1))
        flow, whole, push = area @ v, area @ v**2, (normal.T * area) @ v
        even, odd = flow**2 / area.sum(), np.einsum("im,ij,jm->m", push, spread, push)
        rest = np.maximum(whole - even - odd, 0)
        size = even * monopole[some] + odd * dipole[some] + rest * quadrupole[some]
        weight[some] = np.sqrt(size) * np.where(flow < 0, -1j, 1j)
    return np.asarray(weight * air.density_kg_m3 * air.sound_speed_m_s / np.sqrt(4 * np.pi))
