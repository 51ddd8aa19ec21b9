"""Several recordings of one object -> the damped sinusoids they share.

x_s(t) = Re Σ_k A_sk e^{(−d_k + iω_k) t} + noise
start:   shared_poles.py
refine:  maximum likelihood in white noise, A_sk linear and projected out (pole_refinement.py, projection.py)
spread:  inverse of the information matrix at the end, so the Cramér-Rao bound          [Kay 1993, ch. 3.9]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sonic_bullet.lab.lines.line_values import PINNED, Lines, lines_at, struck_lines, too_loud
from sonic_bullet.lab.lines.pole_refinement import bound_poles, refine_poles
from sonic_bullet.lab.lines.pole_selection import drop_near_doubles, select_poles
from sonic_bullet.lab.lines.projection import (
    ANGLE_AND_DECAY,
    amplitudes_at,
    basis_gram,
    normal_equations,
    products,
    spreads,
)
from sonic_bullet.lab.lines.shared_poles import FASTEST_PER_S, start_poles
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.exponential_law import mean_by_quartile
from sonic_bullet.signal.log_spectral import floor_between
from sonic_bullet.signal.short_time import power_spectrum, window_energy

__all__ = ["PINNED", "Lines", "joint_lines", "lines_of", "noise_rms"]

SIGNIFICANT_ENERGY = 60.0  # of a line over the noise's density, all recordings: a²·sr/(4dσ²) summed
MOST_JOINT_LINES = 160
HIGHEST_OF_RATE = 0.485
SILENT_RMS = 1e-9  # of full scale 1
RINGING_LINES = 3  # that say what rings
SLOWEST_PER_S = 0.02  # decay at which the search ends: T60 of 345 s
# times a recording's peak, where no line of a single hit begins; share of those after several that are echoes' and go
NO_SOUND_BEYOND = (10.0, 0.1)
CROWD_RATIO = 2.5  # starting lines over a body's modes: several hits, that is, of which only the last rings on
LATE_S = (0.03, 0.1)  # where lines are sought instead
LATE_LINES_SHARE = 0.3  # of the lines at the onset: fewer left then rang after several hits


@one_thread()
def joint_lines(
    signals: Array,
    sr: int,
    *,
    band_hz: tuple[float, float] = (20.0, 20_000.0),
    signed: bool = True,
    modes: int | None = None,
    bounds: bool = False,
) -> Lines:
    """Lines of signals (s, n), all starting at the onset of their strike.

    Raises AudioError where there is too little signal.

    modes: about how many the body has, where more than one hit may be in a signal: several in a row make a crowd of
    lines, none of them a mode, or lines that would have to begin far above all that was recorded. Where far fewer are
    left after `late_s`, or none such, lines are those, taken back to the onset: A e^{(d − iω)t}, what a single hit
    there would have had to leave.

    bounds: return lines at the bounds of the search, too.
    """
    seconds_max = 8.0
    signals = np.asarray(signals, float)[:, : int(seconds_max * sr)]
    if signals.shape[1] < 256 or not np.isfinite(signals).all():
        raise AudioError(
            f"recordings of {signals.shape[1]} samples after the onset", "a fit needs at least 256 finite samples"
        )
    if not (np.sqrt((signals**2).mean(axis=1)) > SILENT_RMS).all():
        raise AudioError("a recording is silent", "leave it out of the case")
    low, high = max(band_hz[0], 5.0), min(band_hz[1], HIGHEST_OF_RATE * sr)
    noise = noise_rms(signals, sr)
    try:
        found = _identify_lines(signals, noise, sr, (low, high), signed, modes, crowd=True)
    except np.linalg.LinAlgError as error:
        raise AudioError(
            "lines of the recording cannot be told apart: no decaying sound", "give a recording of one impact"
        ) from error
    return found if bounds else _drop_bounded(found, low, high)


def _identify_lines(
    signals: Array, noise: Array, sr: int, band_hz: tuple[float, float], signed: bool, modes: int | None, *, crowd: bool
) -> Lines:
    """Find lines of one hit, or what is left after several.

    crowd: of more poles than lines those, too, that take most one after another, where these say plainly more.
    """
    plainly = 0.75  # of what other lines leave, in squares
    start = start_poles(signals / noise[:, None], sr, *band_hz)
    few: Lines | None = None
    for late in (round(t * sr) for t in LATE_S) if modes is not None and len(start) >= CROWD_RATIO * modes else ():
        if signals.shape[1] >= 8 * late and RINGING_LINES <= len(
            start_poles(signals[:, late:] / noise[:, None], sr, *band_hz)
        ) < LATE_LINES_SHARE * len(start):
            after = _from(late, signals, sr, band_hz, signed)
            few = few or after
            if after is not None and _fraction_beyond_peak(after, signals) < NO_SOUND_BEYOND[1]:  # else it still hits
                return struck_lines(after, signals, NO_SOUND_BEYOND[0])
    if few is not None:
        return struck_lines(few, signals, NO_SOUND_BEYOND[0])
    start = drop_near_doubles(start)
    many = len(start) > MOST_JOINT_LINES
    loudest = (
        np.argsort(-amplitudes_at(signals, noise, start, sr)[2])[:MOST_JOINT_LINES] if many else np.arange(len(start))
    )
    found = lines_of(signals, noise, _significant(signals, noise, start[loudest], sr, *band_hz), sr, signed)
    if many and crowd:
        other = lines_of(
            signals,
            noise,
            _significant(
                signals, noise, start[select_poles(signals, noise, start, sr, MOST_JOINT_LINES)], sr, *band_hz
            ),
            sr,
            signed,
        )
        if ((other.noise / noise) ** 2).sum() < plainly * ((found.noise / noise) ** 2).sum():
            return other  # a room's: of hits one after another the loudest poles leave least
    for late in (round(t * sr) for t in LATE_S) if modes is not None and _fraction_beyond_peak(found, signals) else ():
        if signals.shape[1] < 8 * late:
            break
        after = _from(late, signals, sr, band_hz, signed)
        if after is None or _fraction_beyond_peak(after, signals) >= NO_SOUND_BEYOND[1]:
            continue
        if RINGING_LINES <= len(after.freq_hz) < LATE_LINES_SHARE * _standing(found, noise, late / sr, sr):
            return struck_lines(after, signals, NO_SOUND_BEYOND[0])
    return found


def _drop_bounded(lines: Lines, low: float, high: float) -> Lines:
    """Drop what stands at a bound of the search, or is over before its first period: no mode.

    They take from the others what an attack, hum or noise leaves, so they are fitted with them. The fastest stay: they
    say themselves that their decay is a bound.
    """
    inside = (lines.freq_hz > low * (1 + 1e-9)) & (lines.freq_hz < high * (1 - 1e-9))
    whole = (lines.decay_per_s > SLOWEST_PER_S * (1 + 1e-9)) & (lines.freq_hz > lines.decay_per_s)
    return lines_at(lines, np.flatnonzero(inside & whole))


def _significant(signals: Array, noise: Array, pole: Array, sr: int, low: float, high: float) -> Array:
    """Poles polished, a full crowd twice, without those that stand out of the noise too little to be a line.

    Recordings without a noise of their own are held against what their lines leave.
    """
    if (noise <= SILENT_RMS).all():
        return _over_what_is_left(signals, noise, pole, sr, low, high)
    colour = _colour(signals, noise, sr)
    for turn in range(3):
        before = len(pole)
        pole = _polish_poles(signals, noise, drop_near_doubles(pole) if turn else pole, sr, low, high)
        _, _, energy, _ = amplitudes_at(signals, noise, pole, sr)
        pole = pole[energy / colour(pole.imag / (2 * np.pi)) > SIGNIFICANT_ENERGY]
        if (len(pole) == before and (turn or before < MOST_JOINT_LINES)) or not len(pole):
            break
    return pole


def _over_what_is_left(signals: Array, noise: Array, pole: Array, sr: int, low: float, high: float) -> Array:
    """Poles polished, the least significant half of those too weak left out each time, until none is.

    A line's weight is what the likelihood loses without it, |A|²/var A [Wald 1943], in the noise that all lines leave.
    """
    while len(pole):
        pole = _polish_poles(signals, noise, drop_near_doubles(pole), sr, low, high)
        lines = lines_of(signals, noise, pole, sr, True)
        weight = (np.abs(lines.amplitude / lines.amplitude_sd) ** 2).sum(axis=0)
        weak = int((weight < SIGNIFICANT_ENERGY).sum())
        if not weak:
            break
        pole = pole[np.sort(np.argsort(weight)[(weak + 1) // 2 :])]
    return pole


def _from(late: int, signals: Array, sr: int, band_hz: tuple[float, float], signed: bool) -> Lines | None:
    """Find lines from a sample on, as they would have begun at the onset; None where nothing can be identified."""
    dead = 9.0  # of ln amplitude: 78 dB
    rest = signals[:, late:]
    if not (np.sqrt((rest**2).mean(axis=1)) > SILENT_RMS).all():
        return None  # by a recording that a gate has shut nothing rang at the onset
    try:
        lines = _identify_lines(rest, noise_rms(rest, sr), sr, band_hz, signed, None, crowd=False)
    except np.linalg.LinAlgError:
        return None
    alive = lines.decay_per_s * late / sr < dead  # what would have been over by then began later
    if not alive.all():
        lines = lines_of(rest, lines.noise, lines.pole[alive], sr, signed)
    if not len(lines.freq_hz):
        return None
    back = np.exp(-lines.pole * late / sr)
    return replace(lines, amplitude=lines.amplitude * back, amplitude_sd=lines.amplitude_sd * np.abs(back))


def _fraction_beyond_peak(lines: Lines, signals: Array) -> float:
    """Share of the lines that begin far above a recording's peak, in one of them."""
    return float(too_loud(lines, signals, NO_SOUND_BEYOND[0]).mean()) if len(lines.freq_hz) else 0.0


