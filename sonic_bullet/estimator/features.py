"""One recorded impact -> its damped sinusoids, each with its spread [Ren, Yeh, Lin 2013, section 4; and what has been learnt since].

    recording -> onset.py (which part is one impact)
    -> noise density over frequency, from the quiet quarter of each neighbourhood of the tail's spectrum
    -> subspace.py (poles, band by band)       every frequency resolution at once, where the paper goes from level to level
    -> likelihood.py (all modes jointly)       the paper's "everything found so far subtracted", to the optimum
    -> the residual's poles are added while they are significant; what is not, goes
    -> Features

A mode is significant where its energy over the noise density exceeds what the strongest of as many noise cells as the recording holds
reaches once in five recordings: T > 2 ln(1.5 n / 0.2) [Kay 1998, Detection Theory, ch. 7.6]. No number is tuned to a recording.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.errors import AudioError
from sonic_bullet.estimator import exact, likelihood, onset, subspace
from sonic_bullet.estimator.likelihood import Modes
from sonic_bullet.estimator.values import Features
from sonic_bullet.records import Array

FASTEST_PER_S = 3000.0
FALSE_ALARMS = 0.2
BAND_HZ = 500.0
ROUNDS = 6
QUICK, THOROUGH = (8, 1e-4), (40, 1e-6)  # steps and tolerance of a fit on the way, and of the last
MOST_MODES = 140
SECONDS_MAX = 8.0
LEAST_SAMPLES = 512
FLOOR = 1e-12  # of the recording's rms: rounding, where there is no noise
NESTED = (1e-5, 1e-7, 1e-9, 1e-11, 0.0)
EXPLAINED = 0.8
STEADY = 0.02  # a decay of less than this over the whole recording, or within two of its spreads of none, is a tone


def extract(signal: Array, sr: int, *, onset_s: float | None = None, band_hz: tuple[float, float] | None = None) -> Features:
    """Features of a recording (n,), full scale 1, at sr Hz. onset_s: where it is known; else it is found.

    What makes the numbers doubtful stands in the note. Raises AudioError: silence, NaN, fewer than 512 samples of sound.
    """
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
    part = onset.span(signal, sr) if onset_s is None else onset.Span(round(onset_s * sr), len(signal), 1)
    x = signal[part.start : min(part.stop, part.start + int(SECONDS_MAX * sr))]
    if len(x) < LEAST_SAMPLES:
        raise AudioError(f"{len(x)} samples follow the onset", f"an impact needs {LEAST_SAMPLES} at least")
    notes = []
    if part.hits > 1:
        notes.append(f"{part.hits} hits: only what comes before the second, {len(x) / sr:.3g} s, is used")
    clipped = onset.clipped_samples(signal)
    if clipped:
        notes.append(f"{clipped} samples are clipped: amplitudes and early decays are not to be trusted")
    modes, density = _modes(x, sr, (low, high))
    start = part.start
    if onset_s is None and len(modes.pole):
        start = onset.by_modes(signal, part.start, modes, sr, _rms(likelihood.residual(x, modes, sr)))
        x = signal[start : start + len(x)]
        modes, density = _moved(x, sr, modes, density, (low, high), start - part.start)
    return _features(x, sr, modes, density, (low, high), start, notes)


def noise_density(signal: Array, *, tail: bool = False) -> Array:
    """Rms per sample (n_f,) over frequency 0 … sr/2, as if white at that level; tail: from the last third, else from all.

    The lower quartile of a neighbourhood knows nothing of the lines in it; for exponential noise power it is ln(4/3) of the mean.
    """
    from scipy.ndimage import percentile_filter

    part = signal[-len(signal) // 3 :] if tail else signal
    window = np.hanning(len(part)) if tail else np.ones(len(part))
    power = np.abs(np.fft.rfft(part * window)) ** 2 / (window**2).sum()
    power = np.concatenate([power, power[-1:]]) if len(power) < 64 else power
    width = max(25, len(power) // 60)
    coarse = max(1, width // 50)
    trimmed = power[: len(power) // coarse * coarse].reshape(-1, coarse)
    smooth = (
        percentile_filter(trimmed.ravel(), 25, size=width, mode="nearest")
        if coarse == 1
        else percentile_filter(np.quantile(trimmed, 0.25, axis=1), 50, size=width // coarse, mode="nearest")
    )
    return np.asarray(np.sqrt(smooth / np.log(4 / 3)))


def matched(left: Array, sr: int, density: Array, band_hz: tuple[float, float], least: float) -> Array:
    """Poles (k,) whose matched filter on what is left (n,) answers with T > least, each the peak of its neighbourhood.

    T(ω, d) = 2|Σ x e^{−(d+iω)t}|² / (σ² Σ e^{−2dt}) [Kay 1998, eq. 7.29 with an exponential envelope], d in octaves: every resolution.
    """
    n = len(left)
    size = 1 << int(np.ceil(np.log2(2 * n)))
    freq = np.arange(size // 2 + 1) * sr / size
    sigma2 = _at(density, freq, sr) ** 2
    time = np.arange(n) / sr
    decay = np.geomspace(0.5 * sr / n, 0.5 * FASTEST_PER_S, 14)
    score = np.empty((len(decay), len(freq)))
    for i, d in enumerate(decay):
        fade = np.exp(-d * time)
        score[i] = 2 * np.abs(np.fft.rfft(left * fade, size)) ** 2 / (sigma2 * float(fade @ fade))
    score[:, (freq < band_hz[0]) | (freq > band_hz[1])] = 0
    best = score.max(axis=0)
    peak = np.flatnonzero((best[1:-1] > least) & (best[1:-1] >= best[:-2]) & (best[1:-1] > best[2:])) + 1
    chosen: list[complex] = []
    for at in peak[np.argsort(-best[peak], kind="stable")]:
        d, f = decay[int(np.argmax(score[:, at]))], freq[at]
        if all(abs(2 * np.pi * f - p.imag) > 4 * max(d, -p.real) for p in chosen):
            chosen.append(complex(-d, 2 * np.pi * f))
    return np.array(chosen, complex)


def _at(density: Array, freq_hz: Array, sr: int) -> Array:
    return np.asarray(np.interp(freq_hz, np.linspace(0, sr / 2, len(density)), density))


def _energies(modes: Modes, density: Array, sr: int, count: int) -> Array:
    """T (k,): energy of each mode, given the others, over twice the noise density there [Kay 1998, eq. 7.36]."""
    k = len(modes.pole)
    gram = likelihood.information(modes, sr, count)[2 * k :, 2 * k :]
    scale = 1 / np.sqrt(np.diag(gram))
    inverse = np.linalg.pinv(gram * scale[:, None] * scale, rcond=1e-13, hermitian=True) * scale[:, None] * scale
    pair = np.arange(k)
    block = np.stack([np.stack([inverse[pair, pair], inverse[pair, pair + k]], -1), np.stack([inverse[pair + k, pair], inverse[pair + k, pair + k]], -1)], -2)
    amplitude = np.stack([modes.amplitude.real, modes.amplitude.imag], -1)
    return np.asarray((amplitude * np.linalg.solve(block, amplitude[:, :, None])[:, :, 0]).sum(-1) / _at(density, modes.pole.imag / (2 * np.pi), sr) ** 2)


def _reach(band_hz: tuple[float, float], sr: int) -> tuple[float, float]:
    return 2 * np.pi * 0.5 * band_hz[0], 2 * np.pi * min(1.02 * band_hz[1], 0.4999 * sr)


def _fit(signal: Array, pole: Array, sr: int, band_hz: tuple[float, float], effort: tuple[int, float] = QUICK) -> Modes:
    return likelihood.fitted(
        signal, likelihood.amplitudes(signal, pole, sr), sr, band=_reach(band_hz, sr), fastest_per_s=FASTEST_PER_S, steps=effort[0], tolerance=effort[1]
    )


def _modes(x: Array, sr: int, band_hz: tuple[float, float]) -> tuple[Modes, Array]:
    """The significant modes of a signal and the noise density they leave."""
    floor = FLOOR * _rms(x)
    without_noise = exact.modes(x, sr)
    if without_noise is not None:
        left = _rms(likelihood.residual(x, without_noise, sr))
        return without_noise, np.full(2, max(left, floor))
    least = 2 * np.log(1.5 * len(x) / FALSE_ALARMS)
    density = np.maximum(noise_density(x, tail=True), floor)
    candidate = subspace.poles(x, sr, density, band_hz, BAND_HZ, FASTEST_PER_S)
    none = Modes(np.zeros(0, complex), np.zeros(0, complex))
    if not len(candidate):
        return none, np.maximum(noise_density(x), floor)
    modes, density = _nested(x, sr, band_hz, candidate, least, floor)
    for _ in range(ROUNDS):
        more = matched(likelihood.residual(x, modes, sr), sr, density, band_hz, least)
        if not len(more) or density.max() <= 2 * floor or len(more) + len(modes.pole) > MOST_MODES:
            break
        trial = _pruned(x, sr, band_hz, _fit(x, np.concatenate([modes.pole, more]), sr, band_hz), density, least)
        if len(trial.pole) <= len(modes.pole):
            break
        modes, density = trial, np.maximum(noise_density(likelihood.residual(x, trial, sr)), floor)
    modes = _pruned(x, sr, band_hz, _fit(x, modes.pole, sr, band_hz, THOROUGH), density, least)
    return modes, np.maximum(noise_density(likelihood.residual(x, modes, sr)), floor)


def _moved(x: Array, sr: int, modes: Modes, density: Array, band_hz: tuple[float, float], later: int) -> tuple[Modes, Array]:
    """The same modes for a signal that starts ``later`` samples after the one they were found in."""
    if later == 0:
        return modes, density
    turned = Modes(modes.pole, modes.amplitude * np.exp(modes.pole / sr * later))
    if len(density) == 2:
        return turned, density
    fitted = likelihood.fitted(x, turned, sr, band=_reach(band_hz, sr), fastest_per_s=FASTEST_PER_S, steps=QUICK[0], tolerance=THOROUGH[1])
    return fitted, density


def _rms(signal: Array) -> float:
    return float(np.sqrt((signal**2).mean()))


def _nested(x: Array, sr: int, band_hz: tuple[float, float], candidate: Array, least: float, floor: float) -> tuple[Modes, Array]:
    """The best of nested sets of candidates, the strongest first, by Schwarz's criterion [Schwarz 1978]."""
    start = likelihood.amplitudes(x, candidate, sr)
    left = likelihood.residual(x, start, sr)
    energy = _energies(start, np.full(2, max(float(np.sqrt((left**2).mean())), floor)), sr, len(x))
    energy_true = _energies(start, np.maximum(noise_density(left), floor), sr, len(x))
    best: tuple[float, Modes, Array] | None = None
    last = -1
    for ratio in NESTED:
        keep = (energy_true > least) & (energy > ratio * energy.max())
        if keep.sum() > MOST_MODES:
            keep &= energy >= np.sort(energy)[-MOST_MODES]
        if keep.sum() in (0, last):
            continue
        last = int(keep.sum())
        modes = _fit(x, candidate[keep], sr, band_hz, THOROUGH)
        left = likelihood.residual(x, modes, sr)
        rms = max(float(np.sqrt((left**2).mean())), floor)
        score = 2 * len(x) * np.log(rms) + 4 * last * np.log(len(x))
        if best is None or score < best[0]:
            best = (score, modes, np.maximum(noise_density(left), floor))
        if rms <= 1.01 * floor:
            break
    if best is None:
        return Modes(np.zeros(0, complex), np.zeros(0, complex)), np.maximum(noise_density(x), floor)
    return best[1], best[2]


