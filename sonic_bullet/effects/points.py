"""Which point of a body explains a number per mode: y ≈ Σ nuisance + strength · φ²(p), strength ≥ 0.

Every surface point is tried at once, the nuisance columns projected out [Frisch & Waugh 1933]; the best few are solved again without outliers.
Source of the laws that have this form: Rayleigh 1894, ch. 4 (added mass: Δλ/λ = −m φ²); Zheng & James 2011 (damper: Δd = ½ c φ²).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.effects.values import Heard
from sonic_bullet.records import Array, ModalModel

MOST_POINTS = 6000
REFINED = 60


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """A vertex, the strength there, nuisance coefficients, the weighted sum of squares left, and before."""

    vertex: int
    strength: float
    nuisance: Array
    left: float
    before: float


def candidates(heard: Heard, *, normal: bool = False) -> tuple[Array, Array]:
    """Surface vertices (p,), and φ² (p, k) of each line's modes there, mean over the modes a line stands for; normal: of the motion along the normal."""
    assert heard.model is not None
    vertex = np.unique(heard.model.face)
    if len(vertex) > MOST_POINTS:
        vertex = vertex[:: len(vertex) // MOST_POINTS + 1]
    shape = heard.model.shape[vertex].astype(float)
    if normal:
        n = vertex_normals(heard.model)[vertex]
        square = np.einsum("pxm,px->pm", shape, n) ** 2
    else:
        square = (shape**2).sum(axis=1)
    return vertex, np.stack([square[:, m].mean(axis=1) for m in heard.mode], axis=1) if heard.mode else np.zeros((len(vertex), 0))


def vertex_normals(model: ModalModel) -> Array:
    """Outward unit normals (v, 3), by the faces around a vertex weighted with their areas."""
    v, f = model.vertex_m, model.face
    corner = v[f]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.zeros_like(v)
    for i in range(3):
        np.add.at(normal, f[:, i], cross)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))


def best_spot(y: Array, sd: Array, nuisance: Array, vertex: Array, square: Array, *, not_negative: bool = True) -> Spot | None:
    """The point whose φ² (p, k) explains y (k,) best beside nuisance (k, c) columns; None where none helps."""
    weight = 1 / sd
    fixed, at = _plain(y, weight, nuisance), weight
    b, a, v = at[:, None] * nuisance, at * y, at * square
    basis, _ = np.linalg.qr(b)
    r = a - basis @ (basis.T @ a)
    v = v - (v @ basis) @ basis.T
    power = (v**2).sum(axis=1)
    push = v @ r
    gain = np.where(push > 0, push**2 / np.maximum(power, 1e-300), 0.0)
    gain[power < 1e-6 * ((at * square) ** 2).sum(axis=1)] = 0.0
    best: Spot | None = None
    for i in np.argsort(-gain)[:REFINED]:
        if gain[i] <= 0:
            break
        x, left = _solve(y, weight, np.column_stack([nuisance, square[i]]), not_negative)
        if x[-1] > 0 and (best is None or left < best.left):
            best = Spot(int(vertex[i]), float(x[-1]), x[:-1], left, fixed)
    return best


def _plain(y: Array, weight: Array, nuisance: Array) -> float:
    return _solve(y, weight, nuisance, False)[1]


def _solve(y: Array, weight: Array, columns: Array, not_negative: bool) -> tuple[Array, float]:
    """Least squares with Huber's weights; the sum of Huber's losses left, doubled. Columns may have any scale."""
    from scipy.optimize import nnls

    scale = 1 / np.maximum(np.sqrt(((columns * weight[:, None]) ** 2).sum(axis=0)), 1e-300)
    a, b = columns * scale * weight[:, None], y * weight
    trust = np.ones(len(y))
    x = np.zeros(columns.shape[1])
    for _ in range(8):
        root = np.sqrt(trust)
        x = nnls(a * root[:, None], b * root)[0] if not_negative else np.linalg.lstsq(a * root[:, None], b * root, rcond=None)[0]
        off = np.abs(b - a @ x)
        trust = np.minimum(1.0, 3.0 / np.maximum(off, 1e-12))
    return x * scale, float(np.where(off <= 3, off**2, 6 * off - 9).sum())
