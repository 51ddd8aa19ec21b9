"""Universal files with a small grammar: datasets between lines of -1, fields at fixed columns of 80 characters."""

from __future__ import annotations

import random
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.fuzzing.mutations import WORDS, changed

WIDTHS = (5, 10, 11, 13, 20)
"""Columns of a field in datasets 15, 58, 164 and 2411."""


@cache
def seed() -> bytes:
    """A file of units, two places and one frequency response."""
    import pyuff

    at_hz = 10.0 * np.arange(1, 64)
    response = 1 / (400.0**2 - at_hz**2 + 40j * at_hz)
    zero = [0, 0]
    sets = [
        {"type": 164, "units_code": 1, "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
        {"type": 15, "node_nums": [1, 2], "def_cs": zero, "disp_cs": zero, "color": zero, "x": [0.0, 0.1], "y": zero,
         "z": zero},
        {"type": 58, "func_type": 4, "rsp_node": 2, "rsp_dir": 3, "ref_node": 1, "ref_dir": -3, "data": response,
         "x": at_hz, "abscissa_spacing": 1, "abscissa_spec_data_type": 18, "ordinate_spec_data_type": 12,
         "orddenom_spec_data_type": 13},
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.uff"
        pyuff.UFF(str(path)).write_sets(sets, "overwrite")
        return path.read_bytes()


def uff_changed(data: bytes, draw: random.Random) -> bytes:
    """The file with one to three fields, lines or datasets changed; now and then with bytes changed."""
    if draw.random() < 0.15:
        return changed(data, draw)
    lines = data.split(b"\n")
    for _ in range(draw.choice((1, 1, 2, 3))):
        row = draw.randrange(len(lines))
        kind = draw.randrange(9)
        if kind < 5:
            width = draw.choice(WIDTHS)
            at = width * draw.randrange(max(1, len(lines[row]) // width))
            field = draw.choice(WORDS)[:width].rjust(width)
            lines[row] = lines[row][:at] + field + lines[row][at + width :]
        elif kind == 5:
            del lines[row : row + draw.choice((1, 1, 2, 11))]
        elif kind == 6:
            lines[row:row] = lines[row : row + draw.choice((1, 2, 11))]
        elif kind == 7:
            lines[row] = lines[row][: draw.randrange(81)]
        else:
            lines[row] = draw.choice((b"    -1", b"    58", b"    15", b"  2411", b"   164", b"    55", b"   58b"))
        lines = lines or [b""]
    return b"\n".join(lines)
