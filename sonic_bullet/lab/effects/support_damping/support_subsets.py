"""Weak dashpots, all at once: to first order decays are linear in their strengths, so best subsets are enumerated.

    d_k = law(ω_k) + ½ Σ_j c_j |φ_k(p_j)|²,  law = a + bω + cω²;   Σ_k ((d_k − …)/sd_k)² -> min over subsets
        (best subsets, law projected out [Frisch & Waugh 1933])

One after another is not enough: the best two or three together need not contain the best one alone. Strong dashpots
couple modes: support_search.py.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.effects.support_damping.dashpot_fit import Dashpot, DashpotFit, Dashpots
from sonic_bullet.records import Array


def subsets(t: DashpotFit, vertices: Array, few: int) -> list[Dashpots]:
    """Find the best single dashpots, pairs and triples on a grid.

    Parameters
    ----------
    t : DashpotFit
        The object.
    vertices : (p,)
        The grid; along the normal or every direction.
    few : int
        Sets of each size.
    """
    same = 1e-6  # of what a set explains
    still = 1e-3  # of what the most telling point does: where nothing moves, nothing is weak
    pairs = 200  # best of two, of which threes are made
    line, mode = t.plain()
    if len(line) < 4:
        return []  # the law says it all
    omega, weight = 2 * np.pi * t.model.freq_hz[mode], np.sqrt(t.worth[line]) / t.sd[line]
    moved = t.model.shape[vertices].astype(float)[:, :, mode]
    along, every = np.einsum("vx,vxm->vm", t.normal[vertices], moved) ** 2, (moved**2).sum(axis=1)
    law = np.linalg.qr(np.stack([(omega / omega.max()) ** n for n in range(3)], axis=1) * weight[:, None])[0]
    column, y = 0.5 * np.concatenate([along, every]) * weight, t.decay_per_s[line] * weight
    column, y = column - (column @ law) @ law.T, y - law @ (law.T @ y)
    gram, projection = column @ column.T, column @ y
    place = [(int(v), direction) for direction in ("normal", "every") for v in vertices]
    does = np.linalg.norm(column, axis=1)
    one = np.flatnonzero(does > still * does.max())
    found: list[Dashpots] = []
    sets = one[:, None]
    for size in (1, 2, 3):
        best, strength, gain = _best(gram, projection, sets)
        new = np.flatnonzero(np.diff(gain, prepend=np.inf) < -same * gain)[:few]  # a body's mirrors do the same
        found += [
            tuple(Dashpot(place[k][0], c, place[k][1]) for k, c in zip(s, x, strict=True))
            for s, x in zip(best[new].tolist(), strength[new].tolist(), strict=True)
        ]
        if size < 3:  # with every other one
            kept = one[:, None] if size == 1 else best[:pairs]
            sets = np.column_stack([np.repeat(kept, len(one), axis=0), np.tile(one, len(kept))])
            sets = np.unique(np.sort(sets, axis=1), axis=0)
    return found


def _best(gram: Array, projection: Array, sets: Array) -> tuple[Array, Array, Array]:
    """Solve subsets (n, r) of columns: return those with strengths above zero, strengths, and gains in Σ y².

    The best come first.
    """
    apart = 1e-6  # of the columns' Gram determinant: two that do the same are one
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))[sets]
    matrix = gram[sets[:, :, None], sets[:, None, :]] / (size[:, :, None] * size[:, None, :])
    good = np.linalg.det(matrix) > apart
    sets, size, matrix = sets[good], size[good], matrix[good]
    right = projection[sets] / size
    strength = np.linalg.solve(matrix, right[..., None])[..., 0]
    gain = np.where((strength > 0).all(axis=1), (strength * right).sum(axis=1), 0.0)
    order = np.argsort(-gain, kind="stable")
    order = order[gain[order] > 0]
    return sets[order], (strength / size)[order], gain[order]
