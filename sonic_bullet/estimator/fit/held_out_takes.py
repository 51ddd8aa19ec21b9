"""Takes held against the fit: how far its prediction of each is, beside silence and beside another take.

    take r, from its onset            ──┐
    placed modes, or typical lines p  ──┴─► D(r, g·p)     g: of least D, where the impulse is not known;
                                                          p with what a residual adds to it, where one is given
    nothing                           ────► D(r, 0)
    the fit's own takes t             ────► min over t and g of D(r, g·t)

D: log_spectral.py, over what stands above the recording's noise, in the case's band. A prediction enters with the
noise's power added, silence with that alone. A prediction farther than silence is none.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from sonic_bullet.estimator.fit.case_fit import TakeDistance
from sonic_bullet.estimator.fit.prediction_of_lines import damped_sum, strike_modes
from sonic_bullet.estimator.fit.recorded import RecordedObject, recorded_signals
from sonic_bullet.estimator.fit.typical_strike import typical_strike
from sonic_bullet.estimator.lines.log_spectral import (
    Floor,
    floor_between,
    noise_spectra,
    power_spectra,
    spectra_distance_db,
)
from sonic_bullet.files.cases import CaseRecording
from sonic_bullet.records import Array, Residual
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.residual.offline import residual_sound

if TYPE_CHECKING:
    from sonic_bullet.estimator.fit.case_fit import CaseFit

WORSE_THAN_SILENCE = "worse-than-silence"
GAIN_REACH_DB = 40.0
"""The best gain is looked for this far about equal energy."""


def judged_by_takes(found: CaseFit, progress: Callable[[str], None] | None = None) -> CaseFit:
    """The fit with the distances of the takes held out, or of its own where none is; and with the verdict that it is
    worse than silence where it is.

    Raises SonicBulletError.
    """
    takes = predicted_takes(found, progress=progress)
    judged = replace(found, takes=takes)
    if not judged.worse_than_silence:
        return judged
    predicted = float(np.nanmean([t.predicted_db for t in takes]))
    silent = float(np.nanmean([t.silence_db for t in takes]))
    verdict = (
        f"{WORSE_THAN_SILENCE}: what is fitted is {predicted:.1f} dB from the takes, silence {silent:.1f} dB; "
        f"{found.fit.verdict}"
    )
    return replace(judged, fit=replace(found.fit, verdict=verdict))


def predicted_takes(
    found: CaseFit, *, residual: Residual | None = None, progress: Callable[[str], None] | None = None
) -> tuple[TakeDistance, ...]:
    """Distances of the takes held out, or of the fit's own where none is; with a residual, where given.

    Raises SonicBulletError where a file cannot be read.
    """
    return next((rows for split in ("holdout", "fit") if (rows := _of_split(found, split, residual, progress))), ())


def _of_split(
    found: CaseFit, split: str, residual: Residual | None, progress: Callable[[str], None] | None
) -> tuple[TakeDistance, ...]:
    """Distances of all takes of a split that have audio, of objects that were fitted."""
    rows: list[TakeDistance] = []
    for e in found.evidence:
        mine = tuple(
            r
            for r in found.case.recordings
            if r.object == e.recordings[0].object and r.split == split and r.file is not None and r.file.is_file()
        )
        if not mine or e.signals is None:
            continue
        if progress is not None:
            progress(f"predicting takes of {e.thing.name}")
        signals, sr = recorded_signals(found.case, e.thing, mine)
        takes = [power_spectra(take) for take in e.signals] if sr == e.sr else []
        for recording, signal in zip(mine, signals, strict=True):
            others = [t for t, r in zip(takes, e.recordings, strict=False) if r != recording]
            rows.append(_distances(found, e, recording, signal, sr, others, residual))
    return tuple(rows)


def _distances(
    found: CaseFit,
    e: RecordedObject,
    recording: CaseRecording,
    signal: Array,
    sr: int,
    others: list[tuple[Array, ...]],
    residual: Residual | None,
) -> TakeDistance:
    floor, power = floor_between([signal]).within(sr, found.case.band_hz), power_spectra(signal)
    made, free = predicted_take(found, e, recording, len(signal), sr, residual)
    modelled = power_spectra(made)
    nearest = [_distance_at_best_gain(power, other, floor, noisy=False) for other in others]
    return TakeDistance(
        recording.file.name if recording.file is not None else "",
        recording.split,
        _distance_at_best_gain(power, modelled, floor) if free else _distance(power, modelled, floor, 1.0),
        _distance(power, modelled, floor, 0.0),
        float(np.nanmin(nearest)) if np.isfinite(nearest).any() else float("nan"),
        free,
    )


def predicted_take(
    found: CaseFit, e: RecordedObject, recording: CaseRecording, n: int, sr: int, residual: Residual | None = None
) -> tuple[Array, bool]:
    """Sound (n,) of a take by the fit, with what a residual adds to it, and whether its gain is free.

    A strike of known place on a mesh is played by its modes; any other by the lines as they were struck on average.
    """
    typical = typical_strike(e.lines)
    modes, free = (typical.freq_hz, typical.decay_per_s, typical.amplitude), True
    if e.family is not None and recording.position_m is not None and np.isfinite(found.gain_sd):
        with suppress(SonicBulletError):
            modes, free = strike_modes(found, recording, sr), recording.impulse_n_s is None
    sound = damped_sum(*modes, n, sr)
    if residual is not None:
        sound = sound + residual_sound(residual, *modes, n, sr)
    return sound, free


def _distance(
    power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, gain: float, *, noisy: bool = True
) -> float:
    """D of a take's power spectra and those of a sound at a gain, with the noise's power added where it has none."""
    noise = noise_spectra(floor, power) if noisy else tuple(np.zeros(1) for _ in power)
    both = []
    for p, m, cell in zip(power, made, noise, strict=False):
        count = min(len(p), len(m))
        both.append((p[:count], gain**2 * m[:count] + cell))
    return spectra_distance_db(tuple(a for a, _ in both), tuple(b for _, b in both), floor)


def _distance_at_best_gain(
    power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, *, noisy: bool = True
) -> float:
    """The least D over the gain of a sound."""
    total = sum(float(m.sum()) for m in made)
    if not total > 0:
        return _distance(power, made, floor, 0.0)
    start = 10 * np.log10(sum(float(p.sum()) for p in power) / total)

    def cost(gain_db: float) -> float:
        return _distance(power, made, floor, 10 ** (gain_db / 20), noisy=noisy)

    steps = start + np.arange(-GAIN_REACH_DB, GAIN_REACH_DB + 1, 8.0)
    costs = np.array([cost(g) for g in steps])
    if not np.isfinite(costs).any():
        return float("nan")
    at = float(steps[int(np.nanargmin(costs))])
    best = minimize_scalar(cost, bounds=(at - 8, at + 8), method="bounded", options={"xatol": 0.1})
    return float(min(best.fun, np.nanmin(costs)))
