"""How `rebound` is looked for.

Identified by the recordings: their residual is the model again, later and weaker.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sonic_bullet.effects.protocol import Impact
from sonic_bullet.effects.rebound import MOST_HITS, Rebound
from sonic_bullet.lab.effects.common.fitting import search_numbers
from sonic_bullet.lab.effects.common.ringing import direct_as_expected
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.lab.effects.rebound.later_hits import (
    LATER_HIT_SPAN_S,
    LEAST_LATER_SHARE,
    REBOUND_EXPONENTS,
    hits_by_strike,
    second_hit,
    third_hit,
)
from sonic_bullet.records import Array

MOST_OF_STRIKES = 0.6  # that must show later hits where each is looked at by itself
# of the logarithm of what is left: where fewer strikes show later hits, all must gain as much by them
LEAST_GAIN_A_STRIKE = 0.05
FADE_NEPERS = 2.0  # over what is looked at
# of what one hit leaves of all strikes: said by a second one, by the best exponent over others that are not
# followed, and left by all hits
SAID_BY_SECOND_HIT = 0.25
BEST_EXPONENT_RATIO = 1.35
LEFT_BY_ALL_HITS = 0.5

HITS = (3, 4, 5, MOST_HITS)
RESTITUTIONS = (0.2, 0.35, 0.5, 0.65, 0.8)


def propose_rebound(evidence: Evidence) -> Rebound | None:
    """Look for later hits strike by strike, and in all strikes at once; None where there are none."""
    h = max((h for h in evidence.observed if h.signal is not None), key=lambda h: len(h.freq_hz), default=None)
    if h is None or len(h.freq_hz) < 3:
        return None
    if isinstance(evidence.known, Rebound):
        again = _refine_rebound(evidence.known, h, known=True)[1]
        return replace(evidence.known, **again) if again["restitution"] > LEAST_LATER_SHARE else None
    found = [one for one in (_one_by_one(h), _of_all(h)) if one is not None]
    return min(found, key=lambda one: _refine_rebound(one, h, known=True)[0], default=None)


def _of_all(h: ObjectEvidence) -> Rebound | None:
    """Look for later hits in all strikes at once; None where there are none.

    A slow decay looks alike a whole number of periods later, so that one strike alone allows many delays. Strikes
    of one strength are of no use: there all exponents fit alike, and hits and beats are not distinguishable.
    """
    apart = 1.3  # loudest over softest strike, for that
    level = np.array([j if np.isfinite(j) else 1.0 for j in h.impulse_n_s])
    if len(level) < 2 or level.max() < apart * level.min():
        return None
    reference = float(np.exp(np.log(level).mean()))
    found = second_hit(h, level / reference)
    most = max(said for said, _, _ in found)
    # a second hit alone says about as much at other exponents by chance; with the later ones that is no longer so
    starts = [
        Rebound(gap, reference, RESTITUTIONS[1], exponent, None, hits)
        for said, gap, exponent in found
        if said > max(SAID_BY_SECOND_HIT, most / BEST_EXPONENT_RATIO)
        for hits in (2, *HITS)
    ]
    if not starts:
        return None
    (left, best), start = min(((_refine_rebound(one, h), one) for one in starts), key=lambda end: end[0][0])
    alone, count = _refine_rebound(replace(start, hits=1), h)[0], len(level)
    return (
        replace(start, **best)
        if best["restitution"] > LEAST_LATER_SHARE and count + left < LEFT_BY_ALL_HITS * (count + alone)
        else None
    )


def _one_by_one(h: ObjectEvidence) -> Rebound | None:
    """Look for later hits in each strike, and combine what they agree on; None where they do not."""
    found = [(level, hits) for level, hits in zip(h.impulse_n_s, hits_by_strike(h), strict=True) if len(hits)]
    need = max(2.0, MOST_OF_STRIKES * len(h.impulse_n_s))
    if len(found) < 2:
        return None
    level = np.array([j if np.isfinite(j) else 1.0 for j, _ in found])
    reference = float(np.exp(np.log(level).mean()))
    every = [np.array(hits) for _, hits in found]
    agreed = [
        (
            _find_agreed_value(
                [np.log(t[:, 0]) - p * np.log(j / reference) for t, j in zip(every, level, strict=True)],
                [t[:, 1] for t in every],
            ),
            p,
        )
        for p in REBOUND_EXPONENTS
    ]
    (_, first, which), exponent = max(agreed, key=lambda a: a[0][0])
    mine = [(t, i) for t, i in zip(every, which, strict=True) if i >= 0]
    share = np.array([t[i, 1] for t, i in mine])
    if len(mine) < 2 or _distance_from_median(np.log(share)) > 0.5:
        return None
    after = [t[t[:, 0] > 1.03 * t[i, 0]] for t, i in mine]
    score, ratio, _ = _find_agreed_value(
        [np.log(np.maximum(a[:, 0] / t[i, 0] - 1, 1e-3)) for a, (t, i) in zip(after, mine, strict=True)],
        [a[:, 1] for a in after],
    )
    shrink = float(np.clip(np.exp(ratio), 0.03, 1.0)) if score > 0 and sum(len(a) > 0 for a in after) >= 2 else None
    e = float(np.clip(np.median(share), 0.03, 0.97))
    count = 1 + round(float(np.median([len(t) - i for t, i in mine])))
    start = Rebound(float(np.exp(first)), reference, e, exponent, shrink, count)
    ends = [_refine_rebound(replace(start, hits=k), h) for k in ((2,) if count <= 2 or shrink is None else HITS)]
    left, best = min(ends, key=lambda end: end[0])
    if len(mine) < need and left > _refine_rebound(replace(start, hits=1), h)[0] - LEAST_GAIN_A_STRIKE * len(
        h.impulse_n_s
    ):
        return None
    return replace(start, **best)


def _refine_rebound(start: Rebound, h: ObjectEvidence, *, known: bool = False) -> tuple[float, dict[str, Any]]:
    """Fit restitution, first gap and ratio of gaps to all strikes: Σ_s |<y, m>|²/<m, m>, m all hits, is largest.

    Returns what is left, up to a constant, and the fitted fields. known: whether start is near the solution.
    """
    ratios = (0.75, 0.9, 1.0)
    # of what is left, that a third hit looked for at every lag must take: some lag always takes something
    sought = 0.07
    held = 0.999  # of the energy of what is played again
    assert h.signal is not None
    n = min(h.signal.shape[1], 3 * int(LATER_HIT_SPAN_S[1] * h.sr))
    size = 2 * n
    # in 1/s: x(t − τ) e^{−wt} = e^{−wτ} (x e^{−wt})(t − τ), so what is cut off at n, of either, counts for less
    fade = FADE_NEPERS * h.sr / n
    window = np.exp(-fade * np.arange(n) / h.sr)
    sound = np.fft.rfft(direct_as_expected(h)[:, :n] * window, size)
    both, own = np.conj(sound) * np.fft.rfft(h.signal[:, :n] * window, size), np.abs(sound) ** 2
    loud = np.argsort(-own.sum(axis=0))
    # the bins that hold the modes
    loud = np.sort(loud[: 1 + int(np.searchsorted(np.cumsum(own.sum(axis=0)[loud]), held * own.sum()))])
    both, own, cycles = both[:, loud], own[:, loud], np.fft.rfftfreq(size, 1 / h.sr)[loud]
    level = h.level_n_s
    total = ((h.signal[:, :n] * window) ** 2).sum(axis=1) * size / 2

    def of(x: Array) -> dict[str, Any]:
        e = float(np.clip(x[0], 0.03, 0.97))
        shrink = None if start.shrink is None else float(np.clip(x[2], 0.03, 1.0))
        return {"gap_s": float(start.gap_s * np.exp(x[1])), "restitution": e, "shrink": shrink, "hits": start.hits}

    def left(x: Array) -> float:
        trial, gone = replace(start, **of(x)), 0.0
        turns: dict[bytes, Array] = {}  # where gaps do not go with strength, all strikes have one
        for s, j in enumerate(level):
            impact = trial.apply(Impact(float(j), np.zeros(1), np.ones(1)))
            turn = turns.get(impact.delay_s.tobytes())
            if turn is None:
                turn = _sum_hits(impact, cycles, fade)
                turns[impact.delay_s.tobytes()] = turn
            gone += (
                max(float((np.conj(turn) * both[s]).real.sum()), 0.0) ** 2
                / max(float((np.abs(turn) ** 2 * own[s]).sum()), 1e-300)
                / max(float(total[s]), 1e-300)
            )
        return -gone

    first = np.array([start.restitution, 0.0, start.restitution if start.shrink is None else start.shrink])
    tries = [
        np.array([e, 0.0, r])
        for e in (first[0], *RESTITUTIONS)
        for r in (first[2:] if start.shrink is None else (first[2], e, *ratios))
    ]
    best = min(tries, key=left)
    step = np.array([0.1, 2e-4, 2e-3])
    found = search_numbers(left, best, step)
    if start.hits > 2 and not known:
        gap = start.gap_s * (level / start.impulse_n_s) ** start.exponent
        whole = np.zeros((2, len(both), size // 2 + 1), complex)
        whole[:, :, loud] = both, own
        e = third_hit(gap, whole[0], whole[1], total, h.sr, fade)
        other = search_numbers(left, np.array([e, 0.0, e]), step)
        found = other if found[0] - other[0] > sought * (len(level) + found[0]) else found
    return found[0], of(found[1])


def _sum_hits(impact: Impact, freq_hz: Array, fade: float) -> Array:
    """Compute Σ_j share_j e^{−(fade + 2πif) delay_j} (f,) in single precision.

    Phases, whole periods taken off, are accurate to 4e-7, and a search spends all its time here.
    """
    phase = np.multiply.outer(impact.delay_s, freq_hz)
    phase = (2 * np.pi * (phase - np.rint(phase))).astype(np.float32)
    share = (impact.share * np.exp(-fade * impact.delay_s)).astype(np.float32)
    return np.asarray(share @ np.cos(phase) - 1j * (share @ np.sin(phase)))


def _find_agreed_value(value: list[Array], share: list[Array]) -> tuple[float, float, list[int]]:
    """Find the value that the largest shares of the strikes agree on.

    Returns (sum of shares, value, which of each strike's or -1).
    """
    nearby = 0.03  # of ln t: delays that agree
    best: tuple[float, float, list[int]] = (0.0, 0.0, [-1] * len(value))
    for centre in np.concatenate([*value, np.zeros(0)]):
        near = [np.where(np.abs(v - centre) < nearby, s, 0.0) for v, s in zip(value, share, strict=True)]
        total = float(sum(s.max(initial=0.0) for s in near))
        if total > best[0]:
            which = [int(s.argmax()) if s.any() else -1 for s in near]
            best = (total, float(np.median([v[i] for v, i in zip(value, which, strict=True) if i >= 0])), which)
    return best


def _distance_from_median(y: Array) -> float:
    """Compute the mean distance from the median."""
    return float(np.abs(y - np.median(y)).mean())
