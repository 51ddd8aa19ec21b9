"""Residual of a recording: its power minus that of the modes [Ren, Yeh, Lin 2013, sec. 6.1].

    represented(t) = Σ_i R_i φ_i(t)
        features φ_i, each with the fraction R_i that the modes have of it (its match ratio)
    P_residual = max(P_recorded - P_represented, 0)                                             pixel by pixel

A preset describes it in two parts. The rest of the features, √(1 - R_i²) of each, is lines: their frequencies are known
far better than from a spectrogram. No band keeps more than recordings have beyond what is played: modes too close to be
resolved make one feature that matches none of them. The rest beside all features is noise, stored as means over bands
and times. From it are subtracted the recording's own floor, what most strikes do not have, and what is not noise: the
foot of lines that are no pure damped sinusoids would else be spread over whole bands.
"""

from __future__ import annotations

import itertools

import numpy as np

from sonic_bullet.engine.residual.transfer import StruckModes
from sonic_bullet.records import Array, Residual
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.exponential_law import mean_by_median
from sonic_bullet.signal.spectrogram import Power, power


def noise_floor_per_hz(left: Power) -> Array:
    """Estimate the floor (b,): the median over the last third of the frames, over ln 2, as of an exponential law."""
    tail = left.per_hz[:, -max(len(left.time_s) // 3, 1) :]
    return mean_by_median(tail, 1)


def cells(left: Power, floor_per_hz: Array) -> tuple[Array, Array, Array]:
    """Average the power less the floor over bands and times: bands (b,) in Hz, times (n,) in s, power per Hz (b, n).

    Bands of a sixth of an octave or a bin, frames of 1, 1, … then ever more.
    """
    growth = 1.12
    longest_s = 1.0
    width = left.freq_hz[1]
    edge = [0.0]
    band_octaves = 1 / 6
    while edge[-1] < left.freq_hz[-1]:
        edge.append(max(edge[-1] + width, edge[-1] * 2**band_octaves))
    band = np.searchsorted(edge[1:-1], left.freq_hz, "right")
    last = int(np.searchsorted(left.time_s, min(longest_s, left.time_s[-1]), "right"))
    ends: list[int] = []
    step = 1.0
    while sum(ends) < last:
        ends.append(int(step))
        step = step * growth if len(ends) > 8 else 1.0
    frame = np.minimum(np.repeat(np.arange(len(ends)), ends), len(ends) - 1)[:last]
    count = np.bincount(band)[:, None] * np.bincount(frame)[None]
    kept = count[:, 0] > 0
    total, quiet = np.zeros(count.shape), np.zeros(len(count))
    np.add.at(total, (band[:, None], frame[None]), left.per_hz[:, :last])
    np.add.at(quiet, band, floor_per_hz)
    mean, quiet = total / np.maximum(count, 1), quiet / np.maximum(np.bincount(band), 1)
    above_floor = 2.0  # cells whose mean is less than this times the floor are the floor
    observed = mean > quiet[:, None] * (above_floor + 3 / np.sqrt(count + 1e-9))
    centre_hz = np.bincount(band, left.freq_hz) / np.maximum(np.bincount(band), 1)
    centre_s = np.bincount(frame, left.time_s[:last]) / np.bincount(frame)
    return centre_hz[kept], centre_s, np.where(observed, mean - quiet[:, None], 0.0)[kept]


def shared_cells(left: list[Power]) -> tuple[Array, Array, Array]:
    """Compute `cells` of the mean over strikes, where most strikes have some themselves. Nothing below `lowest_bins`.

    What one of two strikes has and the other has not is no property of the body.
    """
    lowest_bins = 1.5  # An offset or a drift fills the first two bins of a Hann window
    mean = Power(left[0].freq_hz, left[0].time_s, np.mean([p.per_hz for p in left], axis=0))
    freq, time, per_hz = cells(mean, noise_floor_per_hz(mean))
    most = np.mean([cells(p, noise_floor_per_hz(p))[2] > 0 for p in left], axis=0) > 0.5
    return freq, time, np.where(most & (freq > lowest_bins * mean.freq_hz[1])[:, None], per_hz, 0.0)


def noisiness(fine: Power, freq_hz: Array, time_s: Array) -> Array:
    """Estimate the fraction (b, n) of the power in bands about freq_hz (b,) that is noise.

    Median over mean across a band's fine bins, ln 2 for noise, little where lines remain.
    """
    edge = np.concatenate([[0.0], (freq_hz[1:] + freq_hz[:-1]) / 2, [np.inf]])
    bounds = np.searchsorted(fine.freq_hz, edge)
    frame = np.clip(np.searchsorted(fine.time_s, time_s), 0, len(fine.time_s) - 1)
    share = np.ones((len(freq_hz), len(time_s)))
    for b, (low, high) in enumerate(itertools.pairwise(bounds)):
        if high - low > 3:
            band = fine.per_hz[low:high][:, frame]
            share[b] = mean_by_median(band, 0) / np.maximum(band.mean(axis=0), 1e-300)
    return np.minimum(share, 1.0)


def line_room(
    recorded: list[Power], rest: list[Power], played: list[Power], lines: tuple[Array, Array, Array], seconds: float
) -> Array:
    """Compute the fraction (l,) of lines' energies that the recordings allow.

    All lines in a band together have no more than the recordings have there beyond what is played, or than recorded -
    played has, if that is more (a line missing beside a mode that is played too loud). Energies are means over strikes.
    A line's band: `line_widths` of its half width either way, and three bins at least.
    """
    freq_hz, decay_per_s, amplitude = lines
    step = float(rest[0].freq_hz[1])
    line_widths = 6.0
    half = np.maximum(3 * step, line_widths * decay_per_s / (2 * np.pi))
    edge = np.append(rest[0].freq_hz - step / 2, rest[0].freq_hz[-1] + step / 2)

    def within(sounds: list[Power]) -> Array:
        energy_per_hz = 2 * sounds[0].time_s[1] * np.mean([p.per_hz.sum(axis=1) for p in sounds], axis=0)
        below = np.append(0.0, np.cumsum(energy_per_hz) * step)
        return np.asarray(
            np.maximum(np.interp(freq_hz + half, edge, below) - np.interp(freq_hz - half, edge, below), 0.0)
        )

    room = np.maximum(within(recorded) - within(played), within(rest))
    decay = np.maximum(decay_per_s, 1e-3)
    energy = amplitude**2 / (4 * decay) * -np.expm1(-2 * decay * seconds)
    wanted = (np.abs(freq_hz[:, None] - freq_hz[None]) <= half[:, None]) @ energy
    width_room = 1.25  # six half widths hold nine tenths of a damped sinusoid's energy
    return np.asarray(np.minimum(1.0, width_room * room / np.maximum(wanted, 1e-300)))


def residual_record(
    recorded: Array,
    left: Array,
    rest: Array,
    sr: int,
    modes: StruckModes,
    lines: tuple[Array, Array, Array],
    source: str,
) -> Residual:
    """Make the residual of strikes (s, n) from the onset on.

    Levels are relative to the strongest mode. Neither lines nor noise exceed ``rest``. Raises AudioError on empty clips
    and NaN, RecordError where nothing can follow.

    Parameters
    ----------
    left : (s, n) recording without all features
    rest : (s, n) recording without the modes as the model plays them
    lines : frequency, decay, amplitude (l,), mean square over the strikes, of the rest of the features
    """
    lines_most = 128
    if not len(recorded) or recorded.shape != left.shape or recorded.shape != rest.shape:
        raise AudioError(
            f"recordings of shape {recorded.shape}, of which {left.shape} is left", "give strikes of one length"
        )
    freq, time, per_hz = shared_cells([power(x, sr) for x in left])
    per_hz = np.minimum(per_hz, shared_cells([power(x, sr) for x in rest])[2])
    fine_window = 4096
    per_hz = per_hz * np.mean([noisiness(power(x, sr, fine_window), freq, time) for x in left], axis=0)
    unit = float(modes.amplitude.max())
    if not unit > 0:
        raise AudioError("modes that the strikes do not excite", "strike where the body moves")
    clip = float((recorded**2).sum(axis=1).mean() / sr)
    line_hz, line_decay, line_amplitude = lines
    if len(line_hz):
        fine = [[power(x, sr, fine_window) for x in sounds] for sounds in (recorded, rest, recorded - rest)]
        line_amplitude = line_amplitude * np.sqrt(line_room(fine[0], fine[1], fine[2], lines, recorded.shape[1] / sr))
    energy = line_amplitude**2 / (4 * np.maximum(line_decay, 0.1))
    order = np.argsort(-energy, kind="stable")[:lines_most]
    # lines with less than this fraction of the loudest line's energy (40 dB) and of the clip's are left out
    line_floor = 1e-4
    order = np.sort(order[energy[order] > line_floor * min(float(energy.max(initial=0.0)), clip)])
    whole = float(energy[order].sum()) + 2 * float(np.trapezoid(np.trapezoid(per_hz, time, axis=1), freq))
    if whole < 1e-8 * clip:
        order, per_hz = order[:0], np.zeros_like(per_hz)  # 80 dB below the clip: rounding, no residual
    clip = max(clip, whole)  # lines that outlast the clip
    return Residual(
        modes.freq_hz, modes.decay_per_s, modes.amplitude / unit,
        line_hz[order], line_decay[order], line_amplitude[order] / unit,
        freq, time, per_hz / unit**2, clip / unit**2, source,
    )  # fmt: skip
