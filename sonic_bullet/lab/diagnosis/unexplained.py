"""Description of what no candidate effect explains: times, frequencies, dependence on strength and place.

e = |recorded − played|² in third octaves and thirds of the time, over the recording's own; slopes against ln J; lines
that are no mode, or none that a linear body has (coherent_residual.py)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from sonic_bullet.effects.protocol import ActsAtPlaces
from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, LeftOut, predict_takes
from sonic_bullet.lab.diagnosis.selection.band_levels import in_words
from sonic_bullet.lab.diagnosis.selection.coherent_residual import incoherent_fraction
from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared, SelectionEnd, WorseThanSilence
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.common.points import places_alike
from sonic_bullet.lab.effects.room.shifted_echo import find_copy_ratio
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.signal.log_spectral import ABOVE_NOISE, SPECTRAL_WINDOWS
from sonic_bullet.signal.short_time import power_spectrum, short_time_power, window_energy

SHOWN = 4
NOTHING = "nothing could be compared"


def describe_unexplained(end: SelectionEnd | NothingCompared, takes: Sequence[AudioObservation]) -> dict[str, Any]:
    """Describe what the last hypothesis leaves; empty where that is nothing, or there is no audio.

    Of `explained` it is what is left beside the names, where that is more than suffices_db.
    """
    if isinstance(end, WorseThanSilence):
        words = (
            f"what was fitted is {end.end_db:.1f} dB from the recordings, silence {end.silence_db:.1f} dB: "
            "no effect brings it nearer"
        )
        return {"left_db": None, "words": words}
    if isinstance(end, NothingCompared):
        return {"left_db": None, "words": f"{NOTHING}: {list_left_out(end.left_out) or 'nothing was measured'}"}
    judged = {(t.body.name, t.strike) for t in end.judged if isinstance(t, AudioObservation)}
    takes = [t for t in takes if (t.body.name, t.strike) in judged]
    left_db = end.after_db - end.floor_db
    if not takes or not (end.verdict == "unexplained" or (end.added and left_db > RULES.suffices_db)):
        return {}
    made = predict_takes(end.after, takes)
    share, band_hz, level, total = _shares(takes, made)
    whole = share.mean(axis=0)  # (t, f)
    order = np.argsort(-np.nan_to_num(whole.mean(axis=0)))[:SHOWN]
    bands = [
        {
            "from_hz": float(band_hz[i]),
            "to_hz": float(band_hz[i + 1]),
            "share_of_energy_left": float(np.nanmean(whole[:, i])),
        }
        for i in sorted(order)
    ]
    when = [float(np.nanmean(row)) for row in whole]
    struck = np.isfinite(level)  # of impulses that are not known nothing goes with strength
    slope, slope_sd = (
        _slope(np.log(level[struck]), np.log(np.maximum(total[struck], 1e-9)))
        if struck.sum() > 2 and np.ptp(np.log(level[struck])) > 0.3
        else (None, None)
    )
    scatter = float(np.std(np.log(np.maximum(total, 1e-9))))
    thirds = ["first", "second", "last"]
    words = in_words(end.bands) + "; " if end.bands else ""
    words += f"{left_db:.1f} dB beside what is named, which closes the rest; " if end.added else ""
    most = sorted(sorted(bands, key=lambda b: -b["share_of_energy_left"])[:2], key=lambda b: b["from_hz"])
    words += f"most of it in the {thirds[int(np.nanargmax(when))]} third of the recordings, around " + ", ".join(
        f"{b['from_hz']:.0f} to {b['to_hz']:.0f} Hz" for b in most
    )
    if slope is not None and slope_sd is not None:
        # by two standard errors: of few strikes a slope alone says nothing
        significant = abs(slope) > RULES.standard_errors * slope_sd
        goes = f"{'grows' if slope > 0 else 'falls'} with the strike" if significant else "hardly goes with the strike"
        words += f"; its share {goes} (as its impulse to the power {slope:.1f} ± {slope_sd:.1f})"
    if len(total) > 1:
        words += f"; {_places(takes, scatter)}"
    strange = incoherent_fraction(takes, made)
    if strange > RULES.most_share:
        words += (
            "; modes of one frequency, decay and phase each, whatever they are, do not play it: something goes "
            "with time or level, or is noise"
        )
    own = {id(t.body): t.body for t in takes}.values()
    hits = sum(g.later_hits for body in own if (g := body.recorded) is not None)
    if hits:
        words += f"; {format_count(hits, 'later hit is', 'later hits are')} in the recordings"
    pitch = pitch_of_strikes(takes)
    if pitch is not None:
        words += (
            f"; every strike has its own pitch, {100 * (pitch.min() - 1):+.2f} to {100 * (pitch.max() - 1):+.2f} % "
            "from the first's: the body was warmer, or under another tension"
        )
    again = _find_copy_ratio(takes)
    if again is not None:
        words += (
            f"; many lines are heard again at {again:.4f} times their frequency, as loud against the first in "
            "every strike: an echo of something that moves does that"
        )
    return {
        "left_db": left_db,
        "words": words,
        "bands": bands,
        "bands_off": [asdict(band) for band in end.bands],
        "when": dict(zip(thirds, when, strict=True)),
        "slope_against_impulse": slope,
        "slope_standard_error": slope_sd,
        "scatter_over_strikes": scatter,
        "share_of_no_modes": strange,
        "lines_again_at_ratio": again,
        "pitch_of_strikes": None if pitch is None else pitch.tolist(),
    }


def _places(takes: Sequence[AudioObservation], scatter: float) -> str:
    """Describe its dependence on the strike's place; scatter: standard deviation of its logarithm."""
    at = {t.body.recordings[t.strike].position_m for t in takes} - {None}
    if not at:
        return "no strike has a place: whether it differs from place to place is not known"
    if len(at) == 1:
        return "all strikes are at one place: whether it differs elsewhere is not known"
    return "it differs from place to place" if scatter > 0.5 else "it is alike wherever the body is struck"


