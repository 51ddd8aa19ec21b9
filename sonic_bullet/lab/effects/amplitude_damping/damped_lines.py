"""Lines whose decay depends on the level of their modes: fits of the decay, and of degenerate modes' axes.

    ln |z_s(t)| = const_s + ln |Σ_m A_sm e/(1 + x_sm (1 − e^p))^{1/p}|,   e = e^{−dt},  x_sm = (c a_sm)^p
        [effects.amplitude_damping]
    d by Gauss and Newton at a given damping growth c; const_s of each strike alone, so no gain is needed; the
        differences of these between strikes decide angles alone

Two degenerate modes are one line, and each is damped by its own level: both levels depend on where the pair's axes lie,
which a linear body does not show, and which a mesh leaves to chance (axes.py). ψ is tried all round, line by line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.lab.effects.common.axes import ANGLES, about, degenerate
from sonic_bullet.lab.effects.common.envelope import Envelopes
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array

ENVELOPE_SPREAD = 5e-3  # of ln |z|: what neighbours and windows do to a frame
FRAMES_APART = 3  # one frame of so many will do where angles are tried
DECAY_RATIOS = (0.2, 1.6)  # of the observed decay: where the small-amplitude one is sought
LEVEL_SPREAD = 0.1  # of ln |z|: shapes' own error
LARGEST_LEVEL_ERROR = 2.0  # of ln |z|: more off is no worse
EARLY_NEPERS = 0.5  # of a line's decay
FAINT_SUM = 1e-3  # of Σ|A|: degenerate modes may cancel, not vanish


@dataclass(frozen=True, slots=True, eq=False)
class DecayFrames:
    """Frames of a line's envelope, and its modes under p angles of their axes.

    Attributes
    ----------
    number : int
        Index among the observed lines.
    freq_hz : float
        Middle frequency of its modes in the model.
    decay_per_s : float
        As observed.
    time_s : (t,)
        Times of the frames.
    log : (s, t)
        ln |z|.
    weight : (s, t)
        1/variance of it, 0 for frames that are not clear.
    amplitude, level : (p, s, j)
        Of its j modes under each angle.
    power : float
        p of the damping growth.
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
    """Fit of a line under a damping growth, for each of p angles.

    Attributes
    ----------
    spread : (p,)
        ln of the variance left within strikes.
    between : (p,)
        ln of the variance left between strikes.
    decay_per_s : (p,)
        Fitted decays.
    """

    spread: Array
    between: Array
    decay_per_s: Array

    @property
    def best(self) -> int:
        """Return the index of the angle that fits all strikes, also those in which the line is not observed."""
        return int((self.spread + self.between).argmin())

    @property
    def least(self) -> float:
        """Return what the best angle leaves within strikes."""
        return float(self.spread[self.best])

    @property
    def turned(self) -> bool:
        """Decide whether the mesh's own axes are certainly not the best."""
        turns = 0.1  # of a line's ln variance, that its degenerate modes' axes must be worth
        whole = self.spread + self.between
        return bool(self.best and whole[0] - whole[self.best] > turns)


def lines_under(e: Envelopes, h: ObjectEvidence, measure: str) -> list[DecayFrames]:
    """Select the lines with enough clear frames.

    Parameters
    ----------
    e : Envelopes
        Envelopes of the object's lines.
    h : ObjectEvidence
        The object.
    measure : str
        Measure of the levels, one of `amplitude_pitch.MEASURES`.
    """
    fewest_frames = 8  # clear frames of a strike
    found = []
    for q, k in enumerate(e.line.tolist()):
        good = e.good[:, q] & (e.good[:, q].sum(axis=1) >= fewest_frames)[:, None]
        if not good.any():
            continue
        pair = degenerate(h, k)
        amplitude, level = about(h, k, measure, ANGLES if pair else np.zeros(1))
        thin = slice(None, None, FRAMES_APART if pair else 1)
        size = np.maximum(np.abs(e.z[:, q]), 1e-300)
        weight = np.where(good, 1 / (ENVELOPE_SPREAD**2 + (e.noise[:, q, None] / size) ** 2), 0.0)[:, thin]
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


def fitted_decay(line: DecayFrames, damping_growth: float) -> DecayFit:
    """Fit a line's decay at a damping growth, under every angle.

    Parameters
    ----------
    line : DecayFrames
        The line.
    damping_growth : float
        c in 1/level.
    """
    if damping_growth == 0:  # no angle counts
        line = under(line)
    decay, within = _fit_within(line, damping_growth)
    many = len(line.amplitude)
    return DecayFit(within, _log_variance_between(line, damping_growth, decay) if many > 1 else np.zeros(many), decay)


def fit_decays(line: DecayFrames, damping_growths: Array) -> list[DecayFit]:
    """Fit a line's decay at damping growths (g,) above zero, under every angle, at once."""
    g, p = len(damping_growths), len(line.amplitude)
    level = (damping_growths[:, None, None, None] * line.level).reshape(g * p, *line.level.shape[1:])
    each = replace(line, amplitude=np.tile(line.amplitude, (g, 1, 1)), level=level)  # in units of 1/c
    decay, within = _fit_within(each, 1.0)
    between = _log_variance_between(each, 1.0, decay) if p > 1 else np.zeros(g)
    return [DecayFit(*row) for row in zip(*(x.reshape(g, p) for x in (within, between, decay)), strict=True)]


