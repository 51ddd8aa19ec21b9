"""Pairs of a body's lines and the modes that an elastic tensor gives it.

ObjectEvidence -> BodyLines;   BodyLines, p -> Seen (`Elastic.look`);   BodyLines, Seen -> pairs (line_assignment.py)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.effects.common.line_assignment import Assignment, assign_lines, cosines, weight_by_level
from sonic_bullet.lab.effects.evidence import Elastic, Evidence, ObjectEvidence
from sonic_bullet.lab.effects.orthotropy.tensors import stiffness
from sonic_bullet.records import Array

LINE_CAP = 0.012  # of ln f: a line farther off is no such mode


@dataclass(frozen=True, slots=True, eq=False)
class BodyLines:
    """Lines of one body, whatever they were paired with.

    Attributes
    ----------
    log_hz, sd : (k,)
        ln f and its spread.
    worth : (k,)
        Weights.
    amplitude : (s, k) complex
        None where patterns over the strikes are not comparable.
    row : (s,)
        The strikes' rows in `Elastic.look`.
    elastic : Elastic
        The body under any elasticity.
    """

    log_hz: Array
    sd: Array
    worth: Array
    amplitude: Array | None
    row: Array
    elastic: Elastic


def body_lines_of(evidence: Evidence) -> list[BodyLines]:
    """Return all lines, whatever they were paired with, of the objects that can be of any elasticity."""
    return [
        _body_lines(h) for h in evidence.observed if h.elastic is not None and len(h.freq_hz) + len(h.foreign_hz) > 4
    ]


def select_ringing(h: ObjectEvidence) -> Array:
    """Select the foreign lines (f,) that may be modes by their decay and phases.

    Others belong to a click, a filter, a room or noise.
    """
    # of a line's energy in phase with the impact, where phases are true: a mode moves with it or against it, noise as
    # it likes
    real = 0.75
    short = 2.0  # times its frequency a mode's decay at most: a loss factor of 0.64, more than soft rubber's
    brief = 10.0  # times the modes' usual decay
    decay = np.nan_to_num(h.foreign_decay_per_s)
    own = decay < short * h.foreign_hz
    if np.isfinite(h.decay_per_s).any():
        own &= decay < brief * max(float(np.nanmedian(h.decay_per_s)), 1.0)
    if h.elastic is not None and h.elastic.phased and h.signed and len(h.foreign_amplitude) > 1:
        a = np.nan_to_num(h.foreign_amplitude)
        own &= (a.real**2).sum(axis=0) >= real * (np.abs(a) ** 2).sum(axis=0)
    return np.asarray(own)


def weigh_lines(amplitude: Array) -> Array:
    """Weigh lines (k,) by amplitudes (s, k): 0.06 less a decade below the loudest, half of it all, 0.05 at least."""
    size = np.linalg.norm(np.nan_to_num(amplitude), axis=0)
    if not size.any():
        return np.full(amplitude.shape[1], 0.5)
    return 0.5 * weight_by_level(size, per_decade=0.12)


def _body_lines(h: ObjectEvidence) -> BodyLines:
    """Collect the lines of one object."""
    assert h.elastic is not None
    own = select_ringing(h)
    freq, decay = (
        np.concatenate([h.freq_hz, h.foreign_hz[own]]),
        np.concatenate([h.decay_per_s, h.foreign_decay_per_s[own]]),
    )
    sd = np.concatenate([h.freq_sd_hz / np.maximum(h.freq_hz, 1e-9), np.full(int(own.sum()), 1e-4)])
    amplitude = np.concatenate([h.amplitude, h.foreign_amplitude[:, own]], axis=1)
    order = np.argsort(freq)
    amplitude = amplitude[:, order]
    worth = weigh_lines(amplitude)
    log_hz = np.log(np.hypot(2 * np.pi * freq, np.nan_to_num(decay)) / (2 * np.pi))[order]
    wide = np.nan_to_num(decay)[order] / (2 * np.pi * np.exp(log_hz))
    worth = worth / (1 + (wide / LINE_CAP) ** 2)  # a line broader than that stands for whatever is beside it, too
    row = h.strike_vertex - h.sensor_vertex  # from the end: the sensor is the last
    known = np.isfinite(amplitude).all() and len(row) > 1
    return BodyLines(log_hz, np.nan_to_num(sd, nan=1e-4)[order], worth, amplitude if known else None, row, h.elastic)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Modes of a tensor and one body's lines.

    Attributes
    ----------
    log_hz : (m,)
        ln f of the modes.
    slope : callable
        Modes (k,) -> slopes (9, k) of their ln λ over the constants.
    alike : (k, m)
        Likeness of lines' and modes' patterns, 0 to 1.
    """

    log_hz: Array
    slope: Callable[[Array], Array]
    alike: Array


def seen_by(lines: BodyLines, p: Array) -> Seen:
    """Compute the modes of p (9,) and the likeness of their patterns to the lines'."""
    freq, slope, psi = lines.elastic.look(stiffness(p))
    alike = np.ones((len(lines.log_hz), len(freq)))
    if lines.amplitude is not None:
        psi = psi[len(psi) + lines.row]
        if np.isfinite(psi).all():
            a = lines.amplitude if lines.elastic.phased else np.abs(lines.amplitude)
            psi = psi if lines.elastic.phased else np.abs(psi)
            alike = cosines(a, psi)
    return Seen(np.log(freq), slope, alike)


def pair_modes(lines: BodyLines, seen: Seen, width: float, lowest: int | None = None) -> Assignment:
    """Pair lines and modes at the least price.

    Parameters
    ----------
    lines : BodyLines
        The lines.
    seen : Seen
        The modes.
    width : float
        Of ln f.
    lowest : int
        Number of lines from the lowest, all where None.
    """
    return assign_lines(
        lines.log_hz[:lowest],
        seen.log_hz,
        width,
        likeness=seen.alike[:lowest],
        weight=lines.worth[:lowest, None],
    )
