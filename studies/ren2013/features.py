"""The paper's greedy feature extraction beside this project's, on the paper's own test.

100 damped sinusoids without noise, and 40 modes in close pairs under noise (studies/features.py).
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from sonic_bullet.lab.lines.extraction import extract
from sonic_bullet.records import Array
from studies.features import SR, hundred, matched, mixture
from studies.ren2013.greedy import greedy


def extracted(x: Array, _: int) -> Array:
    """(k, 2) frequencies and decays as this project's `extract` finds them."""
    found = extract(x, SR)
    return np.stack([found.freq_hz, found.decay_per_s], axis=1)


def main() -> int:
    """A row per recording and procedure."""
    full, noisy = hundred(0), mixture(1, 40.0)
    cases = {"100 sinusoids, no noise": (full[0], full[1], full[3]), "40 modes, 40 dB": (noisy[0], noisy[1], noisy[4])}
    procedures: dict[str, Callable[[Array, int], Array]] = {
        "the paper's, greedy": lambda x, most: greedy(x, SR, most)[:, :2],
        "`extract`": extracted,
    }
    errors = "f: mean, median, worst | d: mean, median, worst"
    print(f"| recording | procedure | features | of the modes | false | {errors} | s |\n{'|---' * 8}|")
    for name, (freq, decay, x) in cases.items():
        for label, procedure in procedures.items():
            begun = time.process_time()
            got = procedure(x, len(freq))
            spent = time.process_time() - begun
            hits, said = matched(got, freq, decay)
            counts = f"{len(got)} | {hits} of {len(freq)} | {len(got) - hits}"
            print(f"| {name} | {label} | {counts} | {said} | {spent:.1f} |", flush=True)
    return 0
