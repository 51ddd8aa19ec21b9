"""Degenerate modes whose frequencies depend on their own levels: where the pair's axes lie, for a given bend b.

    z_s(t) = Σ_m A_sm e^{−dt + iθ_sm(t)},   θ = b a_sm² ω (1 − e^{−2dt})/2d,   a_sm and A_sm of axes turned by ψ
        [effects.amplitude_pitch]
    u_s(t) = z_s(t + L)/z_s(t) modelled and observed agree in phase but for δL, whatever the strike's own phase and the
        line's own frequency: ψ -> max

Two degenerate modes are one line until they are loud: then the frequency of one may drift from that of the other, which
was hardly excited. A mesh leaves their axes to chance (axes.py).
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.effects.common.axes import ANGLES, about, degenerate, split_apart
from sonic_bullet.lab.effects.common.envelope import Envelopes
from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array

BEND_FACTORS = np.geomspace(0.6, 1.7, 12)
"""Times the bend identified as if each pair were one mode: where the pairs' own lies."""
FINER = (ANGLES[1] - ANGLES[0]) * np.linspace(-1, 1, 15)  # about the best angle


def bend_with_axes(e: Envelopes, h: ObjectEvidence, measure: str, bend: float, factors: Array) -> float:
    """Refine a bend with degenerate modes about their own axes.

    Parameters
    ----------
    e : Envelopes
        Envelopes of the object's lines.
    h : ObjectEvidence
        The object.
    measure : str
        Measure of the level.
    bend : float
        b identified as if every line were one mode's.
    factors : (n,)
        Grid of the factors among which the best one is.

    Returns
    -------
    float
        The factor times bend that the lines agree on best.
    """
    modes = {
        q: about(h, int(k), measure, ANGLES if degenerate(h, int(k)) else np.zeros(1))
        for q, k in enumerate(e.line)
        if e.good[:, q].any()
    }

    def left(factor: float) -> float:
        return float(sum(log_variances(e, h, q, bend * factor, *pair).min() for q, pair in modes.items()))

    return bend * search_number(left, factors, 0.02)[1]


def axes_of(e: Envelopes, h: ObjectEvidence, measure: str, bend: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return frequencies and angles of the degenerate modes whose axes are observable."""
    turns = 0.1  # of a line's ln variance, that its degenerate modes' axes must be worth
    assert h.model is not None
    found = []
    for q, k in enumerate(e.line.tolist()):
        if split_apart(h, k) or not (degenerate(h, k) and e.good[:, q].any()):
            continue
        cost = log_variances(e, h, q, bend, *about(h, k, measure, ANGLES))
        fine = ANGLES[int(cost.argmin())] + FINER
        closer = log_variances(e, h, q, bend, *about(h, k, measure, fine))
        if cost[0] - closer.min() > turns:
            found.append((float(h.model.freq_hz[h.mode[k]].mean()), float(fine[int(closer.argmin())])))
    return tuple(f for f, _ in found), tuple(t for _, t in found)


def log_variances(e: Envelopes, h: ObjectEvidence, q: int, bend: float, amplitude: Array, level: Array) -> Array:
    """Compute ln of the variances (p,) of a line's levels, up to one factor, and of its gains of phase.

    Parameters
    ----------
    e : Envelopes
        Envelopes of the object's lines.
    h : ObjectEvidence
        The object.
    q : int
        Index of the line among the envelopes.
    bend : float
        b per level².
    amplitude, level : (p, s, j)
        Of its modes under p angles of their axes.
    """
    lags = (2, 6, 18)  # frames
    rough = 0.1  # of ln |z| and of a phase: what neighbours, windows and shapes do to a frame
    largest = 2.0  # of ln |z|: more off is no worse
    k = int(e.line[q])
    decay, omega, t = max(float(h.decay_per_s[k]), 1e-2), 2 * np.pi * float(h.freq_hz[k]), e.time_s[q]
    turn = bend * omega * level[..., None] ** 2 * -np.expm1(-2 * decay * t) / (2 * decay)  # (p, s, j, t)
    modelled = (amplitude[..., None] * np.exp(1j * turn)).sum(axis=2) * np.exp(-decay * t)
    observed, good = e.z[:, q], e.good[:, q]
    worth = good / (rough**2 + (e.noise[:, q, None] / np.maximum(np.abs(observed), 1e-300)) ** 2)
    agree, most = np.zeros(len(amplitude)), 0.0
    for lag in lags:
        both = np.conj(_step(observed, lag)) * _step(modelled, lag)
        weight = np.minimum(worth[:, lag:], worth[:, :-lag])
        agree += np.abs((weight * both).sum(axis=(1, 2)))
        most += float(weight.sum())
    off = np.log(np.maximum(np.abs(modelled), 1e-300)) - np.log(np.maximum(np.abs(observed), 1e-300))
    off -= np.median(off[:, good], axis=1)[:, None, None]
    size = (worth * np.clip(off, -largest, largest) ** 2).sum(axis=(1, 2)) / worth.sum()
    return np.asarray(np.log(size + rough**2) + np.log(np.maximum(2 - 2 * agree / max(most, 1e-300), 0) + rough**2))


def _step(z: Array, lag: int) -> Array:
    """Compute the phase (…, t − lag) that a line gains in ``lag`` frames, as e^{iθ}."""
    u = z[..., lag:] * np.conj(z[..., :-lag])
    return np.asarray(u / np.maximum(np.abs(u), 1e-300))
