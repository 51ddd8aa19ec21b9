"""Whether the levels of lines differ as the spectra of two contacts do: one law for all lines, judged jointly.

    y_k = g + 20 lg |P(f_k τ₁)/P(f_k τ₀)| + e_k,   P: half a sine, or a Hertz pulse; g: the gain     (pulses.py)
    statistic: how much of Σ (y − <y>)² the best τ₀, τ₁ take away
    chance: the larger of two: the share of the exchanges of takes for which they take as much, and that of the
        exchanges of lines, as another place of the strike has no order in frequency   [Westfall & Young 1993, ch. 2.6]

Another contact moves all lines by a little and few of them by enough to be certain alone. Its zeros move, too: near
them a line gains or loses 20 dB while its neighbours hardly change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.effects.common.pulses import magnitude
from sonic_bullet.lab.states.chance import CERTAIN, labelling_count, labellings
from sonic_bullet.lab.states.changes import Changes
from sonic_bullet.records import Array

FEWEST = 6
"""Lines that both states hold: twice as many as two durations and a gain are numbers."""
MOST_FT = 3.5
"""fτ of the most lines: beyond the third zero a pulse leaves a fiftieth, and no line is seen."""
FLOOR = 0.01
"""Of a pulse's spectrum at its zeros: no two bounces are alike."""
CLIPPED_DB = 25.0
EXPLAINED = 0.5
"""Share of the mean departure of lines beyond their scatter that may be left. Of six made plates in rooms (closed form)
struck by two contacts at most 0.35 is left; struck elsewhere or in another room at least 0.6 but of few lines."""
DRAWS = 499


@dataclass(frozen=True, slots=True)
class ContactPair:
    """Durations in s before and after, what lines are off (mean in dB beyond their scatter) with and without them.

    chance: that takes of one state give as much; 1 where takes or lines are too few to say.
    """

    before_s: float
    after_s: float
    off_db: float
    plain_db: float
    chance: float

    @property
    def explains(self) -> bool:
        """Whether two contacts explain nearly all of what levels differ by."""
        return self.before_s != self.after_s and self.off_db <= EXPLAINED * self.plain_db


def fit_contacts(found: Changes) -> ContactPair:
    """Fit the contacts of two states to the levels of lines that both hold."""
    held = [
        np.isfinite(one.freq_hz).mean(axis=0) >= 0.6 if len(one.freq_hz) else np.zeros(len(found.pole), bool)
        for one in (found.before_lines, found.after_lines)
    ]
    at = np.flatnonzero(held[0] & held[1])
    if len(at) < FEWEST:
        return ContactPair(0.0, 0.0, np.inf, 0.0, 1.0)
    freq = found.pole[at].imag / (2 * np.pi)
    takes = [
        one.level_db[:, at] - gain[:, None]
        for one, gain in zip((found.before_lines, found.after_lines), found.gain_db, strict=True)
    ]
    values, after = np.concatenate(takes), np.repeat([False, True], [len(one) for one in takes])
    scatter = np.sqrt(sum(one.var(axis=0, ddof=1) / len(one) if len(one) > 1 else 0.0 * freq for one in takes))
    labels = labellings(after)
    labels = np.concatenate([after[None], labels[(labels != after).any(axis=1)]])
    change = np.array([values[one].mean(axis=0) - values[~one].mean(axis=0) for one in labels])
    change = np.clip(change - np.median(change, axis=1, keepdims=True), -CLIPPED_DB, CLIPPED_DB)
    curve, duration = _curves(freq)
    power = (curve**2).sum(axis=1)
    gained = 2 * (change - change.mean(axis=1, keepdims=True)) @ curve.T - power
    taken, best = gained.max(axis=1) * (1 + 1e-9), int(gained[0].argmax())
    random = np.random.default_rng(0)
    turned = np.array([random.permutation(change[0] - change[0].mean()) for _ in range(DRAWS)])
    by_lines = (1 + ((2 * turned @ curve.T - power).max(axis=1) >= gained[0].max()).sum()) / (1 + DRAWS)
    chance = max(float((taken >= gained[0].max()).mean()), float(by_lines))
    if labelling_count(len(takes[0]), len(takes[1])) * CERTAIN < 1:
        chance = 1.0
    off = [
        np.maximum(np.abs(one - np.median(one)) - scatter, 0.0).mean() for one in (change[0] - curve[best], change[0])
    ]
    return ContactPair(*(float(one) for one in (*duration[best], *off, chance)))


def _curves(freq: Array) -> tuple[Array, Array]:
    """Return what two contacts' levels differ by (c, k) in dB about its mean, and their durations (c, 2)."""
    durations = np.geomspace(5e-5, 5e-3, 72)
    durations = durations[durations * np.quantile(freq, 0.8) < MOST_FT]
    curves, pairs = [], []
    one, other = (x.ravel() for x in np.meshgrid(np.arange(len(durations)), np.arange(len(durations)), indexing="ij"))
    for pulse in ("half-sine", "hertz"):
        level = 20 * np.log10(np.maximum(np.abs(magnitude(pulse, freq * durations[:, None])), FLOOR))
        step = np.clip(level[other] - level[one], -CLIPPED_DB, CLIPPED_DB)
        curves.append(step - step.mean(axis=1, keepdims=True))
        pairs.append(np.column_stack([durations[one], durations[other]]))
    return np.concatenate(curves), np.concatenate(pairs)
