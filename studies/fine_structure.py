"""Does what a take has within a band and time repeat from take to take, beside its lines, too?

    python -m studies.fine_structure --data ../shared/measured [OBJECT ...]

Cells of a spectrogram scatter about their level, that of a third of an octave and of a time (`signal/band_time.py`), as
phases happen to add: 5.6 dB, 20/ln 10 · π/√24, of many partials. With ρ the correlation of that scatter in two takes,
their distance cell by cell is

    D² = ΔL² + 2 · 5.57² (1 − ρ) dB²        ΔL: between their levels                                              (1)

ρ is 0 of noise, 1 of a response that repeats. A noise of the right level stands 7.9 dB from a take, another take as
near as its ρ lets it: no noise can follow where ρ is large, though its levels may be right.

whole: takes as they are. beside lines: less the lines that `fit` hears in the fitted ones, at amplitudes of each take's
own. Every pair of a fitted take and one held out; median over pairs. Windows of 2048 samples, cells 10 dB above the
noise; a slope over time and frequency is level. Two made noises stand first, that fall as the takes do.
"""

from __future__ import annotations

import argparse
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.measured import made_case, objects
from sonic_bullet.files.cases import read_case
from sonic_bullet.lab.fit.prediction_of_lines import damped_sum
from sonic_bullet.lab.fit.recorded import gather, recorded_signals
from sonic_bullet.lab.lines.joint_lines import lines_of, noise_rms
from sonic_bullet.records import Array
from sonic_bullet.signal.band_time import EDGES_S, THIRDS_HZ
from sonic_bullet.signal.log_spectral import floor_between, noise_spectra
from sonic_bullet.signal.short_time import short_time_power

WINDOW = 2048
CELLS = 12  # of a band and time, fewest
ABOVE = 10.0


def scatter(one: Array, other: Array, sr: int) -> tuple[float, float]:
    """Return ρ and the scatter in dB of the cells of two takes (n,) about their levels; NaN where there are few."""
    powers = [short_time_power(x, WINDOW, WINDOW // 4) for x in (one, other)]
    floors = [noise_spectra(floor_between([x]), (p,))[0] for x, p in zip((one, other), powers, strict=True)]
    loud = np.all([p > ABOVE * floor for p, floor in zip(powers, floors, strict=True)], axis=0)
    level = [10 * np.log10(np.maximum(p, 1e-300)) for p in powers]
    time = np.arange(loud.shape[0]) * (WINDOW // 4) / sr
    freq = np.arange(loud.shape[1]) * sr / WINDOW
    products: list[Array] = []
    for middle in THIRDS_HZ:
        band = np.flatnonzero(np.abs(3 * np.log2(np.maximum(freq, 1e-3) / middle)) < 0.5)
        for first, last in pairwise(EDGES_S):
            frame = np.flatnonzero((time >= first) & (time < last))
            use = loud[np.ix_(frame, band)]
            if use.sum() >= CELLS:
                place = np.stack([np.ones(use.shape), *np.meshgrid(time[frame], freq[band], indexing="ij")])[:, use]
                slope = np.linalg.qr(place.T)[0]
                a, b = (x - slope @ (slope.T @ x) for x in (y[np.ix_(frame, band)][use] for y in level))
                products.append(np.array([(a * a).sum(), (b * b).sum(), (a * b).sum(), use.sum()]))
    if not products:
        return float("nan"), float("nan")
    aa, bb, ab, count = np.sum(products, axis=0)
    return float(ab / np.sqrt(aa * bb)), float(np.sqrt((aa + bb) / 2 / count))


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("only", nargs="*")
    given = parser.parse_args()
    rng, fall = np.random.default_rng(0), np.exp(-20 * np.arange(48_000) / 48_000)
    made = [(fall + 1e-4) * rng.standard_normal(48_000) for _ in range(2)]
    print("two noises, T60 0.35 s: rho {:.2f}, scatter {:.1f} dB\n".format(*scatter(made[0], made[1], 48_000)))
    print(
        "| object | pairs | whole: ρ | scatter, dB | by (1) at one level | beside lines: ρ |\n|---|---|---|---|---|---|"
    )
    for thing in objects(given.data):
        if len(thing.takes) < 2 or (given.only and not any(word in thing.name for word in given.only)):
            continue
        with tempfile.TemporaryDirectory() as folder:
            case = read_case(made_case(thing, Path(folder) / "case"))
            e = gather(case, clipped=True)[0]
            if e.signals is None:
                continue
            rest = tuple(r for r in case.recordings if r.split == "holdout")
            held, _ = recorded_signals(case, e.thing, rest, e.hum_hz)
        n = min(e.signals.shape[1], *map(len, held))
        takes = np.stack([x[:n] for x in (*e.signals, *held)])
        own = lines_of(takes, noise_rms(takes, e.sr), e.lines.pole, e.sr, True)
        left = np.stack(
            [
                x - damped_sum(own.freq_hz, own.decay_per_s, a, n, e.sr)
                for x, a in zip(takes, own.amplitude, strict=True)
            ]
        )
        first = len(e.signals)
        pairs = [(i, j) for i in range(first) for j in range(first, len(takes))]
        whole, beside = (np.array([scatter(x[i], x[j], e.sr) for i, j in pairs]) for x in (takes, left))
        rho, wide = np.nanmedian(whole, axis=0)
        print(
            f"| {thing.name} | {len(pairs)} | {rho:.2f} | {wide:.1f} | {wide * np.sqrt(2 * (1 - rho)):.1f} | "
            f"{np.nanmedian(beside, axis=0)[0]:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