def indistinct_places(end: SelectionEnd) -> list[str]:
    """List the images of effects' places that lines cannot separate from them, a sentence a place."""
    body, said = end.judged[0].body, []
    near = 0.1 * float(np.linalg.norm(np.ptp(body.model.vertex_m, axis=0)))
    for effect in (c.effect for c in end.added if isinstance(c.effect, ActsAtPlaces)):
        known = np.empty((0, 3))
        for place in effect.places() if body.family is not None else ():
            if (np.linalg.norm(known - np.array(place), axis=1) < near).any():
                continue  # with an earlier one
            known = np.concatenate([known, images := places_alike(body.model, place)])
            here, *there = (f"({', '.join(f'{x:.3g}' for x in p)}) m" for p in (place, *images))
            if there:
                more = f" or {len(there) - SHOWN} more" if len(there) > SHOWN else ""
                said.append(
                    f"{effect.id} at {here} may as well be at {' or '.join(there[:SHOWN])}{more}, or divided between "
                    "them: all move alike in every mode, so lines cannot tell; a finger laid on each in turn would"
                )
    return said


def list_left_out(left_out: Sequence[LeftOut]) -> str:
    """List the first SHOWN of what could not be compared, each with its reason."""
    said = "; ".join(map(str, left_out[:SHOWN]))
    return f"{said}; and {len(left_out) - SHOWN} more" if len(left_out) > SHOWN else said


def _find_copy_ratio(takes: Sequence[AudioObservation]) -> float | None:
    """Find the ratio of frequencies at which a body's lines recur, if they do."""
    recorded = [g for body in {id(t.body): t.body for t in takes}.values() if (g := body.recorded) is not None]
    return next(
        (
            r
            for g in recorded
            if (r := find_copy_ratio(g.lines.freq_hz, g.lines.decay_per_s, g.lines.amplitude)) is not None
        ),
        None,
    )


