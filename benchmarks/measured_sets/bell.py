"""One stroke of a bell: is a line one mode or two?

The first part of each line's course fitted, the later part predicted.

z(t) of a line, shifted to 0 Hz    before: a e^{(−d + iδ)t}     after: mode-splitting, two such
    null: the second one's δ drawn by lot
error: median |20 lg |z'|/|z|| over the held-out part, where the line stands clear of the noise
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured_sets.observed import cut, lines
from benchmarks.measured_sets.values import Array, Outcome, Row, clear

FITTED_S, HELD_S = 1.2, 2.4
BANDWIDTH_HZ = 25.0
MOST = 6
NULLS = 40


def judge(folder: Path, case: dict[str, Any]) -> Outcome:
    """Each channel's strongest lines. Raises ValueError where none rings long enough."""
    entry = case["files"][0]
    rows, drawn, said = [], [], []
    rng = np.random.default_rng(0)
    for channel in range(min(int(entry.get("channels", 1)), 2)):
        found = clear(
            lines(
                folder / entry["file"],
                channel=channel,
                start_s=0.003,
                seconds=1.5,
                onset_s=0.0,
                band_hz=(1000.0, 12000.0),
            ),
            apart=0.004,
        )
        strong = np.argsort(-(found.amplitude**2) / found.decay_per_s)[:MOST]
        signal, sr = cut(folder / entry["file"], channel, 0.05, HELD_S)
        for k in strong[np.argsort(found.freq_hz[strong])]:
            made = course(signal, sr, float(found.freq_hz[k]))
            if made is None:
                continue
            t, z, fit = made
            one, two = modes(t[fit], z[fit], 1), modes(t[fit], z[fit], 2)
            before, after = off(one, t, z, ~fit), off(two, t, z, ~fit)
            nulls = np.array(
                [
                    off(np.array([one[0], one[0] + 2j * np.pi * rng.uniform(-12, 12)]), t, z, ~fit, (t[fit], z[fit]))
                    for _ in range(NULLS)
                ]
            )
            apart = abs((two[0] - two[1]).imag) / (2 * np.pi)
            name = f"channel {channel}, {found.freq_hz[k]:.0f} Hz"
            rows.append(
                Row(
                    name,
                    int((~fit).sum()),
                    "dB of |z|",
                    before,
                    after,
                    float(np.median(nulls)),
                    float((nulls <= after).mean()),
                    "mode-splitting",
                )
            )
            said.append(f"{name}: {apart:.2f} Hz apart ({100 * apart / found.freq_hz[k]:.3f} %)")
            drawn.append((name, t, z, one, two, fit))
    if not rows:
        raise ValueError("no line stands clear of the noise for long enough")
    text = (
        f"The first {FITTED_S} s of each line fitted, the next {HELD_S - FITTED_S:.1f} s predicted. "
        + "; ".join(said)
        + "."
    )
    left = (
        "one stroke at one place: which way the pairs lie on the rim, and which imperfection parts them, needs "
        "strokes round the rim"
    )
    return Outcome(tuple(rows), text, left, lambda figure: paint(figure, drawn[0]))


def course(signal: Array, sr: int, freq_hz: float) -> tuple[Array, Array, Array] | None:
    """t, z and which of them is fitted, at 4 values a bandwidth; None where the line is lost in noise before half of
    the held-out part.
    """
    n = int(2 * sr / BANDWIDTH_HZ) | 1
    window = np.hanning(n + 2)[1:-1]
    window /= window.sum()
    t = np.arange(len(signal)) / sr
    z = np.convolve(2 * signal * np.exp(-2j * np.pi * freq_hz * t), window, mode="valid")[:: n // 4]
    t = t[n // 2 : n // 2 + len(signal) - n + 1][:: n // 4]
    floor = 3 * np.abs(z[-4:]).min()
    clear_of = np.abs(z) > max(floor * 0.2, 1e-6)
    t, z = t[clear_of], z[clear_of]
    fit = t < FITTED_S
    return (t, z, fit) if fit.sum() > 8 and (~fit).sum() > 8 else None


def modes(t: Array, z: Array, order: int) -> Array:
    """Poles (order,) in 1/s of a course at even steps: linear prediction by total least squares [Hua & Sarkar 1990]."""
    step, half = float(np.median(np.diff(t))), len(z) // 2
    rows = np.lib.stride_tricks.sliding_window_view(z, half + 1)
    _, _, v = np.linalg.svd(rows, full_matrices=False)
    signal = v[:order].conj().T
    turn = np.linalg.lstsq(signal[:-1], signal[1:], rcond=None)[0]
    pole = np.log(np.linalg.eigvals(turn).conj()) / step
    return np.asarray(np.minimum(pole.real, 0.0) + 1j * pole.imag)


def off(pole: Array, t: Array, z: Array, held: Array, told: tuple[Array, Array] | None = None) -> float:
    """Median |20 lg| on the held-out part; amplitudes by least squares on the fitted one."""
    a, b = told if told is not None else (t[~held], z[~held])
    size = np.linalg.lstsq(np.exp(np.multiply.outer(a, pole)), b, rcond=None)[0]
    made = np.exp(np.multiply.outer(t[held], pole)) @ size
    return float(np.median(np.abs(20 * np.log10(np.maximum(np.abs(made), 1e-9) / np.abs(z[held])))))


def paint(figure: Any, drawn: tuple[str, Array, Array, Array, Array, Array]) -> None:
    name, t, z, one, two, fit = drawn
    axes = figure.subplots()
    axes.plot(t, 20 * np.log10(np.abs(z)), ".", ms=3, color="0.4", label="heard")
    for pole, style, label in ((one, "--", "one mode"), (two, "-", "two")):
        size = np.linalg.lstsq(np.exp(np.multiply.outer(t[fit], pole)), z[fit], rcond=None)[0]
        axes.plot(t, 20 * np.log10(np.abs(np.exp(np.multiply.outer(t, pole)) @ size)), style, lw=1, label=label)
    axes.axvline(FITTED_S, color="C3", lw=0.8)
    axes.set_xlabel("s (right of the line: held out)")
    axes.set_ylabel("dB")
    axes.set_title(name, fontsize=8)
    axes.legend(fontsize=6)
