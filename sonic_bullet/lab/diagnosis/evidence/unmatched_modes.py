"""Frequencies of unmatched modes, those without a line, by the recordings themselves.

    T_s = recording − all other modes;   r_j -> argmin Σ_s ∫ |T_s(f) − A_sj L(f; f_j (1 + r_j), d_j)|² df,   |r_j| <= 1
        %,   L(f) = ½ Σ_t e^{(−d + iω)t} e^{−2πi f t}

Degenerate modes that a mesh has split, modes it has put together, modes in each other's skirts and short ones are in no
list of lines, but the model gives their amplitudes at every strike, so their place shows. The baseline's correction of
a mesh's error, for those of its modes; one that the recordings do not clearly want elsewhere stays. Beyond the band's
edges L is 0: a mode that the mesh has just inside, and that is not recorded, may lie just outside.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.lab.diagnosis.evidence.effect_evidence import object_evidence
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, predict
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.records import Array

MOST_CORRECTION = 0.01  # of a mode's frequency, relative
# half widths to both sides: where a mode is looked for, and taken out
SKIRT_WIDTHS = 4.0
WIDE_SKIRT_WIDTHS = 40.0


def place_unmatched(h: Hypothesis, bodies: tuple[StruckBody, ...]) -> tuple[StruckBody, ...]:
    """Correct the bodies' modes without a line by their recordings; one that comes to a line's frequency takes it."""
    return tuple(_place_unmatched_of(predict(h, body)) if can_tell(body) else body for body in bodies)


def can_tell(body: StruckBody) -> bool:
    """Decide whether amplitudes are known with their signs, and there are recordings to compare."""
    g = body.recorded
    return (
        g is not None
        and g.signals is not None
        and body.family is not None
        and g.lines.signed
        and body.kind in ("velocity", "sum")
    )


def _place_unmatched_of(p: Prediction) -> StruckBody:
    """Correct one body's modes without a line."""
    h, body = p.hypothesis, p.body
    assert body.recorded is not None
    shared = np.bincount(body.line[body.line >= 0], minlength=1)[np.maximum(body.line, 0)] > 1
    # modes that a mesh has put side by side may have taken one line where there are two
    free = (body.line < 0) | shared
    correction = search_corrections(p, np.flatnonzero(free), alone=body.line < 0)
    lines, line = body.recorded.lines.freq_hz, body.line.copy()
    for j in np.flatnonzero(correction != body.correction) if len(lines) else ():
        freq = body.model.freq_hz[j] * (1 + correction[j])
        width = (h.alpha_per_s + h.beta_s * (2 * np.pi * freq) ** 2) / (4 * np.pi)
        near = int(np.argmin(np.abs(lines - freq)))
        line[j] = near if abs(lines[near] - freq) < width else -1
    return replace(body, correction=correction, line=line)


def search_corrections(p: Prediction, which: Array, *, alone: Array | None = None) -> Array:
    """Search for corrections (m,) of some of a body's modes, the loudest first.

    Parameters
    ----------
    p : Prediction
        The hypothesis on the body.
    which : (w,)
        Indices of the modes.
    alone : (m,) bool
        Modes without a line; all where None. Another moves only if nothing but itself, as the mesh has it, is at its
        line: degenerate modes that an imperfection has turned are not the mesh's.
    """
    pure = 0.1  # of its energy near its line may be something else
    turns = 3
    body, known, model, plain = p.body, p.hypothesis.correction, p.model, p.without_corrections()
    assert body.recorded is not None and body.recorded.signals is not None
    observed, count = object_evidence(p, plain=plain), p.base.mode_count
    correction = np.zeros(count) if known is None else known[body.name].copy()
    own, rank = np.full(count, np.nan), np.full(count, -1)  # overdamped modes are in neither
    own[plain.order], rank[p.order] = plain.model.freq_hz, np.arange(len(p.order))
    energy = (np.abs(observed.push) ** 2).sum(axis=0) / np.maximum(model.decay_per_s, 1e-3)
    hidden = 2 * (observed.noise_at(model.freq_hz) ** 2).sum(axis=0) / observed.sr
    loud = [int(j) for j in which if rank[j] >= 0 and np.isfinite(own[j]) and energy[rank[j]] > hidden[rank[j]]]
    loud.sort(key=lambda j: -energy[rank[j]])
    left, n = np.fft.rfft(observed.residual, axis=1), body.recorded.signals.shape[1]
    for _ in range(turns):
        before = correction.copy()
        for j in loud:
            decay, push = float(model.decay_per_s[rank[j]]), observed.push[:, rank[j]]
            most = np.inf if alone is None or alone[j] else pure
            ratio = _best(
                left, push, decay, own[j], correction[j], n=n, sr=observed.sr, most=most, band_hz=body.band_hz
            )
            if ratio != correction[j]:
                half = 2 * MOST_CORRECTION * own[j] + WIDE_SKIRT_WIDTHS * (decay / (2 * np.pi) + observed.sr / n)
                bins = _bins(own[j], half, n, observed.sr)
                was, will = (
                    _line(own[j] * (1 + r), decay, bins, n, observed.sr, body.band_hz) for r in (correction[j], ratio)
                )
                left[:, bins] += push[:, None] * (was - will)
                correction[j] = ratio
        if (correction == before).all():
            break
    return correction


