"""Feature extraction measured: the paper's own test, mixtures in noise, real recordings.

.venv/bin/python studies/features.py paper [DRAWS]
    100 damped sinusoids without noise: worst errors over draws, rates, laws of d, phases
.venv/bin/python studies/features.py steps
    what each step buys, on one draw of that test and one mixture
.venv/bin/python studies/features.py mixtures [SEEDS]
    20, 40, 60 dB: found, false, error over the Cramér-Rao bound, truth of the spreads
.venv/bin/python studies/features.py real FOLDER
    every .flac, .wav and hits.npz below: count, strongest modes, processor time
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from sonic_bullet.lab.lines import exact_modes
from sonic_bullet.lab.lines.extraction import extract
from sonic_bullet.lab.lines.joint_lines import joint_lines, noise_rms
from sonic_bullet.lab.lines.shared_poles import start_poles
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError

SR = 44_100


def sound(freq: Array, decay: Array, amplitude: Array, phase: Array, count: int, sr: int = SR) -> Array:
    t = np.arange(count) / sr
    found = np.zeros(count)
    for f, d, a, p in zip(freq, decay, amplitude, phase, strict=True):
        found += a * np.exp(-d * t) * np.cos(2 * np.pi * f * t + p)
    return found


def hundred(
    seed: int, law: str = "uniform", phase: str = "any", sr: int = SR, seconds: float = 1.0, count: int = 100
) -> tuple[Array, Array, Array, Array]:
    """The paper's test: f uniform in 20 … 21 500 Hz, d in 0.1 … 1000 1/s."""
    rng = np.random.default_rng(seed)
    freq = rng.uniform(20, 21_500, count)
    decay = rng.uniform(0.1, 1000, count) if law == "uniform" else np.exp(rng.uniform(np.log(0.1), np.log(1000), count))
    amplitude = 10 ** rng.uniform(-1, 0, count)
    turn = rng.uniform(0, 2 * np.pi, count) if phase == "any" else np.full(count, -np.pi / 2)
    return freq, decay, amplitude, sound(freq, decay, amplitude, turn, int(seconds * sr), sr)


def mixture(seed: int, db: float) -> tuple[Array, Array, Array, float, Array]:
    """Twenty pairs of modes 0.3 to 5 % apart, 100 Hz to 12 kHz, d 1 to 100 1/s, in white noise db below the sound."""
    rng = np.random.default_rng(seed)
    lower = 100 * 120 ** ((np.arange(20) + rng.uniform(0, 0.7, 20)) / 20)
    freq = np.concatenate([lower, lower * (1 + np.exp(rng.uniform(np.log(0.003), np.log(0.05), 20)))])
    decay, amplitude = np.exp(rng.uniform(np.log(1), np.log(100), 40)), 0.05 * np.exp(rng.normal(0, 0.7, 40))
    clean = sound(freq, decay, amplitude, rng.uniform(0, 2 * np.pi, 40), SR)
    sigma = float(np.sqrt((clean**2).mean()) * 10 ** (-db / 20))
    return freq, decay, amplitude, sigma, clean + sigma * rng.standard_normal(SR)


def paper(draws: int) -> None:
    print(f"| sr | d | phase | draws | modes found | worst f | worst d | s of processor a draw |\n{'|---' * 8}|")
    for sr in (44_100, 48_000):
        for law in ("uniform", "logarithmic"):
            for phase in ("any", "sine"):
                counts: set[int] = set()
                worst, start = np.zeros(2), time.process_time()
                for seed in range(draws):
                    freq, decay, _, x = hundred(seed + sr, law, phase, sr, 1.0 + seed % 3)
                    found = extract(x, sr)
                    near = np.abs(found.freq_hz[:, None] - freq).argmin(axis=0)
                    counts.add(len(found.freq_hz))
                    worst = np.maximum(
                        worst,
                        [
                            np.abs(found.freq_hz[near] / freq - 1).max(),
                            np.abs(found.decay_per_s[near] / decay - 1).max(),
                        ],
                    )
                print(
                    f"| {sr} | {law} | {phase} | {draws} | {counts} | {worst[0]:.1e} | {worst[1]:.1e} | "
                    f"{(time.process_time() - start) / draws:.1f} |",
                    flush=True,
                )


def matched(got: Array, freq: Array, decay: Array) -> tuple[int, str]:
    """Found (k, 2) of f and d within a decay's width of the modes (m,), and relative errors of both: mean, median,
    worst.
    """
    width = np.maximum(decay / (2 * np.pi), 0.5)
    cost = np.minimum(np.abs(got[:, :1] - freq) / width, 10)
    i, j = linear_sum_assignment(cost)
    i, j = i[cost[i, j] < 1], j[cost[i, j] < 1]
    f, d = np.abs(got[i, 0] / freq[j] - 1), np.abs(got[i, 1] / decay[j] - 1)
    return len(i), " | ".join(f"{e.mean():.1e}, {np.median(e):.1e}, {e.max():.1e}" for e in (f, d))


