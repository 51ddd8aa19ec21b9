"""Grains under way, and friction as a row of micro-collisions: state in, samples and state out.

    strike:    grain from sample n_0 on
    friction:  force f on the sections [jG, jG + 2G) of absolute time, under w² + w'² = 1:
        grain_j = T⁻¹(T(f w) √A (cos θ_j T(base_0) + sin θ_j T(base_1))), θ_j(f) seeded

A section's force is used as it is, every micro-collision of it at its own time. Sections overlap by half with windows
whose squares add to one, and as no two have the same noise their powers add: steady friction sounds steady. A section
is known when it is over, so its sound comes 2G samples late, 21 ms at 48 kHz. Sections lie on the grid of absolute
samples, grains are added in the order in which they became known: any split into calls gives the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet._engine import shape_spectrum
from sonic_bullet.engine.residual.grains import Voice, angles, response
from sonic_bullet.records import Array
from sonic_bullet.signal.elementary import cos, sin

SECTION = 512


@dataclass(frozen=True, slots=True, eq=False)
class Grain:
    """Samples (n,) of one body in one weight set, from absolute sample ``start`` on."""

    start: int
    weight_set: int
    body: int
    sample: Array


def add_grains(out: Array, grains: tuple[Grain, ...], at: int) -> tuple[Grain, ...]:
    """Add the grains to out (W, b, n), whose first sample is ``at``; return those that continue afterwards."""
    end = at + out.shape[2]
    for grain in grains:
        low, high = max(grain.start, at), min(grain.start + len(grain.sample), end)
        if low < high:
            out[grain.weight_set, grain.body, low - at : high - at] += grain.sample[
                low - grain.start : high - grain.start
            ]
    return tuple(grain for grain in grains if grain.start + len(grain.sample) > end)


@dataclass(frozen=True, slots=True, eq=False)
class FrictionHistory:
    """Friction force of one pair on one side so far.

    Samples (n,) in newton from absolute sample ``start``, a multiple of `SECTION`. gain (m,): last Uᵀ per newton on the
    side's modes.
    """

    start: int
    force_n: Array
    gain: Array


def section_window() -> Array:
    """Return a window (2G,) with w[n]² + w[n + G]² = 1 (the power-complementary window of Vorbis)."""
    return sin(np.pi / 2 * sin(np.pi * (np.arange(2 * SECTION) + 0.5) / (2 * SECTION)) ** 2)


def cut_rubbed_sections(
    state: FrictionHistory | None, force_n: Array | None, at: int, n: int
) -> tuple[list[tuple[int, Array]], FrictionHistory | None]:
    """Cut the sections that are complete with the n samples from ``at`` on; also return the state after them.

    Sections are (number j, force under the window (2G,)). force_n None: the pair has no friction; the state is None
    when nothing of it is left.
    """
    if state is None:
        if force_n is None:
            return [], None
        start = (at // SECTION - 1) * SECTION  # the section before began in silence
        state = FrictionHistory(start, np.zeros(at - start), np.zeros(0))
    force = np.concatenate([state.force_n, np.zeros(n) if force_n is None else force_n])
    start, done, window = state.start, [], section_window()
    while len(force) >= 2 * SECTION:
        part = force[: 2 * SECTION]
        if part.any():
            done.append((start // SECTION, part * window))
        force, start = force[SECTION:], start + SECTION
    if force_n is None and not force.any():
        return done, None
    return done, replace(state, start=start, force_n=force)


def section_grain(voice: Voice, force_n: Array, struck_power: Array, number: int) -> Array:
    """Compute the sound (length + 2G,) of one section of force (2G,) in newton.

    struck_power (p,): a² of the pairs per N·s.
    """
    level = float(np.sqrt(struck_power.max(initial=0.0))) * float(np.abs(force_n).sum()) / voice.sr
    least_level = 2e-6  # sections that could reach no more than this, -20 dB SPL at 1 m, are skipped
    if voice.silent or level < least_level:
        return np.zeros(0, np.float32)
    from scipy.fft import irfft, rfft

    gain, angle = response(voice, struck_power), angles(number)
    spectrum = rfft((force_n / voice.sr).astype(np.float32), voice.size)
    first, second = ((gain * part).astype(np.float32) for part in (cos(angle), sin(angle)))
    shape_spectrum(spectrum, voice.base, first, second)
    return np.asarray(irfft(spectrum, voice.size, overwrite_x=True)[: voice.length + 2 * SECTION])