def _standing(lines: Lines, noise: Array, late_s: float, sr: int) -> int:
    """Count the lines that still stand out of the noise (s,) a while after the onset.

    Of a single hit as many are found from there on; of several the others only cancel each other between them.
    """
    late = np.abs(lines.amplitude) * np.exp(-lines.decay_per_s * late_s)
    density = 4 * np.maximum(lines.decay_per_s, SLOWEST_PER_S) * noise[:, None] ** 2 / sr
    return int(((late**2 / density).sum(axis=0) > SIGNIFICANT_ENERGY).sum())


def noise_rms(signals: Array, sr: int) -> Array:
    """Return the rms (s,) of the stationary floor, white, from the lower quarter of each last third's spectrum."""
    tail = signals[:, -signals.shape[1] // 3 :]
    power = power_spectrum(tail, np.hanning(tail.shape[1]))
    density = mean_by_quartile(power, 1)
    return np.asarray(np.maximum(np.sqrt(density / window_energy(tail.shape[1])), SILENT_RMS))


def _colour(signals: Array, noise: Array, sr: int) -> Callable[[Array], Array]:
    """Power of the floor at a frequency over the white noise's, which it is at least."""
    level = np.maximum(floor_between(list(signals / noise[:, None])).variance, 1.0)
    return lambda freq: np.asarray(np.interp(freq, np.linspace(0, sr / 2, len(level)), level))


def _polish_poles(signals: Array, noise: Array, pole: Array, sr: int, low: float, high: float) -> Array:
    """Poles at the maximum of the likelihood, from the k nearest start."""
    if not len(pole):
        return pole
    bound = bound_poles((low, high), SLOWEST_PER_S, FASTEST_PER_S)
    return refine_poles(lambda p: normal_equations(signals, noise, p, sr), pole, ANGLE_AND_DECAY, bound=bound)[0]


@one_thread()
def lines_of(signals: Array, noise: Array, pole: Array, sr: int, signed: bool) -> Lines:
    """Lines of signals (s, n) over white noise (s,) at poles (k,) in 1/s that are known already."""
    k, none = len(pole), np.zeros(0)
    if k == 0:
        left = np.sqrt((signals**2).mean(axis=1))
        return Lines(
            none,
            none,
            np.zeros((len(signals), 0), complex),
            none,
            none,
            np.zeros((len(signals), 0)),
            left,
            none,
            signed,
        )
    amplitude, _, energy, residual = amplitudes_at(signals, noise, pole, sr)
    level = np.maximum(noise, residual)  # what the lines leave is noise too, to whoever asks how sure they are
    matrix = normal_equations(signals, level, pole, sr).matrix
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    spread = spreads(matrix * scale[:, None] * scale) * scale
    even, odd = products(pole / sr, signals.shape[1])
    gram = basis_gram(even[0], odd[0])
    width = 1 / np.sqrt(np.diag(gram))
    root = spreads(gram * width[:, None] * width) * width
    return Lines(
        pole.imag / (2 * np.pi),
        -pole.real,
        amplitude,
        spread[:k] / (2 * np.pi),
        spread[k:],
        level[:, None] * np.maximum(root[:k], root[k:]),
        residual,
        energy,
        signed,
    )
