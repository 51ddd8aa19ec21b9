"""Damped sinusoids as rows: acoustic quantities of a decay d, with their spreads.

T60 = ln(1000)/d,  η = 2d/ω,  Q = 1/η                                               [Cremer, Heckl & Petersson 2005]
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from typing import Any

from sonic_bullet.apps.cli.output import table

Row = dict[str, float | int | None]


def decay_values(freq_hz: float, decay_per_s: float, decay_sd_per_s: float) -> Row:
    """Return T60 in s, loss factor η and quality factor Q of a line, each with its spread.

    None for an unknown value, as of a decay not larger than its spread.
    """
    known = math.isfinite(decay_per_s) and decay_per_s > (decay_sd_per_s if math.isfinite(decay_sd_per_s) else 0)
    values = {
        "t60_s": math.log(1000) / decay_per_s if known else math.nan,
        "loss_factor": decay_per_s / (math.pi * freq_hz) if known else math.nan,
        "q": math.pi * freq_hz / decay_per_s if known else math.nan,
    }
    relative = decay_sd_per_s / decay_per_s if known else math.nan
    row: Row = {}
    for name, value in values.items():
        unit = name.removeprefix("t60")
        row[name] = finite(value)
        row[f"t60_sd{unit}" if name == "t60_s" else f"{name}_sd"] = finite(value * relative)
    return row


def finite(value: float) -> float | None:
    """Return a number, or None for NaN and infinity, which JSON lacks."""
    return float(value) if math.isfinite(value) else None


def decay_cells(row: Row) -> tuple[str, str, str]:
    """Format T60, η and Q for a table."""

    def format_value(name: str) -> str:
        return "?" if row[name] is None else f"{row[name]:.3g}"

    return format_value("t60_s"), format_value("loss_factor"), format_value("q")


def write_csv(path: str | None, rows: Sequence[dict[str, Any]], columns: Sequence[str]) -> None:
    """Write rows with a header line, None as an empty field; a path of None: nowhere; raises FileError."""
    if path is None:
        return

    from sonic_bullet.files import replace_file

    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(columns), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with replace_file(path) as file:
        file.write(text.getvalue().encode())


def take_tables(takes: Any) -> list[str]:
    """Format how near the prediction of each take is; empty where no take could be compared."""
    from sonic_bullet.lab.fit.case_fit import NO_GAIN

    if not takes:
        return []

    def format_value(value: float) -> str:
        return f"{value:.1f} dB" if math.isfinite(value) else "-"

    held = all(t.split == "holdout" for t in takes)
    head = "takes that were not fitted" if held else "takes, as none is held out"
    guessed = any(math.isfinite(t.plausible_db) for t in takes)
    leveled = any(math.isfinite(t.levels_db) for t in takes)
    columns = (
        "predicted",
        "silence",
        "nearest other take",
        *(["the guessed material"] if guessed else []),
        *(["levels, with noise", "of another take"] if leveled else []),
        "gain",
    )
    rows = [
        (
            t.file,
            format_value(t.predicted_db),
            format_value(t.silence_db),
            format_value(t.other_take_db),
            *([format_value(t.plausible_db)] if guessed else []),
            *([format_value(t.levels_db), format_value(t.other_take_levels_db)] if leveled else []),
            ("fitted" if t.gain else NO_GAIN) if t.free_gain else "known",
        )
        for t in takes
    ]
    return [table((head, *columns), rows)]
