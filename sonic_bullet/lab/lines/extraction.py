"""One recorded impact -> its damped sinusoids, each with its spread [Ren, Yeh, Lin 2013, section 4, and later work].

    recording -> onset.py (which part is one impact)
    -> exact_modes.py     where there is no noise: the rank of the Hankel matrix tells all modes at once
    -> noise_density.py   density over frequency, course over time
    -> subspace.py (poles, band by band)
        every frequency resolution at once, where the paper goes from level to level
    -> after_attack.py    where what those leave is far louder than the noise: of what rings after the attack
    -> pole_refinement.py (all modes jointly)  the paper's "everything found so far subtracted", to the optimum
    -> the residual's matched filter adds poles while they are significant; what is not, goes
    -> onset.py   the modes, run backwards, tell the sample of the onset
    -> Features

A mode is significant where its energy over the noise density exceeds what the strongest of as many noise cells as the
recording holds reaches once in twenty recordings: T > 2 ln(1.5 n / 0.05) [Kay 1998, Detection Theory, ch. 7.6]. No
number is tuned to a recording.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet.lab.lines import exact_modes, onset, sinusoids, subspace
from sonic_bullet.lab.lines.after_attack import ringing_lines
from sonic_bullet.lab.lines.band_limit import limit_band, without_drift
from sonic_bullet.lab.lines.joint_lines import noise_rms
from sonic_bullet.lab.lines.line_values import (
    ATTACK_S,
    DECAY_IDENTIFIED,
    EXPLAINED_SHARE,
    EXTRACTED_FASTEST_PER_S,
    EXTRACTION_BAND_HZ,
    FALSE_ALARMS,
    FEW_MODES,
    FRONT_ENERGY_SHARE,
    FRONT_OF_RECORDING,
    LEAST_SAMPLES_A_MODE,
    MANY_MODES,
    MOST_BAND_MODES,
    NEAR_DECAYS,
    NO_LINES_OVER_NOISE,
    PINNED_DECAY,
    QUICK_FIT,
    QUIETEST_NOISE,
    ROUGH_FIT,
    ROUNDING_FLOOR,
    THOROUGH_FIT,
    TRUSTED_SHARE,
    Features,
    Lines,
)
from sonic_bullet.lab.lines.noise_density import Noise, matched, measured, noise_density, white
from sonic_bullet.lab.lines.pole_refinement import refine_poles, within
from sonic_bullet.lab.lines.projection import ANGLE_AND_DECAY, normal_equations
from sonic_bullet.lab.lines.sinusoids import Sinusoids
from sonic_bullet.lab.lines.standing_hum import describe_hum, find_standing_hum
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError


@one_thread()
def extract(
    signal: Array, sr: int, *, onset_s: float | None = None, band_hz: tuple[float, float] | None = None
) -> Features:
    """Features of a recording (n,), full scale 1, at sr Hz. onset_s: where it is known; else it is found.

    What makes the numbers doubtful stands in the note. Raises AudioError: silence, NaN, fewer than 512 samples.
    """
    restored = 3  # times that modes get back what a limit above took of them
    seconds_max = 8.0
    least_samples = 512
    signal = np.ascontiguousarray(signal, np.float64)
    if signal.ndim != 1:
        raise AudioError(f"recording has shape {signal.shape}", "pass one channel")
    if not np.isfinite(signal).all():
        raise AudioError("recording holds NaN or infinite samples", "repair the file")
    if len(signal) == 0 or np.abs(signal).max() < 1e-7:
        raise AudioError("recording is silent", "record an impact")
    low, high = band_hz or (20.0, 22_000.0)
    high = min(high, 0.49 * sr)
    if not 0 < low < high:
        raise AudioError(f"band is {low:g} to {high:g} Hz", f"give a band inside 0 to {sr / 2:g} Hz")
    clipped = onset.clipped_samples(signal)
    signal, drift = without_drift(signal, sr) if band_hz is None else (signal, "")
    limited = signal
    if band_hz is not None:
        signal, limited = limit_band(signal, sr, (low, np.inf)), limit_band(signal, sr, (low, high))
    part = (
        onset.span(limited, sr) if onset_s is None else onset.until_next_hit(limited, sr, max(0, round(onset_s * sr)))
    )
    hum, hum_hz = find_standing_hum(limited, sr, part.start)
    signal, limited = signal - hum, limited - hum
    quiet = limited[: part.start]
    steady_above = len(quiet) > 0 and _rms(signal[: part.start] - quiet) > _rms(quiet)
    if steady_above:
        signal = limited  # what is above was there before; else it belongs to the impact, which a limit would smear
    x = signal[part.start : min(part.stop, part.start + int(seconds_max * sr))]
    if len(x) < least_samples:
        raise AudioError(f"{len(x)} samples follow the onset", f"an impact needs {least_samples} at least")
    doubts, hopeless = onset.describe_doubts(x, sr)
    if hits := part.describe_hits(sr):
        hits += f": only what comes before the second, {len(x) / sr:.3g} s, is used"
    notes = [*filter(None, [hits, onset.describe_clipping(clipped), drift, describe_hum(hum_hz)]), *doubts]
    found = (
        (Sinusoids(np.zeros(0, complex), np.zeros(0, complex)), white(_rms(x), sr))
        if hopeless
        else _modes(x, sr, (low, high))
    )
    if isinstance(found, Lines):
        return _ringing(x, limited[part.start : part.start + len(x)], found, sr, part.start, notes)
    (modes, noise), start = found, part.start
    for _ in range(restored if steady_above and len(modes.pole) else 0):
        # what the limit took of the modes' beginning is theirs again: cut off at the onset it would be in every band
        model = np.zeros(len(limited))
        model[start : start + len(x)] = -sinusoids.residual(np.zeros(len(x)), modes, sr)
        signal = limited + limit_band(model, sr, (low, np.inf)) - limit_band(model, sr, (low, high))
        x = signal[start : start + len(x)]
        modes = _pruned(x, (low, high), _fit(x, modes, sr, (low, high), THOROUGH_FIT), noise, _least(x))
        noise = measured(sinusoids.residual(x, modes, sr), sr, ROUNDING_FLOOR * _rms(x), len(modes.pole), (low, high))
    if onset_s is None and len(modes.pole):
        start = onset.by_modes(signal, part.start, modes, sr, _rms(sinusoids.residual(x, modes, sr)))
        x = signal[start : start + len(x)]
        modes = _moved(x, modes, noise, (low, high), start - part.start)
    banded = limited[start : start + len(x)]
    return _features(x, banded, modes, noise, (low, high), start, notes, whole=band_hz is None)


def _rms(signal: Array) -> float:
    return float(np.sqrt((signal**2).mean()))


def _fit(
    signal: Array, start: Sinusoids, sr: int, band_hz: tuple[float, float], effort: tuple[int, float] = QUICK_FIT
) -> Sinusoids:
    """Refine modes; effort: steps, and the fall of the sum of squares, relative, that ends it."""
    if not len(start.pole):
        return start
    bound = within((0.5 * band_hz[0], min(1.02 * band_hz[1], 0.4999 * sr)), 1e-3, EXTRACTED_FASTEST_PER_S)
    pole, _ = refine_poles(
        lambda p: normal_equations(signal[None], np.ones(1), p, sr),
        start.pole,
        ANGLE_AND_DECAY,
        bound=bound,
        steps=effort[0],
        settled=0.0,
        relative=effort[1],
        slack=2.0,
    )
    return sinusoids.amplitudes(signal, pole, sr)


def _modes(x: Array, sr: int, band_hz: tuple[float, float]) -> tuple[Sinusoids, Noise] | Lines:
    """Find the significant modes of a signal and the noise they leave; of a real take what rings after its attack."""
    rounds = 6
    floor = ROUNDING_FLOOR * _rms(x)
    without_noise = exact_modes.modes(x, sr)
    if without_noise is not None:
        return without_noise, white(max(_rms(sinusoids.residual(x, without_noise, sr)), floor), sr)
    least = _least(x)
    start = _start(x, sr, band_hz, floor)
    left = sinusoids.residual(x, start, sr)
    late = min(round(ATTACK_S * sr), len(x) // 4)
    if _rms(left[late:]) > NO_LINES_OVER_NOISE * max(noise_rms(x[None], sr)[0], QUIETEST_NOISE * _rms(x[late:])):
        return ringing_lines(x[None], sr, band_hz, signed=True)
    modes, noise = _first(x, sr, start, band_hz, least, floor)
    most = min(MOST_BAND_MODES, len(x) // LEAST_SAMPLES_A_MODE)
    for _ in range(rounds):
        more = matched(
            sinusoids.residual(x, modes, sr), noise, band_hz, _needed(modes.pole, least), EXTRACTED_FASTEST_PER_S
        )
        more = more[: max(0, min(MANY_MODES, most - len(modes.pole)))]
        if not len(more):
            break
        trial = _pruned(
            x,
            band_hz,
            _fit(x, sinusoids.amplitudes(x, np.concatenate([modes.pole, more]), sr), sr, band_hz),
            noise,
            least,
        )
        if len(trial.pole) <= len(modes.pole):
            break
        modes, noise = trial, measured(sinusoids.residual(x, trial, sr), sr, floor, len(trial.pole), band_hz)
    modes = _pruned(x, band_hz, _fit(x, modes, sr, band_hz, THOROUGH_FIT), noise, least)
    return modes, measured(sinusoids.residual(x, modes, sr), sr, floor, len(modes.pole), band_hz)


def _least(x: Array) -> float:
    """Least energy of a mode over the noise's density: what the strongest of all cells reaches once in twenty."""
    return float(2 * np.log(1.5 * len(x) / FALSE_ALARMS))


