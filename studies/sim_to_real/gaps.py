"""What recordings of the open half have that simulated clips of their class have not, by features that say physics.

    python -m studies.sim_to_real.gaps FULL [FULL ...] --data ../shared/measured

Of each body the median of its takes, and the percentile of the class's simulated clips that it stands at: near 0 or 100
it is outside of what was simulated.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from sonic_bullet.records import Array
from studies.sim_to_real.__main__ import Heard, recorded, simulated
from studies.sim_to_real.features import BANDS, FLOOR_DB, HOP_S, decays_of
from studies.sim_to_real.halves import CLASSES, OPEN

NAMES = (
    "fall, dB/s", "fall to 1.2 kHz", "fall to 3.8 kHz", "fall to 10 kHz", "lines to -20 dB", "lowest, Hz", "centre, Hz",
    "end, dB",
)  # fmt: skip


def physics_of(heard: Heard) -> Array:
    """Return the features (n, 8) of NAMES."""
    rows = []
    for picture, lines, _ in zip(*heard.seen, strict=True):
        decay = decays_of(picture)
        weight = (picture[:, :10].max(axis=1) - FLOOR_DB) ** 2
        rate = decay[-BANDS:]
        # bands in thirds of the mel scale: to 700 Hz, 2.2 kHz, 10 kHz
        thirds = [
            weight[part] @ rate[part] / max(weight[part].sum(), 1e-9) for part in np.array_split(np.arange(BANDS), 3)
        ]
        falls = 10.0 ** np.array([decay[0], *thirds]) / HOP_S
        rows.append([*falls, lines[1], np.exp(lines[5]), np.exp(lines[7]), picture[:, -20:].max()])
    return np.array(rows)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("full", type=Path, nargs="+", metavar="FULL")
    parser.add_argument("--data", type=Path, required=True)
    asked = parser.parse_args()
    made, real = simulated(*asked.full), recorded(asked.data, OPEN)
    of_made, of_real = physics_of(made), physics_of(real)
    print("| of | " + " | ".join(NAMES) + " |\n|---|" + "---|" * len(NAMES))
    for name in CLASSES:
        mine = of_made[made.classes == name]
        print(f"| {name}, simulated | " + " | ".join(f"{x:.3g}" for x in np.median(mine, axis=0)) + " |")
        for body in dict.fromkeys(real.objects[real.classes == name]):
            own = np.median(of_real[real.objects == body], axis=0)
            place = 100 * (mine < own).mean(axis=0)
            cells = " | ".join(f"{x:.3g} ({at:.0f})" for x, at in zip(own, place, strict=True))
            print(f"| {body} | {cells} |")


if __name__ == "__main__":
    main()