def steps() -> None:
    full, noisy = hundred(0), mixture(1, 40.0)
    cases = {"100 sinusoids, no noise": (full[0], full[1], full[3]), "40 modes, 40 dB": (noisy[0], noisy[1], noisy[4])}
    print(
        "| recording | step | features | of the modes | false | f: mean, median, worst | d: mean, median, "
        f"worst | s |\n{'|---' * 8}|"
    )
    for name, (freq, decay, x) in cases.items():
        rows: list[tuple[str, Array]] = []
        times: list[float] = []

        def timed(
            label: str, pole: Array, start: float, rows: list[tuple[str, Array]] = rows, times: list[float] = times
        ) -> None:
            rows.append((label, np.stack([pole.imag / (2 * np.pi), -pole.real], axis=1)))
            times.append(time.process_time() - start)

        begun = time.process_time()
        pole = start_poles(x[None] / noise_rms(x[None], SR), SR, 20.0, 21_600.0)
        timed("poles by bands", pole, begun)
        if len(freq) == 100:
            begun = time.process_time()
            raw = exact_modes._poles(x[:1499], 500)
            assert raw is not None
            timed("poles by the rank of the whole", raw * SR, begun)
            polished = exact_modes.modes(x, SR)
            assert polished is not None
            timed("… polished jointly", polished.pole, begun)
        else:
            lines = joint_lines(x[None], SR, band_hz=(20.0, 21_600.0))
            timed("… the significant, refined jointly", lines.pole, begun)
        begun = time.process_time()
        found = extract(x, SR)
        rows.append(("the whole of `extract`", np.stack([found.freq_hz, found.decay_per_s], axis=1)))
        times.append(time.process_time() - begun)
        for (label, got), spent in zip(rows, times, strict=True):
            hits, said = matched(got, freq, decay)
            print(
                f"| {name} | {label} | {len(got)} | {hits} of {len(freq)} | {len(got) - hits} | {said} | {spent:.1f} |",
                flush=True,
            )


def mixtures(seeds: int) -> None:
    print(
        "| noise | found | false | f: median, 90 % over the bound | d | spread of normalised errors f, d | "
        f"s of processor a second of sound |\n{'|---' * 7}|"
    )
    for db in (20.0, 40.0, 60.0):
        errors: tuple[list[float], list[float]] = ([], [])
        normal: tuple[list[float], list[float]] = ([], [])
        tally, start = np.zeros(4, int), time.process_time()
        for seed in range(seeds):
            freq, decay, amplitude, sigma, x = mixture(seed, db)
            found = extract(x, SR, onset_s=0.0)
            bound = np.sqrt(8 * decay**3 / (SR * amplitude**2 / (2 * sigma**2)))
            width = np.maximum(10 * bound, 0.3 * decay) / (2 * np.pi)
            cost = np.minimum(np.abs(found.freq_hz[:, None] - freq) / width, 10)
            i, j = linear_sum_assignment(cost)
            i, j = i[cost[i, j] < 1], j[cost[i, j] < 1]
            audible = amplitude**2 * SR / (4 * decay * sigma**2) >= 16
            tally += [audible.sum(), audible[j].sum(), len(found.freq_hz), len(found.freq_hz) - len(i)]
            off = 2 * np.pi * (found.freq_hz[i] - freq[j]), found.decay_per_s[i] - decay[j]
            for k, sd in enumerate((2 * np.pi * found.freq_sd_hz[i], found.decay_sd_per_s[i])):
                errors[k].extend(np.abs(off[k]) / bound[j])
                normal[k].extend(off[k] / sd)
        said = " | ".join(f"{np.median(e):.2f}, {np.quantile(e, 0.9):.2f}" for e in errors)
        spread = ", ".join(f"{np.std(np.clip(v, -6, 6)):.2f}" for v in normal)
        print(
            f"| {db:.0f} dB | {tally[1]} of {tally[0]} ({100 * tally[1] / tally[0]:.1f} %) | {tally[3]} of "
            f"{tally[2]} ({100 * tally[3] / tally[2]:.1f} %)"
            f" | {said} | {spread} | {(time.process_time() - start) / seeds:.1f} |",
            flush=True,
        )


def real(folder: str) -> None:
    from sonic_bullet.files import read_audio

    print(
        "| recording | s | features | the three of most energy: Hz ± sd (d ± sd 1/s) | noise dBFS | "
        f"processor s | note |\n{'|---' * 7}|"
    )
    for path in sorted(p for p in Path(folder).rglob("*") if p.suffix in (".flac", ".wav") or p.name == "hits.npz"):
        if path.suffix == ".npz":
            held = np.load(path)
            channels, sr = held["accel"][:1].astype(float), int(held["fs_hz"])
        else:
            channels, sr = read_audio(path)
        x = channels[int(np.argmax((channels**2).sum(axis=1)))]
        start = time.process_time()
        try:
            r = extract(x, sr)
        except AudioError as error:
            print(
                f"| {path.relative_to(folder)} | {len(x) / sr:.1f} | error | {error} |  | "
                f"{time.process_time() - start:.1f} | |",
                flush=True,
            )
            continue
        top = np.argsort(-(r.amplitude**2) / np.maximum(r.decay_per_s, 1e-3), kind="stable")[:3]
        said = ", ".join(
            f"{r.freq_hz[k]:.1f} ± {r.freq_sd_hz[k]:.2g} ({r.decay_per_s[k]:.3g} ± {r.decay_sd_per_s[k]:.2g})"
            for k in top
        )
        name = str(path.relative_to(folder)).replace("/dev/", "/")
        spent = time.process_time() - start
        print(
            f"| {name} | {len(x) / sr:.1f} | {len(r.freq_hz)} | {said} | {r.noise_dbfs:.1f} | {spent:.1f} | "
            f"{r.note[:90]} |",
            flush=True,
        )


if __name__ == "__main__":
    what, rest = sys.argv[1] if len(sys.argv) > 1 else "mixtures", sys.argv[2:]
    {
        "paper": lambda: paper(int(rest[0]) if rest else 10),
        "steps": steps,
        "mixtures": lambda: mixtures(int(rest[0]) if rest else 10),
        "real": lambda: real(rest[0]),
    }[what]()
