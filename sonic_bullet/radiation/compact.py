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

    The mean flow through faces (f, 3) is its monopole, the rest its dipole.

        |p|² = (ρ₀c)²/4π [A₀ x²/(1 + x²) + (A - A₀) x⁴/(4 + x⁴)],  x = ka, a = √(S/4π), A = ∮v²dS, A₀ = (∮v dS)²/S
        [Pierce 1989, sec. 4-1, 4-2]

    Limit: modes of short waves, whose flow cancels, are up to 20 dB too loud below coincidence.
    """
    m, weight = model.mode_count, np.zeros(model.mode_count, complex)
    x2 = k**2 * area.sum() / (4 * np.pi)
    for lo in range(0, m, MODES_AT_ONCE):
        some = slice(lo, min(lo + MODES_AT_ONCE, m))
        v = np.einsum("fi,fim->fm", normal, model.shape[:, :, some].astype(float)[face].mean(axis=1))
        flow, whole = area @ v, area @ v**2
        even = flow**2 / area.sum()
        size = even * (x2 / (1 + x2))[some] + np.maximum(whole - even, 0) * (x2**2 / (4 + x2**2))[some]
        weight[some] = np.sqrt(size) * np.where(flow < 0, -1j, 1j)
    return np.asarray(weight * air.density_kg_m3 * air.sound_speed_m_s / np.sqrt(4 * np.pi))
