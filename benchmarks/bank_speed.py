"""How many modes can one core keep sounding in real time, and what do strikes, forces and many bodies cost?

    python benchmarks/bank_speed.py [--modes 2000 20000 150000]

48 kHz, frames of 200 samples (physics at 240 Hz), double precision. Prints modes sustained in real time and ratios to
the plain ways to write the same bank (`benchmarks/peers/plain_python.py`), measured in the same run. Best of several
repeats, processor time of this thread: other work on the machine disturbs it less.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks.peers.plain_python import FRAME, best_s, by_lfilter, by_outer
from benchmarks.peers.tools import SR
from sonic_bullet._engine import advance_bank
from sonic_bullet.engine.bank import FLOOR, ModeSet, append, empty_bank
from sonic_bullet.records import Array
from tests.made.banks import Force, Strike, advance, step_scratch, tables

FRAMES = 32  # 6400 samples: 25 of the bank's blocks
PULSE_S = 1e-4


def modes_of(rng: np.random.Generator, count: int) -> ModeSet:
    omega = 2 * np.pi * np.sort(np.exp(rng.uniform(np.log(100), np.log(20_000), count)))
    return ModeSet(omega, rng.uniform(0.5, 5.0, count), rng.normal(size=(1, count)) + 0j)


def ours(sizes: list[int], strikes_per_s: float = 0.0, forced: bool = False, repeats: int = 5) -> float:
    """Seconds of CPU for FRAMES frames with all modes ringing."""
    rng = np.random.default_rng(0)
    bank, state = empty_bank(SR, radiates=np.ones(1, bool))
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


def ringing(sizes: list[int], repeats: int = 5) -> float:
    """Seconds of CPU for FRAMES frames with all modes ringing free, called as the driver calls the bank: into
    buffers that stay.
    """
    rng = np.random.default_rng(0)
    bank, state = empty_bank(SR, radiates=np.ones(1, bool))
    bank, state = append(bank, state, [modes_of(rng, size) for size in sizes])
    advance(bank, state, 512, [Strike(b, 1.3, PULSE_S, rng.normal(size=size)) for b, size in enumerate(sizes)])
    scratch, group = step_scratch(bank, FRAME), tables(bank, state)
    scratch.sounds[:] = 1
    along = np.zeros(FRAME)

    def run() -> None:
        for _ in range(FRAMES):
            advance_bank(state.at, FRAME, float(SR), along, group, scratch)
            state.at += FRAME

    return best_s(run, repeats)


def sustained(count: int, seconds: float) -> float:
    """Modes in real time, of so many that took so long for FRAMES frames."""
    return count * FRAMES * FRAME / SR / seconds


def bank_modes_sustained(count: int = 20_000) -> float:
    """Modes that one core keeps ringing in real time, in bodies of 200."""
    sizes = [min(200, count)] * max(1, count // 200)
    return sustained(sum(sizes), ringing(sizes))


def growth(few: int = 10_000, many: int = 1_000_000) -> float:
    """Time a mode among many over that among few."""
    few_s, many_s = (ringing([200] * max(1, count // 200), repeats=3) for count in (few, many))
    return many_s / max(1, many // 200) / (few_s / max(1, few // 200))


def envelope_error(seconds: int = 10) -> float:
    """Greatest deviation from the closed form over the mode's envelope, f 20 Hz … 20 kHz times T60 0.05 … 20 s.

    One mode a body, each while its envelope is above ten times the bank's floor.

    q̇ = e^{-dt}(cos ωt - (d/ω) sin ωt) of a unit impulse at 0; whole turns are taken off in extended precision.
    """
    grid = np.meshgrid(np.geomspace(20, 20_000, 13), np.geomspace(0.05, 20, 9))
    omega, decay = 2 * np.pi * grid[0].ravel(), np.log(1000) / grid[1].ravel()
    bank, state = empty_bank(SR, radiates=np.ones(1, bool))
    one = np.ones((1, 1), complex)
    bank, state = append(bank, state, [ModeSet(omega[i : i + 1], decay[i : i + 1], one) for i in range(len(omega))])
    short = 1e-12  # samples: a pulse so short is an impulse
    strikes = [Strike(i, -short, short / SR, np.ones(1)) for i in range(len(omega))]
    worst = 0.0
    for second in range(seconds):
        sound = advance(bank, state, SR, strikes if second == 0 else ())[0]
        time_s = (second * SR + np.arange(0, SR, 7)) / SR
        phase = np.multiply.outer(omega.astype(np.longdouble), time_s.astype(np.longdouble))
        phase = (phase % (2 * np.longdouble(np.pi))).astype(float)
        envelope = np.exp(-np.multiply.outer(decay, time_s))
        wanted = envelope * (np.cos(phase) - (decay / omega)[:, None] * np.sin(phase))
        size = envelope * np.hypot(1, decay / omega)[:, None]
        alive = envelope > 10 * FLOOR
        off = np.abs(sound[:, ::7] - wanted)[alive] / size[alive]
        worst = max(worst, float(off.max(initial=0)))
    return worst


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--modes", type=int, nargs="+", default=[2_000, 20_000, 150_000, 300_000])
    chosen: Array = np.array(parser.parse_args().modes)
    plain = {
        "lfilter a mode": by_lfilter(),
        "numpy exp outer": by_outer(),
    }
    for name, rate in plain.items():
        print(f"{name:34s} {rate / 1e3:8.1f} k modes in real time")
    for count in chosen:
        rate = bank_modes_sustained(int(count))
        ratios = ", ".join(f"{rate / other:.1f} x {name}" for name, other in plain.items())
        print(f"bank, {count:6d} modes ringing          {rate / 1e3:8.1f} k modes in real time   ({ratios})")
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
    bank, state = empty_bank(SR, radiates=np.ones(1, bool))
    bank, state = append(bank, state, [modes_of(rng, size) for size in uneven])
    silent = best_s(lambda: advance(bank, state, FRAME), 20)
    print(f"the same 1000 bodies silent: {silent / (FRAME / SR):.2%} of real time")


if __name__ == "__main__":
    main()
