"""How many modes can one core keep sounding in real time, and what do strikes, forces and many bodies cost?

    python benchmarks/bank_speed.py [--modes 2000 20000 150000] [--peers]

48 kHz, frames of 200 samples (physics at 240 Hz), double precision. Prints modes sustained in real time and ratios to
the plain ways to write the same bank, measured in the same run: scipy's lfilter a mode, numpy's exp of an outer
product, and the textbook numba loop. Best of several repeats, CPU time of this thread: other work on the machine
disturbs it less.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import njit
from scipy.signal import lfilter

from sonic_bullet.records import Array
from sonic_bullet.synth.bank import ModeSet, append, empty_bank

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.made.banks import Force, Strike, advance

SR, FRAME = 48_000, 200
FRAMES = 32  # 6400 samples: 25 of the bank's blocks
PULSE_S = 1e-4


def modes_of(rng: np.random.Generator, count: int) -> ModeSet:
    omega = 2 * np.pi * np.sort(np.exp(rng.uniform(np.log(100), np.log(20_000), count)))
    return ModeSet(omega, rng.uniform(0.5, 5.0, count), rng.normal(size=(1, count)) + 0j)


def best_s(run: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begin = time.thread_time()
        run()
        times.append(time.thread_time() - begin)
    return min(times)


def ours(sizes: list[int], strikes_per_s: float = 0.0, forced: bool = False, repeats: int = 5) -> float:
    """Seconds of CPU for FRAMES frames with all modes ringing."""
    rng = np.random.default_rng(0)
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [modes_of(rng, size) for size in sizes])
    advance(bank, state, 512, [Strike(b, 1.3, PULSE_S, rng.normal(size=size)) for b, size in enumerate(sizes)])
    gains = [rng.normal(size=size) for size in sizes]
    signal, progress = rng.normal(size=FRAME), np.linspace(0, 1, FRAME)
    plan = [
        [
            (int(rng.integers(len(sizes))), rng.uniform(0, FRAME - 1))
            for _ in range(rng.poisson(strikes_per_s * FRAME / SR))
        ]
        for _ in range(FRAMES)
    ]

    def run() -> None:
        for hits in plan:
            strikes = [Strike(b, state.at + late, PULSE_S, gains[b]) for b, late in hits]
            advance(
                bank,
                state,
                FRAME,
                strikes,
                [Force(b, signal, g, g) for b, g in enumerate(gains)] if forced else (),
                progress,
            )

    return best_s(run, repeats)


def by_lfilter(count: int) -> float:
    modes = modes_of(np.random.default_rng(0), count)
    pole = np.exp((-modes.decay_per_s + 1j * modes.omega_rad_s) / SR)
    memory = np.stack([pole.real, -(np.abs(pole) ** 2)], axis=1)
    silence = np.zeros(FRAME)

    def run() -> None:
        out = np.zeros(FRAME)
        for m in range(count):
            sound, memory[m] = lfilter([1.0], [1.0, -2 * pole[m].real, abs(pole[m]) ** 2], silence, zi=memory[m])
            out += sound

    return best_s(run, 3) * FRAMES


def by_outer(count: int) -> float:
    modes = modes_of(np.random.default_rng(0), count)
    s = (-modes.decay_per_s + 1j * modes.omega_rad_s) / SR
    return best_s(lambda: np.exp(np.multiply.outer(s, np.arange(FRAME))).real.sum(axis=0), 3) * FRAMES


@njit
def _textbook(state, pole, out):  # type: ignore[no-untyped-def]
    for m in range(len(pole)):
        z, p = state[m], pole[m]
        for n in range(len(out)):
            out[n] += z.real
            z *= p
        state[m] = z


def by_textbook(count: int) -> float:
    modes = modes_of(np.random.default_rng(0), count)
    pole, state = np.exp((-modes.decay_per_s + 1j * modes.omega_rad_s) / SR), np.ones(count, complex)
    _textbook(state, pole, np.zeros(FRAME))

    def run() -> None:
        for _ in range(FRAMES):
            _textbook(state, pole, np.zeros(FRAME))

    return best_s(run, 3)


def sustained(count: int, seconds: float) -> float:
    return count * FRAMES * FRAME / SR / seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--modes", type=int, nargs="+", default=[2_000, 20_000, 150_000, 300_000])
    chosen: Array = np.array(parser.parse_args().modes)
    plain = {
        "lfilter a mode": sustained(300, by_lfilter(300)),
        "numpy exp outer": sustained(300, by_outer(300)),
        "textbook numba": sustained(2_000, by_textbook(2_000)),
    }
    for name, rate in plain.items():
        print(f"{name:34s} {rate / 1e3:8.1f} k modes in real time")
    for count in chosen:
        sizes = [int(min(200, count))] * max(1, int(count) // 200)
        rate = sustained(sum(sizes), ours(sizes))
        ratios = ", ".join(f"{rate / other:.1f} x {name}" for name, other in plain.items())
        print(f"bank, {sum(sizes):6d} modes ringing          {rate / 1e3:8.1f} k modes in real time   ({ratios})")
    sizes = [300] * 20
    free, hit, pushed = ours(sizes), ours(sizes, strikes_per_s=1000), ours(sizes, forced=True)
    second = FRAMES * FRAME / SR
    print(
        f"20 bodies of 300 modes: ringing {free / second:.1%} of real time; with 1000 strikes/s "
        f"{hit / second:.1%}; with a force on each {pushed / second:.1%}"
    )
    print(
        f"one strike on 300 modes, all in: {(hit - free) / (1000 * second) * 1e6:.0f} us; one sample of one "
        f"forced mode: {(pushed - free) / (6000 * FRAMES * FRAME) * 1e9:.2f} ns"
    )
    rng = np.random.default_rng(1)
    uneven = [int(size) for size in rng.integers(5, 301, 1000)]
    many, one = ours(uneven, repeats=7), ours([sum(uneven)], repeats=7)
    print(f"1000 bodies of 5 to 300 modes against one body of {sum(uneven)}: {many / one:.2f} x the time")
    bank, state = empty_bank(SR)
    bank, state = append(bank, state, [modes_of(rng, size) for size in uneven])
    silent = best_s(lambda: advance(bank, state, FRAME), 20)
    print(f"the same 1000 bodies silent: {silent / (FRAME / SR):.2%} of real time")


if __name__ == "__main__":
    main()