def _best(
    left: Array,
    push: Array,
    decay: float,
    own: float,
    now: float,
    *,
    n: int,
    sr: int,
    most: float,
    band_hz: tuple[float, float],
) -> float:
    """Find the correction of a mode of amplitudes push (s,) that leaves least near it.

    The old one stays unless the new one is clearly better and leaves no more than ``most``.
    """
    fine = 0.25  # of a mode's half width, or of a bin: steps of the search
    better = 0.25  # of a mode's own energy must go from what is left
    step = fine * max(decay / (2 * np.pi), sr / n) / own
    grid = np.concatenate(
        [
            [now],
            np.linspace(-MOST_CORRECTION, MOST_CORRECTION, 2 * int(np.ceil(MOST_CORRECTION / step)) + 1),
        ]
    )
    bins = _bins(own, MOST_CORRECTION * own + SKIRT_WIDTHS * decay / (2 * np.pi) + 2 * sr / n, n, sr)
    shape = _line(own * (1 + grid[:, None]), decay, bins, n, sr, band_hz)
    target = left[:, bins] + push[:, None] * shape[0]
    energy = (np.abs(push) ** 2).sum() * (np.abs(shape) ** 2).sum(axis=1)
    cost = energy - 2 * (shape @ (np.conj(target) * push[:, None]).sum(axis=0)).real
    i = int(cost.argmin())
    inside = abs(grid[i]) < 0.99 * MOST_CORRECTION  # at the end of its reach it runs after something else
    near = np.abs(bins * sr / n - own * (1 + grid[i])) < decay / np.pi + 2 * sr / n
    rest = np.abs(target - push[:, None] * shape[i])[:, near] ** 2
    pure = most == np.inf or rest.sum() < most * (np.abs(push[:, None] * shape[i])[:, near] ** 2).sum()
    return float(grid[i]) if inside and pure and cost[i] < cost[0] - better * energy[0] else now


def _bins(freq_hz: float, half_hz: float, n: int, sr: int) -> Array:
    """Return the bins of a spectrum about a frequency."""
    return np.arange(max(int((freq_hz - half_hz) * n / sr), 1), min(int((freq_hz + half_hz) * n / sr) + 2, n // 2))


def _line(freq_hz: Array | float, decay: float, bins: Array, n: int, sr: int, band_hz: tuple[float, float]) -> Array:
    """Compute ½ Σ_t e^{(−d + iω)t} e^{−2πi kt/n} at some bins of n-point spectra; 0 outside the band."""
    freq = np.asarray(freq_hz)
    start = (-decay + 2j * np.pi * freq) / sr  # the bins' own turns come full circle after n samples
    line = 0.5 * (1 - np.exp(start * n)) / (1 - np.exp(start) * np.exp(-2j * np.pi * bins / n))
    return np.asarray(np.where((freq >= band_hz[0]) & (freq <= band_hz[1]), line, 0))
