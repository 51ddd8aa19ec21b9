"""Lines whose decay goes with the level of the modes they stand for: d and what is left, for a given damping growth c;
and the axes of degenerate modes.

    ln |z_s(t)| = const_s + ln |Σ_m A_sm e/(1 + x_sm (1 − e^p))^{1/p}|,   e = e^{−dt},  x_sm = (c a_sm)^p
        [effects.amplitude_damping]
    d by Gauss and Newton; const_s of each strike alone, so no gain is needed; how far these differ from strike to
        strike tells angles alone

Two degenerate modes are one line, and each is damped by its own level: how loud each is depends on where the pair's
axes lie, which in a linear body nobody hears, and which a mesh leaves to chance (axes.py). ψ is tried all round, line
by line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.effects.common.axes import ANGLES, about, degenerate
from sonic_bullet.effects.common.envelope import Envelopes
from sonic_bullet.effects.protocol import ObjectEvidence
from sonic_bullet.records import Array

ROUGH = 5e-3  # of ln |z|: what neighbours and windows do to a frame
FEWEST_FRAMES = 8  # clear frames of a strike
THIN = 3  # one frame of so many will do where angles are tried
STEPS = 4  # of Gauss and Newton
RANGE = (0.2, 1.6)  # of the observed decay
TURNS = 0.1  # of a line's ln variance, that its degenerate modes' axes must be worth
LEVEL, MOST, EARLY = 0.1, 2.0, 0.5  # of ln |z|: shapes' own error; more off is no worse; nepers of a line's decay
FAINT = 1e-3  # of Σ|A|: degenerate modes may cancel, not vanish


@dataclass(frozen=True, slots=True, eq=False)
class DecayFrames:
    """A line's frames: time_s (t,), logarithm (s, t) and weight (s, t) of |z|; amplitude and level (p, s, j) of its j
    modes under p angles of their axes.

    freq_hz: the modes' middle in the model; decay_per_s: as observed. number: which of the observed. power: p.
    """

    number: int
    freq_hz: float
    decay_per_s: float
    time_s: Array
    log: Array
    weight: Array
    amplitude: Array
    level: Array
    power: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class DecayFit:
    """Of a line under a damping_growth: ln of the variance (p,) it leaves within strikes, ln of that between them, and
    its decay (p,) under every angle.
    """

    spread: Array
    between: Array
    decay_per_s: Array

    @property
    def best(self) -> int:
        """The angle that all strikes tell, those as well in which nobody hears the line."""
        return int((self.spread + self.between).argmin())

    @property
    def least(self) -> float:
        """What the best angle leaves within strikes."""
        return float(self.spread[self.best])

    @property
    def turned(self) -> bool:
        """Whether the mesh's own axes are surely not the best."""
        whole = self.spread + self.between
        return bool(self.best and whole[0] - whole[self.best] > TURNS)


def lines_under(e: Envelopes, h: ObjectEvidence, measure: str) -> list[DecayFrames]:
    """The lines that say something, their levels by a measure."""
    found = []
    for q, k in enumerate(e.line.tolist()):
        good = e.good[:, q] & (e.good[:, q].sum(axis=1) >= FEWEST_FRAMES)[:, None]
        if not good.any():
            continue
        pair = degenerate(h, k)
        amplitude, level = about(h, k, measure, ANGLES if pair else np.zeros(1))
        thin = slice(None, None, THIN if pair else 1)
        size = np.maximum(np.abs(e.z[:, q]), 1e-300)
        weight = np.where(good, 1 / (ROUGH**2 + (e.noise[:, q, None] / size) ** 2), 0.0)[:, thin]
        freq = float(h.model.freq_hz[h.mode[k]].mean()) if h.model is not None else float(h.freq_hz[k])
        found.append(
            DecayFrames(
                k,
                freq,
                max(float(h.decay_per_s[k]), 1e-2),
                e.time_s[q, thin],
                np.log(size)[:, thin],
                weight,
                amplitude,
                level,
            )
        )
    return found


