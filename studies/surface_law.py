"""Does the rolling voice obey the measured level laws, and where does it stop? One line a pair of materials.

    python studies/surface_law.py

Exponents n (level against speed, 0.05 … 2 m/s) and m (against roughness, 0.1 … 20 µm), smallest and largest over the
other quantity, and how much they drift from its smallest to its largest value; of the force and of the sound of a body
with 12 modes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from sonic_bullet.records import Array

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.made.surfaces import advance, surface_pairs

SR = 48000
SPEED, ROUGH = np.geomspace(0.05, 2, 6), np.geomspace(0.1e-6, 20e-6, 5)
CASES = {  # m* kg, E* Pa, R* m, ζ
    "steel ball 1 cm on stone": (0.033, 5e10, 0.01, 0.25),
    "steel ball 3 cm on stone": (0.88, 5e10, 0.03, 0.25),
    "steel ball 1 cm on wood": (0.033, 1e10, 0.01, 0.25),
    "steel ball 3 cm on wood": (0.88, 1e10, 0.03, 0.25),
    "steel ball 1 cm on steel": (0.033, 1.1e11, 0.01, 0.25),
    "plastic ball 5 cm, 1 kg": (1.0, 3e9, 0.05, 0.25),
    "wooden box 0.8 kg": (0.8, 5e9, 0.05, 0.3),
}


def ring(force: Array) -> Array:
    total = np.zeros_like(force)
    for f in (310, 480, 740, 1130, 1580, 2100, 2750, 3600, 4400, 5600, 6900, 8200):
        r = np.exp(-(10 + 1e-7 * (2 * np.pi * f) ** 2) / SR)
        total += lfilter([1, -1], [1, -2 * r * np.cos(2 * np.pi * f / SR), r * r], force)
    return total


for name, (mass, modulus, radius, zeta) in CASES.items():
    v, h = (a.ravel() for a in np.meshgrid(SPEED, ROUGH))
    p = len(v)
    rough = np.stack([0 * h, h], 1)
    each = np.ones(p)
    pairs = surface_pairs(
        mass * each,
        modulus * each,
        radius * each,
        zeta * each,
        rough,
        np.full((p, 2), 0.75),
        np.arange(2 * p).reshape(p, 2),
    )
    load, sweep = 9.81 * pairs["mass_kg"], np.stack([v, v], 1)
    ends = np.stack([load, load]), np.stack([sweep, sweep])
    force = np.concatenate([advance(pairs, *ends, np.arange(960) / 960, SR) for _ in range(60)], 1)
    line = f"{name:26s}"
    for what, observed in (("force", force), ("sound", ring(force))):
        level = np.log(observed[:, 4800:].std(1)).reshape(len(ROUGH), len(SPEED))
        n = [np.polyfit(np.log(SPEED), row, 1)[0] for row in level]
        m = [np.polyfit(np.log(ROUGH), column, 1)[0] for column in level.T]
        fit = min(
            [np.corrcoef(np.log(SPEED), row)[0, 1] ** 2 for row in level]
            + [np.corrcoef(np.log(ROUGH), c)[0, 1] ** 2 for c in level.T]
        )
        line += (
            f" | {what} n {min(n):.2f}…{max(n):.2f} drift {n[-1] - n[0]:+.2f}, m {min(m):.2f}…{max(m):.2f} drift "
            f"{m[-1] - m[0]:+.2f}, R² ≥ {fit:.3f}"
        )
    print(line)