def pitch_of_strikes(takes: Sequence[AudioObservation]) -> Array | None:
    """Find each strike's pitch over the first's (s,), where strikes do not share one; None where they do.

    By the lag at which their spectra over ln f, in decades over the noise, are most alike [cf. the mellin transform].
    """
    reach, step = 0.03, 1e-4  # of ln f
    less_alike, alike = 0.8, 0.5  # at no lag, over the best one; at the best one, over a spectrum with itself
    window = max(SPECTRAL_WINDOWS)
    if len(takes) < 2 or min(len(t.sample) for t in takes) < window or len({t.sr for t in takes}) > 1:
        return None
    sr, high = takes[0].sr, min(takes[0].body.band_hz[1], 0.45 * takes[0].sr)
    n = min(len(t.sample) for t in takes)
    log_hz = np.arange(np.log(max(takes[0].body.band_hz[0], 20 * sr / n)), np.log(high), step)
    rows = []
    for t in takes:
        power = power_spectrum(t.sample[:n], np.hanning(n)) / window_energy(n)
        over = np.log10(1 + np.maximum(power / t.floor.at(len(power)) / ABOVE_NOISE - 1, 0))
        row = np.interp(np.exp(log_hz), np.fft.rfftfreq(n, 1 / sr), over)
        rows.append(row - row.mean())
    most = round(reach / step)
    lag = np.arange(-most, most + 1)
    found = [0]
    for row in rows[1:]:
        like = np.array([float(rows[0][most:-most] @ np.roll(row, -k)[most:-most]) for k in lag])
        best = int(like.argmax())
        apart = abs(lag[best]) > 1 and like[most] < less_alike * like[best]
        whole = float(np.linalg.norm(rows[0]) * np.linalg.norm(row))
        found.append(int(lag[best]) if apart and like[best] > alike * whole else 0)
    shift = np.array(found)
    return np.exp(shift * step) if (shift != 0).sum() > 0.5 * (len(takes) - 1) else None


def _shares(takes: Sequence[AudioObservation], made: Predictions) -> tuple[Array, Array, Array, Array]:
    """Compute energy left over the recording's (s, 3, f), band edges (f + 1,) in Hz, impulses (s,), NaN unknown.

    The last (s,) is that of a strike's cells above the noise together: a softer strike has fewer, not less left.
    """
    window = 1024
    sr = takes[0].sr
    edges = 1000 * 2.0 ** (np.arange(-17, 14) / 3)
    lowest = min((float(made[t.body].model.freq_hz.min(initial=np.inf)) for t in takes), default=np.inf)
    lowest = min([lowest, *(float(g.lines.freq_hz.min(initial=np.inf)) for t in takes if (g := t.body.recorded))])
    edges = edges[(edges < 0.5 * sr) & (edges * 2 ** (1 / 3) > min(lowest, 0.25 * sr))]  # below rings no mode, no line
    rows, level, total = [], [], []
    for take in takes:
        if take.sr != sr or len(take.sample) < 6 * window:
            continue
        bins = np.searchsorted(edges, np.fft.rfftfreq(window, 1 / sr)) - 1
        table = []
        for x in (take.sample - take.synthesize(made[take.body]), take.sample):
            power = short_time_power(x, window, window // 2)
            thirds = [part.sum(axis=0) for part in np.array_split(power, 3)]
            table.append([[row[bins == i].sum() for i in range(len(edges) - 1)] for row in thirds])
        left, own = np.array(table)
        noise = take.floor.at(window // 2 + 1) * window_energy(window) * (len(power) / 3)
        floor = np.array([noise[bins == i].sum() for i in range(len(edges) - 1)])
        clear = own > 4 * floor
        rows.append(np.where(clear, np.maximum(left - floor, 0) / np.maximum(own, 1e-300), 0.0))
        level.append(float(take.body.impulse_n_s[take.strike]))
        total.append(float(np.maximum(left - floor, 0)[clear].sum() / max(float(own[clear].sum()), 1e-300)))
    if not rows:
        return np.zeros((1, 3, len(edges) - 1)), edges, np.ones(1), np.zeros(1)
    return np.array(rows), edges, np.array(level), np.array(total)


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Compute the slope of y over x, three points or more, by least squares, and its standard error."""
    x, y = x - x.mean(), y - y.mean()
    size = max(float((x * x).sum()), 1e-300)
    slope = float((x * y).sum()) / size
    return slope, float(np.sqrt(((y - slope * x) ** 2).sum() / (len(x) - 2) / size))
