"""Takes held against the fit: how far its prediction of each is, beside silence and beside another take.

    take r, from its onset            ──┐
    placed modes, or typical lines p  ──┴─► D(r, g·p)     g: of least D, where the impulse is not known;
                                                          p with what a residual adds to it, where one is given
    nothing                           ────► D(r, 0)
    the guessed material on the mesh  ────► min over g of D(r, g·m)
    the fit's own takes t             ────► min over t and g of D(r, g·t)

    lines of p, and the noise that t share beside them ──► levels by band and time, beside those of t (noise_part.py)

D: log_spectral.py, over what stands above the recording's noise, in the case's band. A prediction enters with the
noise's power added, silence with that alone. A prediction farther than silence is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.engine.residual.offline import residual_sound
from sonic_bullet.files.cases import CaseRecording
from sonic_bullet.lab.fit.case_fit import NO_GAIN, TakeDistance
from sonic_bullet.lab.fit.prediction_of_lines import risen_sum, strike_modes
from sonic_bullet.lab.fit.recorded import RecordedObject, recorded_signals
from sonic_bullet.lab.fit.takes.best_gain import BestGain, distance_at, find_best_gain, find_nearest_take
from sonic_bullet.lab.fit.takes.plausible_preset import plausible_sound
from sonic_bullet.lab.fit.typical_strike import strike_lines
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records import Array, Residual
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.signal.band_time import BandTime, band_time, level_distance_db
from sonic_bullet.signal.log_spectral import Floor, floor_between, power_spectra
from sonic_bullet.signal.noise_part import noise_beside_lines, with_noise_part

if TYPE_CHECKING:
    from sonic_bullet.lab.fit.case_fit import CaseFit


def judged_by_takes(found: CaseFit) -> CaseFit:
    """Return the fit with its distances from the takes held out, and with the verdict of one worse than silence.

    Where none is held out they are those of its own takes. Raises SonicBulletError.
    """
    worse_than_silence = "worse-than-silence"
    takes = predicted_takes(found)
    judged = replace(found, takes=takes)
    if not judged.worse_than_silence:
        return judged
    predicted = float(np.nanmean([t.predicted_db for t in takes]))
    silent = float(np.nanmean([t.silence_db for t in takes]))
    lost = all(t.gain == 0 for t in takes)
    why = f"what is fitted is {predicted:.1f} dB from the takes, silence {silent:.1f} dB"
    verdict = f"{worse_than_silence}: {NO_GAIN if lost else why}; {found.fit.verdict}"
    return replace(judged, fit=replace(found.fit, verdict=verdict))


@one_thread()
def predicted_takes(found: CaseFit, *, residual: Residual | None = None) -> tuple[TakeDistance, ...]:
    """Distances of the takes held out, or of the fit's own where none is; with a residual, where given.

    Raises SonicBulletError where a file cannot be read.
    """
    return next((rows for split in ("holdout", "fit") if (rows := _of_split(found, split, residual))), ())


def _of_split(found: CaseFit, split: str, residual: Residual | None) -> tuple[TakeDistance, ...]:
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
        report_progress(f"predicting takes of {e.thing.name}")
        signals, sr = recorded_signals(found.case, e.thing, mine, e.hum_hz)
        takes = [power_spectra(take) for take in e.signals] if sr == e.sr else []
        shared = _shared_noise(found, e) if residual is not None and sr == e.sr else None
        for recording, signal in zip(mine, signals, strict=True):
            others = [t for t, r in zip(takes, e.recordings, strict=False) if r != recording]
            row = _distances(found, e, recording, signal, sr, others, residual)
            if shared is not None:
                levels, other = _level_distances(found, e, recording, signal, shared)
                row = replace(row, levels_db=levels, other_take_levels_db=other)
            rows.append(row)
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
    silence = distance_at(power, modelled, floor, 0.0)
    best = find_best_gain(power, modelled, floor) if free else BestGain(1.0, distance_at(power, modelled, floor, 1.0))
    return TakeDistance(
        recording.file.name if recording.file is not None else "",
        recording.split,
        best.distance_db,
        silence,
        find_nearest_take(power, others, floor),
        free,
        best.gain,
        _plausible_db(found, e, recording, power, floor, (len(signal), sr)),
    )


def _shared_noise(found: CaseFit, e: RecordedObject) -> BandTime | None:
    """Noise that an object's takes share beside what the fit plays of them; None of takes too short for it."""
    shortest_s = 0.2  # tenths of which are two blocks
    if e.signals is None or e.signals.shape[1] < shortest_s * e.sr:
        return None
    takes = [band_time(signal, e.sr) for signal in e.signals]
    played = [band_time(predicted_take(found, e, r, e.signals.shape[1], e.sr)[0], e.sr) for r in e.recordings]
    return noise_beside_lines(takes, played, _impulses(e.recordings))


def _impulses(recordings: Sequence[CaseRecording]) -> Array | None:
    """Impulses (t,) in N s of strikes; None where one is not known."""
    impulse = [r.impulse_n_s for r in recordings]
    return np.array(impulse) if all(impulse) else None


def _level_distances(
    found: CaseFit, e: RecordedObject, recording: CaseRecording, signal: Array, noise: BandTime
) -> tuple[float, float]:
    """Distances of a take's levels by band and time from those predicted, and from the nearest other take's."""
    assert e.signals is not None
    count = min(len(signal), e.signals.shape[1])
    recorded = band_time(signal[:count], e.sr)
    played = band_time(predicted_take(found, e, recording, count, e.sr)[0], e.sr)
    known = _impulses((*e.recordings, recording))
    made = with_noise_part(played, noise, 1.0 if known is None else float(known[-1]))
    others = [
        level_distance_db(band_time(take[:count], e.sr), recorded)
        for take, r in zip(e.signals, e.recordings, strict=False)
        if r != recording
    ]
    return level_distance_db(made, recorded), min(others, default=float("nan"))


def _plausible_db(
    found: CaseFit,
    e: RecordedObject,
    recording: CaseRecording,
    power: tuple[Array, ...],
    floor: Floor,
    size: tuple[int, int],
) -> float:
    """Distance of the guessed material's take at its best gain, of (n, sr); NaN where there is none."""
    with suppress(SonicBulletError):
        made = plausible_sound(found, e, recording, *size)
        if made is not None:
            return find_best_gain(power, power_spectra(made), floor).distance_db
    return float("nan")


def predicted_take(
    found: CaseFit, e: RecordedObject, recording: CaseRecording, n: int, sr: int, residual: Residual | None = None
) -> tuple[Array, bool]:
    """Sound (n,) of a take by the fit, with what a residual adds to it, and whether its gain is free.

    A strike of known place on a mesh is played by its modes; any other by the lines as they were struck on average.
    """
    typical, known = strike_lines(e, recording)
    impulse = recording.impulse_n_s if known and recording.impulse_n_s is not None else 1.0
    modes, free = (typical.freq_hz, typical.decay_per_s, impulse * typical.at_peak), not known
    if recording.position_m is not None and found.plays_modes(e):
        with suppress(SonicBulletError):
            freq, decay, amplitude = strike_modes(found, recording, sr)
            modes, free = (freq, decay, amplitude * np.exp(-decay * typical.rise_s)), recording.impulse_n_s is None
    sound = risen_sum(*modes, n, sr, round(typical.rise_s * sr))
    if residual is not None:
        sound = sound + residual_sound(residual, *modes, n, sr)
    return sound, free
