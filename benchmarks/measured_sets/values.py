"""What a set says: rows of errors before and after, a verdict in words, a figure; and the null every row stands
beside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.effects import Evidence, ObjectEvidence
from sonic_bullet.estimator.lines.line_values import Features

Array = np.ndarray[Any, Any]
DRAWS = 200
# of the model so far, in 1/s and s: lines in a table come with none, and nothing is yet taken from their decays
ALPHA, BETA = 1.0, 1e-9
ACCEPTED_BELOW = 0.9  # an effect's error on what it was not fitted to must fall below this share of the baseline's
CHANCE = 0.05  # of the null's draws, at most, may do as well


@dataclass(frozen=True)
class Row:
    """One number predicted for the held-out part (count items) by baseline and by baseline + effect, in unit; null:
    median error of the null, chance: its share as good.

    effect: what was added, "" where nothing was proposed (after = before). again: the same of every other reading
    (observed.py), None where one came to nothing of the kind.
    """

    what: str
    count: int
    unit: str
    before: float
    after: float
    null: float
    chance: float
    effect: str
    again: tuple[Row | None, ...] = ()

    def read_again(self, others: Sequence[Sequence[Row]]) -> Row:
        """With what other readings' rows say of the same."""
        return replace(
            self,
            again=tuple(
                next((r for r in rows if (r.what, r.effect) == (self.what, self.effect)), None) for rows in others
            ),
        )

    @property
    def accepted(self) -> bool:
        """Whether it is accepted in every reading."""
        return self.accepted_here and all(r is not None and r.accepted_here for r in self.again)

    @property
    def accepted_here(self) -> bool:
        """Whether it is in this one."""
        return bool(
            self.effect
            and "no effect" not in self.effect
            and self.after < ACCEPTED_BELOW * self.before
            and self.chance <= CHANCE
        )


@dataclass(frozen=True)
class Outcome:
    """What a set says.

    text: a paragraph; unexplained: what is left, in words; draw: paints the set's figure on a matplotlib Figure;
    skipped: one line each.
    """

    rows: tuple[Row, ...]
    text: str
    unexplained: str
    draw: Callable[[Any], None]
    skipped: tuple[str, ...] = ()


Judge = Callable[[Path, dict[str, Any]], Outcome]
"""Folder of a set, its case.json -> what was found.

May raise anything: the set is then named and counted as skipped.
"""


@dataclass(frozen=True, eq=False)
class Lines:
    """k lines of one body: f, d and their spreads, |A| at the first strike."""

    freq_hz: Array
    decay_per_s: Array
    decay_sd_per_s: Array
    amplitude: Array
    freq_sd_hz: Array

    def part(self, keep: Array) -> Lines:
        return Lines(
            *(x[keep] for x in (self.freq_hz, self.decay_per_s, self.decay_sd_per_s, self.amplitude, self.freq_sd_hz))
        )

    @property
    def omega(self) -> Array:
        return np.asarray(np.hypot(2 * np.pi * self.freq_hz, self.decay_per_s))


def clear(
    found: Features, *, down_db: float = 45.0, sure: float = 0.15, loss: float = 0.03, apart: float = 0.01
) -> Lines:
    """Lines that ring, by frequency: energy a²/d within down_db of the strongest's, d known to sure, 2d/ω < loss, the
    strongest within ± apart.

    What is over in a few periods is the click; what lies beside a stronger line is its beating.
    """
    sd = np.where(np.isfinite(found.decay_sd_per_s), found.decay_sd_per_s, np.inf)
    ring = (
        (found.decay_per_s > 0)
        & (sd < np.maximum(sure * found.decay_per_s, 0.1))
        & (found.decay_per_s < loss * np.pi * found.freq_hz)
    )
    energy = np.where(ring, found.amplitude**2 / np.maximum(found.decay_per_s, 1e-3), 0.0)
    kept: list[int] = []
    for i in np.argsort(-energy):
        if energy[i] > 10 ** (-down_db / 10) * energy.max() and all(
            abs(found.freq_hz[i] / found.freq_hz[j] - 1) > apart for j in kept
        ):
            kept.append(int(i))
    order = np.array(kept, int)[np.argsort(found.freq_hz[kept])] if kept else np.zeros(0, int)
    return Lines(*(x[order] for x in (found.freq_hz, found.decay_per_s, sd, found.amplitude, found.freq_sd_hz)))


def told(
    freq_hz: Array, decay_per_s: Array, decay_sd_per_s: Array | None = None, amplitude: Array | None = None
) -> Lines:
    """Lines out of a table."""
    f, d = np.asarray(freq_hz, float), np.asarray(decay_per_s, float)
    order = np.argsort(f)
    sd = 0.05 * d if decay_sd_per_s is None else np.asarray(decay_sd_per_s, float)
    size = np.ones(len(f)) if amplitude is None else np.asarray(amplitude, float)
    return Lines(f[order], d[order], sd[order], size[order], np.full(len(f), 1e-4) * f[order])


def observed(lines: Lines) -> ObjectEvidence:
    """One body's lines as an effect is told them; without shape or sound."""
    k, none, flat = len(lines.freq_hz), np.zeros(0), np.zeros((1, 0))
    size = lines.amplitude[None, :].astype(complex)
    return ObjectEvidence(
        impulse_n_s=np.ones(1),
        freq_hz=lines.freq_hz,
        decay_per_s=lines.decay_per_s,
        freq_sd_hz=lines.freq_sd_hz,
        decay_sd_per_s=lines.decay_sd_per_s,
        amplitude=size,
        amplitude_sd=0.05 * np.abs(size),
        mode=tuple(np.array([i]) for i in range(k)),
        model_hz=lines.freq_hz,
        expected_decay_per_s=0.5 * (ALPHA + BETA * (2 * np.pi * lines.freq_hz) ** 2),
        expected=size,
        pattern=np.abs(size),
        foreign_hz=none,
        foreign_decay_per_s=none,
        foreign_amplitude=flat,
        foreign_sd=flat,
        model=None,
        strike_vertex=np.zeros(1, int),
        strike_direction=np.array([[0.0, 0.0, 1.0]]),
        sensor_vertex=0,
        sensor_direction=np.array([0.0, 0.0, 1.0]),
        signal=None,
        predicted=None,
        noise=np.zeros(1),
        sr=0,
        signed=False,
        push=size,
        pressed=np.ones(size.shape),
        all_hz=lines.freq_hz,
        plain=None,
    )


def evidence(bodies: list[Lines]) -> Evidence:
    """Several bodies' lines, all that is known of them."""
    top = max(float(b.freq_hz.max(initial=1.0)) for b in bodies)
    return Evidence(tuple(observed(b) for b in bodies), ALPHA, BETA, 1.0, (), (20.0, top), 0)
