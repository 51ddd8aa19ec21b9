"""A transferred residual as one clip, without a scene.

recorded, represented + Modes of source and target -> transfer -> invert, from the source's phases -> samples
    the paper's algorithm 1, on a recording
Residual + Modes (a complex) -> Voice -> lines, each a quarter turn from the mode it follows; a grain of noise ->
    samples   what the run time plays of one strike

Phases: a sinusoid of f_s at t_s has f_s t_s turns; moved to f_t and t_t it has f_t t_t. So each pixel takes the phase
of its source pixel, turned by f_t t_t - f_s t_s. A body's transfer to itself turns nothing.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import add_damped_lines
from sonic_bullet.engine.residual.grains import filtered, make_voice, mixed_number, response, varied
from sonic_bullet.engine.residual.invert import INVERSION, invert, magnitude_of
from sonic_bullet.engine.residual.transfer import StruckModes, come_from, pair, paired_power, transfer
from sonic_bullet.records import Array, Residual
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.spectrogram import RESIDUAL_WINDOW, Power, axes, checked, power, transform


def damped(freq_hz: Array, decay_per_s: Array, amplitude: Array, n: int, sr: int) -> Array:
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
    recorded, represented = checked(recorded, sr), checked(represented, sr)
    if recorded.shape != represented.shape:
        raise AudioError(f"{len(represented)} samples represented of {len(recorded)}", "give clips of one length")
    whole, taken = power(recorded, sr, window), power(represented, sr, window)
    left = Power(whole.freq_hz, whole.time_s, np.maximum(whole.per_hz - taken.per_hz, 0.0))
    return left, transform(recorded - represented, window)


def transferred_clip(
    recorded: Array,
    represented: Array,
    sr: int,
    source: StruckModes,
    target: StruckModes,
    *,
    seconds: float | None = None,
) -> Array:
    """Transfer the residual of a recording (k,) from modes ``source`` to modes ``target``: (n,) float32.

    represented (k,): what ``source`` represents of the recording. As long as the recording, or ``seconds``. Raises
    AudioError as `clip_residual` and `StruckModes`.
    """
    looking = 4  # frames a quarter of a window apart, as in `clip_residual`
    left, start = clip_residual(recorded, represented, sr)
    pairs = pair(source, target)
    n = len(recorded) if seconds is None else max(1, round(seconds * sr))
    freq, time = axes(n, sr)
    here, _, rate = come_from(pairs, freq)
    there_s = np.minimum(rate * time[:, None], left.time_s[-1])
    row = np.round(there_s * sr * looking / RESIDUAL_WINDOW).astype(np.int64)
    column = np.clip(np.round(here * RESIDUAL_WINDOW / sr).astype(np.int64), 0, RESIDUAL_WINDOW // 2)
    # phases are counted from a frame's beginning, half a window before its time
    flip = 1 - 2 * ((column + np.arange(len(freq))) % 2)
    turned = np.exp(2j * np.pi * (freq * time[:, None] - here * there_s)) * flip
    magnitude = magnitude_of(transfer(left, source, target, freq, time, pairs=pairs), sr)
    return invert(magnitude, start[row, column] * turned, n, iterations=INVERSION.most_iterations, overlap=looking)


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
    out = damped(lines.freq_hz[observed], lines.decay_per_s[observed], turned[observed], n, sr)
    grain = (
        varied(filtered(voice, response(voice, power)), 1.0, mixed_number(seed)) if not voice.silent else np.zeros(0)
    )
    count = min(n, len(grain))
    out[:count] += grain[:count]
    return out
