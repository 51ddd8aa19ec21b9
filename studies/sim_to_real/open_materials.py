"""Presets of materials that know nothing of the closed half: `made-NAME` of all other bodies.

    python -m studies.sim_to_real.open_materials FOLDER

The package's presets take their loss from docs/measured/decays.csv, in which bodies of the closed half are. Here these
rows are left out; of glass none is left, and TDW's two classes of glass stand in. All else is the preset's.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from benchmarks.made_presets import made_preset
from benchmarks.measured_decays import MeasuredDecay, read_table
from benchmarks.recorded_presets import write_compactly
from sonic_bullet.apps.dataset.household.materials import MATERIALS
from studies.sim_to_real.halves import CLOSED


def open_rows() -> list[MeasuredDecay]:
    """Return the table without the closed half; of glass the classes count as bodies."""
    kept = [row for row in read_table() if row.set not in CLOSED]
    return [replace(row, kind="body") if row.material == "glass" else row for row in kept]


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    rows = open_rows()
    for name in MATERIALS:
        preset = made_preset(name, rows)
        write_compactly(folder / f"{name}.json", preset)
        print(f"{name}: loss factor {preset.damping.loss_factor:g}, {preset.damping.exponent or 1:g}")


if __name__ == "__main__":
    main()
