"""A residual as one clip, without a scene: of a recording, and of one strike as the run time plays it.

recorded, represented -> P_residual and its transform
Residual + Modes (a complex) -> Voice -> lines, each a quarter turn from the mode it follows; a grain of noise ->
    samples
"""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import add_damped_lines
from sonic_bullet.engine.residual.grains import apply_gain, make_voice, mixed_number, response, vary_grains
from sonic_bullet.engine.residual.transfer import StruckModes, paired_power
from sonic_bullet.records import Array, Residual
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.spectrogram import RESIDUAL_WINDOW, Power, check_samples, power, transform


def synthesize_lines(freq_hz: Array, decay_per_s: Array, amplitude: Array, n: int, sr: int) -> Array:
    """Compute Re Σ a e^{(-d + iω)t} (n,) of lines (l,), a complex; each until it has fallen by `nepers`."""
    nepers = 40.0
    out = np.zeros(n)
    decay = np.asarray(decay_per_s, float)
    length = np.where(decay > 0, np.minimum(n, nepers * sr / np.maximum(decay, 1e-9) + 1), n).astype(np.int64)
    pole = np.exp((-decay + 2j * np.pi * np.asarray(freq_hz)) / sr)
    add_damped_lines(pole, np.ascontiguousarray(amplitude, complex), length, out)
    return out


def clip_residual(
    recorded: Array, represented: Array, sr: int, represented_sr: int | None = None, window: int = RESIDUAL_WINDOW
) -> tuple[Power, Array]:
    """Compute P_residual of a recording (n,), and the complex transform of recorded - represented (m, k).

    The inversion starts from the phases of the second. Raises AudioError: empty, NaN, other lengths, or another rate.
    """
    if represented_sr is not None and represented_sr != sr:
        raise AudioError(f"a residual of {represented_sr} Hz beside a recording of {sr} Hz", "resample one of them")
    recorded, represented = check_samples(recorded, sr), check_samples(represented, sr)
    if recorded.shape != represented.shape:
        raise AudioError(f"{len(represented)} samples represented of {len(recorded)}", "give clips of one length")
    whole, taken = power(recorded, sr, window), power(represented, sr, window)
    left = Power(whole.freq_hz, whole.time_s, np.maximum(whole.per_hz - taken.per_hz, 0.0))
    return left, transform(recorded - represented, window)


def residual_sound(
    residual: Residual, freq_hz: Array, decay_per_s: Array, amplitude: Array, n: int, sr: int, seed: int = 0
) -> Array:
    """Synthesise the residual (n,) of modes (m,) of complex amplitude at the onset, in their unit."""
    longest_s = 1.0
    order = np.argsort(freq_hz, kind="stable")
    freq, decay, start = freq_hz[order], decay_per_s[order], np.asarray(amplitude, complex)[order]
    if not len(freq) or not np.abs(start).max() > 0:
        return np.zeros(n)
    target = StruckModes(freq, decay, np.abs(start))
    voice = make_voice(residual, target, sr, longest_s)
    power = paired_power(voice.pairs, target)
    lead = np.zeros(len(power), complex)
    for k in np.argsort(np.abs(start), kind="stable"):
        if voice.pairs.group[k] >= 0:
            lead[voice.pairs.group[k]] = start[k] / max(abs(start[k]), 1e-300)
    lines = voice.lines
    observed = lines.freq_hz < sr / 2
    turned = 1j * lead[lines.follows] * lines.ratio * np.sqrt(power[lines.follows])
    out = synthesize_lines(lines.freq_hz[observed], lines.decay_per_s[observed], turned[observed], n, sr)
    grain = (
        vary_grains(apply_gain(voice, response(voice, power)), 1.0, mixed_number(seed))
        if not voice.silent
        else np.zeros(0)
    )
    count = min(n, len(grain))
    out[:count] += grain[:count]
    return out
