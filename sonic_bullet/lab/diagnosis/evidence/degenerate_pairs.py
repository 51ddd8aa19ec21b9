"""Modes that a mesh leaves at one frequency by accident, and that two lines show to be two.

    a group of three modes or more, cut at its widest gap -> two lines near it, one without a mode so far, like the one
        part and the other  ->  each its own line

A plate has pairs of modes for its symmetry, and now and then a single mode at a pair's frequency: as one group they
would be one line, and the other line foreign. For two modes alone it is undecidable whether a mesh or an imperfection
splits them: they stay together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.lab.diagnosis.evidence.unmatched_modes import MOST_CORRECTION
from sonic_bullet.lab.diagnosis.prediction.prediction import pattern
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.records import Array

# cosine of a line's amplitudes over the strikes and its modes' pattern
SAME_PATTERN_COSINE = 0.97
LEAST_PATTERN_STRIKES = 3  # by which a pattern is known


def separate_pairs(body: StruckBody) -> StruckBody:
    """Divide a body's groups of modes that two lines show to be two."""
    least_members = 3  # modes of such a group
    if body.recorded is None or body.family is None or len(body.fitted) < LEAST_PATTERN_STRIKES:
        return body
    lines, row = body.recorded.lines, pattern(body, body.model)[body.fitted]
    line, correction, freq = body.line.copy(), body.correction.copy(), body.model.freq_hz
    for one in np.unique(line[line >= 0]):
        group = np.flatnonzero(line == one)
        if len(group) < least_members:
            continue
        cut = 1 + int(np.diff(freq[group]).argmax())
        free = [
            k
            for k in range(len(lines.freq_hz))
            if k not in line and abs(lines.freq_hz[k] / freq[group].mean() - 1) < MOST_CORRECTION
        ]
        directions = [(low, high) for k in free for low, high in ((one, k), (k, one))]
        fits = [
            min(like(lines.amplitude[:, a], row[:, group[:cut]]), like(lines.amplitude[:, b], row[:, group[cut:]]))
            for a, b in directions
        ]
        if not fits or max(fits) < SAME_PATTERN_COSINE:
            continue
        for k, part in zip(directions[int(np.argmax(fits))], (group[:cut], group[cut:]), strict=True):
            line[part] = k
            correction[part] = np.clip(lines.freq_hz[k] / freq[part] - 1, -MOST_CORRECTION, MOST_CORRECTION)
    return replace(body, line=line, correction=correction) if (line != body.line).any() else body


def like(amplitude: Array, pattern_of: Array) -> float:
    """Compute the cosine of a line's |A| (s,) and |Σ J ψ| (s,) of some modes' patterns (s, p)."""
    a, b = np.abs(amplitude), np.abs(pattern_of.sum(axis=1))
    return float(a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-300))
