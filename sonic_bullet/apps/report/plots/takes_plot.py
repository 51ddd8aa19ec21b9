"""Picture of the takes cut: each recording's envelope, its takes shaded in turn, each strike numbered."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sonic_bullet.files import replace_file
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class DrawnRecording:
    """A recording (n,), and the samples of each strike, of the start and of the end of its take."""

    name: str
    signal: Array
    sr: int
    bounds: list[tuple[int, int, int]]


def write_takes_picture(path: Path, recordings: list[DrawnRecording]) -> None:
    """Draw recordings and their takes to .png, .pdf or .svg. Raises FileError."""
    envelope_columns = 2000  # of an envelope: more than a picture is wide
    lowest_db = -80.0
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 1 + 2 * len(recordings)), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, one in zip(figure.subplots(len(recordings), squeeze=False)[:, 0], recordings, strict=True):
        step = max(1, len(one.signal) // envelope_columns)
        block = np.abs(one.signal[: len(one.signal) // step * step]).reshape(-1, step).max(axis=1)
        time = np.arange(len(block)) * step / one.sr
        axes.plot(time, 20 * np.log10(np.maximum(block, 10 ** (lowest_db / 20))), linewidth=0.7, color="k")
        for k, (strike, start, stop) in enumerate(one.bounds, 1):
            axes.axvspan(start / one.sr, stop / one.sr, color=f"C{k % 2}", alpha=0.2, linewidth=0)
            axes.axvline(strike / one.sr, color="C3", linewidth=1)
            axes.annotate(
                str(k), (strike / one.sr, 1), (3, -11), ("data", "axes fraction"), "offset points", fontsize=8
            )
        axes.set(title=one.name, xlabel="time in s", ylabel="peak in dBFS", ylim=(lowest_db, 3), xlim=(0, time[-1]))
    with replace_file(path) as file:
        figure.savefig(file, format=path.suffix[1:], dpi=110)
