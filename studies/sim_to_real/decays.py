"""How long made objects ring beside measured ones of the open half: median T60 by class and octave.

    python -m studies.sim_to_real.decays [--count 200 --objects 100 --seed 1]

A made object's modes lose what its material, the air and fingers take; what it lies on is left out, and so are clips
that are dropped. As of measured bodies, what rings 20 ms after the strike counts, by its energy.
"""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np

from benchmarks.measured_decays import OCTAVES_HZ, by_octave, read_table
from sonic_bullet.apps.dataset.household.clips import draw_clip
from sonic_bullet.apps.dataset.household.materials import CLASS_OF as MADE_OF
from sonic_bullet.apps.dataset.household.sounding import body_of, struck_place
from sonic_bullet.machine.progress import without_progress
from sonic_bullet.options.dataset import HouseholdOptions
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air
from studies.sim_to_real.halves import CLASS_OF, CLASSES, OPEN

Row = dict[int, list[float]]


def measured() -> dict[str, Row]:
    """Return T60 of each open body by class and octave."""
    found: dict[str, Row] = {name: defaultdict(list) for name in CLASSES}
    for row in read_table():
        if row.set in OPEN and row.kind == "body" and row.material in CLASS_OF:
            found[CLASS_OF[row.material]][row.octave_hz].append(row.t60_s)
    return found


def made(options: HouseholdOptions, count: int) -> dict[str, Row]:
    """Return T60 of each struck clip by class and octave."""
    found: dict[str, Row] = {name: defaultdict(list) for name in CLASSES}
    for number in range(count):
        clip = draw_clip(np.random.default_rng([options.seed, number]), options)
        if clip.striker is None:
            continue
        _, model = body_of(clip, options)
        weight, damping = radiation_of(model, Air())
        place, normal = struck_place(clip, options, model)
        near = int(np.linalg.norm(model.vertex_m - place, axis=1).argmin())
        size = np.abs(normal @ model.shape[near].astype(float)) * np.abs(weight)
        t60 = np.log(1000) / (model.decay_per_s + damping)
        for octave, (median, _) in by_octave(zip(model.freq_hz, t60, size, strict=True)).items():
            found[MADE_OF[clip.object.material]][octave].append(median)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--objects", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with without_progress():
        tables = {"made": made(HouseholdOptions(objects=asked.objects, seed=asked.seed), asked.count)}
    tables["measured"] = measured()
    print("| T60 in s | " + " | ".join(f"{octave} Hz" for octave in OCTAVES_HZ) + " |")
    print("|---|" + "---|" * len(OCTAVES_HZ))
    for name in CLASSES:
        for label, rows in tables.items():
            cells = [
                f"{np.median(rows[name][octave]):.2g} ({len(rows[name][octave])})" if rows[name][octave] else ""
                for octave in OCTAVES_HZ
            ]
            print(f"| {name}, {label} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
