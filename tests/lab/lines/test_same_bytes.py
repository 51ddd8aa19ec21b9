"""One recording, one machine: the same bytes, whatever the process was started with."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

CHILD = """
import hashlib
import numpy as np
from sonic_bullet.lab.lines.extraction import extract
from sonic_bullet.lab.lines.joint_lines import joint_lines

SR = 16_000

def crowd(modes, count):
    rng = np.random.default_rng(3)
    time = np.arange(count) / SR
    freq = np.linspace(150, 7500, modes) * (1 + 0.004 * rng.standard_normal(modes))
    sound = 1e-4 * rng.standard_normal(count)
    for f, d, phase in zip(freq, rng.uniform(8, 40, modes), rng.uniform(0, 6, modes), strict=True):
        sound += 0.01 * np.exp(-d * time) * np.sin(2 * np.pi * f * time + phase)
    return sound

some = joint_lines(crowd(70, 2400)[None], SR), extract(crowd(30, 1600), SR, onset_s=0.0)
assert len(some[0].freq_hz) > 50 and len(some[1].freq_hz) > 15
names = "freq_hz", "decay_per_s", "amplitude", "freq_sd_hz", "decay_sd_per_s", "amplitude_sd"
for lines in some:
    print(hashlib.sha256(b"".join(getattr(lines, name).tobytes() for name in names)).hexdigest())
"""


def test_lines_of_a_crowd_whatever_the_hashes_and_threads() -> None:
    said = []
    for seed, threads in (("0", "1"), ("1", "2")):
        run = subprocess.run(
            [sys.executable, "-c", CHILD],
            env={**os.environ, "PYTHONHASHSEED": seed, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
            cwd=Path(__file__).parents[3],
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        said.append(run.stdout.split())
    assert said[0] == said[1]
    assert [len(one) for one in said[0]] == 2 * [len(hashlib.sha256().hexdigest())]
