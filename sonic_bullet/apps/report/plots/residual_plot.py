"""Picture of a residual: recorded, its features, synthesised, represented, and left [Ren, Yeh, Lin 2013, Fig. 7].

above: spectrograms of one strike;
    below: features and modes in the (f, d) plane, features filled by the fraction of them that is represented
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from sonic_bullet.engine.residual.offline import clip_residual, synthesize_lines
from sonic_bullet.files import replace_file
from sonic_bullet.lab.residual.recorded_strikes import Strikes
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError
from sonic_bullet.signal.spectrogram import Power, power


def write_residual_picture(path: str | os.PathLike[str], strikes: Strikes) -> None:
    """Draw the first strike to .png, .pdf or .svg. Raises FileError."""
    window = 1024
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    kind = os.fspath(path).rsplit(".", 1)[-1]
    if kind not in ("png", "pdf", "svg"):
        raise FileError(f"cannot write {path}: pictures are .png, .pdf or .svg", "end the name with one of them")
    sound, sr, n = strikes.signals[0], strikes.sr, strikes.signals.shape[1]
    features, share = strikes.amplitude[0], strikes.share
    parts = {
        "features": synthesize_lines(strikes.freq_hz, strikes.decay_per_s, features, n, sr),
        "synthesised": synthesize_lines(strikes.mode_hz, strikes.mode_decay_per_s, strikes.mode_amplitude[0], n, sr),
        "represented": synthesize_lines(strikes.freq_hz, strikes.decay_per_s, features * share, n, sr),
    }
    shown = {"recorded": power(sound, sr, window)} | {name: power(x, sr, window) for name, x in parts.items()}
    shown["residual"] = clip_residual(sound, parts["represented"], sr, window=window)[0]
    top = 10 * float(np.log10(shown["recorded"].per_hz.max()))
    figure = Figure(figsize=(15, 8), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 5)
    for column, (name, one) in enumerate(shown.items()):
        axes = figure.add_subplot(grid[0, column])
        _spectrogram(axes, one, top)
        axes.set(title=name, xlabel="s", ylabel="kHz" if column == 0 else "")
    axes = figure.add_subplot(grid[1, :])
    _plane(axes, strikes, np.abs(features), share)
    with replace_file(path) as file:
        figure.savefig(file, format=kind, dpi=110)


def _spectrogram(axes: Any, one: Power, top: float) -> None:
    dynamics_db = 80.0
    level = 10 * np.log10(one.per_hz + 1e-30) - top
    extent = (0, one.time_s[-1], 0, one.freq_hz[-1] / 1000)
    axes.imshow(level, origin="lower", aspect="auto", extent=extent, vmin=-dynamics_db, vmax=0, cmap="magma")


def _plane(axes: Any, strikes: Strikes, amplitude: Array, share: Array) -> None:
    size = (
        20 + 6 * np.clip(20 * np.log10(amplitude / amplitude.max() + 1e-9) + 60, 0, 60) if len(amplitude) else amplitude
    )
    drawn = axes.scatter(
        strikes.freq_hz / 1000,
        strikes.decay_per_s,
        size,
        share,
        cmap="Blues",
        vmin=0,
        vmax=1,
        edgecolors="b",
        label="features",
    )
    axes.plot(strikes.mode_hz / 1000, strikes.mode_decay_per_s, "r+", label="modes played")
    axes.plot(
        strikes.residual.line_freq_hz / 1000,
        strikes.residual.line_decay_per_s,
        "k.",
        ms=4,
        label="lines of the residual",
    )
    axes.figure.colorbar(drawn, ax=axes, label="share represented")
    axes.set(xlabel="kHz", ylabel="decay in 1/s", yscale="log", title=strikes.residual.source[:140])
    axes.legend(fontsize=8)