def _least_of_a_second(modes: int, least: float) -> float:
    """Least energy of a second mode in a line: of all cells it has but the few beside the lines to chance upon."""
    return float(min(least, 2 * np.log(1.5 * 2 * NEAR_DECAYS * max(modes, 1) / FALSE_ALARMS)))


def _needed(pole: Array, least: float) -> Callable[[Array], Array]:
    """Least energy (n,) of a mode at frequencies (n,) in Hz, given those that are there."""
    centre, reach = np.abs(pole.imag) / (2 * np.pi), NEAR_DECAYS * -pole.real / (2 * np.pi)

    def at(freq_hz: Array) -> Array:
        need = np.full(len(freq_hz), least)
        for first, last in zip(
            np.searchsorted(freq_hz, centre - reach), np.searchsorted(freq_hz, centre + reach), strict=True
        ):
            need[first:last] = _least_of_a_second(len(pole), least)
        return need

    return at


def _start(x: Array, sr: int, band_hz: tuple[float, float], floor: float) -> Sinusoids:
    """Return the bands' poles and their amplitudes; the strongest alone where there are more than can be identified."""
    early_per_s = 150.0  # modes faster than this are largely over when a band's filter is full
    density = np.maximum(noise_density(x, sr, band_hz, tail=True), floor)
    slow = subspace.poles(x, sr, density, band_hz, EXTRACTION_BAND_HZ, EXTRACTED_FASTEST_PER_S)
    fast = subspace.early_poles(x, sr, density, band_hz, EXTRACTED_FASTEST_PER_S)
    seen = (np.abs(fast[:, None] - slow) < 0.5 * np.abs(fast.real[:, None])).any(axis=1)
    pole = np.concatenate([slow, fast[~seen & (fast.real < -early_per_s)]])
    most = min(2 * MOST_BAND_MODES, len(x) // LEAST_SAMPLES_A_MODE)
    if len(pole) > most:
        pole = pole[np.argsort(-sinusoids.alone(x, pole, sr), kind="stable")[:most]]
    return sinusoids.amplitudes(x, pole, sr)


def _first(
    x: Array, sr: int, start: Sinusoids, band_hz: tuple[float, float], least: float, floor: float
) -> tuple[Sinusoids, Noise]:
    """Return the significant ones of the bands' poles, fitted."""
    pole = start.pole
    noise = measured(sinusoids.residual(x, start, sr), sr, floor, len(pole), band_hz)
    if not len(pole):
        return start, noise
    energy = sinusoids.spreads(start, sr, len(x))[1] / noise.rms(pole.imag / (2 * np.pi), -pole.real) ** 2
    kept = np.argsort(-energy, kind="stable")[:MOST_BAND_MODES]
    kept = kept[energy[kept] > least]
    modes = _fit(x, sinusoids.amplitudes(x, pole[kept], sr), sr, band_hz)
    noise = measured(sinusoids.residual(x, modes, sr), sr, floor, len(modes.pole), band_hz)
    return _pruned(x, band_hz, modes, noise, least), noise


def _pruned(x: Array, band_hz: tuple[float, float], modes: Sinusoids, noise: Noise, least: float) -> Sinusoids:
    """Drop modes that are not significant, or share a line so that no decay is identified, and fit the rest again.

    The weakest go first.
    """
    cancelling = 4.0  # of the recording's peak: modes that large cancel one another, and model what is no mode
    while len(modes.pole):
        met = noise.rms(modes.pole.imag / (2 * np.pi), -modes.pole.real)
        spread, energy = sinusoids.spreads(modes, noise.sr, len(x))
        energy = energy / met**2
        outside = (
            (modes.pole.real <= -PINNED_DECAY * EXTRACTED_FASTEST_PER_S)
            | (modes.pole.imag < 2 * np.pi * band_hz[0])
            | (modes.pole.imag > 2 * np.pi * band_hz[1])
        )
        energy[outside | (np.abs(modes.amplitude) > cancelling * np.abs(x).max())] *= 1e-9
        far, fade = np.abs(modes.pole.imag[:, None] - modes.pole.imag), -modes.pole.real
        near = far < NEAR_DECAYS * np.maximum(fade[:, None], fade)
        vague = (fade < DECAY_IDENTIFIED * spread[1] * met) & (near.sum(axis=1) > 1)
        weak = np.flatnonzero(
            (energy <= np.where(near.sum(axis=1) > 1, _least_of_a_second(len(fade), least), least)) | vague
        )
        if not len(weak):
            break
        rival = near[np.ix_(weak, weak)] & (energy[weak] < energy[weak, None])  # two that share one line: one may stay
        gone = np.union1d(
            weak[~rival.any(axis=1)], weak[np.argsort(energy[weak], kind="stable")[: (len(weak) + 1) // 2]]
        )
        modes = sinusoids.amplitudes(x, np.delete(modes.pole, gone), noise.sr)
        modes = _fit(x, modes, noise.sr, band_hz, ROUGH_FIT if len(gone) > FEW_MODES else QUICK_FIT)
    return modes


def _moved(x: Array, modes: Sinusoids, noise: Noise, band_hz: tuple[float, float], later: int) -> Sinusoids:
    """Return the same modes for a signal that starts ``later`` samples after the one they were found in."""
    if later == 0:
        return modes
    turned = Sinusoids(modes.pole, modes.amplitude * np.exp(modes.pole / noise.sr * later))
    return turned if len(noise.density) == 2 else _fit(x, turned, noise.sr, band_hz, (QUICK_FIT[0], THOROUGH_FIT[1]))


def _features(
    x: Array,
    banded: Array,
    modes: Sinusoids,
    noise: Noise,
    band_hz: tuple[float, float],
    start: int,
    notes: list[str],
    *,
    whole: bool,
) -> Features:
    """Make features of the modes of a signal (n,).

    banded (n,): what the band alone holds of it. whole: no band was asked for, whose edge makes lines at the onset
    that are none.
    """
    steady = 0.02  # a decay of less than this over the whole recording, or within two of its spreads of none, is a tone
    k, sr = len(modes.pole), noise.sr
    left = banded - (x - sinusoids.residual(x, modes, sr))
    explained = 1 - float(left @ left) / float(banded @ banded)
    freq, decay = modes.pole.imag / (2 * np.pi), -modes.pole.real
    sd = sinusoids.spreads(modes, sr, len(x))[0] * noise.rms(freq, decay) if k else np.zeros((4, 0))
    tone, vague = decay * len(x) / sr < steady, decay < DECAY_IDENTIFIED * sd[1]
    for which, said in ((tone, "without decay"), (vague & ~tone & whole, "without a decay that can be told")):
        if which.any():
            shown = ", ".join(f"{f:.1f}" for f in np.sort(freq[which])[:8])
            notes.append(f"{format_count(int(which.sum()), 'line')} {said} left out: {shown} Hz")
    modal = _modal(explained, banded, notes)
    amplitude, turn = np.abs(modes.amplitude), np.angle(modes.amplitude)
    pinned = (
        (sd[1] > 0)
        & (np.abs(decay / EXTRACTED_FASTEST_PER_S - PINNED_DECAY) < 1.001 * (1 - PINNED_DECAY))
        & (len(noise.density) > 2)
    )
    keep = np.flatnonzero(~(tone | vague | pinned) & (freq >= band_hz[0]) & (freq <= band_hz[1]) & modal)
    keep = keep[np.argsort(-(amplitude[keep] ** 2) / decay[keep], kind="stable")]
    if not len(keep) and modal:
        notes.append("no mode stands above the noise")
    return Features(
        freq_hz=freq[keep],
        decay_per_s=decay[keep],
        amplitude=amplitude[keep],
        phase_rad=turn[keep] + np.pi / 2,  # Re A e^{iωt} = |A| sin(ωt + arg A + π/2)
        freq_sd_hz=sd[0, keep] / (2 * np.pi),
        decay_sd_per_s=sd[1, keep],
        amplitude_sd=np.hypot(sd[2, keep] * np.cos(turn[keep]), sd[3, keep] * np.sin(turn[keep])),
        onset_s=start / sr,
        noise_dbfs=20 * np.log10(max(_rms(left), 1e-15)),
        sr=sr,
        note="; ".join(notes),
    )


def _modal(explained: float, banded: Array, notes: list[str], enough: float = EXPLAINED_SHARE) -> bool:
    """Whether lines that explain so much of a sound's energy are worth being shown; notes get what is amiss."""
    front = banded[: int(FRONT_OF_RECORDING * len(banded))]
    # a rattle starts with its most; speech, noise, music do not
    modal = explained >= TRUSTED_SHARE or float(front @ front) >= FRONT_ENERGY_SHARE * float(banded @ banded)
    if explained < enough:
        given = "" if modal else "; no feature is given"
        notes.append(
            f"not an impact, or not modal: damped sinusoids explain {100 * explained:.0f} % of the energy{given}"
        )
    return modal


def _ringing(x: Array, banded: Array, lines: Lines, sr: int, start: int, notes: list[str]) -> Features:
    """Features of what rings after the attack of a take (n,); banded (n,): what the band alone holds of it."""
    left = sinusoids.residual(x, Sinusoids(lines.pole, lines.amplitude[0]), sr) + banded - x
    late = min(round(ATTACK_S * sr), len(x) // 4)
    explained = 1 - float(left[late:] @ left[late:]) / float(banded[late:] @ banded[late:])
    amplitude = np.abs(lines.amplitude[0])
    order = np.argsort(-(amplitude**2) / lines.decay_per_s, kind="stable")
    keep = order if _modal(explained, banded, notes, TRUSTED_SHARE) else order[:0]
    if not len(order):
        notes.append("no mode stands above the noise")
    return Features(
        freq_hz=lines.freq_hz[keep],
        decay_per_s=lines.decay_per_s[keep],
        amplitude=amplitude[keep],
        phase_rad=np.angle(lines.amplitude[0, keep]) + np.pi / 2,
        freq_sd_hz=lines.freq_sd_hz[keep],
        decay_sd_per_s=lines.decay_sd_per_s[keep],
        amplitude_sd=lines.amplitude_sd[0, keep],
        onset_s=start / sr,
        noise_dbfs=20 * np.log10(max(_rms(left), 1e-15)),
        sr=sr,
        note="; ".join(notes),
    )
