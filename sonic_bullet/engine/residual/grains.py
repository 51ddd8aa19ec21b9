"""Noise of a strike beside its modes: a grain of shaped noise, made once a body and then filtered to each place.

    once a body:
        P(f, t) shifted and stretched onto its modes -> magnitudes -> invert -> base_v(t), v = 0, 1 from two seeds
    once a place:    g_v = T⁻¹(T(base_v) √A(f) |F̂(fτ)|)
        A: `transfer.scale` of the modes as they are struck there, F̂: the force pulse
    each strike:     J-level · (cos θ g_0 + sin θ g_1), θ seeded: as loud, of the same spectrogram, and no two alike

A does not depend on time, so the order (transfer, then invert) or (invert, then scale) gives the same up to the
window's length. Places are distinguished by A itself, in steps of 2 dB at each pair of modes, and pulses in eighths of
an octave: a cached grain has the same bits, whichever strike made it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from sonic_bullet._engine import count_level_steps, filter_grains, mix_grains
from sonic_bullet.engine.residual.invert import INVERSION_OVERLAP, invert, magnitude_of, noise_phases
from sonic_bullet.engine.residual.transfer import (
    ModePairs,
    ResidualLines,
    StruckModes,
    come_from,
    merge_modes,
    pair,
    scale,
    scale_power,
    source_modes,
    source_power,
    transfer_lines,
)
from sonic_bullet.records import Array, Residual
from sonic_bullet.signal.elementary import cos, log, power, sin
from sonic_bullet.signal.spectrogram import RESIDUAL_WINDOW, axes

GRAIN_STEP_DB = 2.0
LN_2 = 0.6931471805599453


@dataclass(frozen=True, slots=True, eq=False)
class Voice:
    """A body's residual for playback.

    Attributes
    ----------
    here_hz : (k,) source frequency of each bin
    source_power : (p,) of the pairs' modes
    base : (2, F) complex64, spectra of the base grains of ``length`` samples at FFT size ``size``
    silent : whether there is no noise
    cache : of `place_grains`, by key; a pure function's, so it may be shared
    """

    sr: int
    pairs: ModePairs
    here_hz: Array
    source_power: Array
    base: Array
    length: int
    size: int
    lines: ResidualLines
    silent: bool
    cache: dict[bytes, Array] = field(default_factory=dict)


def make_voice(residual: Residual, target: StruckModes, sr: int, longest_s: float = 0.5) -> Voice:
    """Make a body's voice: ``target`` are its modes at a typical strike, which decide the pairs."""
    source = source_modes(residual)
    pairs = pair(source, target)
    joined, _ = merge_modes(source)
    n = duration(residual, pairs, sr, longest_s)
    freq, time = axes(n, sr, overlap=INVERSION_OVERLAP)
    here, slope, rate = come_from(pairs, freq)
    magnitude = magnitude_of(scale_power(source_power(residual), here, slope, rate, time), sr)
    size = 1 << int(np.ceil(np.log2(n + 4 * RESIDUAL_WINDOW)))
    shape = fade_window(n, sr)
    seeds = (0x5EED, 0xF00D)
    base = (
        [np.fft.rfft(shape * invert(magnitude, noise_phases(n, seed), n), size) for seed in seeds]
        if magnitude.any()
        else [np.zeros(size // 2 + 1)] * 2
    )
    return Voice(
        sr,
        pairs,
        here,
        joined.amplitude[pairs.source] ** 2,
        np.array(base, np.complex64),
        n,
        size,
        transfer_lines(residual, pairs),
        not bool(magnitude.any()),
    )


def duration(residual: Residual, pairs: ModePairs, sr: int, longest_s: float) -> int:
    """Count the samples until the end of a residual's noise, stretched onto the pairs; a window at least."""
    sounding = np.flatnonzero(residual.power_per_hz.any(axis=0))
    last = float(residual.time_s[min(int(sounding[-1]) + 1, len(residual.time_s) - 1)]) if len(sounding) else 0.0
    return max(2 * RESIDUAL_WINDOW, round(sr * min(longest_s, last / float(pairs.rate.min()))))


@lru_cache(maxsize=16)
def fade_window(n: int, sr: int) -> Array:
    """Return a window (n,) float32 that rises within a millisecond and falls over the last 15 %, without corners."""
    fade_out = 0.15
    fade_in_s = 1e-3
    shape = np.ones(n, np.float32)
    rise, fall = max(2, round(fade_in_s * sr)), max(2, int(fade_out * n))
    shape[:rise] = sin(np.pi / 2 * (np.arange(rise) + 0.5) / rise) ** 2
    shape[n - fall :] *= cos(np.pi / 2 * (np.arange(fall) + 0.5) / fall) ** 2
    shape.setflags(write=False)
    return shape


def response(voice: Voice, struck_power: Array, pulse: Array | None = None) -> Array:
    """Compute the factors (k,) of the base grains' bins: √A for modes struck to a² (p,), times a pulse's |F̂| (k,)."""
    return np.asarray(
        np.sqrt(scale(voice.pairs, voice.source_power, struck_power, voice.here_hz)) * (1.0 if pulse is None else pulse)
    )


def apply_gain(voice: Voice, gain: Array) -> Array:
    """Filter the base grains by a response (k,): (2, length) float32."""
    spectrum = np.empty_like(voice.base)
    filter_grains(voice.base, np.asarray(gain, np.float32), spectrum)
    from scipy.fft import irfft

    return np.asarray(irfft(spectrum, voice.size, axis=1)[:, : voice.length] * fade_window(voice.length, voice.sr))


Pulse = Callable[[Array, bool], Array]


def place_grains(voice: Voice, struck_power: Array, tau_s: float, flat: bool, pulse: Pulse) -> tuple[Array, float]:
    """Return the two grains (2, length) of a place and a pulse, and the level by which they are to be multiplied.

    struck_power (p,): a² of the pairs. pulse: |F̂| (k,) of a force pulse at products fτ (k,), flat or not, relative to
    0 Hz.
    """
    cached = 256
    most = float(struck_power.max(initial=0.0))
    if most <= 0 or voice.silent:
        return np.zeros((2, 0), np.float32), 0.0
    step = np.empty(len(struck_power) + 2, np.int16)
    octave = round(8 * float(log(max(tau_s, 1e-6))) / LN_2)
    step[-2:] = octave, flat
    count_level_steps(struck_power, most, GRAIN_STEP_DB, step)
    key = step.tobytes()
    found = voice.cache.get(key)
    if found is None:
        gain = response(
            voice,
            power(10.0, step[:-2] * GRAIN_STEP_DB / 10),
            pulse(axes(0, voice.sr)[0] * float(power(2.0, octave / 8)), flat),
        )
        found = apply_gain(voice, gain)
        while len(voice.cache) >= cached:
            voice.cache.pop(next(iter(voice.cache)))
        voice.cache[key] = found
    return found, float(np.sqrt(most))


def vary_grains(grains: Array, level: float, number: int) -> Array:
    """Mix a different grain (length,) float32 for each ``number``, as loud as the others."""
    angle = 2 * np.pi * fraction(number)
    out = np.empty(grains.shape[1], np.float32)
    mix_grains(grains, level * float(cos(angle)), level * float(sin(angle)), out)
    return out


def mixed_number(*parts: int) -> int:
    """Hash parts to a number below 2⁶⁴ (splitmix64's finaliser, a part at a time)."""
    state = 0x9E3779B97F4A7C15
    for part in parts:
        state = (state ^ (part & 0xFFFFFFFFFFFFFFFF)) * 0xBF58476D1CE4E5B9 & 0xFFFFFFFFFFFFFFFF
        state = (state ^ (state >> 27)) * 0x94D049BB133111EB & 0xFFFFFFFFFFFFFFFF
        state ^= state >> 31
    return state


def fraction(number: int) -> float:
    """Scale a number below 2⁶⁴ to 0 … 1."""
    return (number >> 11) / (1 << 53)


def angles(number: int) -> Array:
    """Draw an angle (k,) for each bin, random over `knots` bands: grains of two numbers are all but uncorrelated."""
    knots = 33
    state = np.uint64(mixed_number(number)) + np.arange(knots, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    knot = (state ^ (state >> np.uint64(31))) / 2.0**64
    return np.asarray(
        2 * np.pi * np.interp(np.arange(RESIDUAL_WINDOW // 2 + 1), np.linspace(0, RESIDUAL_WINDOW // 2, knots), knot)
    )
