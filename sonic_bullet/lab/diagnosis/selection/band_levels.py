"""Levels of recording and synthesis, band by band: a mean distance over all cells hides what one band lacks.

    d_sb = 10 lg Σ|R|² / Σ(|P|² + N)   over the cells of a band b, the first early_s and the rest apart;
        third octaves that overlap by half
    off:  |mean_s d| > band_apart_db, and strong_evidence that it is not 0,
        over the strikes s in which either is ABOVE over the noise N

A correction may put a mode MOST_CORRECTION away, over a band's edge, and a window spreads it over two cells to
each side: recorded is more only where it is more than what is played so much beyond the band, too, and the other way
round. Each band has the shortest window of which it holds a main lobe. No effect is looked for here: it can only
revoke a verdict `none`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.lab.diagnosis.evidence.unmatched_modes import MOST_CORRECTION
from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, ScoredObservation
from sonic_bullet.lab.diagnosis.selection.acceptance import evidence
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.signal.log_spectral import ABOVE_NOISE, Floor
from sonic_bullet.signal.short_time import short_time_power, window_energy

CENTRE_HZ = 1000 * 2.0 ** (np.arange(-24, 28) / 6)  # third octaves every sixth
HALF_BAND = 2 ** (1 / 6)  # of a third octave, to each side


@dataclass(frozen=True, slots=True)
class BandOff:
    """A band in which the mean over strikes of recorded over played is off.

    Attributes
    ----------
    from_hz, to_hz : float
        Edges.
    early : bool
        In the first early_s, not after.
    recorded_over_played_db : float
        The mean.
    standard_error_db : float
        Of the mean.
    strikes : int
        Number of strikes.
    """

    from_hz: float
    to_hz: float
    early: bool
    recorded_over_played_db: float
    standard_error_db: float
    strikes: int

    def __str__(self) -> str:
        """Format it as a sentence."""
        less = "less" if self.recorded_over_played_db < 0 else "more"
        when = (
            f"in the first {1000 * RULES.early_s:.0f} ms"
            if self.early
            else f"after the first {1000 * RULES.early_s:.0f} ms"
        )
        where = f"between {self.from_hz / 1000:.2g} and {self.to_hz / 1000:.2g} kHz"
        strikes = format_count(self.strikes, "strike")
        return f"recorded {abs(self.recorded_over_played_db):.1f} dB {less} than played {where} {when}, {strikes}"


def bands_off(takes: Sequence[ScoredObservation], made: Predictions) -> tuple[BandOff, ...]:
    """Find the bands in which a prediction is not as loud as the recordings; lists of lines have no levels."""
    rows = [
        over_db(t.sample, t.synthesize(made[t.body]), t.sr, t.floor, t.body.band_hz)
        for t in takes
        if isinstance(t, AudioObservation)
    ]
    return off_in(np.array(rows)) if rows else ()


def over_db(recorded: Array, played: Array, sr: int, floor: Floor, band_hz: tuple[float, float]) -> Array:
    """Compute the level of a recording over its synthesis in the bands around CENTRE_HZ.

    Parameters
    ----------
    recorded, played : (n,)
        The sounds from the onset on.
    sr : int
        Sampling rate in Hz.
    floor : Floor
        The recording's noise.
    band_hz : (2,)
        Band of the recordings.

    Returns
    -------
    (2, b)
        dB in the first early_s and in the rest; NaN where neither is above the noise, or a band holds too few cells.
    """
    early = round(RULES.early_s * sr)
    parts = [(x[:early], x[early:]) for x in (recorded, played)]
    return np.array([_over_db(a, b, sr, floor, band_hz) for a, b in zip(*parts, strict=True)])


def _over_db(recorded: Array, played: Array, sr: int, floor: Floor, band_hz: tuple[float, float]) -> Array:
    """Compute the same of one part of the sounds."""
    windows = (512, 1024, 2048, 4096, 8192)
    found = np.full(len(CENTRE_HZ), np.nan)
    low, high = CENTRE_HZ / HALF_BAND, CENTRE_HZ * HALF_BAND
    inside = (low >= band_hz[0]) & (high <= min(band_hz[1], sr / 2))
    fits = [w for w in windows if w <= len(recorded)]
    lobe = 2  # cells from the middle of a Hann window's main lobe to its first zeros
    window = np.array([next((w for w in fits if 2 * lobe * sr / w <= wide), 0) for wide in high - low])
    for w in np.unique(window[inside & (window > 0)]).tolist():
        who = np.flatnonzero(inside & (window == w))
        cell, mine = sr / w, (low[who], high[who])
        edge = np.maximum(lobe * cell, MOST_CORRECTION * CENTRE_HZ[who])
        beyond = (mine[0] - edge, mine[1] + edge)
        (a, near_a), (b, near_b) = (
            (_sum_cells(p, *mine, cell), _sum_cells(p, *beyond, cell))
            for p in (short_time_power(x, w, w // 4).sum(axis=0) for x in (recorded, played))
        )
        n = _sum_cells(floor.at(w // 2 + 1) * window_energy(w) * _frames(len(recorded), w), *mine, cell)
        more, less = 10 * np.log10(np.maximum(a, n) / (near_b + n)), 10 * np.log10(np.maximum(near_a, n) / (b + n))
        found[who] = np.where(
            (a > ABOVE_NOISE * n) | (b > ABOVE_NOISE * n),
            np.maximum(more, 0) + np.minimum(less, 0),
            np.nan,
        )
    return found


def _frames(count: int, window: int) -> int:
    """Count the frames of a sound."""
    return (count - window) // (window // 4) + 1


def _sum_cells(power: Array, low_hz: Array, high_hz: Array, cell_hz: float) -> Array:
    """Sum power (bins,) over the cells from low_hz to high_hz (b,)."""
    total = np.concatenate([[0.0], np.cumsum(power)])
    first, last = (np.clip(np.ceil(f / cell_hz).astype(int), 0, len(power)) for f in (low_hz, high_hz))
    return np.asarray(total[last] - total[first])


def off_in(over: Array) -> tuple[BandOff, ...]:
    """Find the bands that are off in recorded over played (s, 2, b) in dB, from low to high, early ones first."""
    count, usual = np.isfinite(over).sum(axis=0), _scatter_db(over)
    found = []
    for part, b in zip(*np.nonzero(count), strict=True):
        d = over[np.isfinite(over[:, part, b]), part, b]
        few = len(d) < 3  # which leave one degree of freedom, or none
        error = (usual if few else float(d.std(ddof=1))) / np.sqrt(len(d))
        clear = abs(d.mean()) > RULES.standard_errors * error if few else abs(evidence(d)) > RULES.strong_evidence
        if clear and abs(d.mean()) > RULES.band_apart_db:
            found.append(
                BandOff(
                    float(CENTRE_HZ[b] / HALF_BAND),
                    float(CENTRE_HZ[b] * HALF_BAND),
                    part == 0,
                    float(d.mean()),
                    float(error),
                    len(d),
                )
            )
    return tuple(found)


def _scatter_db(over: Array) -> float:
    """Compute the scatter of strikes about a band's mean, over all bands (s, 2, b).

    Of one strike alone the scatter of its bands; ∞ of one band of one strike.
    """
    seen = np.isfinite(over)
    count = seen.sum(axis=0)
    free = int(np.maximum(count - 1, 0).sum())
    if not free:
        return float(over[seen].std(ddof=1)) if seen.sum() > 1 else np.inf
    off = np.where(seen, over, 0.0) - np.where(seen, over, 0.0).sum(axis=0) / np.maximum(count, 1)
    return float(np.sqrt((np.where(seen, off, 0.0) ** 2).sum() / free))


def in_words(bands: Sequence[BandOff]) -> str:
    """Describe the shown bands that are farthest off; bands that overlap as one, with the largest value."""
    runs: list[list[BandOff]] = []
    for band in bands:
        last = runs[-1][-1] if runs else None
        one = (
            last is not None
            and last.early == band.early
            and last.to_hz > band.from_hz
            and last.recorded_over_played_db * band.recorded_over_played_db > 0
        )
        runs = [*runs[:-1], [*runs[-1], band]] if one else [*runs, [band]]
    runs = sorted(runs, key=lambda run: -max(abs(band.recorded_over_played_db) for band in run))
    shown = 4  # in words
    said = [_format_run(run) for run in runs[:shown]]
    return "; ".join(said) + (f"; and {len(runs) - shown} more" if len(runs) > shown else "")


def _format_run(run: Sequence[BandOff]) -> str:
    """Describe a run as one band, with the largest value."""
    far = max(run, key=lambda band: abs(band.recorded_over_played_db))
    words = str(replace(far, from_hz=run[0].from_hz, to_hz=run[-1].to_hz))
    return words if len(run) == 1 else words.replace("recorded ", "recorded up to ", 1)
