"""Which parts of a residual are kept: those with which the takes that it is of are nearest.

    parts: lines and noise, lines, noise, none -> argmin of the mean over takes of D(take, g·(fitted + parts))

D and g: fit/held_out_takes.py. A residual is a mean over takes that has lost its phases, as noise is drawn anew and its
lines begin where those of the modes do. Where that lies farther from the takes than what is played without, it says of
them less than nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.held_out_takes import predicted_take
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.lab.fit.takes.best_gain import distance_at, find_best_gain
from sonic_bullet.records import Array, Residual
from sonic_bullet.signal.log_spectral import Floor, floor_between, power_spectra


def keep_nearest_parts(found: CaseFit, e: RecordedObject, residual: Residual) -> Residual:
    """Return a residual of an object's takes with the parts that bring them nearest."""
    assert e.signals is not None
    takes = [(floor_between([x]).within(e.sr, found.case.band_hz), power_spectra(x)) for x in e.signals]
    parts = list(_list_parts(residual))
    return parts[int(np.argmin([_mean_distance_db(found, e, takes, one) for one in parts]))]


def _list_parts(whole: Residual) -> Iterator[Residual]:
    """Yield it whole, and without its noise, its lines, and both."""
    silent, no_lines = (
        {"power_per_hz": np.zeros_like(whole.power_per_hz)},
        dict.fromkeys(("line_freq_hz", "line_decay_per_s", "line_amplitude"), np.zeros(0)),
    )
    for less in ({}, silent, no_lines, silent | no_lines):
        yield replace(whole, **less)


def _mean_distance_db(
    found: CaseFit, e: RecordedObject, takes: list[tuple[Floor, tuple[Array, ...]]], residual: Residual
) -> float:
    """Compute the mean distance of an object's takes, noise and powers, from what is played with a residual."""
    assert e.signals is not None
    off = []
    for recording, (floor, power) in zip(e.recordings, takes, strict=True):
        made, free = predicted_take(found, e, recording, e.signals.shape[1], e.sr, residual)
        played = power_spectra(made)
        off.append(find_best_gain(power, played, floor).distance_db if free else distance_at(power, played, floor, 1.0))
    return float(np.mean(off))
