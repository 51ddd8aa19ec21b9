"""How many strong lines pair with a mesh's modes, and how many would by chance.

    lines (f_k) of recordings, modes (γ, ν) -> pairs (material_fit.py)          n strong lines paired of N
    lines (f_k e^{δ_c}), clusters c moved at random -> pairs, eight times       n_1 … n_D
    by chance: n ≤ max n_i

The moved lines are searched through the same γ and ν as those recorded, so that the freedom of the search is in n_i. No
such test is made where most strong lines are modes, and nothing speaks against the mesh; nor of so few lines that γ and
ν meet any.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sonic_bullet.lab.effects.common.line_assignment import move_at_random
from sonic_bullet.lab.fit.pairing import Pairs, mark_heaped
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.lab.lines.line_values import Lines
from sonic_bullet.records import Array

PAIRED = 0.6  # share of the strong lines that are to be modes

Placing = Callable[[tuple[RecordedObject, ...]], tuple[Pairs, ...]]


def strong_lines(lines: Lines) -> Array:
    """Which lines (k,) hold `strong` of the strongest line's energy; lines that others cancel hold none."""
    strong = 1e-3  # of the strongest line's energy
    energy = np.where(mark_heaped(lines), 0.0, lines.energy)
    return np.asarray((energy > 0) & (energy >= strong * energy.max(initial=0)))


def paired_by_chance(shaped: tuple[RecordedObject, ...], pairs: tuple[Pairs, ...], place: Placing) -> bool:
    """Whether lines moved at random find as many modes as those recorded. place: how a search pairs objects' lines."""
    unknowns = 2
    found, strong = _strong_paired(shaped, pairs), sum(int(strong_lines(e.lines).sum()) for e in shaped)
    if found >= PAIRED * strong or strong <= unknowns:
        return False
    random = np.random.default_rng(0)
    draws = 8
    for _ in range(draws):
        moved = tuple(replace(e, lines=_move_clusters(e.lines, random)) for e in shaped)
        if _strong_paired(moved, place(moved)) >= found:
            return True
    return False


def _strong_paired(shaped: tuple[RecordedObject, ...], pairs: tuple[Pairs, ...]) -> int:
    return sum(int(strong_lines(e.lines)[p.line].sum()) for e, p in zip(shaped, pairs, strict=True))


def _move_clusters(lines: Lines, random: np.random.Generator) -> Lines:
    """Lines whose clusters stand elsewhere, as loud and as long as they were."""
    return replace(lines, freq_hz=np.exp(move_at_random(np.log(lines.freq_hz), random)))
