"""Command `features`: the damped sinusoids of a recording, each with its spread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.apps.cli.line_table import decay_cells, decay_values, finite, write_csv
from sonic_bullet.apps.cli.output import clean_stdout, places, print_report, status, table, warn, write_json
from sonic_bullet.files import read_channel, replace_file
from sonic_bullet.lab.lines.line_values import Features
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.options.states import FeatureOptions
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, FileError

LINE_NUMBERS = ("freq_hz", "decay_per_s", "amplitude", "freq_sd_hz", "decay_sd_per_s", "amplitude_sd")


def run_features(recording: str, options: FeatureOptions) -> None:
    """Run `features`; raises SonicBulletError."""
    picture, channel = options.picture, options.channel
    decays = ("t60_s", "t60_sd_s", "loss_factor", "loss_factor_sd", "q", "q_sd")
    if picture is not None and not picture.endswith((".png", ".pdf", ".svg")):
        raise FileError(f"cannot write {picture}: pictures are .png, .pdf or .svg", "end the name with one of them")
    picture, json_to, csv_to = places(picture, options.json_to, options.csv_to)
    observed, sr, which = read_channel(recording, channel)
    warn(f"{recording}: {words}" for words in [which] if words)
    with clean_stdout(json_to) as echo:
        from sonic_bullet.lab.lines.extraction import extract

        with status(recording):
            report_progress("looking for modes")
            try:
                found = extract(observed, sr, onset_s=options.onset_s, band_hz=options.band)
            except AudioError as error:
                raise AudioError(f"{recording}: {error.what}", error.remedy) from error
        notes = "; ".join(filter(None, (which, found.note)))
        if picture is not None:
            _draw(picture, observed, sr, found)
        report = FeatureReport(recording, found, notes, bool(found.note) or (bool(which) and channel is None))
        print_report(report, echo)
    warn(f"{recording}: {note}" for note in [found.note] if note)
    write_csv(csv_to, report.rows(), (*LINE_NUMBERS, *decays))
    write_json(json_to, report.to_json())


@dataclass(frozen=True, slots=True)
class FeatureReport:
    """Report of the features of a recording. doubtful: a note puts them in doubt."""

    recording: str
    found: Features
    notes: str
    doubtful: bool

    def to_json(self) -> dict[str, Any]:
        """Return features, onset and noise; null for a spread that is not known."""
        rows = self.rows()
        verdict = "features" if rows and not self.doubtful else "doubtful" if rows else "no features"
        return {
            "features": rows,
            "onset_s": self.found.onset_s,
            "noise_dbfs": self.found.noise_dbfs,
            "sr": self.found.sr,
            "verdict": verdict,
            "note": self.notes,
        }

    def lines(self) -> list[str]:
        """Return onset and noise, and a table of the features."""
        order, values = np.argsort(self.found.freq_hz), self.rows()
        rows = [
            (
                f"{self.found.freq_hz[k]:.3f}",
                f"{self.found.freq_sd_hz[k]:.2g}",
                f"{self.found.decay_per_s[k]:.4g}",
                f"{self.found.decay_sd_per_s[k]:.2g}",
                *decay_cells(values[k]),
                f"{20 * np.log10(self.found.amplitude[k]):.1f}",
            )
            for k in order
        ]
        head = f"{self.recording}: {format_count(len(rows), 'feature')}, onset at {self.found.onset_s:.4f} s, "
        head += f"noise {self.found.noise_dbfs:.1f} dBFS"
        return [head, table(("Hz", "±", "decay 1/s", "±", "T60 s", "loss factor", "Q", "dBFS"), rows)]

    def rows(self) -> list[dict[str, float | int | None]]:
        """Return a row a feature, strongest first, with T60, η and Q of its decay; None for a spread not known."""
        columns = [getattr(self.found, name) for name in LINE_NUMBERS]
        return [
            {name: finite(column[k]) for name, column in zip(LINE_NUMBERS, columns, strict=True)}
            | decay_values(self.found.freq_hz[k], self.found.decay_per_s[k], self.found.decay_sd_per_s[k])
            for k in range(len(self.found.freq_hz))
        ]


def _draw(path: str, sound: Array, sr: int, found: Features) -> None:
    """Draw the spectrogram with a line a feature, as long as its decay by 60 dB, and the (f, d) plane."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from sonic_bullet.apps.report.plots.scene_plot import spectrogram_db  # the run time is loaded with it

    figure = Figure(figsize=(11, 5), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    freq, time, level = spectrogram_db(sound, sr)
    left.pcolormesh(
        time,
        freq / 1000,
        level,
        vmin=level.max() - 90,
        vmax=level.max(),
        cmap="magma",
        shading="nearest",
        rasterized=True,
    )
    last = np.minimum(found.onset_s + 6.9 / np.maximum(found.decay_per_s, 1e-3), time[-1])
    left.hlines(found.freq_hz / 1000, found.onset_s, last, colors="c", linewidth=0.7)
    # the spread across, at the middle of each line
    left.errorbar(
        (found.onset_s + last) / 2,
        found.freq_hz / 1000,
        yerr=np.nan_to_num(found.freq_sd_hz) / 1000,
        fmt="none",
        ecolor="c",
        elinewidth=0.7,
        capsize=2,
    )
    left.set(xlabel="time in s", ylabel="frequency in kHz", title="recording, features down to -60 dB")
    right.errorbar(
        found.freq_hz / 1000, found.decay_per_s, yerr=found.decay_sd_per_s, fmt="o", markersize=3, linewidth=0.7
    )
    right.set(xlabel="frequency in kHz", ylabel="decay in 1/s", yscale="log", title="decay over frequency")
    with replace_file(path) as file:
        figure.savefig(file, format=path.rsplit(".", 1)[1], dpi=110)
