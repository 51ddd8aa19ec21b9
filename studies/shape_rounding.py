"""What does rounding mode shapes cost? The sound of every scene with shapes as they were solved, and as rounded.

    python studies/shape_rounding.py [SCENE ...] [--bits 9 10 11 12 13] [--seconds 2]

Each scene is simulated once, its shapes not rounded, and its log rendered with shapes of each number of bits, radiation
solved anew. A row: the difference's peak over the sound's peak in dB, the largest of all channels, and the log's size
with the shapes that are rounded as `sonic_bullet.records.mode_shapes` says.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.modal import modal_analysis as solved
from sonic_bullet.records.mode_shapes import quantize_shapes
from sonic_bullet.scene import render_scene

SHAPE_BITS = 11

SCENE_FOLDER = Path(__file__).resolve().parents[1] / "scenes"
SCENES = ("bar", "drop", "rolling", "sliding", "tabletop", "robot_arm")


def with_bits(log: ContactLog, bits: int) -> ContactLog:
    """The log with its shapes rounded; bodies that share a model still do."""
    models = {id(body.model): body.model for body in log.bodies if body.model is not None}
    made = {key: replace(model, shape=quantize_shapes(model.shape, bits)) for key, model in models.items()}
    bodies = (b if b.model is None else replace(b, model=made[id(b.model)]) for b in log.bodies)
    return replace(log, bodies=tuple(bodies))


def difference_db(samples: np.ndarray, exact: np.ndarray) -> float:
    """Peak of the difference over the peak of the exact sound, of the channel where it is largest, dB."""
    return float(20 * np.log10((np.abs(samples - exact).max(axis=1) / np.abs(exact).max(axis=1)).max()))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--bits", nargs="+", type=int, default=[9, 10, 11, 12, 13])
    parser.add_argument("--seconds", type=float, default=2.0)
    asked = parser.parse_args()
    worst = -np.inf
    print("scene        MB     " + "  ".join(f"{bits:>3} bits     MB" for bits in asked.bits))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "log.npz"

        def size_mb(log: ContactLog) -> float:
            log.save(place)
            return place.stat().st_size / 1e6

        for name in asked.scenes:
            with patch.object(solved, "quantize_shapes", lambda shape: shape):
                log = render_scene(SCENE_FOLDER / f"{name}.py", seconds=asked.seconds).log
            exact, cells = render_log(log), []
            for bits in asked.bits:
                coarse = with_bits(log, bits)
                found = difference_db(render_log(coarse), exact)
                worst = max(worst, found if bits == SHAPE_BITS else -np.inf)
                cells.append(f"{found:5.1f} dB {size_mb(coarse):6.2f}")
            print(f"{name:10} {size_mb(log):6.2f}   " + "  ".join(cells), flush=True)
    print(f"{SHAPE_BITS} bits: {worst:.1f} dB at most; must hold: <= -60 dB")
    return int(worst > -60)


if __name__ == "__main__":
    sys.exit(main())