def _fit_within(line: DecayFrames, damping_growth: float) -> tuple[Array, Array]:
    """Fit the decays (p,) under every angle, and ln of the variance (p,) that they leave within strikes."""
    steps, settled = 8, 1e-6  # of Gauss and Newton; of a decay, where they end
    decay = np.full(len(line.amplitude), line.decay_per_s)
    low, high = DECAY_RATIOS[0] * line.decay_per_s, DECAY_RATIOS[1] * line.decay_per_s
    for _ in range(steps):
        left, slope = _decay_residual(line, damping_growth, decay)
        step = (line.weight * left * slope).sum(axis=(1, 2)) / np.maximum(
            (line.weight * slope**2).sum(axis=(1, 2)), 1e-300
        )
        before, decay = decay, np.clip(decay - step, low, high)
        if (np.abs(decay - before) < settled * before).all():
            break
    left, _ = _decay_residual(line, damping_growth, decay)
    return decay, np.log((line.weight * left**2).sum(axis=(1, 2)) / line.weight.sum() + ENVELOPE_SPREAD**2)


def _log_variance_between(line: DecayFrames, damping_growth: float, decay: Array) -> Array:
    """Compute ln of the variance (p,) of the strikes' modelled over observed levels.

    In a strike where the line is not observed the model may not be louder.
    """
    observed = line.weight.sum(axis=1) > 0
    early = line.time_s < line.time_s[0] + EARLY_NEPERS / line.decay_per_s
    weight = np.where(observed[:, None], line.weight, early.astype(float))
    # (p, s)
    off = (weight / weight.sum(axis=1, keepdims=True) * (line.log - _model(line, damping_growth, decay)[0])).sum(axis=2)
    off = off - np.median(off[:, observed], axis=1, keepdims=True)
    off = np.clip(np.where(observed, off, np.minimum(off, 0.0)), -LARGEST_LEVEL_ERROR, LARGEST_LEVEL_ERROR)
    return np.asarray(np.log((off**2).mean(axis=1) + LEVEL_SPREAD**2))


def would(line: DecayFrames, damping_growth: float, decay_per_s: float, angle: int) -> float:
    """Compute the variance that a fit without damping growth would leave of a line that follows one exactly."""
    one = under(line, angle)
    model = _model(one, damping_growth, np.array([decay_per_s]))[0][0]
    plain = fitted_decay(replace(one, log=model), 0.0)
    return float(np.exp(plain.spread[0]))


def onset(line: DecayFrames, damping_growth: float, decay_per_s: float, angle: int) -> Array:
    """Compute |z| (s,) at the onset by the whole envelope; NaN for strikes without clear frames."""
    one = under(line, angle)
    model = _model(one, damping_growth, np.array([decay_per_s]))[0][0]
    total = line.weight.sum(axis=1)
    mean = (line.weight * (line.log - model)).sum(axis=1) / np.where(total > 0, total, np.nan)
    return np.asarray(
        np.exp(mean)
        * np.maximum(np.abs(one.amplitude[0].sum(axis=1)), FAINT_SUM * np.abs(one.amplitude[0]).sum(axis=1))
    )


def under(line: DecayFrames, angle: int = 0) -> DecayFrames:
    """Restrict a line to one angle."""
    one = slice(angle, angle + 1)
    return replace(line, amplitude=line.amplitude[one], level=line.level[one])


def _model(line: DecayFrames, damping_growth: float, decay: Array) -> tuple[Array, Array]:
    """Compute ln |z| (p, s, t) up to a constant, and its slope over the decay."""
    fall = np.exp(-line.power * decay[:, None] * line.time_s)[:, None, None, :]  # (p, 1, 1, t)
    x = (damping_growth * line.level[..., None]) ** line.power  # (p, s, j, 1)
    less = 1 + x * (1 - fall)
    part = line.amplitude[..., None] * less ** (-1 / line.power)
    total = part.sum(axis=2)
    least = FAINT_SUM * np.abs(line.amplitude).sum(axis=2)[..., None]
    total = np.where(np.abs(total) > least, total, np.where(total < 0, -1.0, 1.0) * np.maximum(least, 1e-300))
    slope = -line.time_s * (part * (1 + x) / less).sum(axis=2) / total
    return np.log(np.abs(total)) - decay[:, None, None] * line.time_s, slope


def _decay_residual(line: DecayFrames, damping_growth: float, decay: Array) -> tuple[Array, Array]:
    """Compute model − observed (p, s, t) and its slope over the decay, without each strike's mean."""
    model, slope = _model(line, damping_growth, decay)
    share = line.weight / np.maximum(line.weight.sum(axis=1, keepdims=True), 1e-300)
    left = model - line.log
    return left - (share * left).sum(axis=2, keepdims=True), slope - (share * slope).sum(axis=2, keepdims=True)