def fitted_decay(line: DecayFrames, damping_growth: float, start: Array | None = None) -> DecayFit:
    """What a line says of a damping growth. start (p,): decays to begin with."""
    if damping_growth == 0:  # no angle counts
        line = under(line)
    many = len(line.amplitude)
    decay = np.full(many, line.decay_per_s) if start is None or len(start) != many else start
    low, high = RANGE[0] * line.decay_per_s, RANGE[1] * line.decay_per_s
    for _ in range(STEPS):
        left, slope = _left(line, damping_growth, decay)
        step = (line.weight * left * slope).sum(axis=(1, 2)) / np.maximum(
            (line.weight * slope**2).sum(axis=(1, 2)), 1e-300
        )
        decay = np.clip(decay - step, low, high)
    left, _ = _left(line, damping_growth, decay)
    within = np.log((line.weight * left**2).sum(axis=(1, 2)) / line.weight.sum() + ROUGH**2)
    return DecayFit(within, _between(line, damping_growth, decay) if many > 1 else np.zeros(many), decay)


def _between(line: DecayFrames, damping_growth: float, decay: Array) -> Array:
    """ln of the variance (p,) of the levels that the model gives strikes over those observed; one in which the line is
    not observed may not be modelled louder.
    """
    observed = line.weight.sum(axis=1) > 0
    early = line.time_s < line.time_s[0] + EARLY / line.decay_per_s
    weight = np.where(observed[:, None], line.weight, early.astype(float))
    # (p, s)
    off = (weight / weight.sum(axis=1, keepdims=True) * (line.log - _model(line, damping_growth, decay)[0])).sum(axis=2)
    off = off - np.median(off[:, observed], axis=1, keepdims=True)
    off = np.clip(np.where(observed, off, np.minimum(off, 0.0)), -MOST, MOST)
    return np.asarray(np.log((off**2).mean(axis=1) + LEVEL**2))


def would(line: DecayFrames, damping_growth: float, decay_per_s: float, angle: int) -> float:
    """The variance that no damping growth would leave of a line that is just what a damping growth makes it: what that
    is of its misfit.
    """
    one = under(line, angle)
    model = _model(one, damping_growth, np.array([decay_per_s]))[0][0]
    plain = fitted_decay(replace(one, log=model), 0.0)
    return float(np.exp(plain.spread[0]))


def onset(line: DecayFrames, damping_growth: float, decay_per_s: float, angle: int) -> Array:
    """|z| (s,) at the onset, as the whole envelope tells it; NaN for strikes that say nothing."""
    one = under(line, angle)
    model = _model(one, damping_growth, np.array([decay_per_s]))[0][0]
    total = line.weight.sum(axis=1)
    mean = (line.weight * (line.log - model)).sum(axis=1) / np.where(total > 0, total, np.nan)
    return np.asarray(
        np.exp(mean) * np.maximum(np.abs(one.amplitude[0].sum(axis=1)), FAINT * np.abs(one.amplitude[0]).sum(axis=1))
    )


def under(line: DecayFrames, angle: int = 0) -> DecayFrames:
    """The line under one angle alone."""
    one = slice(angle, angle + 1)
    return replace(line, amplitude=line.amplitude[one], level=line.level[one])


def _model(line: DecayFrames, damping_growth: float, decay: Array) -> tuple[Array, Array]:
    """ln |z| (p, s, t) but for a constant, and its slope over the decay."""
    fall = np.exp(-line.power * decay[:, None] * line.time_s)[:, None, None, :]  # (p, 1, 1, t)
    x = (damping_growth * line.level[..., None]) ** line.power  # (p, s, j, 1)
    less = 1 + x * (1 - fall)
    part = line.amplitude[..., None] * less ** (-1 / line.power)
    total = part.sum(axis=2)
    least = FAINT * np.abs(line.amplitude).sum(axis=2)[..., None]
    total = np.where(np.abs(total) > least, total, np.where(total < 0, -1.0, 1.0) * np.maximum(least, 1e-300))
    slope = -line.time_s * (part * (1 + x) / less).sum(axis=2) / total
    return np.log(np.abs(total)) - decay[:, None, None] * line.time_s, slope


def _left(line: DecayFrames, damping_growth: float, decay: Array) -> tuple[Array, Array]:
    """Model − observed (p, s, t) and its slope over the decay, without each strike's mean."""
    model, slope = _model(line, damping_growth, decay)
    share = line.weight / np.maximum(line.weight.sum(axis=1, keepdims=True), 1e-300)
    left = model - line.log
    return left - (share * left).sum(axis=2, keepdims=True), slope - (share * slope).sum(axis=2, keepdims=True)
