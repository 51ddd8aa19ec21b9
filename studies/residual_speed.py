"""How long does a residual's transfer take?

`python studies/residual_speed.py`: one core, one run, everything counted.

From scratch: pairs of modes, shift, stretch and scale of the spectrogram, phases, four turns of the inversion,
fade: a grain of 0.5 s at 48 kHz for one body and place. From the cache: which place it is, the grain found, a fresh
variation of it at the strike's level. Between them lies what a new place on a known body costs.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from sonic_bullet.engine.residual.grains import fade_window, make_voice, place_grains, vary_grains
from sonic_bullet.engine.residual.invert import (
    INVERSION_ITERATIONS,
    INVERSION_OVERLAP,
    invert,
    magnitude_of,
    noise_phases,
)
from sonic_bullet.engine.residual.player import SECTION, section_grain
from sonic_bullet.engine.residual.transfer import StruckModes, source_modes, source_power, transfer
from sonic_bullet.records import Array, Residual
from sonic_bullet.signal.spectrogram import axes

SEEDS = (0x5EED, 0xF00D)

SR = 48_000
SCRATCH_MS, CACHE_US = 5.0, 50.0


def example(modes: int = 60, seed: int = 1) -> tuple[Residual, StruckModes]:
    """A residual of half a second over the whole band, and another body's modes."""
    random = np.random.default_rng(seed)
    freq, time_s = np.geomspace(20.0, 22_000.0, 50), np.linspace(0.0, 0.5, 60)
    hz = np.sort(random.uniform(200.0, 16_000.0, modes))
    noise = 1e-7 * np.exp(-8.0 * time_s)[None] * np.ones((50, 1))
    lines = np.sort(random.uniform(300.0, 9000.0, 20))
    residual = Residual(
        hz,
        random.uniform(5.0, 60.0, modes),
        random.uniform(0.05, 1.0, modes),
        lines,
        np.full(20, 12.0),
        np.full(20, 0.05),
        freq,
        time_s,
        noise,
        1.0,
    )
    return residual, StruckModes(
        np.sort(random.uniform(200.0, 16_000.0, modes)),
        random.uniform(5.0, 60.0, modes),
        random.uniform(0.05, 1.0, modes),
    )


def once(residual: Residual, target: StruckModes, n: int = SR // 2) -> Array:
    """The paper's algorithm 1 from end to end."""
    freq, time_s = axes(n, SR, overlap=INVERSION_OVERLAP)
    power = transfer(source_power(residual), source_modes(residual), target, freq, time_s)
    return fade_window(n, SR) * invert(magnitude_of(power, SR), noise_phases(n, SEEDS[0]), n)


def best(work: Callable[[int], object], turns: int) -> tuple[float, float]:
    """Least and median processor time of a call, in s."""
    spent = []
    for k in range(turns):
        begun = time.thread_time()
        work(k)
        spent.append(time.thread_time() - begun)
    return min(spent), float(np.median(spent))


def main() -> int:
    """Print the table; 1 where it is slower than it may be."""
    residual, target = example()
    voice = make_voice(residual, target, SR)
    power = np.abs(np.random.default_rng(0).normal(size=(4096, len(voice.pairs.target_hz)))) + 1e-3

    def flat(f_tau: Array, _: bool) -> Array:
        return np.ones(len(f_tau))

    def strike(k: int) -> Array:
        return vary_grains(*place_grains(voice, power[0], 1e-4, False, flat), k)

    once(residual, target)
    strike(0)
    force = np.random.default_rng(2).normal(size=2 * SECTION)
    section_grain(voice, force, power[0], 0)
    rows = [
        (
            f"from scratch: transfer and {INVERSION_ITERATIONS} turns of inversion",
            best(lambda _: once(residual, target), 60),
            SCRATCH_MS * 1e-3,
        ),
        ("a body's voice: two grains and their spectra", best(lambda _: make_voice(residual, target, SR), 20), np.inf),
        (
            "a new place on a known body",
            best(lambda k: place_grains(voice, power[k + 1], 1e-4, False, flat), 200),
            np.inf,
        ),
        ("from the cache: place, grain, fresh variation", best(strike, 2000), CACHE_US * 1e-6),
        (f"{2 * SECTION} samples of rubbing", best(lambda k: section_grain(voice, force, power[k], k), 100), np.inf),
    ]
    print(f"{'0.5 s at 48 kHz, 60 modes':58s} {'least':>10s} {'median':>10s} {'allowed':>9s}")
    for name, (least, median), most in rows:
        print(
            f"{name:58s} {1e6 * least:8.0f} µs {1e6 * median:8.0f} µs "
            + (f"{1e6 * most:6.0f} µs" if np.isfinite(most) else "")
        )
    return int(any(median > most for _, (_, median), most in rows))


if __name__ == "__main__":
    sys.exit(main())
