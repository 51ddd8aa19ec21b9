"""Do the recovered α, β, γ, σ hang on the metric's free constants, or on what full scale stands for?

The recordings are those of plates.py: no parameters fit them exactly. Each row changes one constant and prints by how
many percent the fast search's answer moves from that of the constants as shipped; "truth" says how far the shipped
answer itself is from what was planted. The last row of each goes down Π from a start off in all four, on a recording
that the model can make exactly, features playing no part but in Π_MRP: its minimum is where the truth is, whatever the
constants.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from sonic_bullet.lab.lines.line_values import Features
from sonic_bullet.records import Array
from studies.ren2013.hybrid.metric import Constants
from studies.ren2013.optimise import fast, polish
from studies.ren2013.plates import plate
from studies.ren2013.problem import Problem, modes_of

NAMES = ("metal", "glass", "wood")
AWAY = np.array([1.1, 0.93, 1.01, 1.1])
ROWS: tuple[tuple[str, Any], ...] = (
    ("bark_step", 0.25),
    ("bark_step", 1.0),
    ("levels", 3),
    ("levels", 6),
    ("shortest_s", 0.0053),
    ("shortest_s", 0.0214),
    ("seconds", 0.5),
    ("per_bark", 2.0),
    ("per_bark", 8.0),
    ("per_duration", 0.5),
    ("per_duration", 2.0),
    ("near", 0.05),
    ("near", 0.2),
    ("power", 0.15),
    ("power", 0.6),
)


def at_level(asked: Problem, full_scale_db_spl: float) -> Problem:
    """The same problem, full scale standing for another level."""
    return dataclasses.replace(asked, full_scale_db_spl=full_scale_db_spl)


def exact(asked: Problem, truth: Array) -> Problem:
    """The same body and strike, recorded without noise and without anything the model does not know."""
    freq_hz, decay, amplitude = modes_of(truth, asked.lambda_hat, asked.amplitude_hat)
    sr = asked.features.sr
    there = (freq_hz > 20) & (freq_hz < 0.45 * sr)
    time = np.arange(int(1.2 * sr)) / sr
    parts = zip(freq_hz[there], decay[there], amplitude[there], strict=True)
    signal = np.asarray(sum(a * np.exp(-d * time) * np.sin(2 * np.pi * f * time) for f, d, a in parts))
    observed = there & (np.abs(amplitude) > 1e-5 * np.abs(amplitude[there]).max())
    none = np.full(int(observed.sum()), np.nan)
    phase = np.where(amplitude[observed] < 0, np.pi, 0.0)
    features = Features(
        freq_hz[observed], decay[observed], np.abs(amplitude[observed]), phase, none, none, none, 0.0, -240.0, sr
    )
    return dataclasses.replace(asked, features=features, signal=signal)


def line(label: str, values: Array) -> None:
    """One row: by how much the four numbers move."""
    print(f"  {label:20}" + "".join(f"{100 * value:+10.3f} %" for value in values), flush=True)


def main(names: tuple[str, ...]) -> int:
    """A block per material; 1 where Π alone misses what was planted by more than 1e-4."""
    worst = 0.0
    for name in names:
        asked, truth = plate(name)
        base = fast(asked).parameters
        print(f"{name:22}{'α':>10}  {'β':>10}  {'γ':>10}  {'σ':>10}")
        line("truth", base / truth - 1)
        for db in (-20.0, 20.0):
            line(f"full scale {db:+.0f} dB", fast(at_level(asked, 94.0 + db)).parameters / base - 1)
        for field, value in ROWS:
            line(
                f"{field} {value:g}",
                fast(asked, dataclasses.replace(Constants(), **{field: value})).parameters / base - 1,
            )
        clean = exact(asked, truth)
        away = truth * AWAY
        clean_errors = [
            np.abs(polish(at_level(clean, 94.0 + db), away).parameters / truth - 1) for db in (-20.0, 0.0, 20.0)
        ]
        clean_errors += [
            np.abs(polish(clean, away, dataclasses.replace(Constants(), **{field: value})).parameters / truth - 1)
            for field, value in ROWS
        ]
        errors = np.max(clean_errors, axis=0)
        worst = max(worst, float(errors.max()))
        said = " ".join(f"{error:.1e}" for error in errors)
        print(
            f"  exact recording, Π alone from a start up to 10 % off, largest errors of {len(clean_errors)}: {said}\n"
        )
    return 0 if worst < 1e-4 else 1
