"""One recorded impact -> its damped sinusoids, each with its spread [Ren, Yeh, Lin 2013, section 4, and later work].

    recording -> onset.py (which part is one impact), less drift, hum and what lies outside of the band
    -> exact_modes.py     where there is no noise: the rank of the Hankel matrix tells all modes at once
       joint_lines.py     where damped sinusoids leave no more than white noise: lines of takes, of which this is one
       after_attack.py    else, of nearly all that is recorded: of what rings after the attack
    -> onset.py   the modes, run backwards, tell the sample of the onset
    -> Features

The three are the estimators of cases and states; what is particular to a tap is which of them explains it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.lab.lines import exact_modes, onset
from sonic_bullet.lab.lines.after_attack import ringing_lines
from sonic_bullet.lab.lines.band_limit import limit_band, without_drift
from sonic_bullet.lab.lines.joint_lines import joint_lines, lines_of, noise_rms
from sonic_bullet.lab.lines.line_values import Features, Lines
from sonic_bullet.lab.lines.shared_poles import power_beside_lines
from sonic_bullet.lab.lines.sinusoids import Sinusoids, residual
from sonic_bullet.lab.lines.standing_hum import describe_hum, find_standing_hum
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError

ATTACK_S = 0.02
"""After which a take is judged."""
WHITE_NOISE_RATIO = 2.0
"""Rms left over that of white noise: 0.99 to 1.9 of made sums at 0 to 60 dB of noise, 3.6 and more of twelve takes."""
LEAST_LEFT = 10**-2.6
"""Of a take's rms: poles band by band leave up to 2e-3 of a sum of a hundred lines, 1e-2 and more of twelve takes."""
EXPLAINED_SHARE = 0.8
"""Of the energy: of less it is said."""
TRUSTED_SHARE = 0.5
"""Of less no feature is given of a sound that is not over soon."""


@one_thread()
def extract(
    signal: Array, sr: int, *, onset_s: float | None = None, band_hz: tuple[float, float] | None = None
) -> Features:
    """Features of a recording (n,), full scale 1, at sr Hz. onset_s: where it is known; else it is found.

    What makes the numbers doubtful stands in the note. Raises AudioError: silence, NaN, fewer than 512 samples.
    """
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
    if hopeless:
        lines, kind = lines_of(x[None], np.ones(1), np.zeros(0, complex), sr, True), "all"
    else:
        lines, kind = _lines(x, sr, (low, high), limited=band_hz is not None)
    start = part.start
    if onset_s is None and (kind != "after the attack" or band_hz) and len(lines.freq_hz):
        start = onset.by_modes(
            signal, part.start, Sinusoids(lines.pole, lines.amplitude[0]), sr, _rms(_subtract_lines(x, lines, sr))
        )
        x = signal[start : start + len(x)]
        since = np.exp(lines.pole / sr * (start - part.start))
        lines = replace(lines, amplitude=lines.amplitude * since, amplitude_sd=lines.amplitude_sd * np.abs(since))
    return _features(x, limited[start : start + len(x)], (lines, kind), sr, band_hz, start, notes)


def _rms(signal: Array) -> float:
    return float(np.sqrt((signal**2).mean()))


def _subtract_lines(x: Array, lines: Lines, sr: int) -> Array:
    """Return what lines leave of a signal (n,)."""
    return residual(x, Sinusoids(lines.pole, lines.amplitude[0]), sr)


