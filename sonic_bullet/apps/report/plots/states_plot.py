"""Picture of two states: spectra with an arrow a line that moved, T60 over frequency, and the difference over time.

A row a comparison. Spectra are means over takes whose own gains are taken off; the difference is of thirds of octaves,
where either stands above the noise.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.files import replace_file
from sonic_bullet.lab.states.changes import Changes
from sonic_bullet.lab.states.state_causes import shifts
from sonic_bullet.lab.states.state_comparison import ComparedStates
from sonic_bullet.records import Array
from sonic_bullet.signal.band_time import EDGES_S, THIRDS_HZ, band_time, cell_levels

BEFORE, AFTER = "#2a6fb0", "#c8541a"


def write_states_picture(path: Path, found: ComparedStates) -> None:
    """Draw compared states to .png, .pdf or .svg. Raises FileError."""
    figure = draw_states(found)
    with replace_file(path) as file:
        figure.savefig(file, format=path.suffix[1:], dpi=100)


def states_picture_png(found: ComparedStates) -> bytes:
    """Return the picture as PNG."""
    held = io.BytesIO()
    draw_states(found).savefig(held, format="png", dpi=80)
    return held.getvalue()


def draw_states(found: ComparedStates) -> Any:
    """Draw a row of three axes for each comparison."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    count = len(found.comparisons)
    figure = Figure(figsize=(14, 0.4 + 3.6 * count), layout="constrained")
    FigureCanvasAgg(figure)
    for row, one in zip(figure.subplots(count, 3, squeeze=False), found.comparisons, strict=True):
        changes = one.changes
        title = f"{changes.before.state.name} → {changes.after.state.name}: {one.verdict}"
        _draw_spectra(row[0], changes, title)
        _draw_decays(row[1], changes)
        _draw_difference(row[2], changes)
    return figure


def _draw_spectra(axes: Any, changes: Changes, title: str) -> None:
    for values, gain, colour in (
        (changes.before, changes.gain_db[0], BEFORE),
        (changes.after, changes.gain_db[1], AFTER),
    ):
        freq, level = _mean_spectrum(values.state, gain)
        axes.plot(freq / 1000, level, color=colour, linewidth=0.7, label=values.state.name)
    top = axes.get_ylim()[1]
    for k, row in enumerate(shifts(changes)):
        height = top - 4 - 5 * (k % 4)
        axes.annotate(
            "",
            (row.after / 1000, height),
            (row.before / 1000, height),
            arrowprops={"arrowstyle": "->", "color": "k", "linewidth": 0.9},
        )
        axes.text(row.before / 1000, height + 0.5, f"{row.change:+.3g} %", fontsize=6)
    axes.set(xscale="log", xlabel="kHz", ylabel="dB", title=title, ylim=(top - 90, top + 3))
    axes.legend(fontsize=7, loc="lower left")


def _mean_spectrum(state: Any, gain_db: Array) -> tuple[Array, Array]:
    n = min(*(len(take.signal) for take in state.takes), state.sr)
    window = np.hanning(2 * n)[n:]
    power = [
        np.abs(np.fft.rfft(take.signal[:n] * window)) ** 2 * 10 ** (-gain / 10)
        for take, gain in zip(state.takes, gain_db, strict=True)
    ]
    freq = np.fft.rfftfreq(n, 1 / state.sr)
    keep = freq > 30
    return freq[keep], 10 * np.log10(np.mean(power, axis=0)[keep] + 1e-20)


def _draw_decays(axes: Any, changes: Changes) -> None:
    for kind, mark in (("line T60", "."), ("octave T60", "s")):
        for row in changes.of(kind, certain=False):
            strong = 1.0 if row.certain else 0.35
            axes.plot([row.freq_hz / 1000] * 2, [row.before, row.after], color="0.6", linewidth=0.8, alpha=strong)
            axes.plot(row.freq_hz / 1000, row.before, mark, color=BEFORE, alpha=strong, markersize=5)
            axes.plot(row.freq_hz / 1000, row.after, mark, color=AFTER, alpha=strong, markersize=5)
    axes.set(
        xscale="log", yscale="log", xlabel="kHz", ylabel="s", title="T60: lines ·, octaves ▪; pale: as takes differ"
    )


def _draw_difference(axes: Any, changes: Changes) -> None:
    sounds = [
        [band_time(take.signal, values.state.sr) for take in values.state.takes]
        for values in (changes.before, changes.after)
    ]
    noise = np.max([one.noise for some in sounds for one in some], axis=0)
    levels = [
        np.nanmean([cell_levels(one, noise) - g for one, g in zip(some, gain, strict=True)], axis=0)
        for some, gain in zip(sounds, changes.gain_db, strict=True)
    ]
    floor = 10 * np.log10(np.maximum(noise, 1e-30))[:, None] + 3
    shown = np.where(np.maximum(*levels) > floor, levels[1] - levels[0], np.nan)
    edges = THIRDS_HZ[: len(shown)] * 2 ** (-1 / 6) / 1000
    edges = np.append(edges, edges[-1] * 2 ** (1 / 3))
    times = np.array([EDGES_S[1] / 2, *EDGES_S[1:]])
    image = axes.pcolormesh(times, edges, shown, cmap="RdBu_r", vmin=-15, vmax=15)
    axes.set(xscale="log", yscale="log", xlabel="s after the onset", ylabel="kHz", title="after − before, dB")
    axes.figure.colorbar(image, ax=axes)
