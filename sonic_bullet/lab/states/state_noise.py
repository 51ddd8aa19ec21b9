"""Noise of a state: what its takes share beside its lines, by levels in bands and over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from sonic_bullet.engine.residual.offline import synthesize_lines
from sonic_bullet.lab.states.changes import StateValues
from sonic_bullet.signal.band_time import EDGES_S, THIRDS_HZ, BandTime, band_time, cell_levels
from sonic_bullet.signal.noise_part import noise_beside_lines


def state_noise(values: StateValues) -> BandTime:
    """Measure the noise that a state's takes share beside its lines.

    Phases of lines differ from take to take: they are spread evenly, by the golden ratio, as their powers add.
    """
    takes, sr, lines = values.state.takes, values.state.sr, values.lines
    count = min(len(take.signal) for take in takes)
    turn = np.exp(2j * np.pi * (np.arange(len(lines.freq_hz)) * (np.sqrt(5) - 1) / 2))
    sound = synthesize_lines(lines.freq_hz, lines.decay_per_s, 10 ** (lines.level_db / 20) * turn, count, sr)
    return noise_beside_lines([band_time(take.signal[:count], sr) for take in takes], [band_time(sound, sr)])


def noise_to_json(noise: BandTime) -> dict[str, Any]:
    """Return levels (b, c) in dB of thirds of octaves in cells of time; None where there is nothing beside lines."""
    least_db = -200.0
    level = cell_levels(BandTime(noise.power, np.zeros(len(noise.power))))
    return {
        "freq_hz": THIRDS_HZ[: len(level)].round(1).tolist(),
        "until_s": list(EDGES_S[1:]),
        "level_db": [[round(float(x), 1) if x > least_db else None for x in row] for row in level],
    }
