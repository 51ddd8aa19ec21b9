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
from sonic_bullet.records import Residual
from sonic_bullet.signal.log_spectral import floor_between, power_spectra


def keep_nearest_parts(found: CaseFit, e: RecordedObject, residual: Residual) -> Residual:
    """Return a residual of an object's takes with the parts that bring them nearest."""
    parts = list(_list_parts(residual))
    return parts[int(np.argmin([_mean_distance_db(found, e, one) for one in parts]))]


def _list_parts(whole: Residual) -> Iterator[Residual]:
    """Yield it whole, and without its noise, its lines, and both."""
    silent, no_lines = (
        {"power_per_hz": np.zeros_like(whole.power_per_hz)},
        dict.fromkeys(("line_freq_hz", "line_decay_per_s", "line_amplitude"), np.zeros(0)),
    )
    for less in ({}, silent, no_lines, silent | no_lines):
        yield replace(whole, **less)


def _mean_distance_db(found: CaseFit, e: RecordedObject, residual: Residual) -> float:
    """Compute the mean distance of an object's takes from what is played of them with a residual."""
    assert e.signals is not None
    off = []
    for recording, signal in zip(e.recordings, e.signals, strict=True):
        made, free = predicted_take(found, e, recording, len(signal), e.sr, residual)
        floor, power, played = (
            floor_between([signal]).within(e.sr, found.case.band_hz),
            power_spectra(signal),
            power_spectra(made),
        )
        off.append(find_best_gain(power, played, floor).distance_db if free else distance_at(power, played, floor, 1.0))
    return float(np.mean(off))