def _lines(x: Array, sr: int, band_hz: tuple[float, float], *, limited: bool) -> tuple[Lines, str]:
    """Find the lines of a signal (n,), and say whether they are "exact", "all", or those "after the attack".

    limited: to the band, which smears the onset: no sum of lines explains it.
    """
    rounding = 1e-12  # of the recording's rms, where there is no noise
    judged_s = 2.0
    if limited and len((lines := ringing_lines(x[None], sr, band_hz, signed=True)).freq_hz):
        return lines, "after the attack"
    exact = exact_modes.modes(x, sr)
    if exact is not None:
        exact = exact.take(np.argsort(exact.pole.imag))
        floor = max(_rms(residual(x, exact, sr)), rounding * _rms(x))
        found = lines_of(x[None], np.array([floor]), exact.pole, sr, True)
        return replace(found, amplitude=exact.amplitude[None]), "exact"
    noise, part = noise_rms(x[None], sr)[0], x[: int(judged_s * sr)]
    most = max(WHITE_NOISE_RATIO * noise, LEAST_LEFT * _rms(part[min(round(ATTACK_S * sr), len(part) // 4) :]))
    enough = (most / noise) ** 2
    if power_beside_lines(part / noise, sr, band_hz, ATTACK_S, enough) < enough:
        return joint_lines(x[None], sr, band_hz=band_hz, bounds=True), "all"
    return ringing_lines(x[None], sr, band_hz, signed=True), "after the attack"


def _features(
    x: Array,
    banded: Array,
    found: tuple[Lines, str],
    sr: int,
    band_hz: tuple[float, float] | None,
    start: int,
    notes: list[str],
) -> Features:
    """Make features of the lines of a signal (n,).

    banded (n,): what the band alone holds of it. Where a band was asked for, its edge makes lines at the onset that are
    none.
    """
    steady = 0.02  # a decay of less than this over the whole recording, or within two of its spreads of none, is a tone
    identified = 2.0  # spreads that a decay must be away from none
    cancelling = 4.0  # of the recording's peak: lines that large cancel one another, and model what is no mode
    lines, kind = found
    late = min(round(ATTACK_S * sr), len(x) // 4) if kind == "after the attack" else 0
    left = _subtract_lines(x, lines, sr) + banded - x
    explained = 1 - float(left[late:] @ left[late:]) / float(banded[late:] @ banded[late:])
    freq, decay, amplitude = lines.freq_hz, lines.decay_per_s, np.abs(lines.amplitude[0])
    keep = np.ones(len(freq), bool)
    if kind != "after the attack":
        tone = decay * len(x) / sr < steady
        vague = (decay < identified * lines.decay_sd_per_s) & ~tone
        for which, said in ((tone, "without decay"), (vague & (not band_hz), "without a decay that can be told")):
            if which.any():
                shown = ", ".join(f"{f:.1f}" for f in freq[which][:8])
                notes.append(f"{format_count(int(which.sum()), 'line')} {said} left out: {shown} Hz")
        keep = ~(tone | vague) & (amplitude <= cancelling * np.abs(x).max())
        keep &= np.isfinite(lines.identified_sd_per_s) | (kind == "exact")
        low, high = band_hz or (20.0, np.inf)
        keep &= (freq >= low) & (freq <= high)
    modal = _modal(explained, banded, notes, TRUSTED_SHARE if late else EXPLAINED_SHARE)
    if modal and not keep.any():
        notes.append("no mode stands above the noise")
    order = np.flatnonzero(keep & modal)
    order = order[np.argsort(-(amplitude[order] ** 2) / decay[order], kind="stable")]
    return Features(
        freq_hz=freq[order],
        decay_per_s=decay[order],
        amplitude=amplitude[order],
        phase_rad=np.angle(lines.amplitude[0, order]) + np.pi / 2,  # Re A e^{iωt} = |A| sin(ωt + arg A + π/2)
        freq_sd_hz=lines.freq_sd_hz[order],
        decay_sd_per_s=lines.decay_sd_per_s[order],
        amplitude_sd=lines.amplitude_sd[0, order],
        onset_s=start / sr,
        noise_dbfs=20 * np.log10(max(_rms(left), 1e-15)),
        sr=sr,
        note="; ".join(notes),
    )


def _modal(explained: float, banded: Array, notes: list[str], enough: float) -> bool:
    """Whether lines that explain so much of a sound's energy are worth being shown; notes get what is amiss."""
    front_part, front_share = 0.3, 0.75  # of a recording, and of its energy
    front = banded[: int(front_part * len(banded))]
    # a rattle starts with its most; speech, noise, music do not
    modal = explained >= TRUSTED_SHARE or float(front @ front) >= front_share * float(banded @ banded)
    if explained < enough:
        given = "" if modal else "; no feature is given"
        notes.append(
            f"not an impact, or not modal: damped sinusoids explain {100 * explained:.0f} % of the energy{given}"
        )
    return modal