def _pruned(x: Array, sr: int, band_hz: tuple[float, float], modes: Modes, density: Array, least: float) -> Modes:
    """Without the modes that are not significant, the weakest first, the rest fitted again."""
    while len(modes.pole):
        weak = _energies(modes, density, sr, len(x)) <= least
        weak |= (modes.pole.real <= -0.999 * FASTEST_PER_S) | (modes.pole.imag < 2 * np.pi * band_hz[0]) | (modes.pole.imag > 2 * np.pi * band_hz[1])
        if not weak.any():
            break
        modes = _fit(x, modes.pole[~weak], sr, band_hz)
    return modes


def _features(x: Array, sr: int, modes: Modes, density: Array, band_hz: tuple[float, float], start: int, notes: list[str]) -> Features:
    k = len(modes.pole)
    left = likelihood.residual(x, modes, sr)
    energy = float(x @ x)
    explained = 1 - float(left @ left) / energy
    freq, decay = modes.pole.imag / (2 * np.pi), -modes.pole.real
    here = _at(density, freq, sr) if k else np.zeros(0)
    sd = likelihood.spreads(modes, sr, len(x)) * here if k else np.zeros((4, 0))
    tone = (decay * len(x) / sr < STEADY) | (decay < 2 * sd[1])
    if tone.any():
        shown = ", ".join(f"{f:.1f}" for f in np.sort(freq[tone])[:8])
        notes.append(f"{int(tone.sum())} lines do not decay and are left out: {shown} Hz")
    if explained < EXPLAINED:
        notes.append(f"not an impact, or not modal: damped sinusoids explain {100 * explained:.0f} % of the energy")
    amplitude = np.abs(modes.amplitude)
    keep = np.flatnonzero(~tone & (freq >= band_hz[0]) & (freq <= band_hz[1]))
    keep = keep[np.argsort(-amplitude[keep], kind="stable")]
    if not len(keep):
        notes.append("no mode stands above the noise")
    noise = float(np.sqrt((left**2).mean()))
    return Features(
        freq_hz=freq[keep],
        decay_per_s=decay[keep],
        amplitude=amplitude[keep],
        phase_rad=np.angle(modes.amplitude[keep]) + np.pi / 2,  # Re A e^{iωt} = |A| sin(ωt + arg A + π/2)
        freq_sd_hz=sd[0, keep] / (2 * np.pi),
        decay_sd_per_s=sd[1, keep],
        amplitude_sd=np.hypot(sd[2, keep] * np.cos(np.angle(modes.amplitude[keep])), sd[3, keep] * np.sin(np.angle(modes.amplitude[keep]))),
        onset_s=start / sr,
        noise_dbfs=20 * np.log10(max(noise, 1e-15)),
        sr=sr,
        note="; ".join(notes),
    )
