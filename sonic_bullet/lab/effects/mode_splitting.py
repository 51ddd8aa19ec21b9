"""How `mode-splitting` is looked for.

Identified by two lines 0.1 to 1 % from each other where the mesh has a pair: their amplitudes over the strikes give ψ,
their distance ε.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from sonic_bullet.effects.common.axes import AXES_PAIR, pair_at
from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.records import Array

SPLIT_RANGE = (1e-4, 3e-2)  # of a frequency, relative
LOUD_HALF = 1e-3  # of the strongest line
CLEAR_HALF = 30.0  # of a line's own spread
ALIKE_PATTERNS = 0.9
# relative; sin 2ψ: what the mesh has apart, and nothing has turned, are neighbours by chance, which it has too near
# or too far
SAME_FREQUENCY = 1e-4
TURNED_PAIR = 0.3


def propose_mode_splitting(evidence: Evidence) -> ModeSplitting | None:
    """Find the pairs of modes that two lines represent; None where there are none."""
    rows: list[tuple[float, ...]] = []
    for h in (h for h in evidence.observed if h.plain is not None):
        if isinstance(evidence.known, ModeSplitting):
            rows += _estimate_known_pairs(h, evidence.known)
            continue
        found = _pairs(h, 1.0)
        if len(found) > 1:  # E/ρ may have been fitted to one line of each pair
            found = [row[:3] for row in _pairs(h, float(np.median([row[3] for row in found])))]
        rows += found
    return ModeSplitting(*(tuple(float(r[i]) for r in rows) for i in range(3))) if rows else None


def _pairs(h: ObjectEvidence, scale: float) -> list[tuple[float, ...]]:
    """Find (f, ε, ψ, f over the mesh's) of every pair of modes, frequencies times ``scale``, that two lines represent.

    A line represents one mode; the most certain pairs choose first. An imperfection splits many pairs: where some are
    plain, others may be less so.
    """
    observed = 0.12  # of a line's own width: pairs nearer than that sound as one
    reach = 2e-2  # of a line from its pair's middle
    # pairs that make it plain that the body is split: how alike others then need to be, every strike as loud, of so
    # many
    plainly, also, strikes = (
        3,
        0.8,
        5,
    )
    mostly = 0.5  # of the pairs must be more than that
    most = 7
    assert h.plain is not None  # the mesh's own order: corrections may have turned a pair's about
    every, decay, amplitude = h.every_hz, h.every_decay_per_s, h.every_amplitude
    strike, sensor = h.participation(h.plain.shape[h.places])
    level = h.level_n_s[:, None]
    even, evenly = strike / level, amplitude / level  # one loud strike is alike with anything
    model_hz = h.plain.freq_hz
    size = np.abs(amplitude).max(axis=0)
    clear = size > np.maximum(
        LOUD_HALF * size.max(),
        CLEAR_HALF * np.concatenate([h.amplitude_sd, h.foreign_sd], axis=1).max(axis=0),
    )
    trials: list[tuple[bool, float, int, int, int, float, float]] = []
    for a in np.flatnonzero(np.diff(model_hz) < AXES_PAIR * model_hz[:-1]):
        middle = scale * (model_hz[a] + model_hz[a + 1]) / 2
        near = np.flatnonzero((np.abs(every / middle - 1) < reach) & clear)
        near = np.sort(near[np.argsort(-size[near])][:most])
        for i, j in combinations(near.tolist(), 2):
            low, high = (int(i), int(j)) if every[i] < every[j] else (int(j), int(i))
            split = float(2 * (every[high] - every[low]) / (every[high] + every[low]))
            if (
                not SPLIT_RANGE[0] < split < SPLIT_RANGE[1]
                or split * middle < observed * min(decay[low], decay[high]) / np.pi
            ):
                continue
            turn, alike = _turn(strike[:, [a, a + 1]], sensor[[a, a + 1]], amplitude[:, [low, high]], h.signed)
            off = abs((every[low] + every[high]) / (2 * middle) - 1)
            plain = alike > ALIKE_PATTERNS
            if not plain and alike > also and len(strike) >= strikes:
                alike = min(alike, _turn(even[:, [a, a + 1]], sensor[[a, a + 1]], evenly[:, [low, high]], h.signed)[1])
            if plain or (alike > also and len(strike) >= strikes):
                trials.append(
                    (
                        plain,
                        float(alike - off / reach * (1 - ALIKE_PATTERNS)),
                        int(a),
                        int(low),
                        int(high),
                        split,
                        turn,
                    )
                )
    found: list[tuple[float, ...]] = []
    split_off: list[bool] = []
    taken: set[int] = set()
    done: set[int] = set()
    for plain, _, mode, low, high, split, turn in sorted(trials, reverse=True):
        if not plain and len(found) < plainly:
            break
        if low in taken or high in taken or mode in done or mode + 1 in done:
            continue
        taken.update((low, high))
        done.update((mode, mode + 1))
        middle = float((every[low] + every[high]) / 2)
        found.append((middle, split, turn, 2 * middle / float(model_hz[mode] + model_hz[mode + 1])))
        split_off.append(
            bool(model_hz[mode + 1] / model_hz[mode] - 1 < SAME_FREQUENCY or abs(np.sin(2 * turn)) > TURNED_PAIR)
        )
    return sorted(found) if split_off and np.mean(split_off) >= mostly else []


def _estimate_known_pairs(h: ObjectEvidence, known: ModeSplitting) -> list[tuple[float, ...]]:
    """Estimate (f, ε, ψ) of known pairs from fewer strikes.

    Two lines that only the excluded strike excited strongly are still no single mode.
    """
    assert h.plain is not None
    every, amplitude = h.every_hz, h.every_amplitude
    strike, sensor = h.participation(h.plain.shape[h.places])
    found: list[tuple[float, ...]] = []
    for f, split in zip(known.freq_hz, known.split, strict=True):
        a, b = pair_at(h.plain.freq_hz, f)
        line = [int(np.abs(every - f * (1 + side * split / 2)).argmin()) for side in (-1, 1)]
        if (
            a < 0
            or line[0] == line[1]
            or (np.abs(every[line] / (f * (1 + np.array([-1, 1]) * split / 2)) - 1) > split / 4).any()
        ):
            continue
        turn, _ = _turn(strike[:, [a, b]], sensor[[a, b]], amplitude[:, line], h.signed)
        found.append((float(every[line].mean()), float(np.ptp(every[line]) / every[line].mean()), turn))
    return found


def _turn(strike: Array, sensor: Array, amplitude: Array, signed: bool) -> tuple[float, float]:
    """Estimate ψ from the two lines' patterns (s, 2), and the likeness that it gives."""
    observed = (
        np.real(amplitude * np.exp(-1j * np.angle((amplitude**2).sum(axis=0)) / 2)) if signed else np.abs(amplitude)
    )
    turn = np.linspace(0, np.pi, 181)[:-1]
    # (2, line, turn)
    direction = np.stack([np.stack([np.cos(turn), np.sin(turn)]), np.stack([-np.sin(turn), np.cos(turn)])], axis=1)
    participation = np.einsum("sx,xlt->tsl", strike, direction) * np.einsum("x,xlt->tl", sensor, direction)[:, None, :]
    participation = participation if signed else np.abs(participation)
    size, loud = np.linalg.norm(participation, axis=1), np.linalg.norm(observed, axis=0)
    fit = np.abs(np.einsum("tsl,sl->tl", participation, observed)) / np.maximum(size * loud, 1e-300)
    ratio = (size @ loud) / np.maximum(np.linalg.norm(size, axis=1) * np.linalg.norm(loud), 1e-300)
    score = fit.mean(axis=1) * np.sqrt(np.maximum(ratio, 0.0))
    best = int(score.argmax())
    return float(turn[best]), float(score[best])
