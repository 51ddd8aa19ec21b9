"""Tolerance of two sounds whose samples need not be equal, and what was compared, in words.

Octave levels within so many decibels, as many onsets, the same length and channels. Bands 60 dB below the loudest do
not count: T60 is the time after which a sound counts as silent [ISO 3382-1].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.apps.compare.outcome.sound_effects import (
    at_common_rate,
    band_levels,
    level_words,
    onsets_s,
)
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import CompareError
from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ

if TYPE_CHECKING:
    from sonic_bullet.apps.compare.ensemble import Audibility
    from sonic_bullet.apps.compare.sides import Side


@dataclass(frozen=True, slots=True)
class SoundMeasures:
    """Measures of a sound. band_db: octave levels, dB re 1 Pa², None: silent."""

    seconds: float
    channels: int
    onset_count: int
    band_db: tuple[float | None, ...]


@dataclass(frozen=True, slots=True)
class Closeness:
    """Whether one sound is within a tolerance of another, and why, in one line."""

    tolerance_db: float
    within: bool
    words: str


def as_tolerance(value: object) -> float:
    """Return a tolerance in dB; raises CompareError."""
    return as_number(value, "tolerance_db", "give decibels, 0 or more", least=0, most=200, error=CompareError)


def measure_sound(x: Array, sr: int) -> SoundMeasures:
    """Measure a sound x (channels, n) in Pa."""
    levels = tuple(float(v) if np.isfinite(v) else None for v in band_levels(x, sr))
    return SoundMeasures(x.shape[1] / sr, len(x), len(onsets_s(x, sr)), levels)


def closeness(a: SoundMeasures, b: SoundMeasures, tolerance_db: float) -> Closeness:
    """Check whether b is within that tolerance of a."""
    range_db = 60.0
    faults = []
    if abs(a.seconds - b.seconds) > 1e-6 or a.channels != b.channels:
        faults.append(f"length {a.seconds:.4g} → {b.seconds:.4g} s, channels {a.channels} → {b.channels}")
    if a.onset_count != b.onset_count:
        faults.append(f"onsets {a.onset_count} → {b.onset_count}")
    heights = [one for one in (*a.band_db, *b.band_db) if one is not None]
    floor = max(heights, default=0.0) - range_db
    change, most_hz = 0.0, 0.0
    for f, one, other in zip(AUDIBLE_OCTAVES_HZ, a.band_db, b.band_db, strict=False):
        old, new = (floor if level is None else max(level, floor) for level in (one, other))
        if abs(new - old) > abs(change):
            change, most_hz = new - old, f
    said = (
        f"octave levels differ most at {most_hz:g} Hz, where the second sound is {level_words(change)}"
        if change
        else "octave levels are equal"
    )
    if abs(change) > tolerance_db:
        faults.append(said)
    where = "beyond" if faults else "within"
    return Closeness(tolerance_db, not faults, f"{where} {tolerance_db:g} dB: {'; '.join(faults) or said}")


def found_closeness(a: Side, b: Side, tolerance_db: float) -> Closeness:
    """Check whether b is within that tolerance of a; sounds of two rates are compared at the lower one."""
    one, other, sr = at_common_rate(a.sound.samples(), b.sound.samples(), a.sr, b.sr)
    return closeness(measure_sound(one, sr), measure_sound(other, sr), as_tolerance(tolerance_db))


def passes(same: bool, within: Closeness | None, audible: Audibility | None) -> bool:
    """Tell whether two sounds count as the same: equal samples, or within the tolerance or chance asked for."""
    return same or (within is not None and within.within) or (audible is not None and not audible.beyond_chance)


def sameness_words(within: Closeness | None) -> str:
    """Describe how two sounds with different samples count as the same."""
    if within is None or not within.within:
        return "the same but for chance"
    return f"the same within {within.tolerance_db:g} dB"


def compared_words(side: Side, same: bool, within: Closeness | None) -> str:
    """Describe what was compared in one line: bodies, events, seconds, tolerance."""
    most_names = 6
    tolerance_db = None if same or within is None else within.tolerance_db
    x = side.sound.samples()
    names: Sequence[str] = [] if side.log is None else [one.name for one in side.log.bodies if one.material is not None]
    rest = f" and {len(names) - most_names} more" if len(names) > most_names else ""
    who = f"{format_count(len(names), 'body', 'bodies')} ({', '.join(names[:most_names])}{rest}), " if names else ""
    events = format_count(len(onsets_s(x, side.sr)), "event")
    how = "to the bit" if tolerance_db is None else f"tolerance {tolerance_db:g} dB"
    return f"{who}{events}, {x.shape[1] / side.sr:.4g} s, {how}"
